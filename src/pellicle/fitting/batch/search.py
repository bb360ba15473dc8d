"""Search for the minima of many spectra: scan by a table, Gauss-Newton steps with the exact model.

The candidates of the scan (`lookup`) that could be answer of a spectrum or its rival are polished with
the model, the weights and the bounds that `pellicle.fit` has (`polish`); the others keep what the
scan predicts.
"""

from __future__ import annotations

from dataclasses import dataclass
from logging import getLogger

import numpy as np

from pellicle.fitting.batch import polish
from pellicle.fitting.batch.candidates import BatchSearch, Candidates, candidates
from pellicle.fitting.batch.data import BatchData, BatchMinima
from pellicle.scene.instrument import Drift

log = getLogger(__name__)

_CHANCE, _REACH = 20.0, 1.25
"""Candidates that are polished, chosen as in `fitting.film.search`."""
_SCALE = 0.02
"""Relative error of a scene or an instrument: candidates that it could put before the best are polished too,
because differences of χ² count less by what a scene may leave out."""
_NEAR, _SETTLED = 1e-5, 1e-10
"""Fall of the deviance, in units of the noise, that may be left in a minimum before and after its last step:
the second is 1e-5 of a standard error."""
_FALLING = 0.1
"""Share to which the fall that is left in a minimum comes by one more undamped step."""
_ROUNDS, _MORE_ROUNDS, _LAST = 4, 40, 4
"""Rounds of steps for each candidate, of more for the best of a spectrum, and most repetitions of its
last."""

_REWEIGHTED = 3
"""Times that weights are adapted to the residuals, where priors weigh beside the data."""


def minima(search: BatchSearch, data: BatchData) -> BatchMinima:
    """The best distinct minima of each spectrum; to be called with JAX in float64."""
    spectra, points = data.values.shape
    count, nodes = len(search.problem.parameters), len(search.thickness)
    valid = np.flatnonzero(np.sum(data.weight > 0, axis=1) >= 2)
    best = _minima(search, data.of(valid) if len(valid) < spectra else data) if len(valid) else None
    if best is not None and len(valid) == spectra:
        return best
    orders, curve = (spectra, search.orders), (spectra, points)
    result = BatchMinima(
        values=np.full((*orders, count), np.nan),
        units=np.full((*orders, count), np.nan),
        deviance=np.full(orders, np.inf),
        misfit=np.full(orders, np.inf),
        converged=np.zeros(orders, bool),
        model=np.full(curve, np.nan),
        profile=np.full((spectra, nodes), np.nan),
        thickness=search.thickness,
        signal=np.full(curve, np.nan),
        gain=np.full(curve, np.nan),
        offset=np.full(curve, np.nan),
        slope=np.full((*curve, count), np.nan),
    )
    for name, rows in zip(BatchMinima._fields, best or (), strict=False):
        if name != "thickness":
            getattr(result, name)[valid] = rows
    return result


@dataclass
class _Points:
    """Points of spectra on their way to minima: `units` (spectra, candidates, parameters), with the deviance,
    its part that goes with the weights, and the fall to come (spectra, candidates)."""

    search: BatchSearch
    data: BatchData
    units: np.ndarray
    deviance: np.ndarray
    misfit: np.ndarray
    promise: np.ndarray

    @classmethod
    def unpolished(
        cls, search: BatchSearch, data: BatchData, units: np.ndarray, deviance: np.ndarray
    ) -> _Points:
        """Points of a known deviance."""
        return cls(
            search, data, units, np.array(deviance), np.array(deviance), np.full(deviance.shape, np.inf)
        )

    def polish(self, where: np.ndarray, rounds: int, best: np.ndarray, *, coarse: bool = True) -> None:
        """Polish the points `where`, as far as their distance to the `best` (spectra,) asks if `coarse`."""
        at, which = np.nonzero(where)
        settled = polish.settle(
            *(self.search.static, self.search.common, self.data, at, self.units[at, which]),
            rounds=rounds,
            tolerance=_NEAR * self.search.noise(best[at]),
            coarse=best[at] if coarse else None,
        )
        for mine, own in zip((self.units, self.deviance, self.misfit, self.promise), settled, strict=True):
            mine[at, which] = own

    def end(self, lowest: np.ndarray) -> polish.Best:
        """The last steps of the `lowest` points (spectra,), and the model there."""
        spectra = np.arange(len(lowest))
        best = self._at_best(spectra, self.units[spectra, lowest])
        tolerance = _SETTLED * self.search.noise(best.deviance)
        left = np.flatnonzero(best.promise > tolerance)
        for _ in range(_LAST):
            if not len(left):
                break
            again = self._at_best(left, best.units[left])
            nearer = again.promise <= _FALLING * best.promise[left]
            for mine, own in zip(best, again, strict=True):
                mine[left[nearer]] = own[nearer]
            left = left[nearer & (again.promise > tolerance[left])]
        self._end_damped(lowest, best, np.flatnonzero(best.promise > tolerance), tolerance)
        self.units[spectra, lowest], self.deviance[spectra, lowest] = best.units, best.deviance
        self.misfit[spectra, lowest], self.promise[spectra, lowest] = best.misfit, best.promise
        return best

    def _at_best(self, spectra: np.ndarray, units: np.ndarray) -> polish.Best:
        static, common = self.search.static, self.search.common
        return polish.in_rows(polish.at_best, static, common, self.data.of(spectra), units)

    def _end_damped(
        self, lowest: np.ndarray, best: polish.Best, left: np.ndarray, tolerance: np.ndarray
    ) -> None:
        """End the points of the spectra `left`, where residuals are so large that undamped steps lead away
        from the minimum."""
        if not len(left):
            return
        units, deviance, misfit, _ = polish.settle(
            *(self.search.static, self.search.common, self.data, left, self.units[left, lowest[left]]),
            rounds=_LAST,
            tolerance=tolerance[left],
        )
        ended = self._at_best(left, units)
        far = ended.promise > _NEAR * self.search.noise(deviance)
        ended.units[far], ended.deviance[far], ended.misfit[far] = units[far], deviance[far], misfit[far]
        for mine, own in zip(best, ended, strict=True):
            mine[left] = own


