"""Estimates, limits and rivals from ranked minima."""

import math
from collections.abc import Mapping

import numpy as np

from pellicle.fitting import profile_likelihood
from pellicle.fitting.covariance import Errors
from pellicle.fitting.discrepancy import Discrepancy
from pellicle.fitting.neighbourhood import neighbourhood
from pellicle.fitting.noise import student
from pellicle.fitting.profile_likelihood import ONE_SIDED, Limits, flat_sides, limits
from pellicle.fitting.result import Estimate, Profile, Rival
from pellicle.fitting.reweighting import RankedMinima
from pellicle.fitting.status import RIVAL

_RULED_OUT = 1e8
_MOST_RIVALS, _MOST_NEAR = 10, 3


def rivals(ranked: RankedMinima, share: float = 1.0) -> tuple[Rival, ...]:
    """Every other minimum with its Δχ² on the effective points, best first.

    Of a difference in χ² only a `share` is evidence where residuals are larger than noise. Where few
    residuals set the noise it is less by what Student's t is wider at the threshold of a rival.
    """
    problem, minima = ranked.problem, ranked.minima
    above = share * (minima.deviance - minima.deviance[0]) / student(ranked.freedom, RIVAL) ** 2
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
    parameters = ranked.problem.parameters
    ends = (np.array([getattr(p, side) for p in parameters]) for side in ("lower", "upper"))
    bounded = profile_likelihood.by_curvature(errors.stderr[: len(parameters)], *ends)
    return [Limits(sd) for sd in bounded.tolist()]


def by_profile(
    ranked: RankedMinima, errors: Errors, scans: Mapping[int, Profile], near: tuple[Rival, ...] = ()
) -> list[Limits]:
    """Errors and one-sided limits by profile likelihood.

    `scans` are scans of the misfit by the position of their parameter; profiles start from the `near` rivals
    too.
    """
    close = [list(r.parameters.values()) for r in near[:_MOST_NEAR] if r.delta_chi2 < RIVAL]
    others = np.reshape(close, (-1, len(ranked.problem.parameters)))
    around = neighbourhood(ranked, errors.by_curvature, others)
    flat = {
        axis: flat_sides(scan.thickness, scan.delta_chi2[None], around.best[:, axis])
        for axis, scan in scans.items()
    }
    bounded = limits(around, flat).of_fit(0)
    if errors.curvature is None:
        return bounded
    parameters, values = ranked.problem.parameters, ranked.values.tolist()
    rows = zip(bounded, parameters, values, errors.widening.tolist(), strict=False)
    return [_stretched(own, value, ratio, (p.lower, p.upper)) for own, p, value, ratio in rows]


def _stretched(limits: Limits, value: float, ratio: float, bounds: tuple[float, float]) -> Limits:
    """Limits `ratio` times as far from the value, within the bounds: to first order those at which the
    misfit has risen by the square of it more (A. Rotnitzky and N. Jewell, 1990, Biometrika 77, 485)."""
    lower = None if limits.lower is None else max(value + ratio * (limits.lower - value), bounds[0])
    upper = None if limits.upper is None else min(value + ratio * (limits.upper - value), bounds[1])
    return Limits(ratio * limits.stderr, lower, upper)


def estimates(
    ranked: RankedMinima,
    errors: Errors,
    discrepancy: Discrepancy,
    bounded: list[Limits],
    fixed: list[Estimate],
) -> dict[str, Estimate]:
    """Every parameter by name: free ones first, thickness before all; then nuisances and fixed numbers.

    `errors` and the limits are those of the noise alone.
    """
    parameters, values = ranked.problem.parameters, ranked.values.tolist()
    # a profile likelihood has corrected the error of the noise; what is not noise adds to it
    more = np.maximum(discrepancy.variance - errors.stderr**2, 0.0).tolist()
    free = []
    rows = zip(parameters, values, bounded, more[: len(values)], errors.stderr.tolist(), strict=False)
    for p, value, own, extra, linear_error in rows:
        if linear_error > p.upper - p.lower:
            extra = 0.0  # only the bounds limit it: the difference of two huge variances is rounding
        limit = _widened(own, value, extra, ranked.freedom, (p.lower, p.upper))
        ends = p.lower, p.upper, True, bool(p.on_bound(value)), limit.lower, limit.upper, p.limits is not None
        noise = float(own.stderr), max(ranked.freedom, 1.0)
        free.append(Estimate(p.name, value, float(limit.stderr), p.unit, *ends, *noise))
    order = sorted(range(len(free)), key=lambda i: parameters[i].key != "thickness")
    pairs = zip(ranked.problem.views, ranked.fits, strict=True)
    nuisances = [c for view, fit in pairs for c in view.nuisances(fit.at)]
    linear = []
    widths = zip(errors.stderr[len(values) :].tolist(), more[len(values) :], strict=True)
    for c, (noise_sd, extra) in zip(nuisances, widths, strict=True):
        sd = math.sqrt(noise_sd**2 + extra)
        reach = ONE_SIDED**0.5 * sd
        # an offset compatible with 0 has an upper limit
        upper = c.value + reach if c.not_negative and c.value < reach else None
        ends = "", -math.inf, math.inf, True
        linear.append(Estimate(c.name, c.value, sd, *ends, upper_limit=upper, stderr_noise=noise_sd))
    return {e.name: e for e in [*(free[i] for i in order), *linear, *fixed]}


def _widened(
    limits: Limits, value: float, variance: float, freedom: float, bounds: tuple[float, float]
) -> Limits:
    """Limits with a further variance, and as Student's t has them, within the bounds.

    Where the data do not see a side there is no variance to add: its limit is that of the noise.
    """
    if not math.isfinite(limits.stderr):
        return limits
    reach, wider = math.sqrt(ONE_SIDED * variance), student(freedom, ONE_SIDED)
    lower = None if limits.lower is None else value - math.hypot(wider * (value - limits.lower), reach)
    upper = None if limits.upper is None else value + math.hypot(wider * (limits.upper - value), reach)
    return Limits(
        math.sqrt(limits.stderr**2 + variance),
        None if lower is None else max(lower, bounds[0]),
        None if upper is None else min(upper, bounds[1]),
    )
