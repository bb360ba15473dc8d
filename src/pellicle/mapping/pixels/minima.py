"""Data and minima of many pixels: what the search of pixels hands to their errors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

ORDERS = 4
"""Minima of each pixel that are kept."""


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
