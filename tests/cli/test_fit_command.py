"""`pellicle fit`: result on stdout, talk on stderr, exit codes, folders, flags, and what repeats a fit."""

import csv
import hashlib
import json
import math
import re
import tomllib

import numpy as np
import pytest

from pellicle.api import fits
from pellicle.cli.flags import SceneFlags
from pellicle.data.options import FileOptions
from pellicle.errors import DataError, UsageError
from pellicle.scene.instrument import Drift

RESULT_KEYS = {"schema", "data", "status", "verdict", "parameters", "rivals", "chi2_reduced", "rms"}
RESULT_KEYS |= {"correlation", "budget", "plan", "warnings", "versions", "seconds"}


def test_stdout_is_the_report_and_stderr_the_talk(pellicle, spectrum_file, scene):
    ran = pellicle("fit", spectrum_file(), *scene, code=0)
    assert "thickness" in ran.out
    assert "converged" in ran.out
    assert "unit" not in ran.out.split("[[")[0]
    assert "signal unit: fraction, assumed" in ran.err
    assert "±" not in ran.err


def test_json_is_one_strict_object_a_line_with_the_contracts_keys(pellicle, spectrum_file, scene):
    file = spectrum_file()
    ran = pellicle("fit", file, *scene, "--json")
    (found,) = ran.objects
    assert set(found) >= RESULT_KEYS
    assert found["schema"] == "pellicle.fit/1"
    assert found["status"] == "converged"
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    assert found["data"] == {"path": str(file), "sha256": digest, "signal": "R", "points": 100}
    thickness = found["parameters"]["thickness"]
    assert abs(thickness["value"] - 300) < 4 * thickness["stderr_noise"] < 4
    assert {"value", "stderr", "stderr_noise", "unit", "lower", "upper", "free"} <= set(thickness)
    assert thickness["stderr"] > thickness["stderr_noise"]  # of usual instruments and samples
    assert thickness["expanded"] == pytest.approx(thickness["coverage_factor"] * thickness["stderr"])
    assert {"effect", "uncertainty", "unit", "changes", "amount", "explains", "carries"} == set(
        found["budget"][0]
    )
    assert (thickness["unit"], thickness["lower"], thickness["upper"]) == ("nm", 10, 800)
    assert {"effect", "on", "why", "error_bound"} <= set(found["plan"][0])
    assert found["correlation"]["names"] == ["thickness"]
    assert all({"parameters", "delta_chi2"} <= set(rival) for rival in found["rivals"])
    assert {"pellicle", "jax"} <= set(found["versions"])


def test_a_misspelt_name_of_a_limit_ends_the_command_before_a_fit(
    pellicle, spectrum_file, scene, monkeypatch
):
    monkeypatch.setattr("pellicle.cli.batch.Batch._codes", lambda *given: pytest.fail("fitted"))
    words = "--spec", "instrument.scale=0:2", "--spec", "thicknes=1:2"
    pellicle("fit", spectrum_file(), *scene, *words).refused(
        2, "--spec thicknes", "did you mean 'thickness'?"
    )


def test_a_figure_for_a_paper(pellicle, spectrum_file, scene, tmp_path):
    file, figure = spectrum_file(), tmp_path / "oxide.pdf"
    ran = pellicle("fit", file, *scene, "--figure", figure, code=0)
    assert figure.read_bytes().startswith(b"%PDF")
    assert f"{figure}: written" in ran.err
    again = pellicle("fit", file, *scene, "--figure", figure, code=2)
    assert "choose another --figure" in again.err
    of_two = pellicle("fit", file, spectrum_file("two.csv"), *scene, "--figure", tmp_path / "b.pdf", code=2)
    assert "--figure is of one fit" in of_two.err


