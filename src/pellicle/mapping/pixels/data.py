"""Measured values of many pixels as a fit sees them, and the minima that a search finds for them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from pellicle.fitting import noise
from pellicle.fitting.problem import Noise
from pellicle.fitting.robust_losses import MAD_TO_SIGMA, median
from pellicle.signals.sphere import ROUGH, ncs, sphere_frame, sphere_sigma

ORDERS = 4
"""Minima of each pixel that are kept."""
_TO_NORMAL = MAD_TO_SIGMA / np.sqrt(6.0)
"""Standard deviation of normal noise over the median size of its second differences."""


class PixelData(NamedTuple):
    """Measured values of pixels as a fit sees them, without padding.

    Points are data values in the order of the model: of R or T one for each wavelength (and angle), of
    ellipsometry N, C, S (or N and C) for each.

    - `values` (pixels, points): 0 where nothing was measured.
    - `weight` (pixels, points): 1/σ by the given σ or, where that is absent, by the first guess of
      `pellicle.fit`; 0 where nothing was measured.
    - `level` (pixels,): median of the values' size, the unit of an offset.
    - `frame` (pixels, wavelengths, channels, channels): of N, C, S where Ψ and Δ have errors of their own.
    """

    values: np.ndarray
    weight: np.ndarray
    level: np.ndarray
    frame: np.ndarray | None = None

    def of(self, which: np.ndarray) -> PixelData:
        """The data of some pixels, by their positions."""
        frame = None if self.frame is None else self.frame[which]
        return PixelData(self.values[which], self.weight[which], self.level[which], frame)


class PixelMinima(NamedTuple):
    """The best distinct local minima of each pixel, best first, as arrays (pixels, orders, ...).

    - `values` (pixels, orders, parameters) in the parameters' own units, `units` the same in the unit cube.
      NaN where a pixel has fewer minima, or no data.
    - `deviance` (pixels, orders): −2 ln of the marginal likelihood, priors included, as in `pellicle.fit`,
      with the weights of `PixelData`; infinite where there are fewer minima.
    - `misfit` (pixels, orders): the part of it that goes with the weights, the sum of squared weighted
      residuals of the data. With weights times s the deviance is s² `misfit` + (`deviance` − `misfit`), up to
      how much priors shift the minimum.
    - `converged` (pixels, orders): whether the solver settled. False too for rivals that are too bad to be
      polished, whose values and deviances are those that a linear step predicts.
    - `model` (pixels, points): the best model as measured, with its nuisances.
    - `profile` (pixels, nodes): least predicted deviance near each node of the scanned `thickness` (nodes,)
      in nm, above that of the best minimum; (pixels, 0) where no thickness is free.
    - `signal`, `gain` and `offset` (pixels, points): the simulated signal at the best minimum, and the scale
      and offset that make the model of it, gain · signal + offset.
    - `slope` (pixels, points, parameters): ∂ signal / ∂ parameter there, in its own unit.
    """

    values: np.ndarray
    units: np.ndarray
    deviance: np.ndarray
    misfit: np.ndarray
    converged: np.ndarray
    model: np.ndarray
    profile: np.ndarray
    thickness: np.ndarray
    signal: np.ndarray
    gain: np.ndarray
    offset: np.ndarray
    slope: np.ndarray


def pixel_data(block: Mapping[str, np.ndarray], source: Noise) -> PixelData:
    """The data of a block of pixels (`Cube.pixels`), with weights as `pellicle.fit` first gives them.

    `source` is the noise of the view that explains them.
    """
    known = np.isfinite(block["values"])
    for values in block.values():
        known &= np.isfinite(values)
    whole = bool(known.all())
    arrays = block if whole else {name: _filled(array, known) for name, array in block.items()}
    values = arrays["values"]
    if "delta" in arrays:
        return _on_sphere(arrays, known)
    if "sigma" in arrays:
        weight = known / arrays["sigma"]
    else:
        weight = known / (noise.drifting_sigma(values) if source.drifting else _guess(values))
    size = np.abs(values)
    level = median(size, -1) if whole else _median_of(size, known)
    return PixelData(np.where(known, values, 0.0), weight, np.maximum(level, 1e-12))


def _on_sphere(arrays: Mapping[str, np.ndarray], known: np.ndarray) -> PixelData:
    """Ψ and Δ as N, C, S, in a frame where their errors are given."""
    psi, delta, points = arrays["values"], arrays["delta"], (len(known), -1)
    values, sigma, frame = ncs(psi, delta), np.full((*psi.shape, 3), ROUGH), None
    if "sigma" in arrays:
        sigma = sphere_sigma(psi, delta, arrays["sigma"], arrays.get("delta_sigma", arrays["sigma"]))
        frame = sphere_frame(psi, delta)
        values = np.einsum("...ij,...j->...i", frame, values)
    weight = known[..., None] / sigma
    return PixelData(
        (values * known[..., None]).reshape(points), weight.reshape(points), np.ones(len(psi)), frame
    )


def _filled(array: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Rows with the values between the `known` ones by linear interpolation; 1 where a row has none."""
    result, at = np.where(known, array, 1.0), np.arange(array.shape[1])
    for i in np.flatnonzero(known.any(axis=1) & ~known.all(axis=1)):
        result[i] = np.interp(at, at[known[i]], array[i, known[i]])
    return result


def _median_of(size: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Median of the `known` values of each row; 1 where there are none."""
    ordered = np.sort(np.where(known, size, np.inf), axis=1)
    count = np.maximum(known.sum(axis=1), 1)[:, None]
    middle = [np.take_along_axis(ordered, (count - down) // 2, axis=1)[:, 0] for down in (1, 0)]
    middle[1] = np.take_along_axis(ordered, count // 2, axis=1)[:, 0]
    return np.where(known.any(axis=1), 0.5 * (middle[0] + middle[1]), 1.0)


def _guess(values: np.ndarray) -> np.ndarray:
    """First guess of an unknown noise, (pixels, 1), which the residuals replace."""
    rough = median(np.abs(values[:, :-2] - 2 * values[:, 1:-1] + values[:, 2:]), -1)
    guess = np.maximum(0.01 * np.ptp(values, axis=1), _TO_NORMAL * rough)
    return np.maximum(guess, 1e-12)[:, None]
