"""Iteratively reweighted least squares: rank minima by the noise and correlation that the data show.

Model errors are correlated along a spectrum. Counting every point as independent makes a rival look
impossible when it is not: on 119 real soap-film spectra it costs 15 right answers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from logging import getLogger
from typing import Any

import numpy as np

from pellicle.fitting.covariance import Errors, Scaled, errors, scaled
from pellicle.fitting.minima import MOST, Minima, deviance_at, minima
from pellicle.fitting.noise import NoiseEstimate, noise_of
from pellicle.fitting.problem import Problem, View
from pellicle.fitting.robust_losses import LEAST_SQUARES, LOSSES, Loss, inflation, spread

log = getLogger(__name__)


_ROUNDS, _ROBUST_ROUNDS = 3, 12


@dataclass(frozen=True)
class ViewFit:
    """Fit quality of one view at the best minimum, of many data sets with leading axes (...).

    `at` is the local model there; `variance` multiplies the σ² of the weights in the covariance; `length` is
    the number of neighbouring points that count as one; `chi2` is the misfit over `freedom` degrees;
    `outliers` is the number of points to which a robust loss gives less than half their weight. `scores`
    (rows, channels) are the weighted residuals where these stand for the noise of the points.
    """

    at: Any
    variance: Any
    length: Any
    chi2: Any
    freedom: Any
    outliers: Any = 0
    scores: np.ndarray | None = None


@dataclass(frozen=True)
class RankedMinima:
    """Minima ranked on the effective points; `problem` carries the weights that the ranking used, `searched`
    those of the search. Those of many data sets have leading axes (...)."""

    searched: Problem
    problem: Problem
    minima: Minima
    fits: tuple[ViewFit, ...]

    @property
    def freedom(self) -> Any:
        """Degrees of freedom (...) of a noise that comes from residuals, on the effective points; infinite
        where a view's weights are known."""
        if any(view.noise.known for view in self.problem.views):
            return np.full(np.shape(self.fits[0].length), np.inf)[()]
        return sum(fit.freedom / fit.length for fit in self.fits)

    @property
    def chi2_reduced(self) -> Any:
        return sum(fit.chi2 for fit in self.fits) / sum(fit.freedom for fit in self.fits)

    @property
    def counted(self) -> RankedMinima:
        """Return the minima with points that count as in the covariance.

        The ranking lets neighbours with correlated residuals count as fewer points; where σ is given, that is
        chance or what the scene leaves out, which the discrepancy allows for.
        """
        pairs = zip(self.problem.views, self.fits, strict=True)
        views = tuple(view.counting(1 / fit.variance) for view, fit in pairs)
        problem = self.problem._replace(views=views)
        deviance = deviance_at(problem, self.minima.units)
        return replace(self, problem=problem, minima=replace(self.minima, deviance=deviance))

    @property
    def values(self) -> np.ndarray:
        """The best values of the parameters (..., parameters), in their own units."""
        return np.asarray(self.problem.values(self.minima.units[..., 0, :]))


def _view_fit(view: View, noise: NoiseEstimate, at: Any) -> ViewFit:
    """Fit quality of a view whose ranked weights carry this noise."""
    weight, scores = np.square(noise.factor), None
    if view.noise.uneven:
        scores = view.residuals(at)
        if np.ndim(weight):  # the inflation contains their mean already
            scores = scores * math.sqrt(np.mean(weight) / np.mean(weight * scores**2))
    outliers = int(np.sum(weight < 0.5)) if np.ndim(weight) else 0
    numbers = noise.variance(view.noise), noise.length, noise.chi2, noise.freedom
    variance, length, chi2, freedom = (np.asarray(x, float)[()] for x in numbers)
    return ViewFit(at, variance, length, chi2, freedom, outliers, scores)


