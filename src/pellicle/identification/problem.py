"""Spectra of one sample as one vector of values, with the errors that all structures share."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from pellicle.identification.signal_view import SignalView, settings_of
from pellicle.identification.structure import Structure
from pellicle.scene.uncertainty import Uncertainty

LEAST_NOISE = 1e-3
"""Noise below which no instrument's is taken, of fractions and of N, C and S."""
_SHAPES, _SHAPE_SIZE = 10, 0.004
"""Cosines of the spectrum that stand for tables which are wrong in shape, and their root mean square together
as a share of the range: what pages of one material by several laboratories differ by."""
_STEP = 1e-5
"""Step of a number's slope, relative to its range, or in nm where that is larger than 100."""


class Column(NamedTuple):
    """Change of all values by one standard uncertainty of an effect, `named` unless it is a shape."""

    name: str
    change: np.ndarray
    named: bool = True


class Attempt(NamedTuple):
    """A structure at its best numbers, the values there, and their slopes by the numbers."""

    structure: Structure
    x: np.ndarray
    values: np.ndarray
    slopes: np.ndarray
    cost: float


class Metric:
    """Inverse covariance of noise `sigma` (values,) and columns of effects (values, columns)."""

    def __init__(self, sigma: np.ndarray, columns: np.ndarray):
        self.sigma = sigma
        scaled = columns / sigma[:, None]
        lower = np.linalg.cholesky(np.eye(scaled.shape[1]) + scaled.T @ scaled)
        self._basis = np.linalg.solve(lower, scaled.T)

    def grams(self, slopes: np.ndarray, residuals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Sᵀ C⁻¹ S and Sᵀ C⁻¹ r of slopes (rows, numbers, values) and residuals (rows, values)."""
        a, b = slopes / self.sigma, residuals / self.sigma
        low, low_b = a @ self._basis.T, b @ self._basis.T
        normal = a @ np.swapaxes(a, 1, 2) - low @ np.swapaxes(low, 1, 2)
        return normal, np.einsum("rnv,rv->rn", a, b) - np.einsum("rnv,rv->rn", low, low_b)

    def costs(self, residuals: np.ndarray) -> np.ndarray:
        """χ² (rows,) of residuals (rows, values)."""
        scaled = residuals / self.sigma
        return np.sum(scaled**2, axis=1) - np.sum((scaled @ self._basis.T) ** 2, axis=1)


@dataclass(frozen=True, eq=False)
class Problem:
    """Spectra of one sample, with fewer points for scans, and the largest thickness (nm) that is tried."""

    views: tuple[SignalView, ...]
    thickest: float
    coarse: Problem | None = None

    @cached_property
    def data(self) -> np.ndarray:
        """Values of all spectra, (values,)."""
        return np.concatenate([view.data.ravel() for view in self.views])

    @cached_property
    def parts(self) -> list[slice]:
        """Values of each spectrum."""
        ends = np.cumsum([0, *(view.data.size for view in self.views)])
        return [slice(*pair) for pair in pairwise(ends)]

    def simulate(self, structure: Structure, x: np.ndarray) -> np.ndarray:
        """Simulate the values (rows, values) of a structure at `x` (rows, numbers)."""
        return np.concatenate([structure.simulate(x, view) for view in self.views], axis=1)

    def linearised(self, structure: Structure, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (rows, values) and slopes (rows, numbers, values) of a structure at `x` (rows, numbers)."""
        span = structure.upper - structure.lower
        step = np.where(span < 100, 1e-4 * span, np.maximum(1e-3, _STEP * span))
        step = np.where(x + step > structure.upper, -step, step)
        steps = np.concatenate([np.zeros_like(x)[:, None], step[..., None] * np.eye(x.shape[1])], axis=1)
        found = self.simulate(structure, (x[:, None] + steps).reshape(-1, x.shape[1]))
        found = found.reshape(len(x), -1, self.data.size)
        return found[:, 0], (found[:, 1:] - found[:, :1]) / step[..., None]

    def by_channel(self, values: np.ndarray) -> list[tuple[SignalView, np.ndarray]]:
        """Each view and its values (points, channels)."""
        pairs = zip(self.views, self.parts, strict=True)
        return [(view, values[own].reshape(view.data.shape)) for view, own in pairs]

    def short_range_noise(self, residuals: np.ndarray) -> np.ndarray:
        """Noise (channels of all views,) of neighbouring points, by second differences."""
        found = []
        for view, rows in self.by_channel(residuals):
            every = [rows[own] for own in settings_of(view.spectrum)]
            second = np.concatenate([x[2:] - 2 * x[1:-1] + x[:-2] for x in every if len(x) > 2])
            found.append(np.median(np.abs(second), axis=0) / 0.6745 / 6**0.5)
        return np.concatenate(found)

    def sigma(self, noise: np.ndarray) -> np.ndarray:
        """Noise of the channels as one of each value, at least `LEAST_NOISE`."""
        channels = np.split(noise, np.cumsum([view.channels for view in self.views])[:-1])
        pairs = zip(self.views, channels, strict=True)
        rows = [np.broadcast_to(own, view.data.shape).ravel() for view, own in pairs]
        return np.maximum(np.concatenate(rows), LEAST_NOISE)

    @cached_property
    def instrument(self) -> list[Column]:
        """Errors that act on the values alone: level, offsets, and shapes that no table has right."""
        return [
            Column(name, self._padded(i, change), named)
            for i, view in enumerate(self.views)
            for name, change, named in _instrument(view)
        ]

    @cached_property
    def metric(self) -> Metric:
        """Metric of a search: of the data's noise with the errors of the instrument."""
        columns = [*self.instrument, self.of_wavelength(self.data)]
        sigma = self.sigma(self.short_range_noise(self.data))
        return Metric(sigma, np.stack([x.change for x in columns], axis=1))

    def of_wavelength(self, values: np.ndarray) -> Column:
        """The change of values by an error of the wavelengths, by their slope along the spectrum."""
        size, found = Uncertainty().wavelength, []
        for view, rows in self.by_channel(values):
            slope = np.zeros_like(rows)
            for own in settings_of(view.spectrum):
                slope[own] = np.gradient(rows[own], view.spectrum.wavelength[own], axis=0)
            found.append((size * slope).ravel())
        return Column("wavelength", np.concatenate(found))

    def _padded(self, position: int, change: np.ndarray) -> np.ndarray:
        whole = np.zeros(self.data.size)
        whole[self.parts[position]] = change.ravel()
        return whole


def _instrument(view: SignalView) -> list[tuple[str, np.ndarray, bool]]:
    """Name, change (points, channels) and whether it is named, of each error of a view's instrument."""
    allowed, t, kind = Uncertainty(), view.position[:, None], view.spectrum.kind
    rows: list[tuple[str, np.ndarray, bool]] = []
    if kind.has_scale:
        level, bent = allowed.scale * view.data, allowed.scale / 2 * view.data
        rows += [("scale", level, True), ("slope of the scale", level * t, True)]
        rows += [("curvature of the scale", bent * (2 * t**2 - 1), True)]
        rows += [("offset", np.full(view.data.shape, allowed.offset), True)]
    else:
        offsets: Any = kind.offsets(view.data, allowed)
        rows += [(x.name, x.change, True) for x in offsets]
    size = _SHAPE_SIZE * view.span * (2 / _SHAPES) ** 0.5
    for j in range(1, _SHAPES + 1):
        wave = size * np.cos(np.pi * j * (t + 1) / 2)
        for channel in range(view.channels):
            own = np.zeros(view.data.shape)
            own[:, channel] = wave[:, 0]
            rows.append((f"shape {j}", own, False))
    return rows
