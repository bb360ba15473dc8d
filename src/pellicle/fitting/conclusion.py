"""From ranked minima to a status, estimates, limits and rivals."""

import math
from collections.abc import Callable, Mapping, Sequence
from logging import getLogger
from typing import NamedTuple

import numpy as np

from pellicle.fitting import identifiability, profile_likelihood
from pellicle.fitting.covariance import Errors, Scaled, errors, scaled
from pellicle.fitting.discrepancy import Discrepancy
from pellicle.fitting.evaluation import total_deviance
from pellicle.fitting.minima import Minima, deviance_at, solve
from pellicle.fitting.noise import student
from pellicle.fitting.problem import Problem
from pellicle.fitting.profile_likelihood import ONE_SIDED, Limits, Neighbourhood, flat_sides, limits
from pellicle.fitting.result import Estimate, Profile, Rival, Status
from pellicle.fitting.reweighting import RankedMinima, rank
from pellicle.fitting.status import RIVAL, judge

log = getLogger(__name__)

_SETTLED = 0.03
"""Square root of the change of χ² that does not matter to a limit at a rise of 2.7 and more."""


def neighbourhood(ranked: RankedMinima, covariance: np.ndarray, others: np.ndarray) -> Neighbourhood:
    """Neighbourhood of the best of the ranked minima.

    `covariance` has the problem's parameters first; `others` (points, parameters) are further minima, in the
    parameters' own units.
    """
    values = ranked.values
    pairs = zip(ranked.problem.views, ranked.fits, strict=True)
    counted = ranked.problem._replace(views=tuple(view.counting(1 / fit.variance) for view, fit in pairs))
    own = counted.in_own_units(values)
    thinned, box = own.thinned(), own.box
    # a program that the fit has compiled: that of its scan, or that of its polish
    as_scanned = ranked.minima.scan is not None and thinned.views == own.views
    as_polished = not as_scanned and own.coordinates == ranked.problem.coordinates
    lower, span = np.asarray(box.lower), np.asarray(box.upper) - np.asarray(box.lower)
    every = np.clip(np.vstack([values, *others]), lower, box.upper)

    def misfit(which: np.ndarray, at: np.ndarray) -> np.ndarray:
        units = (at[0] - lower) / span
        return (deviance_at(own, units) if as_polished else total_deviance(thinned, units))[None]

    def profile(
        which: np.ndarray, axis: np.ndarray, values: np.ndarray, starts: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        deviance, points = np.empty(len(values)), np.empty(starts[:, 0].shape)
        for each in np.unique(axis).tolist():
            rows = np.flatnonzero(axis == each)
            units = (starts[rows] - lower) / span
            held = np.repeat(values[rows], units.shape[1])
            result = solve(own, units.reshape(len(held), -1), fixed=(each, held), atol=_SETTLED)
            deviances = result.deviance.reshape(len(rows), -1)
            chosen = np.arange(len(rows)), np.argmin(deviances, axis=1)
            deviance[rows] = deviances[chosen]
            points[rows] = lower + result.units.reshape(units.shape)[chosen] * span
        return deviance, points

    count = len(values)
    return Neighbourhood(
        every[:1],
        lower,
        np.asarray(box.upper),
        covariance[None, :count, :count],
        np.reshape([p.natural for p in ranked.problem.parameters], (-1, 2)).astype(bool),
        misfit,
        profile,
        every[None, 1:],
    )


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


def ranked_minima(
    make: Callable[[float], Problem],
    search: Callable[[Problem], Minima],
    tolerance: float,
    loss: str,
    **kept: int,
) -> tuple[RankedMinima, list[str]]:
    """Ranked minima of the problem that `make` returns for a tolerance, and warnings.

    Where the plan turns out to be off by more than the tolerance at the best fit, the fit is done again with
    every effect. `kept` are the numbers of minima of `fitting.reweighting.rank`.
    """
    problem = make(tolerance)
    ranked = rank(problem, search(problem), loss, **kept)
    off = max(view.off_tolerance(problem.seen_by(view, ranked.values)) for view in ranked.problem.views)
    if off <= tolerance:
        return ranked, []
    log.info("plan: off by %.2g at the best fit, beyond the tolerance: again with every effect", off)
    exact = make(0.0)
    warning = (
        f"at the best fit what was left out changes the signal by {off:.2g}, more than the tolerance "
        f"{tolerance:g}: fitted again with every effect"
    )
    return rank(exact, search(exact), loss, **kept), [warning]


def linearised(ranked: RankedMinima) -> tuple[Scaled, Errors]:
    """The scaled Jacobian at the best minimum, and the covariance from it."""
    at, variance = [fit.at for fit in ranked.fits], [fit.variance for fit in ranked.fits]
    jacobian = scaled(ranked.problem, ranked.minima.units[0], at, variance)
    sizes = [view.residuals(own).size for view, own in zip(ranked.problem.views, at, strict=True)]
    pairs = zip(np.cumsum([0, *sizes]).tolist(), ranked.fits, strict=False)
    return jacobian, errors(jacobian, {at: fit.scores for at, fit in pairs if fit.scores is not None})


class Conclusion(NamedTuple):
    """Status, estimates and rivals of a fit; `correlated` are sentences on parameters that are."""

    status: Status
    parameters: dict[str, Estimate]
    rivals: tuple[Rival, ...]
    correlated: list[str]


def conclude(
    ranked: RankedMinima,
    jacobian: Scaled,
    covariance: Errors,
    discrepancy: Discrepancy,
    *,
    misfit: bool,
    fixed: list[Estimate],
    scans: Mapping[int, Profile],
    near: bool = False,
    binding: frozenset[str] = frozenset(),
    amend: Callable[[list[Limits]], Sequence[Limits]] = lambda limits: limits,
) -> Conclusion:
    """Judge the best of the ranked minima.

    The `discrepancy` enlarges errors, and differences in χ² count less by it. Limits come from profiles
    where the fit is usable, else from the covariance alone; with `near` profiles start from near rivals too.
    `amend` has the last word on them. `binding` names parameters whose default bounds count as those of the
    user.
    """
    converged, others = bool(ranked.minima.converged[0]), rivals(ranked, discrepancy.evidence_share)
    bounded = by_curvature(ranked, covariance)
    if not misfit:
        profiled = by_profile(ranked, covariance, scans, others if near else ())
        if not converged:
            # on a plateau, as of an opaque film, a solver has no point to settle at
            rows = zip(ranked.problem.parameters, profiled, strict=True)
            converged = any(p.key == "thickness" and math.isinf(limit.stderr) for p, limit in rows)
        bounded = profiled if converged else bounded
    parameters = estimates(ranked, covariance, discrepancy, list(amend(bounded)), fixed)
    pairs = zip(ranked.problem.parameters, ranked.values.tolist(), strict=True)
    natural = frozenset(p.name for p, value in pairs if p.on_natural_bound(value))
    status = judge(
        converged=converged,
        misfit=misfit,
        parameters=parameters,
        rivals=others,
        natural=natural,
        binding=binding,
    )
    log.info("status: %s", status)
    return Conclusion(status, parameters, others, identifiability.correlated(jacobian, parameters))


def common_rms(sizes: Sequence[int], rms: Sequence[float]) -> float:
    """rms over all parts of a fit, by their number of points."""
    return float(np.sqrt(np.average(np.square(rms), weights=sizes)))
