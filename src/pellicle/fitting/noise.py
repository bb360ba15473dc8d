"""Noise of spectra, and the number of their independent points; leading axes are those of many spectra."""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Chebyshev

from pellicle.fitting.problem import Noise, NoiseGroup
from pellicle.fitting.robust_losses import MAD_TO_SIGMA, median

MODEL_ERROR = 0.12
"""Relative model error of an uncalibrated spectrum, along which lamp, detector and film drift."""
DRIFT_CORRELATION = 10.0
"""Points that count as one where scale and offset drift slowly: the drift's own polynomials hide the
correlation from the residuals of a short or featureless spectrum, so fewer is never assumed."""
WINDOW = 5
"""Correlation times at which the window of their own sum closes (A. Sokal, 1997, Monte Carlo methods in
statistical mechanics)."""
_STEPS, _WHOLE, _FIRST = tuple(10.0**-k for k in range(-1, 7)), 1e-6, 8
"""Steps to which files are rounded, and how near to a whole number of them values lie."""
_UNEVEN, _REGION, _BESIDE, _WHITE = 4.0, 15, 6, 1.5
"""Ratio to the noise of the quieter half at which noise differs along a spectrum, the fewest points where it
does, points beside them that count with them, and the ratio of residuals to it above which they are more."""
_LAGS = 12
"""Lags within which that window is looked for first, by sums of products, ten times as fast as a Fourier
transform: that of white noise closes at 5."""
_MANY = 1000.0
"""Degrees of freedom beyond which Student's t is nearly normal."""
_DEGREE = 10
"""Degree of the polynomial for Student's t between 1 and `_MANY` degrees of freedom: it is within 1e-5."""


def student(freedom: Any, chi2: float) -> Any:
    """By how much Student's t is wider than a normal distribution: the ratio of their quantiles where the
    square of the normal one is `chi2`.

    It widens errors and thresholds where residuals with so many degrees of `freedom` (...) set the noise:
    with two of them a 95 % interval (3.84) is 2.2 times as wide as with known noise, with ten 1.14 times.

    **Source:** JCGM 100:2008, Guide to the expression of uncertainty in measurement, section G.3.
    """
    share = 1 / np.maximum(freedom, 1.0)
    if np.all(share < 1 / _MANY):
        return 1 + 0.25 * (chi2 + 1) * share  # Abramowitz and Stegun 26.7.5
    inside = np.exp(share * _student(chi2)(share))
    return np.where(share < 1 / _MANY, 1 + 0.25 * (chi2 + 1) * share, inside)[()]


@lru_cache(maxsize=16)
def _student(chi2: float) -> Chebyshev:
    """Logarithm of the ratio of the quantiles, times the degrees of freedom ν, against 1/ν."""
    nodes = 0.5 * (1 + 1 / _MANY + (1 - 1 / _MANY) * np.cos(np.pi * (np.arange(14) + 0.5) / 14))
    way = np.linspace(0.0, 1.0, 8001)
    logarithms = []
    for share in nodes.tolist():
        # t = √ν tan θ has the density cos^(ν−1) θ; dense towards π/2, where the slope of that may be infinite
        angle = min(np.pi / 2, 12 * math.sqrt(share)) * (1 - (1 - way) ** 2)
        density = np.cos(angle) ** (1 / share - 1) * (1 - way)
        area = np.cumsum(density[1:] + density[:-1])
        at = np.interp(math.erf((chi2 / 2) ** 0.5) * area[-1], area, angle[1:])
        logarithms.append(math.log(math.tan(at) / math.sqrt(share * chi2)) / share)
    return Chebyshev.fit(nodes, logarithms, _DEGREE, domain=[0.0, 1.0])


def rounding(values: np.ndarray) -> np.ndarray:
    """Standard deviation (..., 1) of the rounding of `values` (..., points) that are all multiples of one
    power of ten: step/√12, 0 where there is no such step."""
    result, span = np.zeros((*values.shape[:-1], 1)), np.ptp(values, axis=-1, keepdims=True)
    for step in _STEPS:
        # the first points show nearly always that there is no such step
        some = _off(values[..., :_FIRST], step) < _WHOLE
        if some.any():
            off = np.where(some, _off(values, step), np.inf)
            result = np.where((result == 0) & (off < _WHOLE) & (span > step), step / math.sqrt(12), result)
    return result


def _off(values: np.ndarray, step: float) -> np.ndarray:
    """Largest distance (..., 1) of `values` (..., points) from a multiple of a step, in steps."""
    return np.abs(values / step - np.round(values / step)).max(axis=-1, keepdims=True)


