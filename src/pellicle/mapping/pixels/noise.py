"""Noise of pixels by their residuals: σ, degrees of freedom, correlation and short-range noise."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from pellicle.fitting.film.sweeps import correlation_in_sweeps
from pellicle.fitting.noise import DRIFT_CORRELATION, integrated_time, student
from pellicle.fitting.problem import Noise

_LAGS = 12
"""Lags within which the window of a correlation time is looked for first: that of white noise closes at 5."""
_WINDOW = 5
"""Times a correlation time at which its window closes: see `fitting.noise.integrated_time`."""


class PixelNoise(NamedTuple):
    """Noise of pixels, each (pixels,): see `fitting.reweighting.ViewFit`.

    `scale` multiplies the weights, `fraction` is how much of an independent point each point counts for,
    `chi2` the misfit with the scaled weights over `freedom` degrees; `variance` multiplies the σ² of the
    weights in the covariance. `student_freedom` are the degrees of freedom of σ on the effective points,
    infinite where it is given.
    """

    scale: np.ndarray
    length: np.ndarray
    fraction: np.ndarray
    chi2: np.ndarray
    freedom: np.ndarray
    variance: np.ndarray
    student_freedom: np.ndarray

    def evidence(self, independent_fraction: float) -> np.ndarray:
        """Factors (pixels,) of a misfit with the given weights and this share of independent points, for the
        weights and the effective points of the ranking."""
        return self.scale**2 * self.fraction / independent_fraction


def noise_of(residual: np.ndarray, parts: Sequence[np.ndarray], noise: Noise, used: int) -> PixelNoise:
    """Noise by the weighted residuals (pixels, rows, channels); `used` numbers were fitted to each pixel.

    As `fitting.reweighting`: a given σ stays, an unknown one becomes the rms of the residuals, that of a
    drifting lamp stays too. `parts` are the rows of each sweep. Of three channels of ellipsometry two are
    independent.
    """
    pixels, rows, channels = residual.shape
    freedom = np.full(pixels, max(min(channels, 2) * rows - used, 1.0))
    misfit = np.einsum("prc,prc->p", residual, residual)
    scale, chi2 = np.ones(pixels), misfit
    if not noise.known:
        scale, chi2 = 1 / np.sqrt(np.maximum(misfit / freedom, 1e-12)), freedom
    length = correlation(residual, parts)
    variance = np.ones(pixels) if noise.given else length
    if noise.drifting:
        variance = variance * np.maximum(chi2 / freedom, 1e-12)
    fraction = np.minimum(1 / length, 1 / DRIFT_CORRELATION if noise.drifting else 1.0)
    own = np.full(pixels, np.inf) if noise.known else freedom / length
    return PixelNoise(scale, length, fraction, chi2, freedom, variance, own)


def correlation(residual: np.ndarray, parts: Sequence[np.ndarray]) -> np.ndarray:
    """Number of points of one channel (pixels,) that count as one: see `correlation_in_sweeps`.

    Of one sweep of one channel it is the correlation time, whose window mostly closes within a few lags:
    sums of products are ten times as fast as a Fourier transform there.
    """
    pixels, rows, channels = residual.shape
    if channels > 1 or len(parts) > 1 or rows <= _LAGS:
        return np.asarray(correlation_in_sweeps(residual, parts))
    series = residual[:, parts[0], 0]
    pairs = [(series[:, lag:], series[:, : rows - lag]) for lag in range(_LAGS)]
    products = np.stack([np.einsum("pr,pr->p", *pair) for pair in pairs], axis=1)
    times = 2 * np.cumsum(products / np.maximum(products[:, :1], 1e-300), axis=1) - 1
    closed = np.arange(_LAGS) >= _WINDOW * times
    result = np.maximum(times[np.arange(pixels), np.argmax(closed, axis=1)], 1.0)
    open_ = ~closed.any(axis=1)
    if open_.any():
        result[open_] = integrated_time(series[open_][..., None])
    return result


def medians(values: np.ndarray) -> np.ndarray:
    """Median (pixels,) of the values of each pixel (pixels, ...): NumPy sorts them three times as fast as it
    finds their median."""
    ordered = np.sort(values.reshape(len(values), -1), axis=1)
    middle = ordered.shape[1] // 2
    return 0.5 * (ordered[:, middle] + ordered[:, -middle - 1])


def typical_noise(values: np.ndarray, window: int = 51) -> np.ndarray:
    """Median (pixels,) of the local noise of `values` (pixels, points): of `fitting.noise.local_noise`.

    Its running medians are not computed: how many of them are below a size follows from counts, and the size
    that half of them are below by bisection.
    """
    points = values.shape[-1]
    if points < 5:
        return np.maximum(np.ptp(values, axis=-1), 1e-12)
    rough = np.abs(values[:, :-2] - 2 * values[:, 1:-1] + values[:, 2:]) / np.sqrt(6)
    rough = np.concatenate([rough[:, :1], rough, rough[:, -1:]], axis=1)
    reach = min(window, points) // 2
    around = np.pad(rough, [(0, 0), (reach, reach)], mode="reflect")
    ordered = np.sort(rough, axis=1)

    def median_of_rank(rank: int) -> np.ndarray:
        """The running median below which `rank` others are."""
        low, high = np.zeros(len(values), int), np.full(len(values), points - 1)
        while np.any(low < high):
            middle = (low + high) // 2
            size = np.take_along_axis(ordered, middle[:, None], axis=1)
            count = np.cumsum(around <= size, axis=1, dtype=np.int16)
            count = np.pad(count, [(0, 0), (1, 0)])
            below = count[:, 2 * reach + 1 :] - count[:, : -2 * reach - 1] > reach
            enough = below.sum(axis=1) > rank
            low, high = np.where(enough, low, middle + 1), np.where(enough, middle, high)
        return np.take_along_axis(ordered, low[:, None], axis=1)[:, 0]

    middle = median_of_rank(points // 2)
    if points % 2 == 0:
        middle = (middle + median_of_rank(points // 2 - 1)) / 2
    return 1.4826 * np.maximum(middle, medians(rough) / 3)


def short_range_noise(residual: np.ndarray, parts: Sequence[np.ndarray], least: np.ndarray) -> np.ndarray:
    """Noise (pixels,) from differences of neighbouring residuals (pixels, rows, channels), at least `least`:
    see `fitting.film.evidence`."""
    channels = range(residual.shape[2])
    squares = [typical_noise(residual[:, part, c]) ** 2 for part in parts for c in channels]
    return np.maximum(np.sqrt(np.mean(squares, axis=0)), least)


_FREEDOMS = np.geomspace(1.0, 1000.0, 200)


@lru_cache(maxsize=8)
def _students(chi2: float) -> np.ndarray:
    return np.array([student(each, chi2) for each in _FREEDOMS.tolist()])


def students(freedom: np.ndarray, chi2: float) -> np.ndarray:
    """`fitting.noise.student` of each of the degrees of freedom."""
    if not np.isfinite(freedom).any():
        return np.ones(len(freedom))
    inside = np.interp(np.log(np.clip(freedom, 1.0, 1000.0)), np.log(_FREEDOMS), _students(chi2))
    return np.where(freedom > 1000.0, 1 + (chi2 + 1) / (4 * freedom), inside)
