"""Traces of simulated films that grow, turn and hide, by a simulator of its own, and the command."""

import json
import re
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import xarray

import pellicle as pl
from pellicle.cli import app
from pellicle.errors import DataError, UsageError
from pellicle.fitting.batch.data import CODES
from pellicle.mapping.trace import lost
from pellicle.mapping.trace_branches import Start
from pellicle.mapping.trace_light import Light
from pellicle.mapping.trace_path import KINK, Candidates, Course, trace_path
from pellicle.mapping.trace_turns import going_on

LASER, INDEX = 633.0, 1.46
FRINGE = LASER / 2 / INDEX
TIME = np.linspace(0, 600, 500)


def reflectance(thickness, nm=LASER, n=INDEX):
    """The Airy formula at normal incidence: a layer of index n on one of 3.88 (times,)."""
    upper, lower = (1 - n) / (1 + n), (n - 3.88) / (n + 3.88)
    turn = np.exp(-4j * np.pi * n * np.asarray(thickness) / nm)
    return np.abs((upper + lower * turn) / (1 + upper * lower * turn)) ** 2


def trace(thickness, nm=(LASER,), noise=0.01, seed=0, gain=2.7, offset=0.13, n=INDEX):
    """Light in volts (times, wavelengths), with noise as a share of its range."""
    values = np.stack([offset + gain * reflectance(thickness, x, n) for x in nm], axis=1)
    values += noise * np.ptp(values, axis=0) * np.random.default_rng(seed).standard_normal(values.shape)
    axes = {"time": ("time", TIME[: len(values)], {"units": "s"}), "wavelength": list(nm)}
    return xarray.Dataset({"R": (("time", "wavelength"), values)}, axes)


def scene(**known):
    film = pl.Layer(INDEX, pl.Free(0, 2000, **known))
    return pl.Scene(film, 3.88, instrument=pl.Instrument(scale="free", offset="free"))


def off(found, thickness):
    """Distance from the truth in standard errors of the noise."""
    return (found["thickness"].values - thickness) / found["thickness_stderr_noise"].values


@pytest.mark.slow
def test_a_laser_follows_a_film_from_a_known_start():
    grown = 5 * FRINGE * (0.7 * TIME / 600 + 0.3 * (TIME / 600) ** 2)
    found = pl.series(trace(grown), scene(first=0.0))
    assert found.decided == 1
    assert not found.warnings
    assert np.sqrt(np.mean((found["thickness"] - grown) ** 2)) < LASER / 200
    assert 0.5 < np.sqrt(np.mean(off(found, grown) ** 2)) < 1.7
    rate = np.gradient(grown, TIME) * 60
    assert (np.abs(found["rate"] - rate) < 5 * found["rate_stderr"]).all()
    made = found.dataset
    for name, true in {"gain_633_nm": 2.7, "offset_633_nm": 0.13}.items():
        assert abs(made[name] - true) < 4 * made[f"{name}_stderr_noise"] < 0.05
    noise = 0.01 * np.ptp(2.7 * reflectance(grown))
    assert float(made.residual.std()) == pytest.approx(noise, rel=0.1)
    np.testing.assert_allclose(
        made.light[:, 0] - made.residual[:, 0], 0.13 + 2.7 * reflectance(grown), atol=noise
    )


def test_a_path_that_comes_to_rest_has_a_rival_that_goes_on():
    """Without it a trace of the benchmark was wrong and decided at 84 % of its times (absorbs, draw 1)."""
    time, kinks = np.arange(100.0), np.zeros(100, bool)
    at, course = going_on(Start(time, np.minimum(4 * time, 200.0), kinks), 0.0, 300.0) or (0, None)
    assert at == 45
    assert course is not None
    np.testing.assert_allclose(course.thickness, np.minimum(4 * time, 300.0))
    assert going_on(Start(time, 2 * time, kinks), 0.0, 300.0) is None


