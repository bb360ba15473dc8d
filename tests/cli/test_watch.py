"""The watch of a folder: lines, table, restart, continuity and jumps, on films of a simulator of its own."""

import csv
import json

import numpy as np
import pytest

from pellicle.cli import app
from pellicle.data.read_cube import read_cube
from pellicle.errors import UsageError
from pellicle.explorer.live_page import LivePage
from pellicle.mapping.live_series import LiveSeries
from pellicle.recipes.read import read_recipe

NM = np.linspace(600, 700, 24)
RECIPE = """[data]
signal = "R"
[scene]
substrate = 3.9
[[scene.layer]]
material = 1.46
thickness = { lower = 0, upper = 3000 }
"""


def write(path, thickness, noise=0.01, nm=NM):
    """A file of the reflectance by the Airy formula, of a layer of index 1.46 on one of 3.9."""
    upper, lower = (1 - 1.46) / 2.46, (1.46 - 3.9) / 5.36
    turn = np.exp(-4j * np.pi * 1.46 * thickness / nm)
    values = np.abs((upper + lower * turn) / (1 + upper * lower * turn)) ** 2
    values = values + noise * np.random.default_rng(int(10 * thickness)).standard_normal(nm.size)
    rows = "\n".join(f"{x:.4f},{y:.6f}" for x, y in zip(nm, values, strict=True))
    path.write_text(f"wavelength_nm,R\n{rows}\n")
    return path


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("film") / "film.toml"
    path.write_text(RECIPE)
    return read_recipe(str(path)).scene(fitted=True)


@pytest.fixture(scope="module")
def live(scene, tmp_path_factory):
    """A film that grows, in noise that leaves orders open at first, jumps by 160 nm, and grows on; files that
    are no data of it. With the true thicknesses."""
    folder, made = tmp_path_factory.mktemp("live"), LiveSeries(scene)
    true = 700.0 + 8 * np.arange(60) - 160 * (np.arange(60) >= 40)
    for i, thickness in enumerate(true):
        made.fit(write(folder / f"run_{i:02d}s.csv", thickness, 0.03 if i < 30 else 0.01))
    for name, content in {"99s.csv": "broken", "no_time.csv": (folder / "run_00s.csv").read_text()}.items():
        (folder / name).write_text(content)
        made.fit(folder / name)
    made.fit(write(folder / "run2_05s.csv", 740.0))
    return made, true


@pytest.mark.slow
def test_continuity_decides_orders_and_a_jump_is_found(live):
    made, true = live
    fits = [fit for fit in made.fits.values() if not fit.error]
    decided = [i for i, fit in enumerate(fits) if fit.status in ("converged", "by-neighbours")]
    assert len(decided) > 45
    assert sum(fit.status == "by-neighbours" for fit in fits) > 3
    off = np.array([fits[i].values[0] - true[i] for i in decided])
    assert np.abs(off).max() < 12
    assert [i for i, fit in enumerate(fits) if fit.jump] == [40]


@pytest.mark.slow
def test_a_file_that_is_no_spectrum_of_the_series_is_said(live):
    made, _ = live
    told = {name: fit.error for name, fit in made.fits.items() if fit.error}
    assert set(told) == {"99s.csv", "no_time.csv", "run2_05s.csv"}
    assert "states no time" in told["no_time.csv"]
    assert "has the time of run_05s.csv" in told["run2_05s.csv"]


def test_a_file_on_another_grid_is_fitted_and_too_many_grids_are_said(scene, tmp_path, monkeypatch):
    monkeypatch.setattr("pellicle.mapping.live_series._GRIDS", 2)
    made = LiveSeries(scene)
    first, second, third = (
        made.fit(write(tmp_path / f"run_{i}s.csv", 740.0 + i, 0.005, NM + 0.4 * i)) for i in range(3)
    )
    assert not first.error
    assert abs(second.values[0] - 741) < 12
    assert "differ from those of" in third.error


def test_the_page_shows_the_files_and_what_is_new(live):
    made, _ = live
    page = LivePage(made, "<b>film</b>")
    text, policy = page.page("")
    assert "<b>film" not in text
    assert "connect-src 'self'" in text
    assert "connect-src 'self'" in policy
    news = page.answer("news", {})
    assert "63 files" in news["sentence"]
    assert len(news["figures"][0]["traces"][0]["x"]) > 50
    assert page.answer("news", {"seen": news["count"]}) == {"count": news["count"]}
    assert "error" in page.answer("fit", {})


def test_nothing_free_is_refused(scene):
    import equinox as eqx

    fixed = eqx.tree_at(lambda s: s.layers[0].thickness, scene, 100.0)
    with pytest.raises(UsageError, match="nothing varies"):
        LiveSeries(fixed)


def test_the_command_goes_on_where_it_was_and_loses_nothing(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data = tmp_path / "data"
    data.mkdir()
    (tmp_path / "film.toml").write_text(RECIPE)
    words = ["watch", "data", "--recipe", "film.toml", "--idle", "0.1", "--no-page"]
    words += ["--out", "out", "--json"]
    for i in range(4):
        write(data / f"f_{i:03d}s.csv", 300.0 + 5 * i, 0.002)
    (data / "broken_007s.csv").write_text("nothing")
    assert app(words) == 0
    told = capsys.readouterr()
    assert "5 files, 1 of them not fitted; the same" in told.err
    records = [json.loads(line) for line in told.out.splitlines()]
    assert [record["status"] for record in records].count("failed") == 1
    assert records[0]["schema"] == "pellicle.watch/1"
    fitted = {r["time"]["value"]: r["parameters"]["thickness"] for r in records if "error" not in r}
    assert fitted[2.0]["value"] == pytest.approx(310, abs=1)
    assert fitted[2.0]["stderr"] > fitted[2.0]["stderr_noise"] > 0
    with (tmp_path / "out" / "watch.csv").open("a") as file:
        file.write("f_003s.csv,3,conv")  # the machine lost its power
    write(data / "f_004s.csv", 320.0, 0.002)
    write(data / "broken_007s.csv", 335.0, 0.002)
    assert app(words) == 0
    told = capsys.readouterr()
    assert "5 files were fitted by an earlier run" in told.err
    assert sorted(json.loads(line)["data"]["path"] for line in told.out.splitlines()) == [
        "data/broken_007s.csv",
        "data/f_004s.csv",
    ]
    with (tmp_path / "out" / "watch.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["status"] for row in rows].count("converged") == 6
    assert all(None not in row.values() and None not in row for row in rows)
    cube = read_cube(sorted(data.iterdir()), time_from="out/watch.csv")
    np.testing.assert_array_equal(cube.coords["time"], [0, 1, 2, 3, 4, 7])
    (tmp_path / "film.toml").write_text(RECIPE.replace("1.46", "1.47"))
    with pytest.raises(UsageError, match="of another folder, scene"):
        app(words)


def test_what_cannot_be_watched_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "film.toml").write_text(RECIPE)
    for words, told in (
        (["nowhere"], "is no folder"),
        ([".", "--idle", "0"], "--idle must be above zero"),
        ([".", "--out", "."], "another folder|did not write"),
        ([".", "--time-from", "gone.csv"], "--time-from gone.csv: is no file"),
        ([".", "--signal", "Q"], "`signal` of a cube must be one of"),
    ):
        with pytest.raises(ValueError, match=told):
            app(["watch", *words, "--recipe", "film.toml"])