def ranked_by_factor(problem: Problem, candidates: Minima, misfit: np.ndarray, at: Any) -> RankedMinima:
    """Rank the minima of many data sets of one view as `rank` does, at which `at` are the best local models.

    Without a robust loss all weights of a data set have one factor, which moves no minimum and multiplies the
    `misfit` (..., minima), the part of the deviance that goes with the weights.
    """
    [view] = problem.views
    noise = _noise_of_view(problem, view, at, None)
    weighted = _reweighted(problem, [noise])
    [after] = weighted.views
    factor = noise.scale[..., 0] ** 2 * after.independent_fraction / view.independent_fraction
    with np.errstate(invalid="ignore"):  # of minima that are not there, which are infinite
        deviance = candidates.deviance + (np.asarray(factor)[..., None] - 1) * misfit
    deviance = np.where(np.isfinite(candidates.deviance), deviance, np.inf)
    ranked = replace(candidates, deviance=deviance)
    return RankedMinima(problem, weighted, ranked, (_view_fit(after, noise, at),))


def rank(
    problem: Problem,
    candidates: Minima,
    loss: str = LEAST_SQUARES,
    *,
    most: int = MOST,
    followed: int = MOST,
) -> RankedMinima:
    """Estimate σ and the effective points of each view from the best fit's residuals, and rank again.

    A given σ stays. An unknown one becomes the rms of the residuals. Where scale and offset drift,
    the weights stay too: the residuals of so flexible a model understate its error. A robust `loss`
    weighs each point by its residual, and takes σ from the bulk of them.
    """
    robust, scan = LOSSES.get(loss), candidates.scan
    best = np.asarray(problem.values(candidates.units[0]))
    views = tuple(view.by_local_noise(problem.seen_by(view, best)) for view in problem.views)
    problem = problem._replace(views=views)
    unit = candidates.units[0] if robust is None else _typical(problem, candidates, robust)
    noise = _noise(problem, unit, robust)
    for _ in range(_ROUNDS if robust is None else _ROBUST_ROUNDS):
        best, weighted = candidates.units[0], _reweighted(problem, noise)
        candidates = minima(weighted, candidates.units, most=most, followed=followed)
        again = _noise(problem, candidates.units[0], robust)
        near = 1e-3 if robust is None else 1e-6
        a, b = (np.concatenate([own.scale for own in each]) for each in (noise, again))
        # the relative weights of the views, and under a robust loss their noise too, agree within 2 %
        pairs = [(a / a[0], b / b[0])] if robust is None else [(a / a[0], b / b[0]), (a, b)]
        alike = all(np.all(np.abs(x - y) <= 0.02 * np.abs(y)) for x, y in pairs)
        if alike and np.all(np.abs(candidates.units[0] - best) <= near + 1e-5 * np.abs(best)):
            break
        noise = again
    weighted = _reweighted(problem, noise)
    for view, own in zip(weighted.views, noise, strict=True):
        log.info(
            "weights%s: residuals are correlated over %.3g points, so that %d points count as %.3g",
            *(f" of {view.name}" if view.name else "", own.length, view.rows, view.rows / own.length),
        )
    at = zip(weighted.views, _local(weighted, candidates.units[0]), noise, strict=True)
    fits = tuple(_view_fit(view, own, local) for view, local, own in at)
    return RankedMinima(problem, weighted, replace(candidates, scan=scan), fits)


def linearised(ranked: RankedMinima) -> tuple[Scaled, Errors]:
    """The scaled Jacobian at the best minima (...), and the covariance from it."""
    at, variance = [fit.at for fit in ranked.fits], [fit.variance for fit in ranked.fits]
    jacobian = scaled(ranked.problem, ranked.minima.units[..., 0, :], at, variance)
    sizes = [view.rows * view.channels for view in ranked.problem.views]
    pairs = zip(np.cumsum([0, *sizes]).tolist(), ranked.fits, strict=False)
    return jacobian, errors(jacobian, {at: fit.scores for at, fit in pairs if fit.scores is not None})


