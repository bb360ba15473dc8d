"""Comparison of solvers on simulated data sets: failures, errors and times."""

from __future__ import annotations

import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pellicle.accuracy.measure import first_runs, mark_pareto, within
from pellicle.accuracy.simulated_data import DataSet, deviances
from pellicle.accuracy.solvers import SOLVERS, Solver, from_truth
from pellicle.fitting.progress import Progress
from pellicle.fitting.status import RIVAL


@dataclass
class SolverResult:
    """Failures, error and time of one solver.

    `error` is the mean over the data sets, `median_error` the median, of the largest error of any parameter
    relative to its bounds; `failures` counts the data sets in which the solver stopped more than Δχ² = 6
    (a rival) above the minimum reached from the true values.
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
class SolverComparison:
    """Results of all solvers of one case, the fastest first, and the solvers left out, with why.

    `requested` counts the data sets that were asked for, of which the time limit may allow fewer.
    """

    noise: float
    requested: int = 0
    results: list[SolverResult] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    interrupted: bool = False

    @property
    def recommended(self) -> str | None:
        """Name of the fastest solver among those that failed least."""
        if not self.results:
            return None
        return min(self.results, key=lambda s: (s.failures / s.datasets, s.seconds)).name


@dataclass
class _Run:
    """A solver while it is measured."""

    solver: Solver
    compile_seconds: float
    times: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    failures: int = 0

    def fit(self, data: DataSet, least: float) -> None:
        began = time.perf_counter()
        unit = self.solver.find(data)
        self.times.append(time.perf_counter() - began)
        inside = np.clip(np.nan_to_num(unit, nan=0.5), 0.0, 1.0)
        self.errors.append(float(np.max(np.abs(inside - data.truth))))
        self.failures += bool(_deviance(data, inside) > least + RIVAL)

    def result(self) -> SolverResult:
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


def _deviance(data: DataSet, unit: np.ndarray) -> float:
    value = float(deviances(*data.program, unit[None])[0])
    return value if np.isfinite(value) else np.inf


def compare_solvers(
    data: Sequence[DataSet],
    noise: float,
    progress: Progress,
    solvers: Sequence[Solver] = SOLVERS,
    *,
    time_limit: float = np.inf,
) -> SolverComparison:
    """Fit every data set with every solver in turn.

    No data set begins later than `time_limit` seconds after the solvers are compiled. Ctrl-C ends this and
    keeps the results so far.
    """
    comparison, runs = SolverComparison(noise, len(data)), []
    try:
        for solver, seconds in first_runs(solvers, lambda s: s.find(data[0]), comparison.left_out, progress):
            runs.append(_Run(solver, seconds))
        for done, one in enumerate(within(data, time_limit)):
            progress("data sets", done, len(data))
            least = _deviance(one, from_truth(one))
            for run in runs:
                run.fit(one, least)
    except KeyboardInterrupt:
        comparison.interrupted = True
    comparison.results = sorted((run.result() for run in runs if run.times), key=lambda s: s.seconds)
    mark_pareto(comparison.results)
    return comparison
