"""Series of simulated films that grow, jump and hide, by a simulator of its own, and the command."""

import html
import json
import re
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

import pellicle as pl
from pellicle.cli import app
from pellicle.errors import UsageError
from pellicle.fitting.batch.data import STATUSES
from pellicle.reporting.series import draw, write_series

NM, TIME = np.linspace(600, 700, 24), np.arange(80) * 10.0
GROWN = 200 + 1800 * (1 - np.exp(-TIME / 500))
SCENE = pl.Scene(pl.Layer(1.46, pl.Free(0, 3000)), 3.9)
KILLS = 3
"""Ten take three minutes, and changed nothing either."""


def reflectance(thickness, n=1.46):
    """The Airy formula at normal incidence: a layer of index n on one of 3.9, (times, wavelengths)."""
    upper, lower = (1 - n) / (1 + n), (n - 3.9) / (n + 3.9)
    turn = np.exp(-4j * np.pi * n * np.asarray(thickness)[:, None] / NM)
    return np.abs((upper + lower * turn) / (1 + upper * lower * turn)) ** 2


def cube(thickness, noise=0.01, seed=0, n=1.46):
    values = reflectance(thickness, n)
    values = values + noise * np.random.default_rng(seed).standard_normal(values.shape)
    coords = {
        "time": ("time", TIME[: len(values)], {"units": "s"}),
        "wavelength": ("wavelength", NM, {"units": "nm"}),
    }
    return xarray.Dataset({"R": (("time", "wavelength"), values)}, coords)


@pytest.fixture(scope="module")
def grown():
    return pl.series(cube(GROWN), SCENE)


def test_thickness_and_rate_come_back_within_their_errors(grown):
    found = grown.dataset
    off = (found.thickness - GROWN) / found.thickness_stderr_noise
    assert np.sqrt(np.mean(off**2)) < 1.7
    assert np.abs(found.thickness - GROWN).max() < 4
    rate = 60 * 1800 / 500 * np.exp(-TIME / 500)  # nm per minute
    assert found.rate.attrs["units"] == "nm/min"
    assert (np.abs(found.rate - rate) < 4 * found.rate_stderr).all()
    assert grown.decided == 1
    assert not grown.breaks


def test_all_times_know_more_than_one(grown):
    alone = np.asarray(grown.map["thickness"]) - GROWN
    assert np.sqrt(np.mean((grown["thickness"] - GROWN) ** 2)) < 0.6 * np.sqrt(np.mean(alone**2))


@pytest.mark.slow
def test_a_jump_and_a_gap_are_told_and_nothing_after_them_is_wrong():
    true = np.where(np.arange(80) < 50, GROWN, GROWN - 160)
    data = cube(true, seed=1)
    data.R[20:30] = np.nan
    found = pl.series(data, SCENE)
    assert found.breaks == pytest.approx([TIME[50] / 60])
    assert any("no data between" in text for text in found.warnings)
    decided = np.isfinite(found["thickness"])
    assert decided.sum() == 70
    assert (np.abs(found["thickness"] - true)[decided] < 5).all()
    left = found.dataset.residual
    assert np.isnan(left[20:30]).all()
    np.testing.assert_allclose(found.dataset.residual_rms[60], np.sqrt(np.mean(left[60] ** 2)), rtol=1e-5)
    assert 0.008 < float(left.std()) < 0.012
    assert len(draw(found).axes[0].collections[0].get_paths()) == 3  # no band crosses a gap or a break
    index = np.searchsorted(found.times, found.dataset.time_worst)
    np.testing.assert_allclose(found.dataset.worst_data, data.R.values[index])
    np.testing.assert_allclose(found.dataset.worst_data - found.dataset.worst_fit, left[index], atol=1e-6)
    assert set(index) == set(np.argsort(-found.dataset.residual_rms.fillna(0).values)[:3])


@pytest.mark.slow
def test_an_index_that_all_times_share_is_known_by_all():
    scene = pl.Scene(pl.Layer(pl.Free(1.4, 1.6), pl.Free(0, 3000)), 3.9)
    found = pl.series(cube(GROWN, noise=0.003, seed=2, n=1.5), scene).dataset
    assert abs(found.n - 1.5) < 4 * found.n_stderr_noise
    assert found.n_stderr_noise < 0.002
    assert (np.abs(found.thickness - GROWN) < 4 * found.thickness_stderr_noise).all()


