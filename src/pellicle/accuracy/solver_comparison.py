"""A race of the solvers over simulated data sets: how often each fails, how far off it is, and its time."""

from __future__ import annotations

import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pellicle.accuracy.measure import Progress, entrants, mark_pareto
from pellicle.accuracy.simulated_data import Trial, misfits
from pellicle.accuracy.solvers import SOLVERS, Solver, from_truth
from pellicle.fitting.status import RIVAL


@dataclass
class SolverResult:
    """How a solver did.

    `error` is the mean over the data sets of the worst parameter's distance from the truth, as a share
    of its bounds, and `median_error` their median; `failures` counts the data sets in which it stopped
    above the minimum in whose valley the truth lies, by a rival's Δχ² (6) or more.
    """

    name: str
    leaves_out: str
    error: float
    median_error: float
    failures: int
    datasets: int
    seconds: float
    compile_seconds: float
    pareto: bool = False


@dataclass
class Race:
    """The solvers of one case, the fastest first, and those that took no part, with why."""

    noise: float
    solvers: list[SolverResult] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    interrupted: bool = False

    @property
    def recommended(self) -> str | None:
        """The fastest of those that failed least."""
        return (
            min(self.solvers, key=lambda s: (s.failures / s.datasets, s.seconds)).name
            if self.solvers
            else None
        )


@dataclass
class _Run:
    solver: Solver
    compile_seconds: float
    times: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    failures: int = 0

    def take(self, trial: Trial, least: float) -> None:
        began = time.perf_counter()
        unit = self.solver.find(trial)
        self.times.append(time.perf_counter() - began)
        inside = np.clip(np.nan_to_num(unit, nan=0.5), 0.0, 1.0)
        self.errors.append(float(np.max(np.abs(inside - trial.truth))))
        self.failures += bool(_misfit(trial, inside) > least + RIVAL)

    def finish(self) -> SolverResult:
        return SolverResult(
            self.solver.name,
            self.solver.leaves_out,
            float(np.mean(self.errors)),
            float(np.median(self.errors)),
            self.failures,
            len(self.times),
            statistics.median(self.times),
            max(self.compile_seconds - statistics.median(self.times), 0.0),
        )


def _misfit(trial: Trial, unit: np.ndarray) -> float:
    value = float(misfits(*trial.program, unit[None])[0])
    return value if np.isfinite(value) else np.inf


def race(
    trials: Sequence[Trial], noise: float, progress: Progress, solvers: Sequence[Solver] = SOLVERS
) -> Race:
    """Let every solver fit every data set, taking turns. Ctrl-C ends it, and keeps what was finished."""
    found, runs = Race(noise), []
    try:
        for solver, seconds in entrants(solvers, lambda s: s.find(trials[0]), found.left_out, progress):
            runs.append(_Run(solver, seconds))
        for done, trial in enumerate(trials):
            progress("data sets", done, len(trials))
            least = _misfit(trial, from_truth(trial))
            for run in runs:
                run.take(trial, least)
    except KeyboardInterrupt:
        found.interrupted = True
    found.solvers = sorted((run.finish() for run in runs if run.times), key=lambda s: s.seconds)
    mark_pareto(found.solvers)
    return found
