"""Search for the minima of many pixels: scan by a table, Gauss-Newton steps with the exact model.

The candidates of the scan (`mapping.lookup`) that could be a pixel's answer or its rival are polished with
the model, the weights and the bounds that `pellicle.fit` has (`mapping.polish`); the others keep what the
scan predicts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from logging import getLogger
from typing import NamedTuple

import numpy as np

from pellicle.fitting.parameter import Parameter
from pellicle.fitting.problem import Problem
from pellicle.fitting.spectra.view import SpectrumView
from pellicle.mapping import polish
from pellicle.mapping.lookup import Layout, Lookup, scan, table
from pellicle.mapping.pixel_minima import ORDERS, PixelData, PixelMinima
from pellicle.scene.instrument import Drift

log = getLogger(__name__)

_MOST_PRODUCTS = 4_000_000
"""Numbers of the product of a block of pixels with the table, 16 MB: larger tables have smaller blocks."""
_MOST_PIXELS, _FEWEST_PIXELS = 1024, 64
_CHANCE, _REACH = 20.0, 1.25
"""Which candidates are polished: as in `fitting.spectra.search`."""
_SCALE = 0.02
"""Relative error of a scene or an instrument: candidates that it could put before the best are polished too,
because differences of χ² count less by what a scene may leave out."""
_ROUNDING = 1e-5
"""Error of a predicted deviance as a share of the data's square: the table is in single precision."""
_SETTLED = 1e-10
"""Fall of the deviance, in units of the noise, that may be left in a minimum: a 1e-5 of a standard error."""
_ROUNDS, _MORE_ROUNDS = 4, 30
"""Rounds of steps for each candidate, and of more for the best of a pixel."""


class PixelSearch(NamedTuple):
    """A problem's one spectrum as of any pixel, and the table that finds its minima."""

    problem: Problem
    view: SpectrumView
    common: polish.Common
    lookup: Lookup
    layout: Layout
    thickness: np.ndarray
    dark: float  # known offset

    @property
    def static(self) -> polish.Static:
        return self.view.form, self.problem.coordinates

    @property
    def block(self) -> int:
        """Pixels that are scanned together."""
        width = self.lookup.columns.shape[1]
        return int(np.clip(2 ** int(np.log2(_MOST_PRODUCTS / width)), _FEWEST_PIXELS, _MOST_PIXELS))


def prepared(problem: Problem, sample: PixelData) -> PixelSearch:
    """The search of pixels for a problem of one spectrum; `sample` are a few pixels, as all are."""
    view: SpectrumView = problem.views[0].unpadded()
    view = replace(view, data=view.data._replace(frame=None))
    instrument, level = view.scene.instrument, float(np.median(sample.level))
    weight = _even_weight(sample, view.channels)
    if isinstance(instrument.scale, Drift):
        weight = weight * sample.level[:, None]
    weight = np.ma.median(np.ma.masked_equal(weight, 0.0), axis=0).filled(0.0)
    lookup, layout, thickness = table(problem, view, weight, level)
    common = polish.Common(view.scene, view.data, problem.box)
    dark = 0.0 if isinstance(instrument.offset, Drift) else float(instrument.offset)
    return PixelSearch(problem, view, common, lookup, layout, thickness, dark)


def _even_weight(data: PixelData, channels: int) -> np.ndarray:
    """Weights (pixels, points) of N, C, S themselves where they are given in a frame."""
    if data.frame is None:
        return data.weight
    square = data.weight.reshape(len(data.weight), -1, channels) ** 2
    return np.repeat(np.sqrt(square.mean(axis=2)), channels, axis=1)