@pytest.mark.slow
def test_an_order_that_nothing_decides_is_not_decided():
    """A film that hardly changes, seen in a narrow band: the order is open, and said to be."""
    data = cube(1500 + 5 * np.sin(TIME / 100), seed=3).isel(wavelength=slice(0, 6))
    found = pl.series(data, SCENE)
    assert found.decided < 0.1
    assert any("not decided" in text for text in found.warnings)
    assert not found.breaks


@pytest.mark.slow
def test_a_netcdf_file_and_a_folder_of_files_are_series(grown, tmp_path):
    data = cube(GROWN)
    data.to_netcdf(tmp_path / "grown.nc")
    assert pl.series(tmp_path / "grown.nc", SCENE).dataset.equals(grown.dataset)
    (tmp_path / "files").mkdir()
    for seconds, row in zip(TIME[:4], data.R.values, strict=False):
        rows = "\n".join(f"{nm:.4f},{r:.6f}" for nm, r in zip(NM, row, strict=True))
        (tmp_path / "files" / f"{seconds:g}s.csv").write_text(f"wavelength_nm,R\n{rows}\n")
    found = pl.series(tmp_path / "files", SCENE)
    assert list(found.times) == pytest.approx([0, 10, 20, 30])


@pytest.mark.slow
def test_a_series_with_dates_counts_from_the_first(grown, tmp_path):
    data = cube(GROWN)
    dates = np.datetime64("2026-05-04T12:30:00", "ns") + (TIME * 1e9).astype("timedelta64[ns]")
    found = pl.series(data.assign_coords(time=dates), SCENE)
    np.testing.assert_allclose(found.times, TIME / 60)
    write_series(tmp_path / "out", found)
    made = xarray.load_dataset(tmp_path / "out" / "series.nc")
    assert np.abs(made.time.values - dates).max() <= np.timedelta64(1, "us")
    raw = xarray.load_dataset(tmp_path / "out" / "series.nc", decode_times=False)
    assert raw.time.attrs["units"] == "minutes since 2026-05-04T12:30:00.000"


@pytest.mark.slow
def test_a_closed_shutter_is_left_out():
    data = cube(GROWN, seed=6)
    data.R[50] = 0.02
    found = pl.series(data, SCENE)
    assert np.isnan(found["thickness"][50])
    assert STATUSES[int(found.dataset.status[50])] in ("misfit", "not-converged")
    assert not found.breaks
    assert f"the spectra at {TIME[50] / 60:g} min: they are left out" in found.warnings[0]
    known = np.arange(len(TIME)) != 50
    rate = 60 * 1800 / 500 * np.exp(-TIME / 500)
    assert (np.abs(found["thickness"] - GROWN)[known] < 5).all()
    assert (np.abs(found["rate"] - rate)[known] < 4 * found["rate_stderr"][known]).all()


def test_what_is_no_series_is_refused(tmp_path):
    data = cube(GROWN)
    with pytest.raises(UsageError, match="comes after a later one"):
        pl.series(data.isel(time=[0, 2, 1, 3]), SCENE)
    with pytest.raises(UsageError, match="three times"):
        pl.series(data.isel(time=[0, 1]), SCENE)
    with pytest.raises(UsageError, match="its times are numbers without a unit"):
        pl.series(data.assign_coords(time=TIME), SCENE)
    with pytest.raises(UsageError, match="along `time` only"):
        pl.series(data.rename(time="x").expand_dims(y=[0.0]), SCENE)
    fixed = pl.Scene(pl.Layer(1.46, pl.Free(0, 3000, varies="shared")), 3.9)
    with pytest.raises(UsageError, match="a series has no file"):
        pl.series([], SCENE)
    with pytest.raises(UsageError, match="nothing varies"):
        pl.series(data, fixed)


