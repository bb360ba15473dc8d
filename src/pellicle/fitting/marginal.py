"""Marginal likelihood of minima: nuisances and systematic effects integrated out.

A rival explains data with a wavelength scale a little off, or a lamp, as well as the best minimum does. So
both are compared with all effects allowed for, each by the linear model at its own place, and with one noise:
that which the discrepancy of the best leaves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.fitting.covariance import Errors, Scaled
from pellicle.fitting.discrepancy import Discrepancy, discrepancy
from pellicle.fitting.linear_system import Effect, Evidence, System
from pellicle.fitting.noise import student
from pellicle.fitting.normal_equations import held_within, times
from pellicle.fitting.reweighting import RankedMinima, at_minimum, led_by, linearised
from pellicle.fitting.robust_losses import median
from pellicle.fitting.status import RIVAL

_REACH = 3.0
"""Total errors of the best minimum by which the parameters of any may move with the effects."""
_UNIFORM = 12.0
"""Inverse variance of a parameter of which the data see nothing, in units of its range."""
_LINEAR = 4.0
"""Factor by which effects may explain more at a rival than at the best minimum."""
_HALF_LOG_2PI = 0.5 * math.log(2 * math.pi)
_erf = np.frompyfunc(math.erf, 1, 1)
CLEAR = 20.0
"""Δχ² by which another minimum than the best by noise must be better to take its place."""
_MUCH = 4.0
"""Least factor on χ² that chance does not make."""


class Marginal(NamedTuple):
    """−2 ln of the marginal likelihood of minima (...), each at its best parameters, and ln of their shares
    of the posterior, both up to a constant; `stderr` (..., parameters) are the standard errors there.

    `log_evidence` (...) is ln of the evidence: the likelihood integrated over effects, nuisances and, with a
    uniform prior between their bounds, the parameters. `step` (..., parameters) leads in the unit cube to the
    best parameters of the linear model.
    """

    deviance: Any
    log_share: Any
    stderr: np.ndarray
    log_evidence: Any
    step: Any


def marginal(
    evidence: Sequence[Evidence],
    scaled: Scaled,
    unit: np.ndarray,
    weights: Sequence[np.ndarray],
    total: np.ndarray,
) -> Marginal:
    """The marginal likelihood at `unit` (..., parameters) of the unit cube by the evidence there.

    `weights` (..., rows, channels) of each view are 1/σ in the unit of the data, where σ is what the effects
    leave at the best minimum, whose noise counts; `total` are its errors.

    **Source:** C. Bishop, 2006, Pattern Recognition and Machine Learning, section 3.5; shares by the normal
    approximation of D. MacKay, 2003, Information Theory, Inference and Learning Algorithms, eq. 27.5, as is
    the evidence (eq. 28.6), of which a parameter near a bound has the part within.
    """
    pairs = zip(evidence, weights, strict=True)
    raised = [view._replace(sigma=view.unit / own, least=1.0) for view, own in pairs]
    system = System(raised, scaled, unit, hold=False)
    views, known, count, fits = system.balances(), system.known, np.shape(unit)[-1], system.fits
    normal = system.normal(views)
    stretch = scaled.stretch.reshape(fits, known, known)
    steps = np.abs(np.linalg.pinv(stretch)) @ np.broadcast_to(total, (fits, known))[..., None]
    reach = _REACH * steps[:, :count, 0]
    lower, upper = system.lower.copy(), system.upper.copy()
    lower[:, :count] = np.maximum(lower[:, :count], -reach)
    upper[:, :count] = np.minimum(upper[:, :count], reach)
    solution = held_within(*normal.solved(), lower, upper)
    left = [x.data - times(np.swapaxes(x.rows, 1, 2), solution) for x in views]
    chi2 = sum(np.sum(x**2, axis=1) for x in left) + np.sum(solution[:, known:] ** 2, axis=1)
    chi2 += np.sum((times(system.priors, solution[:, :known]) + system.pull) ** 2, axis=1)
    matrix = normal.matrix
    linear, across = matrix[:, count:, count:], matrix[:, count:, :count]
    deviance = chi2 + np.linalg.slogdet(linear)[1]
    information = matrix[:, :count, :count] - np.swapaxes(across, 1, 2) @ np.linalg.solve(linear, across)
    covariance = np.linalg.inv(information + _UNIFORM * np.eye(count))
    slope = stretch[:, :count, :count]
    area = np.linalg.slogdet(slope)[1]  # none in the middle of a disc of directions
    by_range = -0.5 * deviance + 0.5 * np.linalg.slogdet(covariance)[1]
    log_share = by_range + np.where(area > -np.inf, area, 0.0)
    stderr = np.sqrt(np.maximum(np.einsum("pij,pjk,pik->pi", slope, covariance, slope), 0.0))
    # where noise is all but absent, a variance may round below zero
    variance, at = np.maximum(np.einsum("pii->pi", covariance), 1e-200), np.reshape(unit, (fits, count))
    wide = np.sqrt(2 * variance)
    inside = 0.5 * np.asarray(_erf((1 - at) / wide) + _erf(at / wide), float)
    gaussian = np.abs(np.einsum("pii->pi", system.priors)[:, :count])  # 1/σ of a prior that is not uniform
    density = np.where(gaussian > 0, np.log(np.maximum(gaussian, 1e-300)), _HALF_LOG_2PI)
    logs = [np.log(np.maximum(own, 1e-300)).reshape(fits, -1) - _HALF_LOG_2PI for own in weights]
    log_evidence = by_range + sum(np.sum(own, axis=1) for own in logs)
    log_evidence += np.sum(density + np.log(np.maximum(inside, 1e-300)), axis=1)
    every = deviance, log_share, stderr, log_evidence, solution[:, :count]
    return Marginal(*(system.led(x) for x in every))


class Ranking(NamedTuple):
    """Ranked minima of one fit, the best with the effects integrated out in front, and what `data` say there.

    `delta_chi2` (minima,) is twice the fall of the marginal likelihood's logarithm, `share` (minima,) that of
    the posterior, and `stderr` (minima, parameters) are the standard errors at each. Of a minimum that
    effects of ordinary size cannot turn the first is that of the noise, the others are 0 and NaN.
    `log_evidence` is that of the best.
    """

    data: Any
    ranked: RankedMinima
    jacobian: Scaled
    discrepancy: Discrepancy
    delta_chi2: np.ndarray
    share: np.ndarray
    stderr: np.ndarray
    log_evidence: float

    def effects(self) -> tuple[tuple[Effect, ...], ...]:
        """Systematic effects of each view at the best minimum, with their changes in the unit of the data."""
        with jax.enable_x64(True):
            views = self.evidence()
        return tuple(tuple(replace(e, change=e.change / view.unit) for e in view.effects) for view in views)

    def evidence(self) -> list[Evidence]:
        """Residuals of each view at the best minimum and what may explain them."""
        return self.data.evidence(self.ranked, self.jacobian)


def ranking(make: Callable[[RankedMinima], Any], ranked: RankedMinima) -> Ranking:
    """Rank the minima of one fit by their marginal likelihood.

    `make` returns the measurements of ranked minima. Where another minimum than the first is clearly better
    it becomes the first, whose noise then counts.
    """
    result = _ranking(make, ranked)
    best = int(np.argmin(result.delta_chi2))
    if result.delta_chi2[best] <= -CLEAR:
        again = _ranking(make, led_by(result.ranked, best))
        if again.delta_chi2.min() > -CLEAR:
            result = again
    order = np.argsort(result.delta_chi2, kind="stable")
    order = np.array([0, *order[order != 0]])
    minima = result.ranked.minima
    columns = {name: getattr(minima, name)[order] for name in ("units", "deviance", "converged")}
    about = {name: getattr(result, name)[order] for name in ("delta_chi2", "share", "stderr")}
    about["delta_chi2"] = np.maximum(about["delta_chi2"], 0.0)
    return result._replace(ranked=replace(result.ranked, minima=replace(minima, **columns)), **about)


def _ranking(make: Callable[[RankedMinima], Any], ranked: RankedMinima) -> Ranking:
    data, units = make(ranked), ranked.minima.units
    jacobian = linearised(ranked)[0]
    evidence = data.evidence(ranked, jacobian)
    allowed = discrepancy(evidence, jacobian, units[0])
    about = left_weights(evidence, allowed), allowed.total
    best, delta = marginal(evidence, jacobian, units[0], *about), above_best(ranked, allowed)
    log_share, stderr = np.full(len(units), -np.inf), np.full(units.shape, np.nan)
    log_share[0], stderr[0] = best.log_share, best.stderr
    for i in (np.flatnonzero(turnable(delta, allowed)[1:]) + 1).tolist():
        own = at_minimum(ranked, i)
        slopes = linearised(own)[0]
        there = marginal(data.evidence(own, slopes), slopes, units[i], *about)
        delta[i] = (there.deviance - best.deviance) / np.asarray(student(ranked.freedom, RIVAL)) ** 2
        log_share[i], stderr[i] = there.log_share, there.stderr
    share = np.exp(log_share - log_share.max())
    shares = share / share.sum()
    return Ranking(data, ranked, jacobian, allowed, delta, shares, stderr, float(best.log_evidence))


def left_weights(evidence: Sequence[Evidence], allowed: Discrepancy) -> list[np.ndarray]:
    """1/σ of the points of each view (..., rows, channels), where σ is what the effects leave."""
    pairs = zip(evidence, allowed.raised, strict=True)
    return [raised * view.weights * view.unit for view, raised in pairs]


def above_best(ranked: RankedMinima, allowed: Discrepancy) -> np.ndarray:
    """Δχ² (..., minima) of the minima on the effective points, by the noise.

    Of a difference in χ² only a share is evidence where residuals are larger than noise. Where few residuals
    set the noise it is less by what Student's t is wider at the threshold of a rival.
    """
    deviance, wider = ranked.minima.deviance, np.asarray(student(ranked.freedom, RIVAL))[..., None]
    share = np.asarray(allowed.evidence_share)[..., None]
    return share * np.maximum(deviance - deviance[..., :1], 0.0) / wider**2


def turnable(above: np.ndarray, allowed: Discrepancy) -> np.ndarray:
    """Minima (..., minima), this Δχ² above the best by the noise, that effects may make as good."""
    return above <= RIVAL * (1 + _LINEAR * np.asarray(allowed.explained)[..., None])


def gains(allowed: Discrepancy) -> list[Any]:
    """Factors (...) of each view on χ² in the ranking, 1 or more: the residuals count for what remains where
    effects explain much of them.

    Residuals of a level that is off are as large as that, and correlated over all points: neither is noise.
    """
    every = [median(raised, (-2, -1)) ** 2 for raised in allowed.raised]
    return [np.where(gain > _MUCH, gain, 1.0) for gain in every]


def by_remaining(ranked: RankedMinima, allowed: Discrepancy) -> RankedMinima:
    """Ranked minima whose points count with these gains in the covariance, or as much as they did.

    Where a lamp drifts that is no noise to be small: errors by noise stay those of its σ.
    """
    fits = [
        fit
        if view.noise.drifting
        else replace(fit, variance=np.minimum(fit.variance, 1 / (gain * view.independent_fraction)))
        for view, fit, gain in zip(ranked.problem.views, ranked.fits, gains(allowed), strict=True)
    ]
    return replace(ranked, fits=tuple(fits))


def with_shift(covariance: Errors, allowed: Discrepancy) -> Errors:
    """Errors of one fit about its own values, which a posterior with the effects does not lie around.

    `covariance` is by the noise, whose unevenness the posterior does not see. The curvature is that of the
    posterior, with effects.
    """
    own = allowed.errors.covariance
    wider = own + np.outer(allowed.shift, allowed.shift)
    factor = np.sqrt(np.maximum(covariance.variance / np.maximum(np.diag(wider), 1e-300), 1.0))
    return replace(covariance, covariance=wider * np.outer(factor, factor), curvature=own)