def test_several_files_in_order_and_one_that_cannot_be_read(pellicle, spectrum_file, scene, tmp_path):
    """A folder for each fit, and a summary of all."""
    bad, out = tmp_path / "bad.csv", tmp_path / "all"
    bad.write_text("wavelength_nm,R\n400,0.1\n401,much\n")
    files = spectrum_file("one.csv", 250.0), bad, spectrum_file("two.csv", 420.0)
    ran = pellicle("fit", *files, *scene, "--json", "--out", out, code=3)
    found = ran.objects
    assert [f["data"]["path"] for f in found] == list(map(str, files))
    assert [f["status"] for f in found] == ["converged", "failed", "converged"]
    assert "line 3" in found[1]["error"]
    assert set(found[1]) >= RESULT_KEYS
    assert "line 3" in ran.err
    assert "Traceback" not in ran.err
    assert {p.name for p in (out / "one").iterdir()} == {p.name for p in (out / "two").iterdir()} == FILES
    assert not (out / "bad").exists()
    rows = list(csv.DictReader((out / "summary.csv").read_text("utf-8-sig").splitlines()))
    assert [row["path"] for row in rows] == list(map(str, files))
    assert [row["status"] for row in rows] == ["converged", "failed", "converged"]
    for record, row, truth in ((found[0], rows[0], 250), (found[2], rows[2], 420)):
        value = record["parameters"]["thickness"]["value"]
        assert abs(value - truth) < 1
        assert float(row["thickness"]) == pytest.approx(value)
    assert "line 3" in rows[1]["error"]


def test_the_assumed_thickness_is_said(pellicle, spectrum_file):
    ran = pellicle("fit", spectrum_file(), "--layer", "1.46", "--substrate", "3.9+0.02j", "--json")
    assert "1 to 5000 nm" in ran.err
    assert ran.objects[0]["parameters"]["thickness"]["upper"] == 5000


FILES = {"recipe.toml", "report.html", "report.txt", "result.json", "figure.png", "fit.csv", "nk.csv"}


def test_a_folder_of_the_user_is_refused_first(pellicle, spectrum_file, scene, tmp_path, monkeypatch):
    out = tmp_path / "mine"
    out.mkdir()
    (out / "thesis.txt").write_text("years of work")

    def never(*_, **__):
        raise AssertionError("fitted for nothing")

    monkeypatch.setattr(fits, "fit", never)
    for files in ([spectrum_file()], [spectrum_file("a.csv"), spectrum_file("b.csv")]):
        pellicle("fit", *files, *scene, "--out", out).refused(2, "pellicle did not write", "--out")
        assert [p.name for p in out.iterdir()] == ["thesis.txt"]


def test_a_recipe_gives_what_the_flags_give(pellicle, spectrum_file, scene, scene_recipe):
    file, recipe = spectrum_file(), scene_recipe("files = ['oxide.csv']")
    (by_recipe,) = pellicle("fit", "--recipe", recipe, "--json").objects
    (by_flags,) = pellicle("fit", file, *scene, "--json").objects
    (named,) = pellicle("fit", file, "--recipe", recipe, "--json").objects
    for found in (by_recipe, by_flags, named):
        found.pop("seconds")
    assert by_recipe == by_flags == named