def _minima(search: BatchSearch, data: BatchData) -> BatchMinima:
    """Minima of spectra that all have data."""
    found = candidates(search, data)
    points, tried = _polished(search, data, found)
    factor = np.ones(len(data.values))
    if search.has_priors:
        points, tried, factor = _reweighted(points, tried, data)
    best = np.where(tried, points.deviance, np.inf)
    lowest, best = np.argmin(best, axis=1), best.min(axis=1)
    first = np.arange(tried.shape[1]) == lowest[:, None]
    near = _NEAR * search.noise(best)[:, None]
    points.polish(first & (points.promise > near), _MORE_ROUNDS, best, coarse=False)
    at_best = points.end(lowest)
    settled = points.promise <= np.maximum(near, polish.COARSE * (points.deviance - best[:, None]) * ~first)
    return _ordered(points, lowest, settled, factor, found.profile, at_best)


def _polished(search: BatchSearch, data: BatchData, found: Candidates) -> tuple[_Points, np.ndarray]:
    """The candidates, polished where they could be the best of their spectrum or its rival, and which
    were."""
    units, predicted = found.units, found.predicted
    several = len(search.problem.parameters) > 1
    optimistic = exact = predicted
    if not found.alike:
        exact = _deviance(search, data, units)
        if not several:
            # the determinant of the nuisances, which predictions leave out, is much the same everywhere
            at = np.arange(len(exact)), np.argmin(exact, axis=1)
            predicted = predicted + (exact[at] - predicted[at])[:, None]
        optimistic = np.minimum(predicted, exact)
    points = _Points.unpolished(search, data, units, exact)
    if several:
        # along a valley of several parameters a linear step says little
        points.polish(np.isfinite(optimistic), 1, exact.min(axis=1))
        optimistic = np.where(np.isfinite(points.deviance), points.deviance, optimistic)
    return points, _polish_all_near(points, optimistic, exact, found.rounding)


def _reweighted(
    points: _Points, tried: np.ndarray, data: BatchData
) -> tuple[_Points, np.ndarray, np.ndarray]:
    """The points polished again with weights by their residuals, which were, and the factors (spectra,) of
    the weights."""
    search, spectra = points.search, np.arange(len(data.values))
    factor = np.ones(len(spectra))
    for _ in range(_REWEIGHTED):
        lowest = np.argmin(np.where(tried, points.deviance, np.inf), axis=1)
        before = points.units[spectra, lowest]
        factor = _weight_factor(points, lowest, data)
        weighted = data._replace(weight=data.weight * factor[:, None])
        exact = _deviance(search, weighted, points.units)
        points = _Points.unpolished(search, weighted, points.units, exact)
        tried = _polish_all_near(points, exact, exact, np.zeros(len(spectra)))
        lowest = np.argmin(np.where(tried, points.deviance, np.inf), axis=1)
        if np.allclose(points.units[spectra, lowest], before, rtol=0.0, atol=1e-3):
            break
    return points, tried, factor


def _ordered(
    points: _Points,
    lowest: np.ndarray,
    settled: np.ndarray,
    factor: np.ndarray,
    profile: np.ndarray,
    at_best: polish.Best,
) -> BatchMinima:
    """The distinct minima of each spectrum, best first, with deviances by its given weights."""
    search, problem = points.search, points.search.problem
    # along a valley of several parameters, points that have not settled are no minima
    listed = settled if len(problem.parameters) > 1 else np.isfinite(points.deviance)
    order = _distinct(search, points.units, points.deviance, lowest, listed)
    rows, here, absent = np.arange(len(order))[:, None], np.maximum(order, 0), order < 0
    ordered = np.where(absent[..., None], np.nan, points.units[rows, here])
    with np.errstate(invalid="ignore"):  # of points that were not tried, which are infinite
        rest = points.deviance - points.misfit
    misfit = points.misfit / factor[:, None] ** 2
    deviance, misfit = (np.where(absent, np.inf, x[rows, here]) for x in (misfit + rest, misfit))
    return BatchMinima(
        values=np.asarray(problem.values(ordered)),
        units=ordered,
        deviance=deviance,
        misfit=misfit,
        converged=settled[rows, here] & ~absent,
        model=at_best.model,
        profile=profile - deviance[:, :1],
        thickness=search.thickness,
        signal=at_best.signal,
        gain=at_best.gain,
        offset=at_best.offset,
        slope=at_best.slope,
    )


