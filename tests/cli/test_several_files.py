"""`pellicle fit` of several files: of one sample with `--joint`, of one spot with `--repeats`."""

import csv
import html
import json
import math
from pathlib import Path

import numpy as np
import pytest

from pellicle.cli.flags import SceneFlags
from pellicle.cli.inputs import inputs
from pellicle.errors import DataError
from pellicle.scene.instrument import Drift

ROOT = Path(__file__).parents[2]
BOTH = "joint = true\n[[data.file]]\npath = 'a.csv'\n[[data.file]]\npath = '{}'\n"


@pytest.fixture
def files(spectrum_file):
    return [spectrum_file(f"{name}.csv", seed=seed) for seed, name in enumerate("ab")]


@pytest.mark.slow
def test_one_object_whose_data_is_a_list(pellicle, files, scene, tmp_path):
    out = tmp_path / "out"
    [found] = pellicle("fit", *files, *scene, "--joint", "--json", "--out", out, code=0).objects
    about = [(data["name"], data["path"], data["points"]) for data in found["data"]]
    assert about == [("a", str(files[0]), 100), ("b", str(files[1]), 100)]
    thickness = found["parameters"]["thickness"]
    assert abs(thickness["value"] - 300.0) < 4 * thickness["stderr_noise"]
    assert json.loads((out / "result.json").read_text())["data"] == found["data"]
    assert not (out / "summary.csv").exists()


def test_a_bad_file_is_one_failed_object(pellicle, files, scene, tmp_path):
    [found] = pellicle("fit", files[0], tmp_path / "gone.csv", *scene, "--joint", "--json", code=3).objects
    assert found["status"] == "failed"
    assert len(found["data"]) == 2
    assert "gone.csv" in found["error"]
    assert "a.csv" not in found["error"]


@pytest.fixture
def asked(monkeypatch):
    """What would be fitted: (spectra, scenes) of each call, in place of the fits themselves."""
    calls = []

    def fit(spectra, scenes, **_):
        calls.append((spectra, scenes))
        raise DataError("not fitted here")

    monkeypatch.setattr("pellicle.api.fits.fit", fit)
    return calls