def test_flags_reach_the_scene(pellicle, spectrum_file, monkeypatch):
    """Each changes what is fitted, or it would be a decoration; other tests fit such scenes."""
    fitted = []

    def fit(data, scene, **_):
        fitted.append((data, scene))
        raise DataError("fitted")

    monkeypatch.setattr(fits, "fit", fit)
    base = ("--layer", "1.46", "--substrate", "3.9+0.02j", "--thickness", "280:320")
    file = spectrum_file()
    oblique = "--angle", "30", "--polarisation", "s", "--ambient", "1.1", "--range", "410:750"
    plate = "--back", "air", "--plate-mm", "0.5"
    freed = "--free", "n=1.4:1.5", "--scale", "free", "--offset", "free"
    for flags in ((), oblique, plate, freed):
        pellicle("fit", file, *base, *flags, code=3)
    (data, plain), (cut, tilted), (_, on_plate), (_, free) = fitted
    assert (data.wavelength.min(), data.wavelength.max()) == (400, 796)
    assert (cut.wavelength.min(), cut.wavelength.max()) == (412, 748)
    assert (plain.light.angle, plain.light.polarisation, plain.ambient(500.0)) == (0, "unpolarised", 1)
    assert (tilted.light.angle, tilted.light.polarisation, tilted.ambient.n) == (30, "s", 1.1)
    back = on_plate.substrate.back
    assert (plain.substrate.back, back(500.0), on_plate.substrate.plate_mm) == (None, 1, 0.5)
    n, thickness = free.layers[0].material.n, free.layers[0].thickness
    assert (n.lower, n.upper, thickness.lower, thickness.upper) == (1.4, 1.5, 280, 320)
    assert (plain.instrument.scale, plain.instrument.offset) == (1, 0)
    assert (type(free.instrument.scale), type(free.instrument.offset)) == (Drift, Drift)


def test_outliers_hardly_count_with_a_robust_loss(pellicle, spectrum_file, scene, scene_recipe):
    """By flag and by recipe; a name that is none is refused, and so is a posterior of it."""
    path = spectrum_file()
    lines = path.read_text().splitlines()
    for row in range(10, 100, 9):
        nm, value = lines[row].split(",")
        lines[row] = f"{nm},{float(value) + 0.2:.6f}"
    path.write_text("\n".join(lines) + "\n")
    plain = pellicle("fit", path, *scene, "--json").objects[0]
    [robust] = pellicle("fit", path, *scene, "--json", "--loss", "student-t", code=0).objects
    assert plain["noise"]["sigma"] > 10 * robust["noise"]["sigma"]
    assert robust["noise"]["sigma"] == pytest.approx(0.002, rel=0.4)
    assert robust["noise"]["source"] == "residuals"
    recipe = scene_recipe(f"files = ['{path.name}']\nloss = 'student-t'")
    [again] = pellicle("fit", "--recipe", recipe, "--json").objects
    assert again["parameters"]["thickness"]["value"] == robust["parameters"]["thickness"]["value"]
    other = pellicle("fit", path, *scene, "--loss", "cauchy")
    other.refused(2, "--loss must be one of least-squares, huber, student-t, not 'cauchy'")
    both = pellicle("fit", path, *scene, "--loss", "huber", "--posterior")
    both.refused(2, "leave the loss out, or the posterior")


def substrate(signal: str = "R", **flags):
    given = SceneFlags(layer="SiO2", substrate="BK7", **flags)
    return given.scene(FileOptions(signal=signal)).substrate


def test_a_share_and_a_number_of_reflections():
    assert substrate(back="air", back_collected="0.4").back_collected == 0.4
    free = substrate(back="air", back_collected="free", back_reflections=2)
    assert (free.back_collected.lower, free.back_collected.upper, free.back_reflections) == (0, 1, 2)
    assert substrate(back="air", back_collected="0.2:0.8").back_collected.upper == 0.8


@pytest.mark.parametrize("word", ["rough", "taped"])
def test_a_back_that_returns_nothing(word, refuses):
    assert substrate(back=word).back_collected == 0.0
    refuses(UsageError, "its transmittance is not simulated", substrate, "T", back=word)
    refuses(UsageError, "leave out `back_collected`", substrate, back=word, back_collected="0.5")


def test_a_share_needs_a_back(refuses):
    refuses(UsageError, "`back_collected` needs the medium behind the plate", substrate, back_collected="0.5")


@pytest.mark.parametrize(
    ("flags", "text"),
    [
        ({"back": "air", "back_collected": "2"}, "`back_collected` must be at most 1"),
        ({"back": "air", "back_reflections": 0}, "`back_reflections` must be 1 to 100"),
        ({"bandwidth": "-2"}, "`bandwidth` must not be negative"),
    ],
)
def test_a_flag_out_of_range_is_wrong_usage(flags, text, refuses):
    refuses(UsageError, text, substrate, **flags)


