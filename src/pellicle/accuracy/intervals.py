"""Coverage of 95 % intervals by several methods on simulated data sets with noise alone, with their times."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from pellicle.accuracy.registry import Comparison, DataSet, Method, OnData, measure_on_data
from pellicle.fitting.conclusion import linearised
from pellicle.fitting.film.search import search
from pellicle.fitting.neighbourhood import neighbourhood
from pellicle.fitting.profile_likelihood import interval
from pellicle.fitting.progress import Progress, quiet
from pellicle.fitting.reweighting import RankedMinima, rank

NOMINAL = 0.95
_WIDE = 1.959964
"""Half width of the central 95 % of a normal distribution, in standard deviations."""

Interval = tuple[np.ndarray, np.ndarray]
"""Lower and upper ends for each parameter, in the unit cube of the bounds."""


def _fit(data: DataSet) -> RankedMinima:
    return rank(data.problem, search(data.problem, quiet)).counted


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


INTERVAL_METHODS = (
    Method("covariance", "curvature, bounds, other minima", _covariance),
    Method("profile", "other minima", _profile),
)
"""Methods of computing intervals without samples, in the order of their cost."""


def compare_intervals(
    data: Sequence[DataSet],
    progress: Progress,
    methods: Sequence[Method] = INTERVAL_METHODS,
    time_limit: float = math.inf,
) -> Comparison:
    """Compute intervals for every data set by every method; see `measure_on_data`."""
    comparison = Comparison("interval", requested=len(data))
    how = OnData("intervals", _fit, _score, _summary)
    return measure_on_data(comparison, methods, data, how, progress, time_limit)


def _score(data: DataSet) -> Callable[[Interval], tuple[np.ndarray, np.ndarray]]:
    """Score of intervals: which true values they contain, and how wide they are."""

    def score(ends: Interval) -> tuple[np.ndarray, np.ndarray]:
        lower, upper = ends
        inside = (lower <= data.truth) & (data.truth <= upper)
        return inside, np.minimum(upper, 1.0) - np.maximum(lower, 0.0)

    return score


def _summary(scores: list[tuple[np.ndarray, np.ndarray]]) -> tuple[float, dict[str, Any]]:
    inside, widths = (np.concatenate(x) for x in zip(*scores, strict=True))
    coverage = float(np.mean(inside))
    doubt = math.sqrt(NOMINAL * (1 - NOMINAL) / len(inside))
    return abs(coverage - NOMINAL), {"coverage": coverage, "doubt": doubt, "width": float(np.median(widths))}