def local_noise(values: np.ndarray, window: int = 51) -> np.ndarray:
    """White noise at each point (..., points), from second differences, by a running median of their size."""
    points = values.shape[-1]
    if points < 5:
        return np.broadcast_to(np.maximum(np.ptp(values, axis=-1, keepdims=True), 1e-12), values.shape)
    rough = _roughness(values)
    least = median(rough, -1)[..., None] / 3
    return MAD_TO_SIGMA * np.maximum(_running_median(rough, window), least)


def _running_median(values: np.ndarray, window: int) -> np.ndarray:
    """Median in a window around each point (..., points): NumPy sorts short rows faster than it finds their
    median."""
    reach = min(window, values.shape[-1]) // 2
    padded = np.pad(values, [(0, 0)] * (values.ndim - 1) + [(reach, reach)], mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis=-1)
    return np.sort(windows, axis=-1)[..., reach]


def _roughness(values: np.ndarray) -> np.ndarray:
    """Size of the second differences around each point (..., points), in units of the noise's own."""
    rough = np.abs(values[..., :-2] - 2 * values[..., 1:-1] + values[..., 2:]) / np.sqrt(6)
    return np.concatenate([rough[..., :1], rough, rough[..., -1:]], axis=-1)


def uneven_noise(residual: np.ndarray, parts: Sequence[np.ndarray]) -> np.ndarray:
    """White noise at each residual (rows,) over that of the quieter half, 1 where it is less than a few times
    as large, or hardly anywhere larger: a detector may be noisier at one end.

    Residuals that are larger than their neighbours differ have structure, which is no noise.
    """
    ratio = np.ones(len(residual))
    for part in parts:
        padded = np.pad(local_noise(residual[part], 2 * _REGION + 1), _BESIDE, mode="edge")
        noise = np.lib.stride_tricks.sliding_window_view(padded, 2 * _BESIDE + 1).max(axis=-1)
        quiet = max(float(np.quantile(noise, 0.25)), 1e-300)
        far = noise > _UNEVEN * quiet
        if np.sum(far) >= _REGION and np.mean((residual[part][far] / noise[far]) ** 2) < _WHITE**2:
            ratio[part] = np.where(far, noise / quiet, 1.0)
    return ratio


def typical_noise(values: np.ndarray, window: int = 51) -> np.ndarray:
    """Median (...) of the local noise of `values` (..., points).

    Of many spectra the running medians of `local_noise` are not computed: how many of them are below a size
    follows from counts, and the size that half of them are below by bisection.
    """
    points = values.shape[-1]
    if points < 5:
        return np.asarray(np.maximum(np.ptp(values, axis=-1), 1e-12))
    if values.ndim == 1:
        rough = _roughness(values)
        middle = median(_running_median(rough, window))
        return np.asarray(MAD_TO_SIGMA * np.maximum(middle, median(rough) / 3))
    rough, reach = _roughness(values.reshape(-1, points)), min(window, points) // 2
    around = np.pad(rough, [(0, 0), (reach, reach)], mode="reflect")
    ordered = np.sort(rough, axis=1)

    def median_of_rank(rank: int) -> np.ndarray:
        """The running median below which `rank` others are."""
        low, high = np.zeros(len(rough), int), np.full(len(rough), points - 1)
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
    noise = MAD_TO_SIGMA * np.maximum(middle, median(rough, -1) / 3)
    return noise.reshape(values.shape[:-1])


def short_range_noise(residual: np.ndarray, parts: Sequence[np.ndarray], least: Any) -> Any:
    """Noise of one point (...), from differences of neighbouring residuals (..., rows, channels) in each
    sweep, at least `least` (...); `parts` are the rows of the sweeps."""
    channels = range(residual.shape[-1])
    squares = [typical_noise(residual[..., part, c]) ** 2 for part in parts for c in channels]
    return np.maximum(np.sqrt(np.mean(squares, axis=0)), least)


def drifting_sigma(values: np.ndarray) -> np.ndarray:
    """Weights of uncalibrated spectra (..., points): a share of the local signal, plus the local noise."""
    edges = [(0, 0)] * (values.ndim - 1) + [(2, 2)]
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(np.abs(values), edges, mode="edge"), 5, axis=-1)
    return MODEL_ERROR * windows.mean(axis=-1) + local_noise(values) + 1e-12


