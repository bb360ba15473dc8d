"""`pellicle fit --joint`: several files of one sample, one result."""

import json
from pathlib import Path

import pytest

from pellicle.cli.inputs import inputs
from pellicle.errors import DataError
from pellicle.scene.instrument import Drift

ROOT = Path(__file__).parents[2]


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


def test_files_with_their_own_words(pellicle, files, scene_recipe, asked):
    """b.csv has counts, not fractions, so only it has a scale; and its own noise and range."""
    files[1].write_text(files[1].read_text().replace("R", "intensity"))
    path = scene_recipe(
        "joint = true\n[[data.file]]\npath = 'a.csv'\n[[data.file]]\npath = 'b.csv'\nsignal = 'R'\n"
        "noise = 0.006\nrange = [420, 790]\ninstrument = { scale = 'free' }"
    )
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
    both = "joint = true\n[[data.file]]\npath = 'a.csv'\n[[data.file]]\npath = 'e.csv'\n"
    return lambda own="": scene_recipe(both + own, substrate="Si", end="[instrument]\nscale = 'free'\n")


def test_ellipsometry_leaves_out_the_scale_of_all(pellicle, beside, asked):
    pellicle("fit", "--recipe", beside())
    [(_, scenes)] = asked
    assert [s.instrument.scale for s in scenes] == [Drift(0), 1.0]


def test_ellipsometry_with_a_scale_of_its_own_is_refused(pellicle, beside):
    pellicle("fit", "--recipe", beside("instrument = { scale = 1.1 }")).refused(
        3, "e.csv: ellipsometry has no scale and no offset"
    )


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
