"""From ranked minima to a status, estimates, limits and rivals.

The numbers are those of one fit, or of many with leading axes (...); the words are those of one.
"""

import math
from collections.abc import Callable, Container, Mapping, Sequence
from logging import getLogger
from typing import Any, NamedTuple

import numpy as np

from pellicle.fitting import identifiability, profile_likelihood
from pellicle.fitting.covariance import Errors
from pellicle.fitting.discrepancy import Discrepancy
from pellicle.fitting.evaluation import total_deviance
from pellicle.fitting.marginal import Ranking
from pellicle.fitting.minima import Minima, deviance_at, solve
from pellicle.fitting.noise import student
from pellicle.fitting.parameter import Parameter
from pellicle.fitting.problem import Problem
from pellicle.fitting.profile_likelihood import FLAT, ONE_SIDED, Limits, Neighbourhood, flat_sides, limits
from pellicle.fitting.result import Estimate, Profile, Rival, Status
from pellicle.fitting.reweighting import RankedMinima, rank
from pellicle.fitting.status import ORDER, RIVAL, Judged, judged, outside

log = getLogger(__name__)

_SETTLED = 0.03
"""Square root of the change of χ² that does not matter to a limit at a rise of 2.7 and more."""
_RULED_OUT = 1e8
_MOST_RIVALS, _MOST_NEAR = 10, 3


class Verdicts(NamedTuple):
    """Numbers from which the words of fits follow, each (...).

    `noise` are the limits of the parameters by the noise alone, `limits` those with all that enlarges them;
    `delta_chi2` (..., minima) is how much worse the minima are than the best, in χ² on the effective points.
    """

    noise: Limits
    limits: Limits
    delta_chi2: np.ndarray
    status: Judged


def verdicts(
    ranked: RankedMinima,
    covariance: Errors,
    discrepancy: Discrepancy,
    delta_chi2: np.ndarray,
    around: Callable[[], Neighbourhood],
    flat: Mapping[int, np.ndarray],
    *,
    misfit: Any,
    binding: Container[str] = (),
    amend: Callable[[Limits], Limits] = lambda limits: limits,
) -> Verdicts:
    """Judge the best of the ranked minima of fits, of which `misfit` (...) are not explained.

    The `discrepancy` enlarges errors. The minima are above the best by `delta_chi2` (..., minima). Limits
    come from profiles in the neighbourhood `around` the best minima where a fit is usable, else from the
    covariance alone, as profiles would mean nothing; `flat` are the `flat_sides` (fits, 2) of scanned
    parameters. `amend` has the last word on the limits by the noise. `binding` names parameters whose default
    bounds count as those of the user.
    """
    parameters, values, freedom = ranked.problem.parameters, ranked.values, np.asarray(ranked.freedom)
    noise, converged = _by_noise(ranked, covariance, around, flat, misfit)
    noise, linear = amend(noise), covariance.stderr[..., : len(parameters)]
    # on a plateau, as of an opaque film or of none, a solver has no point to settle at
    depths = [i for i, p in enumerate(parameters) if p.key == "thickness"]
    converged = converged | (~np.asarray(misfit) & np.isinf(noise.stderr[..., depths]).any(axis=-1))
    lower, upper = (np.array([getattr(p, side) for p in parameters]) for side in ("lower", "upper"))
    # a profile likelihood has corrected the error of the noise; what is not noise adds to it
    more = np.maximum(discrepancy.variance - covariance.variance, 0.0)[..., : len(parameters)]
    # only the bounds limit it: the difference of two huge variances is rounding
    more = np.where(linear > upper - lower, 0.0, more)
    every = _widened(noise, values, linear, more, freedom[..., None], (lower, upper))
    noise, every = _without_film(parameters, values, ~np.asarray(misfit), noise, every)
    rivals = np.asarray(ranked.problem.values(ranked.minima.units[..., 1 : _MOST_RIVALS + 1, :]))
    apart = outside(values, every.stderr, rivals).any(axis=-1)
    close = apart & (delta_chi2[..., 1 : _MOST_RIVALS + 1] < RIVAL)
    status = _status(parameters, values, every.stderr, converged, misfit, close, binding)
    return Verdicts(noise, every, delta_chi2, status)


def _by_noise(
    ranked: RankedMinima,
    covariance: Errors,
    around: Callable[[], Neighbourhood],
    flat: Mapping[int, np.ndarray],
    misfit: Any,
) -> tuple[Limits, Any]:
    """Limits (..., parameters) by the noise, and which fits (...) have converged."""
    parameters, shape = ranked.problem.parameters, ranked.values.shape
    lower, upper = (np.array([getattr(p, side) for p in parameters]) for side in ("lower", "upper"))
    unsettled = profile_likelihood.by_curvature(covariance.stderr[..., : len(parameters)], lower, upper)
    usable, converged = ~np.asarray(misfit), ranked.minima.converged[..., 0]
    if not usable.any():
        return Limits(unsettled, *np.full((2, *shape), np.nan)), converged
    profiled = Limits(*(x.reshape(shape) for x in limits(around(), flat, usable.ravel())))
    if covariance.curvature is not None:
        profiled = _stretched(profiled, ranked.values, covariance.widening[..., : shape[-1]], (lower, upper))
    depths = [i for i, p in enumerate(parameters) if p.key == "thickness"]
    converged = converged | (usable & np.isinf(profiled.stderr[..., depths]).any(axis=-1))
    used = (usable & converged)[..., None]
    ends = (np.where(used, end, np.nan) for end in profiled[1:])
    return Limits(np.where(used, profiled.stderr, unsettled), *ends), converged


