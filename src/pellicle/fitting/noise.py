"""Noise of a spectrum, and the number of its independent points."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

MODEL_ERROR = 0.12
"""Relative model error of an uncalibrated spectrum, along which lamp, detector and film drift."""
DRIFT_CORRELATION = 10.0
"""Points that count as one where scale and offset drift slowly: the drift's own polynomials hide the
correlation from the residuals of a short or featureless spectrum, so fewer is never assumed."""
_MANY = 1000.0
"""Degrees of freedom beyond which Student's t is nearly normal."""


def student(freedom: float, chi2: float) -> float:
    """By how much Student's t is wider than a normal distribution: the ratio of their quantiles where the
    square of the normal one is `chi2`.

    It widens errors and thresholds where residuals with so many degrees of `freedom` set the noise: with two
    of them a 95 % interval (3.84) is 2.2 times as wide as with known noise, with ten 1.14 times.

    **Source:** JCGM 100:2008, Guide to the expression of uncertainty in measurement, section G.3.
    """
    if freedom > _MANY:
        return 1 + (chi2 + 1) / (4 * freedom)  # Abramowitz and Stegun 26.7.5
    # t = √ν tan θ has the density cos^(ν−1) θ
    angle = np.linspace(0.0, np.pi / 2, 4001)
    density = np.cos(angle) ** (max(freedom, 1.0) - 1)
    share = np.cumsum(density[1:] + density[:-1])
    at = np.interp(math.erf((chi2 / 2) ** 0.5) * share[-1], share, angle[1:])
    return math.sqrt(max(freedom, 1.0) / chi2) * math.tan(at)


def local_noise(values: np.ndarray, window: int = 51) -> np.ndarray:
    """White noise at each point, from second differences, by a running median of their size."""
    if len(values) < 5:
        return np.full(len(values), max(float(np.ptp(values)), 1e-12))
    rough = np.abs(values[:-2] - 2 * values[1:-1] + values[2:]) / np.sqrt(6)
    rough = np.concatenate([rough[:1], rough, rough[-1:]])
    reach = min(window, len(rough)) // 2
    padded = np.pad(rough, reach, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
    return 1.4826 * np.maximum(np.median(windows, axis=1), np.median(rough) / 3)


def drifting_sigma(values: np.ndarray) -> np.ndarray:
    """Weights of an uncalibrated spectrum: a share of the local signal, plus the local noise."""
    smooth = np.convolve(np.pad(np.abs(values), 2, mode="edge"), np.full(5, 0.2), mode="valid")
    return MODEL_ERROR * smooth + local_noise(values) + 1e-12


def correlation_length(residual: np.ndarray) -> float:
    """Number of neighbouring residuals that count as one: the integrated autocorrelation time, at least 1."""
    return integrated_time(residual[:, None])


def integrated_time(series: np.ndarray) -> Any:
    """The integrated autocorrelation time of series (..., steps, series) around zero, (...), at least 1.

    The window closes at five times the estimate (A. Sokal, 1997, Monte Carlo methods in statistical
    mechanics); where it does not close, the time is a fifth of the steps.
    """
    size = series.shape[-2]
    spectrum = np.abs(np.fft.rfft(series, 2 * size, axis=-2)) ** 2
    covariance = np.fft.irfft(spectrum.sum(axis=-1))[..., :size]
    some = covariance[..., :1] > 0
    times = 2 * np.cumsum(covariance / np.where(some, covariance[..., :1], 1.0), axis=-1) - 1
    closed = np.arange(size) >= 5 * times
    first = np.take_along_axis(times, np.argmax(closed, axis=-1)[..., None], axis=-1)[..., 0]
    time = np.where(closed.any(axis=-1), first, size / 5)
    return np.where(some[..., 0], np.maximum(time, 1.0), 1.0)[()]