def minima(search: PixelSearch, data: PixelData) -> PixelMinima:
    """The best distinct minima of each pixel; to be called with JAX in float64."""
    pixels, count = len(data.values), len(search.problem.parameters)
    pieces = []
    valid = np.flatnonzero(np.sum(data.weight > 0, axis=1) >= 2)
    for first in range(0, len(valid), search.block):
        own = valid[first : first + search.block]
        pieces.append(_block(search, data.of(own)))
    result = PixelMinima(
        values=np.full((pixels, ORDERS, count), np.nan),
        units=np.full((pixels, ORDERS, count), np.nan),
        deviance=np.full((pixels, ORDERS), np.inf),
        misfit=np.full((pixels, ORDERS), np.inf),
        converged=np.zeros((pixels, ORDERS), bool),
        model=np.full(data.values.shape, np.nan),
        profile=np.full((pixels, len(search.thickness)), np.nan),
        thickness=search.thickness,
        slope=np.full((*data.values.shape, count), np.nan),
        signal=np.full(data.values.shape, np.nan),
        gain=np.full(data.values.shape, np.nan),
        offset=np.full(data.values.shape, np.nan),
    )
    if pieces:
        for name, column in zip(PixelMinima._fields, zip(*pieces, strict=True), strict=True):
            if name != "thickness":
                getattr(result, name)[valid] = np.concatenate(column)
    return result


def _block(search: PixelSearch, data: PixelData) -> PixelMinima:
    """Minima of at most `search.block` pixels, all with data."""
    problem, pixels = search.problem, np.arange(len(data.values))
    units, predicted, profile, rounding = _candidates(search, data)
    exact = polish.in_rows(polish.explained, search.static, search.common, data, units)[0]
    exact = np.where(np.isfinite(exact), exact, np.inf)
    optimistic = np.minimum(predicted, exact)
    size, candidates = optimistic.shape
    deviance, misfit = np.where(np.isfinite(exact), optimistic, np.inf), np.array(exact)
    promise, tried = np.full((size, candidates), np.inf), np.zeros((size, candidates), bool)
    independent = search.view.independent * float(search.view.data.independent_fraction)
    best, fall = np.full(size, np.inf), np.zeros(size)
    systematic = np.sum((_SCALE * data.weight * data.values) ** 2, axis=1)

    def polished(where: np.ndarray, rounds: int, fine: bool) -> None:
        at, which = np.nonzero(where)
        tolerance = _SETTLED * np.maximum(best[at] / independent, 1.0)
        coarse = None if fine else best[at]
        found = polish.settle(
            *(search.static, search.common, data, at, units[at, which]),
            rounds=rounds,
            tolerance=tolerance,
            coarse=coarse,
        )
        units[at, which], deviance[at, which], misfit[at, which], promise[at, which] = found

    best = exact.min(axis=1)
    if len(problem.parameters) > 1:
        # along a valley of several parameters a linear step says little
        polished(np.isfinite(optimistic), 1, False)
        optimistic = np.where(np.isfinite(deviance), deviance, optimistic)
    now = np.zeros((size, candidates), bool)
    now[pixels, np.argmin(optimistic, axis=1)] = True
    now[pixels, np.argmin(exact, axis=1)] = True
    while now.any():
        polished(now, _ROUNDS, False)
        tried |= now
        below = np.where(now, _root(optimistic) - _root(deviance), 0.0)
        fall = np.maximum(fall, np.where(np.isfinite(below), below, 0.0).max(axis=1))
        best = np.where(tried, deviance, np.inf).min(axis=1)
        level = best + _CHANCE * np.maximum(best / independent, 1.0) + systematic + rounding
        near = _root(optimistic) - _REACH * fall[:, None] < _root(level)[:, None]
        now = near & ~tried & np.isfinite(optimistic)
    fine = _SETTLED * np.maximum(best / independent, 1.0)[:, None]
    lowest = np.argmin(np.where(tried, deviance, np.inf), axis=1)
    first = (np.arange(candidates) == lowest[:, None]) & (promise > fine)
    polished(first, _MORE_ROUNDS, True)
    settled = promise <= np.maximum(fine, polish.COARSE * (deviance - best[:, None]))
    settled[pixels, lowest] = promise[pixels, lowest] <= fine[:, 0]
    # along a valley of several parameters, points that have not settled are no minima
    listed = settled if len(problem.parameters) > 1 else np.isfinite(deviance)
    order = _distinct(problem.parameters, units, deviance, lowest, listed)
    rows, here = pixels[:, None], np.maximum(order, 0)
    absent = order < 0
    ordered = np.where(absent[..., None], np.nan, units[rows, here])
    at_best = polish.Best(*polish.in_rows(polish.at_best, search.static, search.common, data, ordered[:, 0]))
    deviance, misfit = (np.where(absent, np.inf, x[rows, here]) for x in (deviance, misfit))
    deviance[:, 0], misfit[:, 0] = at_best.deviance, at_best.misfit
    return PixelMinima(
        values=np.asarray(problem.values(ordered)),
        units=ordered,
        deviance=deviance,
        misfit=misfit,
        converged=settled[rows, here] & ~absent,
        model=at_best.model,
        profile=profile - deviance[:, :1],
        thickness=search.thickness,
        slope=at_best.slope,
        signal=at_best.signal,
        gain=at_best.gain,
        offset=at_best.offset,
    )