@pytest.fixture
def thickness(pellicle, spectrum_file):
    """Fits a spectrum with these flags, and returns the thickness and the names of the budget."""
    file = spectrum_file()

    def thickness(*flags):
        (found,) = pellicle("fit", file, *flags, "--json").objects
        assert found["status"] == "converged"
        return found["parameters"]["thickness"], [row["effect"] for row in found["budget"]]

    return thickness


def test_usual_uncertainties_are_those_without_the_flag(thickness, scene):
    plain, rows = thickness(*scene)
    assert (plain, rows) == thickness(*scene, "--uncertainty", "usual")
    assert {"wavelength shift", "index of the layer", "index of the substrate", "scale"} <= set(rows)


def test_none_leaves_the_noise(thickness, scene):
    plain, _ = thickness(*scene)
    bare, rows = thickness(*scene, "--uncertainty", "none")
    assert rows == []
    assert bare["stderr"] == pytest.approx(bare["stderr_noise"], rel=1e-3)
    assert (bare["value"], bare["stderr_noise"]) == (plain["value"], plain["stderr_noise"])


@pytest.mark.slow
def test_an_index_of_a_recipe_counts_as_one_that_is_fitted(thickness, scene_recipe):
    """With a prior as wide; the value stays that of the given index, and its error includes the distance."""
    n = "{ lower = 1.3, upper = 1.6, value = 1.46, prior = { mean = 1.46, sd = 0.0146 } }"
    materials = "1.46\nindex_uncertainty = 0.01", f"{{ model = 'constant', n = {n} }}"
    alone = {"data": "noise = 0.002", "scene": "uncertainty = 'none'"}
    ways = (thickness("--recipe", scene_recipe(material=x, **alone)) for x in materials)
    (found, one), (fitted, none) = ways
    assert (one, none) == (["index of the layer"], [])
    together = math.hypot(fitted["stderr"], fitted["value"] - found["value"])
    assert found["stderr_noise"] < 0.5 * found["stderr"]
    assert found["stderr"] == pytest.approx(together, rel=0.02)


def test_another_word_is_refused(pellicle, spectrum_file, scene):
    ran = pellicle("fit", spectrum_file(), *scene, "--uncertainty", "some")
    ran.refused(2, "--uncertainty must be usual or none", "'some'")


def test_every_step_of_a_fit_is_told(pellicle, spectrum_file, scene):
    ran = pellicle("fit", spectrum_file(), *scene, "--verbose")
    sentences = re.findall(r"^ *\d+\.\d\d s  (.*)$", ran.err, re.MULTILINE)
    heads = [re.split(r":| of ", sentence)[0] for sentence in sentences if "oxide.csv" not in sentence]
    names = ("scene", "free", "data", "plan", "scan", "polished", "weights", "status", "time")
    assert tuple(dict.fromkeys(heads)) == names
    assert "oxide.csv: 100 rows used: R from 400 to 796 nm" in ran.err
    assert "scene: from air (exactly 1): index 1.46, 10 to 800 nm, on index 3.9 + 0.02i" in sentences
    assert "free: thickness between 10 and 800 nm" in sentences
    assert any("no noise is given" in sentence for sentence in sentences)
    # 790 nm in steps of at most 400 nm / 1.46 / 8
    assert any(s.startswith("scan: 25 values of thickness, 32.9 nm apart") for s in sentences)
    assert "status: converged" in sentences
    quiet = pellicle("fit", spectrum_file("again.csv"), *scene)
    assert quiet.code == ran.code == 0
    assert not re.search(r"^ *\d+\.\d\d s", quiet.err, re.MULTILINE)


