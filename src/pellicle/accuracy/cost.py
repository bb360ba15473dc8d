"""Accuracy against time for a film: methods of simulation, solvers, and methods of computing intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import equinox as eqx
import jax
import numpy as np

from pellicle.accuracy.case import case
from pellicle.accuracy.film_methods import compare_methods
from pellicle.accuracy.intervals import INTERVAL_METHODS, compare_intervals
from pellicle.accuracy.registry import Comparison, Method
from pellicle.accuracy.simulated_data import data_sets
from pellicle.accuracy.solvers import compare_solvers
from pellicle.errors import UsageError
from pellicle.fitting.presentation import PlotMixin
from pellicle.fitting.progress import Progress, quiet
from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves

TOLERANCE, TOLERANCE_IN_DEGREES = 1e-3, 0.1
"""Default tolerance: a fraction, or degrees on the sphere of N, C, S."""


@dataclass
class Cost(PlotMixin):
    """Accuracy against time for one film.

    `methods` compares simulations, `solvers` fits and `intervals` their errors. `solvers` is None where
    nothing was fitted, and `no_solvers` says why.
    """

    methods: Comparison
    solvers: Comparison | None
    no_solvers: str = ""
    intervals: Comparison | None = None

    @property
    def interrupted(self) -> bool:
        """True where Ctrl-C ended the measurement."""
        parts = (self.methods, self.solvers, self.intervals)
        return any(part is not None and part.interrupted for part in parts)


def cost(
    scene: Scene,
    wavelength: np.ndarray,
    *,
    reference: str = "float64",
    tolerance: float | None = None,
    noise: float | None = None,
    datasets: int = 20,
    time_limit: float = 120.0,
    interval_methods: Sequence[Method] = INTERVAL_METHODS,
    progress: Progress = quiet,
) -> Cost:
    """Measure every method of computing the signal of a scene at `wavelength` (nm), and of fitting it.

    `reference` is "float64" or "mpmath". `tolerance` is in the unit of the signal: a fraction, or degrees on
    the sphere of N, C and S; its default is the `noise`, or else 0.001 (0.1 degrees). `datasets` spectra are
    simulated with that noise, or else noise equal to the tolerance, and fitted by every solver. `time_limit`
    (s) ends these fits, and then their intervals, after as many data sets as it allows.

    **Raises:** UsageError for a tolerance that is not above zero, for a reference that cannot compute the
    scene, and for a scene whose signal is 0 everywhere.
    """
    default = TOLERANCE_IN_DEGREES if scene.light.kind.degrees else TOLERANCE
    tolerance = (default if noise is None else noise) if tolerance is None else tolerance
    if not 0 < tolerance < np.inf:
        raise UsageError(f"the tolerance must be above zero, got {tolerance:g}: what error is small enough?")
    with jax.enable_x64(True):
        one = case(scene, wavelength, tolerance)
        methods = compare_methods(one, reference, progress)
        if methods.interrupted:
            return Cost(methods, None, "interrupted before")
        if datasets == 0:
            return Cost(methods, None, "no data sets were requested")
        if not free_leaves(scene):
            return Cost(methods, None, "nothing is free to fit")
        noise = tolerance if noise is None else noise
        with_instrument = eqx.tree_at(lambda s: s.instrument, one.scene, scene.instrument)
        data = data_sets(one, with_instrument, noise, datasets)
        solvers = compare_solvers(data, noise, progress, time_limit=time_limit)
        if solvers.interrupted:
            return Cost(methods, solvers)
        return Cost(
            methods, solvers, intervals=compare_intervals(data, progress, interval_methods, time_limit)
        )
