"""Residuals of one simulated file in NumPy, for many candidates in one call."""

from __future__ import annotations

import itertools

import numpy as np

from whole_fits.cases import Case, Measurement

Array = np.ndarray
SCAN_WAVELENGTHS = 128
CHUNK = 32
"""Candidates in one call of the scan: their arrays stay in the cache of a core."""
DRIFT_DEGREE = 3
"""The scale is a cubic in wavelength, the offset one number, as in the scene of pellicle."""


class Problem:
    """A file and the film that explains it, in the unit cube of the bounds."""

    def __init__(self, case: Case, measured: Measurement):
        self.case = case
        self.lower, self.width = case.bounds[:, 0], np.ptp(case.bounds, axis=1)
        self.truth = (measured.truth - self.lower) / self.width
        nm, _ = case.points
        self.all_points = _Points(case, measured, np.ones(nm.size, bool))
        stride = -(-len(case.wavelength) // SCAN_WAVELENGTHS)
        self.few_points = _Points(case, measured, np.isin(nm, case.wavelength[::stride]))

    def residuals(self, units: Array) -> Array:
        """Residuals over the noise, (candidates, rows), at units (candidates, parameters)."""
        return self.all_points.residuals(self.lower + units * self.width)

    def chi2(self, units: Array) -> Array:
        return np.sum(self.residuals(units) ** 2, axis=-1)

    def starts(self, count: int) -> Array:
        """The lowest local minima of a scan of the thickness with few wavelengths, (≤ count, parameters)."""
        case, axis = self.case, self.case.thickness_axis
        depths = np.linspace(0.0, 1.0, int(np.ceil(self.width[axis] / case.step)) + 1)
        levels = [(np.arange(n) + 0.5) / n for n in case.levels]
        if len(levels) == len(self.lower):
            levels.pop(axis)
        designs = np.array(list(itertools.product(*levels[:axis], (0.0,), *levels[axis:])))
        units = np.repeat(designs, len(depths), axis=0)
        units[:, axis] = np.tile(depths, len(designs))
        values = self.lower + units * self.width
        chunks = (values[i : i + CHUNK] for i in range(0, len(values), CHUNK))
        chi2 = np.concatenate([np.sum(self.few_points.residuals(chunk) ** 2, axis=-1) for chunk in chunks])
        table = np.pad(chi2.reshape(-1, len(depths)), ((0, 0), (1, 1)), constant_values=np.inf)
        here = table[:, 1:-1]
        lowest = np.flatnonzero(((here <= table[:, :-2]) & (here <= table[:, 2:])).ravel())
        return units[lowest[np.argsort(chi2[lowest])][:count]]


class _Points:
    """Some of the points of a file."""

    def __init__(self, case: Case, measured: Measurement, chosen: Array):
        nm, angle = (x[chosen] for x in case.points)
        self.film, self.noise = case.film(nm, angle), case.noise
        self.values = measured.values[chosen]
        self.delta = None if measured.delta is None else measured.delta[chosen]
        self.delta_weight = np.sin(2 * np.deg2rad(self.values)) / 2
        x = np.linspace(-1.0, 1.0, nm.size)
        self.drift = np.polynomial.chebyshev.chebvander(x, DRIFT_DEGREE).T if case.drifting else None

    def residuals(self, values: Array) -> Array:
        signal = self.film(tuple(values.T[:, :, None]))
        if self.delta is not None:
            psi, delta = signal
            turn = (delta - self.delta + 180) % 360 - 180
            return np.concatenate([psi - self.values, self.delta_weight * turn], axis=-1) / self.noise
        if self.drift is None:
            return (signal - self.values) / self.noise
        # scale and offset by linear least squares, at every candidate
        scaled = self.drift * signal[:, None]
        columns = np.concatenate([scaled, np.ones_like(scaled[:, :1])], axis=1)
        square = columns @ columns.swapaxes(1, 2)
        best = np.linalg.solve(square, (columns @ self.values)[..., None])
        return ((best.swapaxes(1, 2) @ columns)[:, 0] - self.values) / self.noise