class NoiseEstimate(NamedTuple):
    """Noise of one view by its residuals, each number with the leading axes of the residuals.

    `chi2` is the misfit over `freedom` degrees, and `length` the number of neighbouring points that count as
    one. `scale` (..., channels) multiplies the weights, so that a noise that is not known becomes the rms of
    the residuals of its channels; `chi2` is the misfit after that. Where a loss is robust, `factor`
    multiplies the weight of each point, and `inflation` the variance. `at_model` multiplies the weights of
    noise that depends on the signal.
    """

    chi2: Any
    freedom: Any
    length: Any
    scale: Any
    factor: Any = 1.0
    inflation: Any = 1.0
    at_model: Any = 1.0

    def variance(self, source: Noise) -> Any:
        """Factor (...) on the σ² of the weights in the covariance."""
        # the ranked weights carry the rms already, so only the correlation remains to be counted
        length = self.length if source.correlated or not source.given else np.ones(np.shape(self.length))
        size = np.maximum(self.chi2 / self.freedom, 1e-12) if source.drifting else 1.0
        return length * size * self.inflation

    def fraction(self, source: Noise) -> Any:
        """Share (...) of an independent point that each point counts for in the ranking."""
        return np.minimum(1 / self.length, 1 / DRIFT_CORRELATION if source.drifting else 1.0)

    def effective_freedom(self, source: Noise) -> Any:
        """Degrees of freedom (...) of σ on the effective points, infinite where it is known."""
        return np.full(np.shape(self.length), np.inf) if source.known else self.freedom / self.length


def noise_of(
    residual: np.ndarray, groups: Sequence[NoiseGroup], freedom: Any, length: Any, bulk: Any = None
) -> NoiseEstimate:
    """Noise by weighted residuals (..., rows, channels) with so many degrees of `freedom` (...) in all.

    A known noise of a group of channels stays, an unknown one becomes the rms of its residuals: or their
    `bulk` (..., channels), where outliers do not count.
    """
    chi2, scale = 0.0, np.ones((*residual.shape[:-2], residual.shape[-1]))
    independent = sum(group.independent for group in groups)
    for group in groups:
        channels, own = list(group.channels), freedom * (group.independent / independent)
        if bulk is None:
            part = residual if len(channels) == residual.shape[-1] else residual[..., channels]
            misfit = np.einsum("...rc,...rc->...", part, part)
        else:
            misfit = bulk[..., channels[0]] ** 2 * own
        if not group.known:
            scale[..., channels] = (1 / np.sqrt(np.maximum(misfit / own, 1e-12)))[..., None]
        chi2 = chi2 + (misfit if group.known else own)
    return NoiseEstimate(chi2, freedom, length, scale)


def correlation_length(residual: np.ndarray) -> float:
    """Number of neighbouring residuals that count as one: the integrated autocorrelation time, at least 1."""
    return integrated_time(residual[:, None])


def integrated_time(series: np.ndarray) -> Any:
    """The integrated autocorrelation time of series (..., steps, series) around zero, (...), at least 1.

    The window closes at `WINDOW` times the estimate; where it does not close, the time is a fifth of the
    steps.
    """
    size = series.shape[-2]
    flat = series.reshape(-1, *series.shape[-2:])
    if size <= _LAGS:
        return _integrated_time(flat).reshape(series.shape[:-2])[()]
    pairs = [(flat[:, lag:], flat[:, : size - lag]) for lag in range(_LAGS)]
    covariance = np.stack([np.einsum("prs,prs->p", *pair) for pair in pairs], axis=1)
    times = 2 * np.cumsum(covariance / np.maximum(covariance[:, :1], 1e-300), axis=1) - 1
    closed = np.arange(_LAGS) >= WINDOW * times
    result = np.maximum(times[np.arange(len(flat)), np.argmax(closed, axis=1)], 1.0)
    still_open = ~closed.any(axis=1)
    if still_open.any():
        result[still_open] = _integrated_time(flat[still_open])
    return result.reshape(series.shape[:-2])[()]


def _integrated_time(series: np.ndarray) -> np.ndarray:
    """The integrated autocorrelation time of series (any, steps, series) by their Fourier transform."""
    size = series.shape[-2]
    spectrum = np.abs(np.fft.rfft(series, 2 * size, axis=-2)) ** 2
    covariance = np.fft.irfft(spectrum.sum(axis=-1))[..., :size]
    some = covariance[..., :1] > 0
    times = 2 * np.cumsum(covariance / np.where(some, covariance[..., :1], 1.0), axis=-1) - 1
    closed = np.arange(size) >= WINDOW * times
    first = np.take_along_axis(times, np.argmax(closed, axis=-1)[..., None], axis=-1)[..., 0]
    time = np.where(closed.any(axis=-1), first, size / WINDOW)
    return np.where(some[..., 0], np.maximum(time, 1.0), 1.0)
