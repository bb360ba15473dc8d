"""Candidates for the minima of many spectra, by a scan of a table."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pellicle.fitting.batch import polish
from pellicle.fitting.batch.data import ORDERS, BatchData
from pellicle.fitting.batch.lookup import Layout, Lookup, scan, table
from pellicle.fitting.film.view import SpectrumView
from pellicle.fitting.problem import Problem
from pellicle.programs.cache import in_chunks
from pellicle.scene.instrument import Drift

_MOST_PRODUCTS = 4_000_000
"""Numbers of the product of a block of spectra with the table, 16 MB: larger tables have smaller blocks."""
_MOST_PIXELS, _FEWEST_PIXELS = 1024, 64
_ROUNDING = 1e-5
"""Error of a predicted deviance as a share of the data's square: the table is in single precision."""


class BatchSearch(NamedTuple):
    """A problem's one spectrum as of any spectrum, and the table that finds its minima."""

    problem: Problem
    view: SpectrumView
    common: polish.Common
    lookup: Lookup
    layout: Layout
    thickness: np.ndarray
    dark: float  # known offset
    orders: int  # minima of each spectrum that are kept
    rows: int  # spectra, or starts, of one call

    @property
    def static(self) -> polish.Static:
        return self.view.form, self.problem.coordinates, self.rows

    def noise(self, deviance: np.ndarray) -> np.ndarray:
        """Size of the noise in the unit of a deviance: where the weights are right, 1."""
        independent = self.view.independent * float(self.view.data.independent_fraction)
        return np.maximum(deviance / independent, 1.0)

    @property
    def has_priors(self) -> bool:
        """True where priors of parameters or of a scale or an offset that drifts weigh beside the data."""
        drifts = (self.view.scene.instrument.scale, self.view.scene.instrument.offset)
        drifting = any(isinstance(x, Drift) and x.degree > 0 for x in drifts)
        return drifting or bool(np.any(np.asarray(self.problem.box.prior_weight) > 0))

    @property
    def block(self) -> int:
        """Spectra that are scanned together."""
        width = self.lookup.columns.shape[1]
        block = int(np.clip(2 ** int(np.log2(_MOST_PRODUCTS / width)), _FEWEST_PIXELS, _MOST_PIXELS))
        return self.rows if self.rows < polish.ROWS else block


def prepared(
    problem: Problem, sample: BatchData, orders: int = ORDERS, rows: int = polish.ROWS
) -> BatchSearch:
    """The search for so many minima of spectra by a problem of one; `sample` are a few, as all are, and
    `rows` the most that are fitted in one call."""
    view: SpectrumView = problem.views[0].unpadded()
    view = replace(view, data=view.data._replace(frame=None))
    instrument, level = view.scene.instrument, float(np.median(sample.level))
    weight = _even_weight(sample, view.channels)
    if isinstance(instrument.scale, Drift):
        weight = weight * sample.level[:, None]
    weight = np.ma.median(np.ma.masked_equal(weight, 0.0), axis=0).filled(0.0)
    lookup, layout, thickness = table(problem, view, weight, level, orders)
    common = polish.Common(view.scene, view.data, problem.box)
    dark = 0.0 if isinstance(instrument.offset, Drift) else float(instrument.offset)
    return BatchSearch(problem, view, common, lookup, layout, thickness, dark, orders, rows)


def _even_weight(data: BatchData, channels: int) -> np.ndarray:
    """Weights (spectra, points) of N, C, S themselves where they are given in a frame."""
    if data.frame is None:
        return data.weight
    square = data.weight.reshape(len(data.weight), -1, channels) ** 2
    return np.repeat(np.sqrt(square.mean(axis=2)), channels, axis=1)


class Candidates(NamedTuple):
    """Candidates of the scan: `units` (spectra, candidates, parameters), their `predicted` deviance (spectra,
    candidates), the `profile` along the thickness (spectra, nodes), the `rounding` error (spectra,) of the
    predictions, and whether the predictions are of the spectra' own weights (`alike`)."""

    units: np.ndarray
    predicted: np.ndarray
    profile: np.ndarray
    rounding: np.ndarray
    alike: bool


def candidates(search: BatchSearch, data: BatchData) -> Candidates:
    """The candidates of spectra by the lookup."""
    lookup, channels, count = search.lookup, search.view.channels, len(data.values)
    values, weight = data.values, _even_weight(data, channels)
    values = _filled(values, data.weight, lookup.weight, channels)
    if data.frame is not None:
        columns = values.reshape(count, -1, channels)
        values = np.einsum("...ij,...i->...j", data.frame, columns).reshape(count, -1)
    if search.dark:
        values = values - search.dark
    seen = np.sqrt(float(search.view.data.independent_fraction)) * weight
    if search.layout.relative:
        values, seen = values / data.level[:, None], seen * data.level[:, None]
    common = lookup.weight * (weight > 0)
    scale = np.sqrt(
        np.sum((seen * (common > 0)) ** 2, axis=1) / np.maximum(np.sum(common**2, axis=1), 1e-300)
    )
    scanned = in_chunks(lambda own: scan(search.layout, lookup, *own), (values, scale), search.block)
    square = np.sum((values * lookup.weight - lookup.known) ** 2, axis=1)
    alike = (
        len(search.problem.parameters) == 1
        and not (search.layout.relative or lookup.rotation.shape[1] or data.frame is not None)
        and np.allclose(seen, scale[:, None] * lookup.weight, rtol=1e-3, atol=0.0)
    )
    rounding = _ROUNDING * square * scale**2
    return Candidates(scanned.units, scanned.deviance.astype(float), scanned.profile, rounding, bool(alike))


def _filled(values: np.ndarray, weight: np.ndarray, common: np.ndarray, channels: int) -> np.ndarray:
    """Values with those that a spectrum lacks, of those that spectra have in common, by linear interpolation
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
