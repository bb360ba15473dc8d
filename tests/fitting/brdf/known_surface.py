"""A known surface, directions in which a goniometer takes samples of it, and searches that start near it."""

from collections.abc import Callable, Sequence

import numpy as np

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.fitting.minima import Minima
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface

TRUTH = {
    "thickness": 320.0,
    "n": (1.48, 1.5, 1.53),
    "exponent_reflection": 60.0,
    "exponent_transmission": 25.0,
    "specular": 1.5,
    "diffuse": 0.1,
}
BOUNDS = {
    "thickness": (0, 1000),
    "exponent_reflection": (1, 1000),
    "exponent_transmission": (1, 1000),
    "specular": (0, 100),
    "diffuse": (0, 2),
}
FREE = Surface("granier-heidrich", {**TRUTH, **{key: Free(*ends) for key, ends in BOUNDS.items()}})


def arcs(values: np.ndarray | None = None, sigma: np.ndarray | None = None) -> BrdfSamples:
    """40 directions in the plane of incidence at each of five incidences."""
    theta_o = np.tile(np.linspace(-78, 78, 40), 5)
    theta_i, phi_o = np.repeat([10.0, 25, 40, 55, 70], 40), np.where(theta_o > 0, 180.0, 0.0)
    values = np.ones((200, 3)) if values is None else values
    return BrdfSamples(theta_i, np.zeros(200), np.abs(theta_o), phi_o, values, ("R", "G", "B"), sigma=sigma)


def search_from(start: Sequence[float]) -> Callable:
    """A replaced search that knows one start, for problems of as many numbers; baselines start anywhere."""

    def search(problem, effort, progress):
        size = len(problem.parameters)
        unit = np.array([start]) if size == len(start) else np.full((1, size), 0.4)
        return Minima(unit, np.zeros(1), np.ones(1, bool))

    return search