def test_why_a_fit_is_no_answer(pellicle, spectrum_file):
    flags = ("--layer", "1.46", "--substrate", "3.9+0.02j", "--thickness", "10:250")
    ran = pellicle("fit", spectrum_file(), *flags, "-v")
    assert ran.code == 2  # there is no short form
    ran = pellicle("fit", spectrum_file(), *flags, "--noise", "0.002", "--verbose", code=4)
    assert "status: does the scene not explain the data? yes" in ran.err
    assert "its noise is given" in ran.err


def numbers(record):
    return {name: np.array([x["value"], x["stderr"]], float) for name, x in record["parameters"].items()}


@pytest.mark.slow
@pytest.mark.parametrize(
    "flags",
    [
        ("--range", "450:750", "--noise", "0.004", "--loss", "huber", "--tolerance", "1e-4"),
        ("--free", "n", "--bandwidth", "free", "--scale", "free", "--uncertainty", "none"),
    ],
)
def test_of_flags(pellicle, spectrum_file, scene, tmp_path, flags):
    out = tmp_path / "out"
    first = pellicle("fit", spectrum_file(), *scene, *flags, "--json", "--out", out)
    again = pellicle("fit", "--recipe", out / "recipe.toml", "--json")
    assert again.code == first.code
    for name, pair in numbers(first.objects[0]).items():
        np.testing.assert_allclose(numbers(again.objects[0])[name], pair, rtol=1e-9)
    assert again.objects[0]["warnings"] == first.objects[0]["warnings"]


@pytest.mark.slow
def test_of_a_recipe_with_files_and_flags(pellicle, spectrum_file, scene_recipe, tmp_path):
    one, other = spectrum_file("one.csv"), spectrum_file("other.csv", seed=1)
    files = f"path = '{one}'\ninstrument = {{ scale = 'free' }}", f"path = '{other}'\nnoise = 0.01"
    data = "".join(["joint = true", *(f"\n[[data.file]]\n{file}" for file in files)])
    recipe, out = scene_recipe(data, material="'SiO2'", substrate="Si"), tmp_path / "out"
    first = pellicle("fit", "--recipe", recipe, "--range", "450:750", "--json", "--out", out)
    again = pellicle("fit", "--recipe", out / "recipe.toml", "--json")
    assert again.objects[0]["parameters"].keys() == first.objects[0]["parameters"].keys()
    for name, pair in numbers(first.objects[0]).items():
        np.testing.assert_allclose(numbers(again.objects[0])[name], pair, rtol=1e-9)
    tables = tomllib.loads((out / "recipe.toml").read_text())["data"]["file"]
    assert [table["range"] for table in tables] == [[450, 750]] * 2


def test_limits_of_a_specification(pellicle, spectrum_file, scene, tmp_path):
    """300 nm: within 250 to 350, and beyond 310 to 400, which ends with exit code 6."""
    file, out = spectrum_file(), tmp_path / "out"
    (found,) = pellicle(
        "fit", file, *scene, "--spec", "thickness=250:350", "--json", "--out", out, code=0
    ).objects
    assert found["spec"] == json.loads((out / "result.json").read_text())["spec"] == {"thickness": "pass"}
    ran = pellicle("fit", file, *scene, "--spec", "thickness=310:400", code=6)
    assert "thickness: FAIL (310 to 400 nm; fitted 30" in ran.out
    pellicle("fit", file, *scene, "--spec", "width=310:400").refused(3, "the fit has thickness")
    pellicle("fit", file, *scene, "--spec", "thicknes=310:400").refused(2, "did you mean 'thickness'")
    pellicle("fit", file, *scene, "--spec", "thickness").refused(2, "NAME=LO:HI")


def test_a_batch_prints_one_line_a_file(pellicle, spectrum_file, scene):
    files = spectrum_file("one.csv", 250.0), spectrum_file("two.csv", 420.0)
    ran = pellicle("fit", *files, *scene, code=0)
    one, two = ran.out.splitlines()
    assert one.startswith(f"{files[0]}: converged; thickness 2")
    assert two.endswith("nm (95 %)")
    assert f"{files[1]}: signal unit" not in ran.err  # that of the first file is said