def _candidates(
    search: PixelSearch, data: PixelData
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Candidates (pixels, candidates, parameters), their predicted deviance, the profile along the thickness,
    and the rounding error of the predictions."""
    lookup, channels, count = search.lookup, search.view.channels, len(data.values)
    values, weight = data.values, _even_weight(data, channels)
    values = _filled(values, data.weight, lookup.weight, channels)
    if data.frame is not None:
        columns = values.reshape(count, -1, channels)
        values = np.einsum("...ij,...i->...j", data.frame, columns).reshape(count, -1)
    values = values - search.dark
    seen = np.sqrt(float(search.view.data.independent_fraction)) * weight
    if search.layout.relative:
        values, seen = values / data.level[:, None], seen * data.level[:, None]
    known = (lookup.weight > 0) & (weight > 0)
    scale = np.sqrt(np.sum((seen * known) ** 2, axis=1) / np.maximum(known @ lookup.weight**2, 1e-300))
    take = np.minimum(np.arange(search.block), count - 1)
    found = scan(search.layout, lookup, values[take], scale[take])
    units, deviance, profile = (np.array(x[:count], dtype=float) for x in found)
    square = np.sum((values * lookup.weight - lookup.known) ** 2, axis=1)
    return units, deviance, profile, _ROUNDING * square * scale**2


def _filled(values: np.ndarray, weight: np.ndarray, common: np.ndarray, channels: int) -> np.ndarray:
    """Values with those that a pixel lacks, of those that pixels have in common, by linear interpolation
    along each channel."""
    lacking = np.flatnonzero(((weight == 0) & (common > 0)).any(axis=1))
    if not len(lacking):
        return values
    values, at = np.array(values), np.arange(values.shape[1] // channels)
    for i in lacking:
        for channel in range(channels):
            own = slice(channel, None, channels)
            known = weight[i, own] > 0
            values[i, own] = np.interp(at, at[known], values[i, own][known])
    return values


def _root(deviance: np.ndarray) -> np.ndarray:
    """‖r‖ of a deviance; evidence may take it below zero."""
    return np.sqrt(np.maximum(deviance, 0.0))


def _distinct(
    parameters: Sequence[Parameter],
    units: np.ndarray,
    deviance: np.ndarray,
    lowest: np.ndarray,
    listed: np.ndarray,
) -> np.ndarray:
    """Positions of the best distinct minima of each pixel (pixels, `ORDERS`), −1 where there are no more: the
    `lowest` (pixels,), and the best of the others that are `listed` (pixels, candidates)."""
    rows, count = np.arange(len(units)), units.shape[1]
    resolution = np.stack([p.resolutions_at(x) for p, x in zip(parameters, units.T, strict=True)]).T
    left = np.where(listed, deviance, np.inf)
    chosen, at = np.full((len(units), ORDERS), -1), lowest
    chosen[:, 0] = at
    for k in range(1, min(ORDERS, count)):
        apart = np.any(np.abs(units - units[rows, at][:, None]) > resolution[rows, at][:, None], axis=2)
        left = np.where(apart, left, np.inf)
        at = np.argmin(left, axis=1)
        chosen[:, k] = np.where(np.isfinite(left[rows, at]), at, -1)
    return chosen
