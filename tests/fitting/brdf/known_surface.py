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


def noisy(rho: np.ndarray, seed: int) -> BrdfSamples:
    """Samples of the values `rho` (200, 3) along `arcs` with normal noise of 1 %, which is known."""
    sigma = 0.01 * rho
    return arcs(np.abs(rho + sigma * np.random.default_rng(seed).standard_normal(rho.shape)), sigma)


def from_all_sides(channels: tuple[str, ...]) -> BrdfSamples:
    """60 directions at incidences around the normal."""
    rng = np.random.default_rng(5)
    theta_i, phi_i = rng.uniform(10, 50, 60), rng.uniform(0, 360, 60)
    theta_o, phi_o = np.abs(theta_i + rng.uniform(-15, 15, 60)), phi_i + 180 + rng.uniform(-20, 20, 60)
    return BrdfSamples(theta_i, phi_i, theta_o, phi_o, np.ones((60, len(channels))), channels)
