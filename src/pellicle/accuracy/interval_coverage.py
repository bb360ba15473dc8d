"""The rungs of uncertainty: ways to a 95 % interval, how often it holds the truth, and its time."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from pellicle.accuracy.measure import Progress, entrants, mark_pareto
from pellicle.accuracy.simulated_data import Trial
from pellicle.fitting.conclusion import linearised
from pellicle.fitting.neighbourhood import neighbourhood
from pellicle.fitting.profile_likelihood import interval
from pellicle.fitting.progress import quiet
from pellicle.fitting.reweighting import RankedMinima, rank
from pellicle.fitting.spectra.search import search
from pellicle.sampling.chain import empty
from pellicle.sampling.checks import missing
from pellicle.sampling.density import log_density
from pellicle.sampling.modes import modes
from pellicle.sampling.run import run
from pellicle.sampling.target import Target

PROMISED = 0.95
_WIDE = 1.959964
"""Standard deviations of a normal distribution on either side of its 95 %."""
_WALKERS = 32
_STEPS = 20_000

Interval = tuple[np.ndarray, np.ndarray]
"""Lower and upper ends for each parameter, in the unit cube of the bounds."""


@dataclass(frozen=True)
class Way:
    """One way from a finished fit to intervals; `missing` names a package that is not installed."""

    name: str
    leaves_out: str
    intervals: Callable[[RankedMinima], Interval]
    missing: str | None = None


@dataclass
class Held:
    """How a way did over the data sets.

    `coverage` is the share of the parameters' truths inside, `error` how far that is from 95 %, `doubt` its
    binomial standard deviation; `width` is that of the intervals as a share of the bounds, their median.
    `seconds` are those after the fit.
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
class Intervals:
    """The ways of one case, the fastest first, and those that took no part, with why."""

    ways: list[Held] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    interrupted: bool = False

    @property
    def recommended(self) -> str | None:
        """The fastest of those whose coverage is 95 % within two of its standard deviations."""
        good = [way for way in self.ways if way.error <= 2 * way.doubt] or self.ways
        return min(good, key=lambda way: way.seconds).name if good else None


def intervals(trials: Sequence[Trial], progress: Progress) -> Intervals:
    """Let every way say what it knows of every data set. Ctrl-C ends it, and keeps what was finished."""
    found, runs = Intervals(), []
    try:
        fits = [_fitted(trial) for trial in trials]
        for way, seconds in entrants(WAYS, lambda way: way.intervals(fits[0]), found.left_out, progress):
            runs.append(_Run(way, seconds))
        for done, (trial, fit) in enumerate(zip(trials, fits, strict=True)):
            progress("intervals", done, len(trials))
            for each in runs:
                each.take(trial, fit)
    except KeyboardInterrupt:
        found.interrupted = True
    found.ways = sorted((each.held() for each in runs if each.times), key=lambda way: way.seconds)
    mark_pareto(found.ways)
    return found


def _fitted(trial: Trial) -> RankedMinima:
    return rank(trial.problem, search(trial.problem, quiet))


@dataclass
class _Run:
    way: Way
    compile_seconds: float
    times: list[float] = field(default_factory=list)
    inside: list[bool] = field(default_factory=list)
    widths: list[float] = field(default_factory=list)

    def take(self, trial: Trial, fit: RankedMinima) -> None:
        began = time.perf_counter()
        lower, upper = self.way.intervals(fit)
        self.times.append(time.perf_counter() - began)
        self.inside += ((lower <= trial.truth) & (trial.truth <= upper)).tolist()
        self.widths += (np.minimum(upper, 1.0) - np.maximum(lower, 0.0)).tolist()

    def held(self) -> Held:
        coverage, count, usual = float(np.mean(self.inside)), len(self.inside), statistics.median(self.times)
        return Held(
            name=self.way.name,
            leaves_out=self.way.leaves_out,
            error=abs(coverage - PROMISED),
            coverage=coverage,
            doubt=math.sqrt(PROMISED * (1 - PROMISED) / count),
            width=float(np.median(self.widths)),
            datasets=len(self.times),
            seconds=usual,
            compile_seconds=max(self.compile_seconds - usual, 0.0),
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
    """By `pellicle.sample`'s own chain, of that many steps or until it is long enough."""
    size = len(fit.problem.parameters)
    target = Target(log_density(fit.problem), _WALKERS // 2)
    chain, checks = run(target, modes(fit), empty(_WALKERS, size, 0), steps, lambda chain: None, quiet)
    return _quantiles(chain.draws[checks.discard :])


def _usual(steps: int, fit: RankedMinima) -> Interval:
    """What is often done: stretch moves from a ball around the best fit, the first half thrown away."""
    import emcee

    size = len(fit.problem.parameters)
    target = Target(log_density(fit.problem), _WALKERS // 2)
    random = np.random.default_rng(0)
    start = np.clip(fit.minima.units[0] + 1e-4 * random.standard_normal((_WALKERS, size)), 1e-9, 1 - 1e-9)
    sampler = emcee.EnsembleSampler(_WALKERS, size, target, vectorize=True)
    sampler.run_mcmc(start, steps, skip_initial_state_check=True)
    return _quantiles(np.asarray(sampler.get_chain(discard=steps // 2)))


def _quantiles(draws: np.ndarray) -> Interval:
    lower, upper = np.quantile(draws.reshape(-1, draws.shape[-1]), [0.025, 0.975], axis=0)
    return lower, upper


_MISSING = next(iter(missing()), None)
WAYS = (
    Way("covariance", "curvature, bounds, other minima", _covariance),
    Way("profile", "other minima", _profile),
    Way("emcee, 25 steps", "most of the chain", partial(_sampled, 25), _MISSING),
    Way("emcee, 100 steps", "half of the chain", partial(_sampled, 100), _MISSING),
    Way("emcee, until it is long enough", "nothing: pellicle sample", partial(_sampled, _STEPS), _MISSING),
    Way("emcee, stretch, 500 steps", "other minima: from the best fit", partial(_usual, 500), _MISSING),
)
"""Every way to an interval, in the order of their cost."""
