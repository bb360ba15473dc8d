"""From ranked minima to a status, estimates and what the data do not determine."""

import math
from collections.abc import Callable, Mapping, Sequence
from logging import getLogger
from typing import NamedTuple

import numpy as np

from pellicle.fitting import identifiability
from pellicle.fitting.covariance import Errors, Scaled, errors, scaled
from pellicle.fitting.discrepancy import Discrepancy
from pellicle.fitting.estimates import by_curvature, by_profile, estimates, rivals
from pellicle.fitting.minima import Minima
from pellicle.fitting.problem import Problem
from pellicle.fitting.profile_likelihood import Limits
from pellicle.fitting.result import Estimate, Profile, Rival, Status
from pellicle.fitting.reweighting import RankedMinima, rank
from pellicle.fitting.status import judge

log = getLogger(__name__)


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
