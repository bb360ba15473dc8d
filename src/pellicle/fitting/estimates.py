"""Estimates, limits and rivals from ranked minima."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from pellicle.fitting.covariance import UNSEEN, Errors
from pellicle.fitting.neighbourhood import neighbourhood
from pellicle.fitting.noise import student
from pellicle.fitting.profile_likelihood import ONE_SIDED, Limits, limits
from pellicle.fitting.result import Estimate, Profile, Rival
from pellicle.fitting.reweighting import RankedMinima
from pellicle.fitting.status import RIVAL

_RULED_OUT = 1e8
_ON_BOUND = 1e-6
_MOST_RIVALS, _MOST_NEAR = 10, 3


def rivals(ranked: RankedMinima) -> tuple[Rival, ...]:
    """Every other minimum with its Δχ² on the effective points, best first.

    Where few residuals set the noise it is less by what Student's t is wider at the threshold of a rival.
    """
    problem, minima = ranked.problem, ranked.minima
    above = (minima.deviance - minima.deviance[0]) / student(ranked.freedom, RIVAL) ** 2
    return tuple(
        Rival(
            dict(zip((p.name for p in problem.parameters), np.asarray(values).tolist(), strict=True)),
            float(d),
        )
        for values, d in zip(problem.values(minima.units)[1 : _MOST_RIVALS + 1], above[1:], strict=False)
        if d < _RULED_OUT
    )


def by_curvature(ranked: RankedMinima, errors: Errors) -> list[Limits]:
    """Errors by the covariance alone, infinite where the data add nothing to the bounds.

    For a fit whose numbers should not be used: profiles of it would mean nothing, and cost most where the
    model misses the data.
    """
    pairs = zip(ranked.problem.parameters, errors.stderr.tolist(), strict=False)
    return [Limits(sd if sd <= UNSEEN * (p.upper - p.lower) else math.inf) for p, sd in pairs]


def by_profile(
    ranked: RankedMinima, errors: Errors, scans: Mapping[int, Profile], near: tuple[Rival, ...] = ()
) -> list[Limits]:
    """Errors and one-sided limits by profile likelihood.

    `scans` are scans of the misfit by the position of their parameter; profiles start from the `near` rivals
    too.
    """
    close = [list(r.parameters.values()) for r in near[:_MOST_NEAR] if r.delta_chi2 < RIVAL]
    others = np.reshape(close, (-1, len(ranked.problem.parameters)))
    return limits(neighbourhood(ranked, errors.covariance, others), scans)


def estimates(
    ranked: RankedMinima, errors: Errors, bounded: list[Limits], fixed: list[Estimate]
) -> dict[str, Estimate]:
    """Every parameter by name: free ones first, thickness before all; then nuisances and fixed numbers."""
    parameters, values = ranked.problem.parameters, ranked.values.tolist()
    free = []
    for p, value, limit in zip(parameters, values, bounded, strict=True):
        margin = min(value - p.lower, p.upper - value)
        at_bound = not p.periodic and margin <= _ON_BOUND * (p.upper - p.lower)
        ends = p.lower, p.upper, True, at_bound, limit.lower, limit.upper, p.limits is not None
        free.append(Estimate(p.name, value, float(limit.stderr), p.unit, *ends))
    order = sorted(range(len(free)), key=lambda i: parameters[i].key != "thickness")
    pairs = zip(ranked.problem.views, ranked.fits, strict=True)
    nuisances = [c for view, fit in pairs for c in view.nuisances(fit.at)]
    linear = []
    for c, sd in zip(nuisances, errors.stderr[len(values) :].tolist(), strict=True):
        reach = ONE_SIDED**0.5 * sd
        # an offset compatible with 0 has an upper limit
        upper = c.value + reach if c.not_negative and c.value < reach else None
        linear.append(Estimate(c.name, c.value, sd, "", -math.inf, math.inf, True, upper_limit=upper))
    return {e.name: e for e in [*(free[i] for i in order), *linear, *fixed]}
