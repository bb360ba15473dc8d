"""Measured values of many spectra as a fit sees them, the minima of a search, and the results of fits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from pellicle.fitting import noise
from pellicle.fitting.problem import Noise
from pellicle.fitting.result import Status
from pellicle.fitting.robust_losses import MAD_TO_SIGMA, median
from pellicle.signals.sphere import ROUGH, ncs, sphere_frame, sphere_sigma

NO_DATA, BY_NEIGHBOURS = "no-data", "by-neighbours"
STATUSES = (NO_DATA, *(str(status) for status in Status), BY_NEIGHBOURS)
"""Status words of a spectrum, in the order of their codes: those of `pellicle.fit`, that of a spectrum
without data, and that of one whose order of interference its neighbours decide."""
CODES = {word: code for code, word in enumerate(STATUSES)}
ORDERS = 4
"""Minima of each spectrum that are kept, where no more are asked for."""
_TO_NORMAL = MAD_TO_SIGMA / np.sqrt(6.0)
"""Standard deviation of normal noise over the median size of its second differences."""


class BatchData(NamedTuple):
    """Measured values of spectra as a fit sees them, without padding.

    Points are data values in the order of the model: of R or T one for each wavelength (and angle), of
    ellipsometry N, C, S (or N and C) for each.

    - `values` (spectra, points): 0 where nothing was measured.
    - `weight` (spectra, points): 1/σ by the given σ or, where that is absent, by the first guess of
      `pellicle.fit`; 0 where nothing was measured.
    - `level` (spectra,): median of the values' size, the unit of an offset.
    - `frame` (spectra, wavelengths, channels, channels): of N, C, S where Ψ and Δ have errors of their own.
    """

    values: np.ndarray
    weight: np.ndarray
    level: np.ndarray
    frame: np.ndarray | None = None

    def of(self, which: np.ndarray) -> BatchData:
        """The data of some spectra, by their positions."""
        frame = None if self.frame is None else self.frame[which]
        return BatchData(self.values[which], self.weight[which], self.level[which], frame)


class BatchMinima(NamedTuple):
    """The best distinct local minima of each spectrum, best first, as arrays (spectra, orders, ...).

    - `values` (spectra, orders, parameters) in the parameters' own units, `units` the same in the unit cube.
      NaN where a spectrum has fewer minima, or no data.
    - `deviance` (spectra, orders): −2 ln of the marginal likelihood, priors included, as in `pellicle.fit`,
      with the weights of `BatchData`; infinite where there are fewer minima.
    - `misfit` (spectra, orders): the part of it that goes with the weights, the sum of squared weighted
      residuals of the data. With weights times s the deviance is s² `misfit` + (`deviance` − `misfit`), up to
      how much priors shift the minimum.
    - `converged` (spectra, orders): whether the solver settled. False too for rivals that are too bad to be
      polished, whose values and deviances are those that a linear step predicts.
    - `model` (spectra, points): the best model as measured, with its nuisances.
    - `profile` (spectra, nodes): least predicted deviance near each node of the scanned `thickness` (nodes,)
      in nm, above that of the best minimum; (spectra, 0) where no thickness is free.
    - `signal`, `gain` and `offset` (spectra, points): the simulated signal at the best minimum, and the scale
      and offset that make the model of it, gain · signal + offset.
    - `slope` (spectra, points, parameters): ∂ signal / ∂ parameter there, in its own unit.
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


class BatchFits(NamedTuple):
    """Fits of spectra, arrays (spectra, ...) in the order of the problem's parameters.

    `values` and `stderr` (spectra, parameters) are in the parameters' own units; `stderr` is the combined
    standard uncertainty, as in `pellicle.fit`, infinite where the data do not determine the parameter, and
    `stderr_noise` that of the noise alone. `minima` (spectra, orders, parameters) are the best minima of each
    spectrum, its answer first, and `delta_chi2` (spectra, orders) how much worse they are: infinite where
    there are no more. `status` (spectra,) are codes of `STATUSES`. Numbers of a spectrum without data are
    NaN.
    """

    values: np.ndarray
    stderr: np.ndarray
    stderr_noise: np.ndarray
    status: np.ndarray
    minima: np.ndarray
    delta_chi2: np.ndarray
    chi2_reduced: np.ndarray
    rms: np.ndarray


def batch_data(block: Mapping[str, np.ndarray], source: Noise) -> BatchData:
    """The data of a block of spectra (`Cube.spectra`), with weights as `pellicle.fit` first gives them.

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
        weight = known / np.hypot(arrays["sigma"], noise.rounding(values))
    else:
        weight = known / (noise.drifting_sigma(values) if source.drifting else _guess(values))
    size = np.abs(values)
    level = median(size, -1) if whole else _median_of(size, known)
    return BatchData(np.where(known, values, 0.0), weight, np.maximum(level, 1e-12))


def _on_sphere(arrays: Mapping[str, np.ndarray], known: np.ndarray) -> BatchData:
    """Ψ and Δ as N, C, S, in a frame where their errors are given."""
    psi, delta, points = arrays["values"], arrays["delta"], (len(known), -1)
    values, sigma, frame = ncs(psi, delta), np.full((*psi.shape, 3), ROUGH), None
    if "sigma" in arrays:
        sigma = sphere_sigma(psi, delta, arrays["sigma"], arrays.get("delta_sigma", arrays["sigma"]))
        frame = sphere_frame(psi, delta)
        values = np.einsum("...ij,...j->...i", frame, values)
    weight = known[..., None] / sigma
    return BatchData(
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
    """First guess of an unknown noise, (spectra, 1), which the residuals replace."""
    bends = np.abs(values[:, :-2] - 2 * values[:, 1:-1] + values[:, 2:])
    rough = median(bends, -1) if bends.size else 0.0
    guess = np.maximum(0.01 * np.ptp(values, axis=1), _TO_NORMAL * rough)
    return np.maximum(guess, 1e-12)[:, None]