@pytest.mark.slow
def test_a_film_whose_fringes_die_out_goes_on():
    """A path that turns at each extremum follows the light, too."""
    grown = 600 * (1 - np.exp(-TIME / 400))
    found = pl.series(
        trace(grown, noise=0.015, seed=6, n=2.3 - 0.35j, gain=8.0),
        pl.Scene(
            pl.Layer(2.3 + 0.35j, pl.Free(0, 900, first=0.0)),
            3.88,
            instrument=pl.Instrument(scale="free", offset="free"),
        ),
    )
    right = np.abs(found["thickness"] - grown) < 20
    assert (right | (found.dataset.status == CODES["ambiguous"])).all()
    assert right.mean() > 0.8


@pytest.mark.slow
def test_a_turn_near_an_extremum_is_found_or_left_open():
    turn = 2 * FRINGE + 3
    grown = np.where(TIME < 300, turn * TIME / 300, turn - (TIME - 300))
    found = pl.series(trace(grown, noise=0.02, seed=7), scene(first=0.0))
    wrong = np.abs(found["thickness"] - grown) > 20
    assert not (wrong & (found.dataset.status == CODES["by-neighbours"])).any()


@pytest.mark.slow
def test_one_laser_without_a_start_decides_no_order():
    grown = 100 + 4 * FRINGE * TIME / 600
    found = pl.series(trace(grown, seed=1), scene())
    assert found.decided == 0
    assert any("not decided" in text for text in found.warnings)


@pytest.mark.slow
def test_no_order_is_decided_because_the_next_path_is_unlikely():
    """A draw in which the path that pays least next is far less likely than the same course a fringe away."""
    at = TIME / 600
    grown = 2.49 * FRINGE * (1 - np.exp(-at / 0.81)) / (1 - np.exp(-1 / 0.81))
    assert pl.series(trace(grown, noise=0.023, seed=1), scene()).decided == 0


@pytest.mark.slow
@pytest.mark.parametrize("depth", [2.0, 2.25])  # it turns between two extrema, and at one
def test_a_film_that_is_etched_and_grows_again_is_followed_through_its_turn(depth):
    thickness = FRINGE * (4.25 - depth * np.sin(np.pi * TIME / 600))
    found = pl.series(trace(thickness, seed=2), scene(first=float(thickness[0])))
    assert found.decided == 1
    assert np.abs(found["thickness"] - thickness).max() < LASER / 200
    assert np.sqrt(np.mean(off(found, thickness) ** 2)) < 1.7


@pytest.mark.slow
def test_two_lasers_decide_the_order_by_themselves():
    grown = 300 + 900 * TIME / 600
    found = pl.series(trace(grown, (532.0, LASER), seed=3), scene())
    assert found.decided == 1
    assert np.abs(found["thickness"] - grown).max() < LASER / 200


@pytest.mark.slow
def test_a_closed_shutter_is_told_and_nothing_after_it_is_wrong():
    grown = 5 * FRINGE * TIME / 600
    data = trace(grown, seed=4)
    data.R[240:260] = 0.0
    found = pl.series(data, scene(first=0.0))
    known = np.isfinite(found["thickness"].values)
    assert known.sum() == 480
    assert any("no data between" in text for text in found.warnings)
    assert np.abs(found["thickness"] - grown)[known].max() < LASER / 200


def test_a_trace_is_refused_where_it_says_too_little():
    data = trace(5 * FRINGE * TIME / 600)
    with pytest.raises(UsageError, match="24 times"):
        pl.series(data.isel(time=slice(0, 20)), scene())
    with pytest.raises(UsageError, match="this has 0 besides 500 that are constant"):
        pl.series(xarray.full_like(data, 0.3).assign_coords(data.coords), scene())
    with pytest.raises(UsageError, match="slowly, or is monotonic"):
        pl.series(data, scene(varies="freely"))
    with pytest.raises(ValueError, match="`first` is 3000, outside"):
        scene(first=3000.0)