def _stretched(
    limits: Limits, values: np.ndarray, ratio: np.ndarray, bounds: tuple[np.ndarray, np.ndarray]
) -> Limits:
    """Limits `ratio` times as far from the values, within the bounds: to first order those at which the
    misfit has risen by the square of it more (A. Rotnitzky and N. Jewell, 1990, Biometrika 77, 485)."""
    lower, upper = (values + ratio * (end - values) for end in limits[1:])
    return Limits(ratio * limits.stderr, np.maximum(lower, bounds[0]), np.minimum(upper, bounds[1]))


def _widened(
    limits: Limits,
    values: np.ndarray,
    linear: np.ndarray,
    variance: np.ndarray,
    freedom: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
) -> Limits:
    """Limits with a further variance, and as Student's t has them, within the bounds.

    Where the data do not see a side, the variance is added to the other limit if the misfit rises there as
    the `linear` standard errors of the noise say, and there is no limit if that reaches the bound. Elsewhere
    the variance would be linear in vain: the limit is that of the noise.
    """
    seen = np.isfinite(limits.stderr)
    expected = np.sqrt(ONE_SIDED) * linear
    reach, wider = np.sqrt(ONE_SIDED * variance), student(freedom, ONE_SIDED)
    ends = []
    for end, bound, side in zip(limits[1:], bounds, (-1, 1), strict=True):
        distance, room = side * (end - values), side * (bound - values)
        rises = (FLAT * expected < distance) & (distance < expected / FLAT)
        widened = np.hypot(wider * distance, reach)
        total = values + side * np.minimum(widened, room)
        open_ = np.where(rises, np.where(widened < room, total, np.nan), end)
        ends.append(np.where(seen, total, open_))
    return Limits(np.sqrt(limits.stderr**2 + variance), *ends)


def _without_film(
    parameters: Sequence[Parameter], values: np.ndarray, usable: Any, noise: Limits, every: Limits
) -> tuple[Limits, Limits]:
    """Limits by the noise, and with all that enlarges them, that have an upper end alone where the only
    thickness rests on its lower bound and no film at all lies within its error: then none is needed."""
    depth = np.array([p.key == "thickness" for p in parameters])
    if depth.sum() != 1:
        return noise, every
    lower, upper = (np.array([getattr(p, side) for p in parameters]) for side in ("lower", "upper"))
    resting = np.stack([p.on_ends(x)[0] for p, x in zip(parameters, values.T, strict=True)], axis=-1)
    reach = math.sqrt(ONE_SIDED) * every.stderr
    absent = depth & resting & np.isfinite(reach) & (lower <= reach) & np.asarray(usable)[..., None]
    noise = noise._replace(stderr=np.where(absent, np.inf, noise.stderr))
    return noise, Limits(
        np.where(absent, np.inf, every.stderr),
        np.where(absent, np.nan, every.lower),
        np.where(absent, np.minimum(values + reach, upper), every.upper),
    )


def _status(
    parameters: Sequence[Parameter],
    values: np.ndarray,
    stderr: np.ndarray,
    converged: Any,
    misfit: Any,
    close: np.ndarray,
    binding: Container[str],
) -> Judged:
    """The status of fits by their parameters (..., parameters), with all of these `at_bound`."""
    order = sorted(range(len(parameters)), key=lambda i: parameters[i].key != "thickness")
    sample = [i for i in order if not parameters[i].name.startswith("instrument.")]
    about = [parameters[i] for i in sample]
    pairs = [(p, values[..., i]) for p, i in zip(about, sample, strict=True)]
    resting = [p.on_bound(x) & ~np.asarray(p.on_natural_bound(x)) for p, x in pairs]
    status = judged(
        [p.name for p in about],
        [p.limits is not None for p in about],
        values[..., sample],
        stderr[..., sample],
        np.moveaxis(np.reshape(resting, (len(sample), *values.shape[:-1])), 0, -1),
        converged=converged,
        misfit=misfit,
        ambiguous=close.any(axis=-1),
        binding=binding,
    )
    if values.ndim == 1:
        which = status.unseen, np.array(resting), status.at_bound
        names = [", ".join(np.array([p.name for p in about])[mask]) or "none" for mask in which]
        for question, answer in (
            ("did the solver converge?", "yes" if converged else "no"),
            ("does the scene not explain the data?", "yes" if misfit else "no"),
            ("which parameters of the sample have no finite error?", names[0]),
            (f"how many rivals lie within Δχ² {RIVAL:g} and outside the errors?", close.sum()),
            ("which parameters lie on a bound?", names[1]),
            ("which of these bounds matter?", names[2]),
        ):
            log.info("status: %s %s", question, answer)
        log.info("status: %s", ORDER[status.position])
    at_bound = np.zeros(values.shape, bool)
    at_bound[..., sample] = status.at_bound
    return status._replace(at_bound=at_bound)