def at_minimum(ranked: RankedMinima, position: int) -> RankedMinima:
    """Ranked minima of one fit as if the one at a position were the only one."""
    chosen = ranked.minima.units[position : position + 1]
    own = replace(ranked.minima, units=chosen, deviance=ranked.minima.deviance[position : position + 1])
    local = _local(ranked.problem, chosen[0])
    fits = tuple(replace(fit, at=at) for fit, at in zip(ranked.fits, local, strict=True))
    return replace(ranked, minima=own, fits=fits)


def led_by(ranked: RankedMinima, position: int) -> RankedMinima:
    """Ranked minima of one fit with the one at a position in front, which sets the noise."""
    minima, problem = ranked.minima, ranked.searched
    order = np.array([position, *(i for i in range(len(minima.units)) if i != position)])
    noise = _noise(problem, minima.units[position], None)
    weighted = _reweighted(problem, noise)
    units = minima.units[order]
    moved = replace(
        minima, units=units, deviance=deviance_at(weighted, units), converged=minima.converged[order]
    )
    rows = zip(weighted.views, _local(weighted, units[0]), noise, strict=True)
    return RankedMinima(problem, weighted, moved, tuple(_view_fit(v, own, at) for v, at, own in rows))


def _local(problem: Problem, unit: np.ndarray) -> list[Any]:
    values = np.asarray(problem.values(unit))
    return [view.local(problem.seen_by(view, values)) for view in problem.views]


def _typical(problem: Problem, candidates: Minima, loss: Loss) -> np.ndarray:
    """The minimum of the least robust loss: least squares may have followed the outliers."""
    each = [
        [view.residuals(at).ravel() for view, at in zip(problem.views, _local(problem, unit), strict=True)]
        for unit in candidates.units
    ]
    least = [min(spread(residuals) for residuals in of_view) for of_view in zip(*each, strict=True)]
    sizes = [1.0 if v.noise.given else size for v, size in zip(problem.views, least, strict=True)]
    losses = [sum(loss.loss(r / s).sum() for r, s in zip(rows, sizes, strict=True)) for rows in each]
    return candidates.units[int(np.argmin(losses))]


def _noise(problem: Problem, unit: np.ndarray, loss: Loss | None) -> list[NoiseEstimate]:
    """Noise of every view. A parameter that several views share costs each a share of it, by their points."""
    return [
        _noise_of_view(problem, view, at, loss)
        for view, at in zip(problem.views, _local(problem, unit), strict=True)
    ]


def _noise_of_view(problem: Problem, view: View, at: Any, loss: Loss | None) -> NoiseEstimate:
    at_model, groups = view.at_model(at), view.noise_groups
    residuals = view.residuals(at) * at_model
    totals = [sum(v.independent for v in problem.views if i in v.takes) for i in view.takes]
    used = sum(view.independent / total for total in totals) + view.nuisance_freedom(at)
    freedom = np.full(residuals.shape[:-2], max(view.independent - used, 1.0))[()]
    if loss is None:
        length = view.correlation_length(residuals)
        return noise_of(residuals, groups, freedom, length)._replace(at_model=at_model)
    size = np.ones(residuals.shape[1])
    for group in groups:
        channels, own = list(group.channels), freedom * group.independent / view.independent
        size[channels] = spread(residuals[:, channels]) * math.sqrt(group.independent / own)
    weight = loss.weight(residuals if view.noise.given else residuals / size)
    length = view.correlation_length(np.sqrt(weight) * residuals)
    return noise_of(residuals, groups, freedom, length, size)._replace(
        factor=np.sqrt(weight), inflation=inflation(loss, residuals / size), at_model=at_model
    )


def _reweighted(problem: Problem, noise: Sequence[NoiseEstimate]) -> Problem:
    pairs = zip(problem.views, noise, strict=True)
    views = (
        v.reweighted(own.scale[..., None, :] * own.factor * own.at_model, 1 / own.length) for v, own in pairs
    )
    return problem._replace(views=tuple(views))
