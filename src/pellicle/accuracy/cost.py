"""What accuracy costs for one scene: its forward rungs, and its solvers where something is free."""

from __future__ import annotations

from dataclasses import dataclass

import equinox as eqx
import jax
import numpy as np

from pellicle.accuracy.case import case
from pellicle.accuracy.interval_coverage import Intervals, intervals
from pellicle.accuracy.measure import Ladder, Progress, climb
from pellicle.accuracy.simulated_data import trials
from pellicle.accuracy.solver_comparison import Race, race
from pellicle.errors import UsageError
from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves

TOLERANCE = {"psi-delta": 0.1}
DEFAULT_TOLERANCE = 1e-3
"""What is accurate enough unless somebody says otherwise: a fraction, or degrees on the sphere of N, C, S."""


@dataclass
class Cost:
    """`race` is None where no solver took part, and `no_race` says why; `intervals` follow it."""

    ladder: Ladder
    race: Race | None
    no_race: str = ""
    intervals: Intervals | None = None

    @property
    def interrupted(self) -> bool:
        return any(part is not None and part.interrupted for part in (self.ladder, self.race, self.intervals))


def cost(
    scene: Scene,
    wavelength: np.ndarray,
    *,
    reference: str = "float64",
    tolerance: float | None = None,
    noise: float | None = None,
    datasets: int = 20,
    progress: Progress = lambda what, done, total: None,
) -> Cost:
    """Measure every way to a scene's signal at `wavelength` (nm), and to its free parameters.

    `reference` is "float64" or "mpmath". `tolerance` is in the signal's unit: a fraction, or degrees on the
    sphere of N, C and S; without it, it is the `noise`, or 0.001 (0.1 degrees). `datasets` spectra are
    simulated with that noise, or noise as large as the tolerance, and fitted by every solver.

    **Raises:** UsageError for a tolerance that is not above zero, a reference that the scene cannot be
    computed with, and a scene whose signal is nothing.
    """
    usual = TOLERANCE.get(scene.light.signal, DEFAULT_TOLERANCE)
    tolerance = (usual if noise is None else noise) if tolerance is None else tolerance
    if not 0 < tolerance < np.inf:
        raise UsageError(f"the tolerance must be above zero, got {tolerance:g}: what error is small enough?")
    with jax.enable_x64(True):
        here = case(scene, wavelength, tolerance)
        ladder = climb(here, reference, progress)
        if ladder.interrupted:
            return Cost(ladder, None, "interrupted before")
        if datasets == 0:
            return Cost(ladder, None, "no data sets were asked for")
        if not free_leaves(scene):
            return Cost(ladder, None, "nothing is free to fit")
        noise = tolerance if noise is None else noise
        own = eqx.tree_at(lambda s: s.instrument, here.scene, scene.instrument)
        sets = trials(here, own, noise, datasets)
        raced = race(sets, noise, progress)
        return Cost(ladder, raced, intervals=None if raced.interrupted else intervals(sets, progress))
