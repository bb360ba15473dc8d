"""Noise and its correlation, estimated from spectra and residuals whose noise is known."""

import numpy as np
import pytest
from scipy import stats

from pellicle.fitting.noise import (
    MODEL_ERROR,
    correlation_length,
    drifting_sigma,
    integrated_time,
    local_noise,
    student,
    typical_noise,
    uneven_noise,
)

RANDOM = np.random.default_rng(8)
POSITION = np.linspace(0.0, 1.0, 1000)
FRINGES = 0.3 + 0.2 * np.cos(2 * np.pi * 12 * POSITION)


def test_white_noise_counts_every_point_and_a_residual_of_one_sign_few():
    lengths = [correlation_length(RANDOM.normal(size=500)) for _ in range(40)]
    assert min(lengths) >= 1
    assert np.mean(lengths) < 1.3
    assert correlation_length(0.01 + 0.0 * POSITION) > 100
    assert correlation_length(np.zeros(100)) == 1.0


@pytest.mark.parametrize("phi", [0.5, 0.8, 0.9])
def test_autoregressive_noise(phi):
    """Of an AR(1) process the integrated time is (1 + φ)/(1 − φ)."""
    lengths = []
    for _ in range(20):
        x = np.zeros(4000)
        steps = RANDOM.normal(size=x.size)
        for i in range(1, x.size):
            x[i] = phi * x[i - 1] + steps[i]
        lengths.append(correlation_length(x))
    assert np.mean(lengths) == pytest.approx((1 + phi) / (1 - phi), rel=0.2)


def test_local_noise_is_that_under_fringes():
    sigma = np.where(POSITION < 0.5, 0.002, 0.02)
    found = local_noise(FRINGES + sigma * RANDOM.normal(size=POSITION.size))
    assert found.shape == POSITION.shape
    assert np.median(found[:400]) == pytest.approx(0.002, rel=0.3)
    assert np.median(found[600:]) == pytest.approx(0.02, rel=0.3)
    assert np.max(local_noise(FRINGES)) < 2e-3 * np.ptp(FRINGES)


@pytest.mark.parametrize("values", [np.array([0.1, 0.3, 0.2]), np.full(50, 0.3), np.zeros(50)])
def test_always_a_positive_weight(values):
    assert (drifting_sigma(values) > 0).all()
    assert np.isfinite(drifting_sigma(values)).all()


def test_drifting_sigma_is_a_share_of_the_signal_plus_the_noise():
    noise = 0.01
    found = drifting_sigma(10 * FRINGES + RANDOM.normal(0, noise, POSITION.size))
    expected = MODEL_ERROR * 10 * FRINGES + noise
    assert 0.10 <= MODEL_ERROR <= 0.15
    assert np.median(np.abs(found / expected - 1)) < 0.02


@pytest.mark.parametrize("chi2", [1.0, 3.84, 6.0])
def test_student_is_wider_than_normal(chi2):
    freedom, z = np.array([1.0, 1.05, 2.0, 7.3, 60.0, 999.0, 1001.0, 1e6]), np.sqrt(chi2)
    expected = stats.t.isf(stats.norm.sf(z), freedom) / z
    assert student(freedom, chi2) == pytest.approx(expected, rel=1e-5)
    assert student(7.3, chi2) == pytest.approx(expected[3], rel=1e-5)
    assert student(np.inf, chi2) == 1.0


@pytest.mark.parametrize("points", [4, 7, 51, 100])
def test_typical_noise_is_the_median_of_the_local_noise(points):
    values = RANDOM.normal(size=(20, points))
    assert typical_noise(values) == pytest.approx(np.median(local_noise(values), axis=1))
    assert np.array_equal(typical_noise(values), [typical_noise(each) for each in values])  # one: another way


def test_correlation_times_by_sums_of_products_are_those_by_a_fourier_transform():
    """White noise closes its window within a few lags, walks do not."""
    white, walks = RANDOM.normal(size=(20, 100)), np.cumsum(RANDOM.normal(size=(20, 100)), axis=1)
    series = np.concatenate([white, white + 0.3 * walks, np.zeros((1, 100))])
    expected = []
    for row in np.fft.irfft(np.abs(np.fft.rfft(series, 200, axis=1)) ** 2)[:, :100]:
        times = 2 * np.cumsum(row / (row[0] or 1.0)) - 1
        closed = np.flatnonzero(np.arange(100) >= 5 * times)
        expected.append(max(times[closed[0]], 1.0) if len(closed) else 20.0)
    assert integrated_time(series[..., None]) == pytest.approx(expected)


def test_noise_that_differs_along_a_spectrum():
    """A detector that is 20 times noisier at one end; even noise, and a bump, which is no noise, are not."""
    rows = [np.arange(400)]
    sigma = np.where(np.arange(400) > 300, 20.0, 1.0)
    white = RANDOM.normal(size=(20, 400))
    for each in white:
        ratio = uneven_noise(sigma * each, rows)
        assert np.all(ratio[:280] == 1)
        assert np.median(ratio[310:]) == pytest.approx(20, rel=0.6)
        assert np.min(ratio[302:]) > 4
        assert np.all(uneven_noise(each, rows) == 1)
        assert np.all(uneven_noise(each + 300 * np.exp(-((np.arange(400) - 200.0) ** 2) / 50), rows) == 1)