@pytest.mark.slow
def test_a_table_with_a_time_and_wavelengths_is_a_trace(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    grown = 5 * FRINGE * TIME / 600
    values = trace(grown, seed=5).R.values[:, 0]
    rows = [f"{t:.3f},{x:.6f},20.0" for t, x in zip(TIME, values, strict=True)]
    (tmp_path / "laser.csv").write_text("\n".join(["Time (s),633 nm (V),Temperature (C)", *rows]))
    film = "[[scene.layer]]\nmaterial = 1.46\nthickness = { lower = 0, upper = 2000, first = 0 }\n"
    recipe = f"[scene]\nsubstrate = 3.88\n{film}"
    (tmp_path / "film.toml").write_text(recipe)
    with pytest.raises(UsageError, match=r'scale = "free" under \[instrument\]'):
        app(["series", "laser.csv", "--recipe", "film.toml"])
    capsys.readouterr()
    (tmp_path / "film.toml").write_text(f'{recipe}[instrument]\nscale = "free"\noffset = "free"\n')
    assert app(["series", "laser.csv", "--recipe", "film.toml", "--out", "grown", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["status"] == {"by-neighbours": 500}
    assert abs(record["parameters"]["gain_633_nm"]["value"] - 2.7) < 0.1
    assert re.search(
        r"gain_633_nm +2\.\d{3} ± 0\.\d{3}, the same", Path("grown/report.txt").read_text("utf-8")
    )
    assert "residual_633_nm" in (tmp_path / "grown" / "series.csv").read_text().split("\n")[0]
    made = xarray.load_dataset("grown/series.nc")
    assert np.abs(made.thickness - grown).max() < LASER / 200


@pytest.mark.parametrize(
    ("head", "said"),
    [
        ("Time,633 nm", "has no unit"),
        ("Time (s),633 nm (V),0.633 um (V)", "a wavelength twice"),
    ],
)
def test_a_table_of_a_trace_is_refused_with_its_remedy(head, said, tmp_path):
    width = head.count(",")
    rows = [",".join([str(i), *[f"{0.1 + i / 100}"] * width]) for i in range(30)]
    (tmp_path / "laser.csv").write_text("\n".join([head, *rows]))
    with pytest.raises(DataError, match=said):
        pl.series(tmp_path / "laser.csv", scene())


def test_the_path_is_the_cheapest_of_all():
    """By enumeration of every path through three candidates at six times."""
    rng = np.random.default_rng(3)
    t = np.array([0.0, 1.0, 2.0, 3.5, 4.0, 5.0])
    thickness = 40 * np.abs(t - 2.5)[:, None] + np.array([0.0, 90.0, 180.0]) + rng.normal(0, 5, (6, 3))
    delta, stderr = np.abs(rng.normal(0, 3, (6, 3))), np.full((6, 3), 4.0)
    candidates, rows = Candidates(thickness, delta, stderr), np.arange(6)

    def price(path, way):
        d = thickness[rows, path]
        steps, total = np.diff(t), float(np.sum(delta[rows, path]))
        for i in range(2, 6):
            ratio = steps[i - 1] / steps[i - 2]
            step, last = d[i] - d[i - 1], ratio * (d[i - 1] - d[i - 2])
            noise = 16 * (1 + (1 + ratio) ** 2 + ratio**2)
            total += min((step - last) ** 2 / ((0.15 * (abs(step) + abs(last))) ** 2 + noise), KINK)
        wrong = way * np.diff(d) < -3 * 4 * np.sqrt(2)
        return np.inf if wrong.any() else total

    every = [*product(range(3), repeat=6)]
    costs = [price(np.array(path), 0) for path in every]
    assert trace_path(t, candidates).price == pytest.approx(min(costs))
    assert tuple(trace_path(t, candidates).chosen) == every[int(np.argmin(costs))]
    monotonic = min(min(price(np.array(path), way) for path in every) for way in (1, -1))
    assert trace_path(t, candidates, Course(turn=np.inf)).price == pytest.approx(monotonic)
    assert monotonic > min(costs)


def test_a_path_that_does_not_follow_the_light_is_told():
    time = np.arange(400.0)
    noise = 0.01 * np.random.default_rng(0).standard_normal((400, 1))
    about = Light(noise, time, np.array([0.01]), np.ones(1), (None, None))
    assert not lost(noise + 0.03 * np.sin(time / 30)[:, None], about).any()  # a laser that drifts
    away = noise.copy()
    away[200:230] += 0.2
    assert lost(away, about)[205:225].all()
    assert not lost(away, about)[:180].any()