def _deviance(search: BatchSearch, data: BatchData, units: np.ndarray) -> np.ndarray:
    """Deviance (spectra, candidates) at points (spectra, candidates, parameters), infinite where there is
    none."""
    deviance = polish.in_rows(polish.explained, search.static, search.common, data, units).deviance
    return np.where(np.isfinite(deviance), deviance, np.inf)


def _weight_factor(points: _Points, lowest: np.ndarray, data: BatchData) -> np.ndarray:
    """Factors (spectra,) of the weights of the `data`, from the residuals of the `lowest` points.

    As in `fitting.reweighting`: σ that is not given is their rms, and correlated neighbours count as one
    point. Without priors that moves no minimum.
    """
    search, view = points.search, points.search.view
    units = points.units[np.arange(len(lowest)), lowest]
    best = polish.in_rows(polish.at_best, search.static, search.common, points.data, units)
    residual = data.weight * (data.values - best.model)
    known = np.sum(data.weight > 0, axis=1) * view.independent / view.points
    nuisances = [
        x for x in (view.scene.instrument.scale, view.scene.instrument.offset) if isinstance(x, Drift)
    ]
    used = len(search.problem.parameters) + sum(x.degree + 1 for x in nuisances)
    square = np.sum(residual**2, axis=1) / np.maximum(known - used, 1.0)
    scale = np.ones(len(square)) if view.noise.known else 1 / np.sqrt(np.maximum(square, 1e-12))
    length = view.correlation_length(residual.reshape(len(residual), -1, view.channels))
    fraction = float(view.data.independent_fraction)
    return scale * np.sqrt(np.minimum(1 / length, fraction) / fraction)


def _polish_all_near(
    points: _Points, optimistic: np.ndarray, exact: np.ndarray, rounding: np.ndarray
) -> np.ndarray:
    """Polish all candidates that could be the best of their spectrum or its rival; returns which they are.

    As in `fitting.film.search`, residuals obey the triangle inequality: a candidate is left out where the
    best is further away than `_REACH` times what polishing has brought in that spectrum.
    """
    spectra, search, data = np.arange(len(exact)), points.search, points.data
    systematic = np.sum((_SCALE * data.weight * data.values) ** 2, axis=1)
    tried, now = np.zeros(exact.shape, bool), np.zeros(exact.shape, bool)
    now[spectra, np.argmin(optimistic, axis=1)] = True
    now[spectra, np.argmin(exact, axis=1)] = True
    best, fall = exact.min(axis=1), np.zeros(len(exact))
    while now.any():
        points.polish(now, _ROUNDS, best)
        tried |= now
        with np.errstate(invalid="ignore"):  # of candidates that are not there
            below = np.where(now, _root(optimistic) - _root(points.deviance), 0.0)
        fall = np.maximum(fall, np.where(np.isfinite(below), below, 0.0).max(axis=1))
        best = np.where(tried, points.deviance, np.inf).min(axis=1)
        level = best + _CHANCE * search.noise(best) + systematic + rounding
        near = _root(optimistic) - _REACH * fall[:, None] < _root(level)[:, None]
        now = near & ~tried & np.isfinite(optimistic)
    return tried


def _root(deviance: np.ndarray) -> np.ndarray:
    """‖r‖ of a deviance; evidence may take it below zero."""
    return np.sqrt(np.maximum(deviance, 0.0))


def _distinct(
    search: BatchSearch,
    units: np.ndarray,
    deviance: np.ndarray,
    lowest: np.ndarray,
    listed: np.ndarray,
) -> np.ndarray:
    """Positions of the best distinct minima of each spectrum (spectra, orders), −1 where there are no more:
    the `lowest` (spectra,), and the best of the others that are `listed` (spectra, candidates)."""
    rows, count = np.arange(len(units)), units.shape[1]
    parameters = search.problem.parameters
    resolution = np.stack([p.resolutions_at(x) for p, x in zip(parameters, units.T, strict=True)]).T
    left = np.where(listed, deviance, np.inf)
    chosen, at = np.full((len(units), search.orders), -1), lowest
    chosen[:, 0] = at
    for k in range(1, min(search.orders, count)):
        apart = np.any(np.abs(units - units[rows, at][:, None]) > resolution[rows, at][:, None], axis=2)
        left = np.where(apart, left, np.inf)
        at = np.argmin(left, axis=1)
        chosen[:, k] = np.where(np.isfinite(left[rows, at]), at, -1)
    return chosen
