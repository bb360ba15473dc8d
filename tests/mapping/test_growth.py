"""Rates of change of thickness maps with an axis of time, against known rates and NumPy's polynomial fit."""

from typing import Any

import numpy as np
import pytest
import xarray as xr

from pellicle.errors import UsageError
from pellicle.fitting.batch.data import CODES
from pellicle.mapping.growth import RATES, growth

NO_DATA, CONSTANT, NOT_CONSTANT = range(len(RATES))
NOISE = 0.4


def series(value, time, *, stderr=None, noise: Any = NOISE, units: str | None = "s", dims=("time", "site")):
    """A map of these thicknesses (times, ...), all converged."""
    errors = {"": noise if stderr is None else stderr, "_noise": noise}
    variables = {"status": (dims, np.full(value.shape, CODES["converged"], np.uint8))}
    variables |= {"thickness": (dims, value, {"units": "nm"})}
    variables |= {f"thickness_stderr{x}": (dims, 0.0 * value + error) for x, error in errors.items()}
    return xr.Dataset(variables, coords={"time": ("time", time, {"units": units} if units else {})})


def noisy(truth, seed=0):
    return truth + NOISE * np.random.default_rng(seed).standard_normal(truth.shape)


def test_rate_and_error_are_those_of_a_weighted_line():
    rng = np.random.default_rng(1)
    time = np.sort(rng.uniform(0, 40, 15))
    sigma = rng.uniform(0.2, 2.0, (15, 3))
    value = 300 - 1.5 * time[:, None] + sigma * rng.standard_normal((15, 3))
    made = growth(series(value, time, noise=sigma))
    for i in range(3):
        line, covariance = np.polyfit(time, value[:, i], 1, w=1 / sigma[:, i], cov="unscaled")
        assert made["thickness_rate"].values[i] == pytest.approx(line[0], rel=1e-9)
        error = np.sqrt(covariance[0, 0])
        assert made["thickness_rate_stderr_noise"].values[i] == pytest.approx(error, rel=1e-6)
        chi2 = np.sum(((value[:, i] - np.polyval(line, time)) / sigma[:, i]) ** 2)
        assert made["thickness_rate_chi2_reduced"].values[i] == pytest.approx(chi2 / 13, rel=1e-6)
    assert made["thickness_rate"].attrs["units"] == "nm/s"


def test_errors_of_constant_rates_cover_the_truth_and_changing_rates_are_found():
    time = np.linspace(0, 20, 12)
    rate = np.random.default_rng(2).uniform(-3, 3, 2000)
    made = growth(series(noisy(500 + time[:, None] * rate), time))
    pull = (made["thickness_rate"] - rate) / made["thickness_rate_stderr_noise"]
    assert abs(pull.values.mean()) < 4 / np.sqrt(2000)
    assert pull.values.std() == pytest.approx(1.0, abs=4 / np.sqrt(2 * 2000))
    assert np.mean(made["thickness_rate_status"] == CONSTANT) > 0.99

    drained = growth(series(noisy(900 / np.sqrt(1 + 0.01 * time[:, None]) + np.zeros((1, 200))), time))
    assert np.all(drained["thickness_rate_status"] == NOT_CONSTANT)
    jump = noisy(500 + 0.5 * time[:, None] + np.zeros((1, 200)))
    jump[7:] += 190.0
    assert np.all(growth(series(jump, time))["thickness_rate_status"] == NOT_CONSTANT)


def test_what_all_times_have_in_common_scales_the_rate_with_its_error():
    """A wrong index scales all thicknesses by one factor; a constant shift leaves the rate alone."""
    time = np.linspace(0, 20, 12)
    value = (600 - 4.0 * time)[:, None]
    made = growth(series(value, time, stderr=np.hypot(NOISE, 0.02 * value)))
    noise = made["thickness_rate_stderr_noise"].item()
    assert made["thickness_rate_stderr"].item() == pytest.approx(np.hypot(noise, 0.02 * 4.0), rel=1e-3)
    shifted = growth(series(value, time, stderr=np.hypot(NOISE, 5.0)))
    assert shifted["thickness_rate_stderr"].item() == pytest.approx(noise, rel=1e-3)


def test_only_decided_times_count_and_two_are_too_few():
    time = np.arange(6.0)
    dataset = series((200 + 2.0 * time)[:, None, None] + np.zeros((1, 2, 2)), time, dims=("time", "y", "x"))
    dataset["thickness"][3, 0, 0] += 190.0
    dataset["status"][3, 0, 0] = CODES["ambiguous"]
    dataset["status"][4, 0, 0] = CODES["by-neighbours"]
    dataset["status"][2:, 1, 1] = CODES["no-data"]
    dataset["thickness"][2:, 1, 1] = np.nan
    made = growth(dataset)
    rate = made["thickness_rate"]
    assert rate.dims == ("y", "x")
    np.testing.assert_allclose(rate.values.ravel()[:3], 2.0)
    np.testing.assert_array_equal(made["thickness_rate_points"], [[5, 6], [6, 2]])
    assert np.isnan(rate.values[1, 1])
    assert made["thickness_rate_status"][1, 1] == NO_DATA


def test_rates_in_a_window_follow_the_truth():
    time = np.linspace(1, 60, 60)
    truth = 2000 / np.sqrt(time)
    made = growth(series(noisy(truth[:, None] + np.zeros((1, 50))), time), window=5)
    assert made["thickness_rate"].dims == ("time", "site")
    late = slice(30, 55)
    away = made["thickness_rate"].values[late] + 1000 * time[late, None] ** -1.5
    assert abs(np.mean(away)) < 0.02
    pull = away / made["thickness_rate_stderr_noise"].values[late]
    assert np.std(pull) == pytest.approx(1.0, abs=0.15)


def test_units_of_time():
    """Of a series of one spectrum."""
    minutes, value = np.arange(5.0), 100 + 3.0 * np.arange(5.0)
    dates = np.datetime64("2024-05-01T12:00", "ns") + (60e9 * minutes).astype("timedelta64[ns]")
    for time, units, asked, rate, unit in (
        (dates, None, {}, 3.0, "nm/min"),
        (dates - dates[0], None, {}, 3.0, "nm/min"),
        (60 * minutes, "s", {}, 3.0, "nm/min"),
        (minutes, "minutes", {}, 3.0, "nm/min"),
        (minutes, "cycles", {}, 3.0, "nm/cycles"),
        (dates, None, {"unit": "s"}, 0.05, "nm/s"),
    ):
        made = growth(series(value, time, units=units, dims=("time",)), **asked)["thickness_rate"]
        assert (made.dims, made.attrs["units"]) == ((), unit)
        assert made.item() == pytest.approx(rate)


def test_maps_that_have_no_rates_are_refused(refuses):
    time, value = np.arange(4.0), np.ones((4, 1))
    for dataset, words, options in (
        (series(value, time).isel(time=slice(2)), "three times", {}),
        (series(value, time).isel(time=0), "axis `time`", {}),
        (series(value, time, units=None), "without a unit", {}),
        (series(value, np.zeros(4)), "different times", {}),
        (series(value, time).drop_vars("thickness_stderr_noise"), "standard error", {}),
        (series(value, time), "window", {"window": 2}),
    ):
        refuses(UsageError, words, growth, dataset, **options)