def neighbourhood(ranked: RankedMinima, covariance: np.ndarray, others: np.ndarray) -> Neighbourhood:
    """Neighbourhood of the best of the ranked minima of one fit.

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


class Conclusion(NamedTuple):
    """Status, estimates and rivals of a fit, and the share of the posterior that the answer has beside those
    rivals that could have some; `correlated` are sentences on parameters that are."""

    status: Status
    parameters: dict[str, Estimate]
    rivals: tuple[Rival, ...]
    probability: float | None
    correlated: list[str]


def conclude(
    best: Ranking,
    covariance: Errors,
    *,
    misfit: bool,
    fixed: list[Estimate],
    scans: Mapping[int, Profile],
    near: bool = False,
    binding: frozenset[str] = frozenset(),
    amend: Callable[[Limits], Limits] = lambda limits: limits,
) -> Conclusion:
    """Judge the `best` of the ranked minima of one fit: see `verdicts`.

    `scans` are scans of the misfit by the position of their parameter; with `near` profiles start from near
    rivals too.
    """
    ranked, discrepancy, above = best.ranked, best.discrepancy, best.delta_chi2
    points = np.asarray(ranked.problem.values(ranked.minima.units))[1 : _MOST_RIVALS + 1]

    def around() -> Neighbourhood:
        close = np.flatnonzero(above[1 : len(points) + 1] < RIVAL)[:_MOST_NEAR] if near else []
        return neighbourhood(ranked, covariance.by_curvature, points[close])

    flat = {
        axis: flat_sides(scan.thickness, scan.delta_chi2[None], ranked.values[axis, None])
        for axis, scan in scans.items()
    }
    about = ranked, covariance, discrepancy, above, around, flat
    numbers = verdicts(*about, misfit=np.array(misfit), binding=binding, amend=amend)
    names = [p.name for p in ranked.problem.parameters]
    columns = (x.tolist() for x in (points, above[1:], best.share[1:], best.stderr[1:]))
    sole = best.share[0] == 1.0
    rivals = tuple(
        Rival(
            dict(zip(names, at, strict=True)),
            delta,
            None if sole else share,
            None if share == 0.0 else dict(zip(names, stderr, strict=True)),
        )
        for at, delta, share, stderr in zip(*columns, strict=False)
        if delta < _RULED_OUT
    )
    parameters = estimates(ranked, numbers, covariance, discrepancy, fixed)
    correlated = identifiability.correlated(best.jacobian, parameters)
    probability = None if sole else float(best.share[0])
    return Conclusion(ORDER[numbers.status.position], parameters, rivals, probability, correlated)


def estimates(
    ranked: RankedMinima,
    numbers: Verdicts,
    covariance: Errors,
    discrepancy: Discrepancy,
    fixed: list[Estimate],
) -> dict[str, Estimate]:
    """Every parameter of one fit by name: free ones first, thickness before all; then nuisances and fixed
    numbers."""
    parameters, freedom, free = ranked.problem.parameters, max(float(ranked.freedom), 1.0), []
    columns = ranked.values, *numbers.limits, numbers.noise.stderr, numbers.status.at_bound
    for p, value, stderr, *ends, noise, binding in zip(
        parameters, *(x.tolist() for x in columns), strict=True
    ):
        lower, upper = (None if math.isnan(end) else end for end in ends)
        bounds = p.lower, p.upper, True, bool(p.on_bound(value)), lower, upper, p.limits is not None
        free.append(Estimate(p.name, value, stderr, p.unit, *bounds, noise, freedom, binding))
    free.sort(key=lambda e: e.name.split(".")[-1] != "thickness")
    pairs = zip(ranked.problem.views, ranked.fits, strict=True)
    nuisances = [c for view, fit in pairs for c in view.nuisances(fit.at)]
    first, linear = len(parameters), []
    rows = zip(nuisances, covariance.variance[first:], discrepancy.variance[first:], strict=True)
    for c, noise, every in rows:
        value, sd = float(c.value), math.sqrt(max(noise, every))
        reach = ONE_SIDED**0.5 * sd
        # an offset compatible with 0 has an upper limit
        limit = value + reach if c.not_negative and value < reach else None
        about = "", -math.inf, math.inf, True
        linear.append(Estimate(c.name, value, sd, *about, upper_limit=limit, stderr_noise=math.sqrt(noise)))
    return {e.name: e for e in [*free, *linear, *fixed]}


def common_rms(sizes: Sequence[int], rms: Sequence[float]) -> float:
    """rms over all parts of a fit, by their number of points."""
    return float(np.sqrt(np.average(np.square(rms), weights=sizes)))