@pytest.mark.slow
def test_the_command_writes_a_folder_and_goes_on_in_it(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    values = cube(GROWN).R.values[::4]
    names = []
    for seconds, row in zip(TIME[::4], values, strict=True):
        names.append(f"film_{seconds:03.0f}s.csv")
        rows = "\n".join(f"{nm:.4f},{r:.6f}" for nm, r in zip(NM, row, strict=True))
        (tmp_path / names[-1]).write_text(f"wavelength_nm,R\n{rows}\n")
    layer = "[[scene.layer]]\nmaterial = 1.46\nthickness = { lower = 0, upper = 3000 }\n"
    (tmp_path / "film.toml").write_text(f"[scene]\nsubstrate = 3.9\n{layer}")
    words = ["series", *names, "--recipe", "film.toml", "--out", "grown", "--workers", "1"]
    assert app(words) == 0
    first = xarray.load_dataset("grown/series.nc")
    assert (np.abs(first.thickness - GROWN[::4]) < 5).all()
    assert {x.name for x in (tmp_path / "grown").iterdir()} >= {"series.csv", "series.png", "report.html"}
    page = html.unescape(Path("grown/report.html").read_text("utf-8"))
    [program] = re.findall(r"import pellicle as pl.*?print\(result\)", page, re.DOTALL)
    made: dict[str, Any] = {}
    exec(program, made)
    np.testing.assert_array_equal(made["result"].dataset.thickness, first.thickness)
    assert "pellicle series film_000s.csv" in page
    assert "thickness = { lower = 0, upper = 3000 }" in page
    capsys.readouterr()
    assert app([*words, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["schema"] == "pellicle.series/1"
    assert record["times"]["count"] == 20
    xarray.testing.assert_identical(xarray.load_dataset("grown/series.nc"), first)


@pytest.mark.slow
def test_kills_at_random_moments_change_nothing(tmp_path, monkeypatch):
    """While it starts, fits each time alone, joins all times, and writes."""
    monkeypatch.setenv("PELLICLE_CACHE", str(tmp_path / "programs"))
    cube(GROWN).to_netcdf(tmp_path / "grown.nc")
    layer = "[[scene.layer]]\nmaterial = 1.46\nthickness = { lower = 0, upper = 3000 }\n"
    (tmp_path / "film.toml").write_text(f"[scene]\nsubstrate = 3.9\n{layer}")

    def start(out):
        words = ["series", "grown.nc", "--recipe", "film.toml", "--out", out]
        return subprocess.Popen([sys.executable, "-m", "pellicle", *words], cwd=tmp_path)

    assert start("whole").wait() == 0
    for seconds in np.random.default_rng(0).uniform(2.0, 12.0, KILLS):
        process = start("killed")
        with suppress(subprocess.TimeoutExpired):
            process.wait(seconds)
        process.kill()
        process.wait()
    assert start("killed").wait() == 0
    made = [xarray.load_dataset(tmp_path / out / "series.nc") for out in ("whole", "killed")]
    xarray.testing.assert_identical(*made)
    for name in ("series.csv", "series.png"):
        assert (tmp_path / "whole" / name).read_bytes() == (tmp_path / "killed" / name).read_bytes()


@pytest.mark.slow
def test_a_lamp_that_drifts_is_a_state_beside_the_thickness():
    level = 1 + 0.05 * np.sin(TIME / 300)
    data = cube(GROWN, seed=4) * xarray.DataArray(level, dims="time")
    scene = pl.Scene(SCENE.layers, 3.9, instrument=pl.Instrument(scale={"varies": "slowly"}))
    found = pl.series(data, scene)
    assert found.decided > 0.95
    for name, true in {"thickness": GROWN, "scale": level}.items():
        off = (found[name] - true) / found[f"{name}_stderr_noise"]
        assert 0.5 < np.sqrt(np.mean(off**2)) < 1.7
    # a spectrum of 24 values of 0.3 with noise of 0.01 knows its level to 0.7 %
    assert found["scale_stderr_noise"].median() < 0.003
    assert (found["scale_stderr"] > found["scale_stderr_noise"]).all()


def test_a_level_that_varies_in_time_is_no_curve_of_the_wavelength():
    for instrument in ({"scale": {"varies": "monotonic"}}, {"offset": {"changes": "slowly"}}):
        with pytest.raises(ValueError, match="has the key varies, one of slowly, freely, shared"):
            pl.Instrument(**instrument)


@pytest.mark.slow
def test_a_window_that_no_time_changes_is_a_lamp_curve_of_the_series():
    data = cube(GROWN, seed=4)
    window = 1 + 0.02 * np.sin(2 * np.pi * (NM - 600) / 100)
    data["R"] = data.R * window
    errors = {}
    for lamp in (None, "joint"):
        found = pl.series(data, SCENE, lamp_curve=lamp)
        errors[lamp] = np.sqrt(np.mean((found["thickness"] - GROWN)[5:] ** 2))
        off = np.abs(found["thickness"] - GROWN) < 1.96 * found["thickness_stderr"]
        assert off.mean() > 0.9
        turning = np.abs(found["rate"] - 60 * 1800 / 500 * np.exp(-TIME / 500)) < 1.96 * found["rate_stderr"]
        assert turning.mean() > 0.9
    assert errors["joint"] < 0.7 * errors[None]
    assert any("lamp curve" in note for note in found.map.notes)