@pytest.mark.parametrize("wanted", ["wafer", "wafer/*.csv"])
def test_folders_and_patterns_are_their_files_in_natural_order(wanted, spectrum_file, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wafer").mkdir()
    for number in (10, 2, 1):
        spectrum_file(f"wafer/site {number}.csv")
    (tmp_path / "wafer" / "notes.md").write_text("cleaned on Monday")
    found = inputs([wanted], None, SceneFlags(layer="SiO2", substrate="Si"))
    assert [Path(file.path).name for file in found.files] == [f"site {i}.csv" for i in (1, 2, 10)]
    with pytest.raises(DataError, match="no file of data is there"):
        inputs(["wafer/*.txt"], None, SceneFlags(layer="SiO2", substrate="Si"))


def test_files_with_their_own_words(pellicle, files, scene_recipe, asked):
    """b.csv has counts, not fractions, so only it has a scale; and its own noise and range."""
    files[1].write_text(files[1].read_text().replace("R", "intensity"))
    own = "signal = 'R'\nnoise = 0.006\nrange = [420, 790]\ninstrument = { scale = 'free' }"
    path = scene_recipe(f"{BOTH.format('b.csv')}{own}")
    pellicle("fit", "--recipe", path)
    [([a, b], [seen_a, seen_b])] = asked
    assert (a.sigma, set(b.sigma)) == (None, {0.006})
    assert (a.wavelength.min(), b.wavelength.min()) == (400, 420)
    assert (seen_a.instrument.scale, seen_b.instrument.scale) == (1.0, Drift(0))
    pellicle("fit", files[0], "--recipe", path).refused(2, "[[data.file]]")


def test_one_file_may_be_joint_and_several_need_not(pellicle, files, scene, asked):
    """A joint fit is one of a list, if only of one file; else each file is fitted by itself."""
    pellicle("fit", files[0], *scene, "--joint")
    pellicle("fit", *files, *scene)
    joint, *apart = (spectra for spectra, _ in asked)
    assert [s.path for s in joint] == [str(files[0])]
    assert [s.path for s in apart] == list(map(str, files))


@pytest.fixture
def beside(files, write, scene_recipe):
    """A recipe of a reflectance of free scale and of Ψ and Δ, about which `own` is said."""
    write("wavelength,psi,delta,angle\n500,30,170,70\n600,31,160,70\n", "e.csv")
    end = "[instrument]\nscale = 'free'\n"
    return lambda own="": scene_recipe(BOTH.format("e.csv") + own, substrate="Si", end=end)


def test_ellipsometry_leaves_out_the_scale_of_all(pellicle, beside, asked):
    pellicle("fit", "--recipe", beside())
    [(_, scenes)] = asked
    assert [s.instrument.scale for s in scenes] == [Drift(0), 1.0]


def test_ellipsometry_has_no_scale_of_its_own(pellicle, beside):
    ran = pellicle("fit", "--recipe", beside("instrument = { scale = 1.1 }"))
    ran.refused(3, "e.csv: ellipsometry has no scale and no offset")


def test_a_folded_delta_is_said_by_flag_or_recipe(pellicle, beside, scene, tmp_path, asked):
    pellicle("fit", "--recipe", beside("folded = true"))
    pellicle("fit", tmp_path / "e.csv", *scene, "--folded")
    (tmp_path / "e.csv").write_text("wavelength,alpha,beta,angle\n500,0.1,0.2,70\n600,0.2,0.3,70\n")
    pellicle("fit", tmp_path / "e.csv", *scene, "--analyser", 45)
    [([_, in_recipe], _), (by_flag, _), (rotating, _)] = asked
    assert (in_recipe.folded, by_flag.folded, rotating.folded) == (True, True, True)


def test_columns_and_spots_are_said_by_flag_or_recipe(pellicle, scene, write, scene_recipe, asked):
    """What a flag says goes before the recipe."""
    write("500,20,30\n600,21,31\n", "f.csv")
    path = scene_recipe("files = ['f.csv']\ncolumns = 'wavelength,_,R'\nsignal_unit = 'percent'")
    pellicle("fit", "--recipe", path)
    pellicle("fit", "--recipe", path, "--columns", "wavelength,R,_")
    spots = ROOT / "measurements" / "ellipsometry" / "post_synthesis.dat"
    pellicle("fit", spots, *scene, "--spot", 2)
    (by_recipe, _), (by_flag, _), (spot, _) = asked
    assert (by_recipe.values.tolist(), by_flag.values.tolist()) == ([0.3, 0.31], [0.2, 0.21])
    assert spot.values[0] == 34.733


def test_the_recipe_turns_a_sample_whose_file_states_no_azimuth(write, scene_recipe):
    write("wavelength_nm,R\n500,0.2\n600,0.3\n")
    crystal = "{ ordinary = 1.6, extraordinary = 1.7, axis = [90, 0] }"
    recipe = scene_recipe("files = ['film.csv']\nangle = 60\nazimuth = 45", material=crystal)
    (file,) = inputs([], str(recipe)).files
    assert (file.scene.light.angle, file.scene.light.azimuth) == (60.0, 45.0)


@pytest.mark.slow
def test_repeats_of_one_thickness_agree(pellicle, spectrum_file, scene, tmp_path):
    files = [spectrum_file(f"{seed}.csv", seed=seed) for seed in range(4)]
    out = tmp_path / "out"
    flags = ("--repeats", "--json", "--out", out, "--jobs", "2")
    *fits, found = pellicle("fit", *files, *scene, *flags, code=0).objects
    assert [fit["schema"] for fit in fits] == ["pellicle.fit/1"] * 4
    assert found["schema"] == "pellicle.repeats/1"
    assert [each["path"] for each in found["data"]] == list(map(str, files))
    values = [fit["parameters"]["thickness"]["value"] for fit in fits]
    thickness = found["parameters"]["thickness"]
    assert thickness["values"] == values
    assert thickness["mean"] == pytest.approx(np.mean(values))
    assert thickness["sd"] == pytest.approx(np.std(values, ddof=1))
    assert thickness["agreement"] == "agrees"
    assert abs(thickness["mean"] - 300.0) < thickness["expanded"]
    assert json.loads((out / "repeats.json").read_text())["parameters"] == found["parameters"]
    [row] = csv.DictReader((out / "repeats.csv").read_text().splitlines()[1:])
    assert float(row["sd_mean"]) == pytest.approx(np.std(values, ddof=1) / math.sqrt(4))
    assert "[[Repeats]]" in (out / "repeats.txt").read_text()
    page = (out / "report.html").read_text()
    scatter = page[page.index('id="repeats-head"') : page.index('id="files"')]
    assert html.escape(found["verdict"]) in scatter
    assert f'<td class="number">{found["parameters"]["thickness"]["mean"]:.7g}</td>' in scatter
    assert (out / "summary.csv").exists()


@pytest.mark.slow
def test_thicknesses_that_differ_are_told(pellicle, spectrum_file, scene_recipe):
    for name, thickness in zip("abc", (299.0, 300.0, 301.5), strict=True):
        spectrum_file(f"{name}.csv", thickness)
    recipe = scene_recipe("files = ['a.csv', 'b.csv', 'c.csv']\nrepeats = true")
    ran = pellicle("fit", "--recipe", recipe, code=0)
    assert ran.out.count("[[Verdict]]") == 3
    assert "the stated noise error is too small" in " ".join(ran.out.split())


@pytest.mark.slow
def test_a_file_that_cannot_be_read_is_not_waited_for(pellicle, spectrum_file, scene, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "repeats.txt").write_text("of an earlier run")
    (out / "result.json").write_text('{"schema": "pellicle.fits/1"}')
    flags = ("--repeats", "--json", "--out", out)
    ran = pellicle("fit", spectrum_file(), tmp_path / "gone.csv", *scene, *flags, code=3)
    assert "repeats need two usable fits" in ran.err
    assert not (out / "repeats.txt").exists()
    failed = ran.objects[-1]
    assert (failed["schema"], failed["status"]) == ("pellicle.repeats/1", "failed")


def test_what_repeats_are_not(pellicle, spectrum_file, scene, scene_recipe):
    file = spectrum_file()
    pellicle("fit", file, *scene, "--repeats").refused(2, "two files or more", "--repeats")
    pellicle("fit", file, file, *scene, "--repeats", "--joint").refused(2, "one by one", "choose one")
    path = scene_recipe("joint = true\nrepeats = true")
    pellicle("fit", file, "--recipe", path).refused(3, "joint and repeats exclude each other")


@pytest.mark.slow
def test_sweeps_of_one_file_are_repeats(pellicle, spectrum_file, scene, tmp_path):
    texts = [spectrum_file(f"{seed}.csv", seed=seed).read_text().split("\n", 1) for seed in range(3)]
    together = tmp_path / "sweeps.csv"
    together.write_text(texts[0][0] + "\n" + "".join(rows for _, rows in texts))
    mean = pellicle("fit", together, *scene, "--json").objects[0]
    assert mean["data"]["points"] == 100
    assert mean["data"]["sweeps"]["number"] == 3
    assert abs(mean["data"]["sweeps"]["sd"] - 0.002) < 0.0003
    each = pellicle("fit", together, *scene, "--repeats", "--json").objects
    alone = pellicle("fit", *(tmp_path / f"{seed}.csv" for seed in range(3)), *scene, "--repeats", "--json")
    assert each[-1]["parameters"] == alone.objects[-1]["parameters"]
    assert [x["path"] for x in each[-1]["data"]] == [f"{together} ({i})" for i in (1, 2, 3)]


def test_other_commands_ignore_the_key(pellicle, spectrum_file, scene_recipe, tmp_path):
    """A recipe of repeats still describes one scene: `compare` takes one file of it."""
    path = scene_recipe("repeats = true")
    other = tmp_path / "other.toml"
    other.write_text(path.read_text().replace("1.46", "1.5"))
    assert pellicle("compare", spectrum_file(), "--recipe", path, "--recipe", other).code in (0, 4)
