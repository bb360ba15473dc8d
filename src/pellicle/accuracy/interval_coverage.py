"""Coverage of 95 % intervals by several methods on simulated data sets with noise alone, with their times."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from pellicle.accuracy.measure import first_runs, mark_pareto, within
from pellicle.accuracy.simulated_data import DataSet
from pellicle.fitting.conclusion import linearised
from pellicle.fitting.film.search import search
from pellicle.fitting.neighbourhood import neighbourhood
from pellicle.fitting.profile_likelihood import interval
from pellicle.fitting.progress import Progress, quiet
from pellicle.fitting.reweighting import RankedMinima, rank
from pellicle.sampling.chain import empty
from pellicle.sampling.checks import missing
from pellicle.sampling.density import Target, log_density
from pellicle.sampling.ensemble import run
from pellicle.sampling.modes import modes

NOMINAL = 0.95
_WIDE = 1.959964
"""Half width of the central 95 % of a normal distribution, in standard deviations."""
_WALKERS = 32
_STEPS = 20_000

Interval = tuple[np.ndarray, np.ndarray]
"""Lower and upper ends for each parameter, in the unit cube of the bounds."""


@dataclass(frozen=True)
class IntervalMethod:
    """A method of computing intervals from a fit; `missing` names a package that is not installed."""

    name: str
    leaves_out: str
    intervals: Callable[[RankedMinima], Interval]
    missing: str | None = None


@dataclass
class IntervalResult:
    """Coverage and cost of one method over all data sets.

    `coverage` is the share of true values inside the intervals, `error` its distance from 95 %, `doubt` its
    binomial standard deviation. `width` is the median width of the intervals relative to the bounds,
    `seconds` the time after the fit.
    """

    name: str
    leaves_out: str
    error: float
    coverage: float
    doubt: float
    width: float
    datasets: int
    seconds: float
    compile_seconds: float
    pareto: bool = False


@dataclass
class IntervalComparison:
    """Results of all methods of one case, the fastest first, and the methods left out, with why.

    `requested` counts the data sets that were asked for, of which the time limit may allow fewer.
    """

    requested: int = 0
    results: list[IntervalResult] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    interrupted: bool = False

    @property
    def recommended(self) -> str | None:
        """Name of the fastest method whose coverage is 95 % within two of its standard deviations."""
        good = [result for result in self.results if result.error <= 2 * result.doubt] or self.results
        return min(good, key=lambda result: result.seconds).name if good else None


def compare_intervals(
    data: Sequence[DataSet], progress: Progress, *, time_limit: float = math.inf
) -> IntervalComparison:
    """Compute intervals for every data set by every method.

    No data set begins later than `time_limit` seconds after the methods are compiled. Ctrl-C ends this and
    keeps the results so far.
    """
    comparison, runs = IntervalComparison(len(data)), []
    try:
        fit = _fit(data[0])
        first = lambda method: method.intervals(fit)  # noqa: E731
        for method, seconds in first_runs(INTERVAL_METHODS, first, comparison.left_out, progress):
            runs.append(_Run(method, seconds))
        for done, one in enumerate(within(data, time_limit)):
            progress("intervals", done, len(data))
            fit = _fit(one)
            for run in runs:
                run.add(one, fit)
    except KeyboardInterrupt:
        comparison.interrupted = True
    results = (run.result() for run in runs if run.times)
    comparison.results = sorted(results, key=lambda result: result.seconds)
    mark_pareto(comparison.results)
    return comparison


def _fit(data: DataSet) -> RankedMinima:
    return rank(data.problem, search(data.problem, quiet)).counted


@dataclass
class _Run:
    """A method while it is measured."""

    method: IntervalMethod
    compile_seconds: float
    times: list[float] = field(default_factory=list)
    inside: list[bool] = field(default_factory=list)
    widths: list[float] = field(default_factory=list)

    def add(self, data: DataSet, fit: RankedMinima) -> None:
        began = time.perf_counter()
        lower, upper = self.method.intervals(fit)
        self.times.append(time.perf_counter() - began)
        self.inside += ((lower <= data.truth) & (data.truth <= upper)).tolist()
        self.widths += (np.minimum(upper, 1.0) - np.maximum(lower, 0.0)).tolist()

    def result(self) -> IntervalResult:
        coverage, count = float(np.mean(self.inside)), len(self.inside)
        seconds = statistics.median(self.times)
        return IntervalResult(
            name=self.method.name,
            leaves_out=self.method.leaves_out,
            error=abs(coverage - NOMINAL),
            coverage=coverage,
            doubt=math.sqrt(NOMINAL * (1 - NOMINAL) / count),
            width=float(np.median(self.widths)),
            datasets=len(self.times),
            seconds=seconds,
            compile_seconds=max(self.compile_seconds - seconds, 0.0),
        )


def _covariance(fit: RankedMinima) -> Interval:
    problem, best = fit.problem, fit.minima.units[0]
    _, errors = linearised(fit)
    sd = errors.stderr[: len(best)] / (problem.box.upper - problem.box.lower)
    return best - _WIDE * sd, best + _WIDE * sd


def _profile(fit: RankedMinima) -> Interval:
    box = fit.problem.box
    count = len(fit.problem.parameters)
    _, errors = linearised(fit)
    around = neighbourhood(fit, errors.covariance, np.zeros((0, count)))
    ends = np.array([interval(around, i) for i in range(count)])
    lower, upper = (ends.T - box.lower) / (box.upper - box.lower)
    return lower, upper


def _sampled(steps: int, fit: RankedMinima) -> Interval:
    """Intervals by the chain of `pellicle.sample`, of `steps` steps or until it is long enough."""
    size = len(fit.problem.parameters)
    target = Target(log_density(fit.problem), _WALKERS // 2)
    chain, checks = run(target, modes(fit), empty(_WALKERS, size, 0), steps, lambda chain: None, quiet)
    return _quantiles(chain.draws[checks.discard :])


def _stretch(steps: int, fit: RankedMinima) -> Interval:
    """Intervals by the usual chain: stretch moves from a ball around the best fit, half of it burn-in."""
    import emcee

    size = len(fit.problem.parameters)
    target = Target(log_density(fit.problem), _WALKERS // 2)
    random = np.random.default_rng(0)
    start = np.clip(fit.minima.units[0] + 1e-4 * random.standard_normal((_WALKERS, size)), 1e-9, 1 - 1e-9)
    sampler = emcee.EnsembleSampler(_WALKERS, size, target, vectorize=True)
    # emcee's wrapper prints to stdout where the target is interrupted
    sampler.log_prob_fn = target  # pyright: ignore[reportAttributeAccessIssue]
    sampler.run_mcmc(start, steps, skip_initial_state_check=True)
    return _quantiles(np.asarray(sampler.get_chain(discard=steps // 2)))


def _quantiles(draws: np.ndarray) -> Interval:
    lower, upper = np.quantile(draws.reshape(-1, draws.shape[-1]), [0.025, 0.975], axis=0)
    return lower, upper


_MISSING = next(iter(missing()), None)
INTERVAL_METHODS = (
    IntervalMethod("covariance", "curvature, bounds, other minima", _covariance),
    IntervalMethod("profile", "other minima", _profile),
    IntervalMethod("emcee, 25 steps", "most of the chain", partial(_sampled, 25), _MISSING),
    IntervalMethod("emcee, 100 steps", "half of the chain", partial(_sampled, 100), _MISSING),
    IntervalMethod(
        "emcee, until it is long enough", "nothing: pellicle sample", partial(_sampled, _STEPS), _MISSING
    ),
    IntervalMethod(
        "emcee, stretch, 500 steps", "other minima: from the best fit", partial(_stretch, 500), _MISSING
    ),
)
"""Every method of computing intervals, in the order of their cost."""
