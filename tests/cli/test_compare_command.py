"""`pellicle compare`: which recipe the data call for, against criteria computed by hand."""

import importlib
import math

import pytest

from pellicle.files import new_folder

CAUCHY = "{ model = 'cauchy', A = { lower = 1.3, upper = 1.7 }, B = 0.0 }"


@pytest.mark.slow
def test_data_that_call_for_one_more_parameter(pellicle, scene_recipe, spectrum_file, tmp_path):
    film = spectrum_file(index=1.52)
    a, b = scene_recipe(name="a.toml"), scene_recipe(name="b.toml", material=CAUCHY)
    flags = ("--recipe", a, "--recipe", b, "--json", "--out", tmp_path / "out")
    [again] = pellicle("compare", film, *flags, code=0).objects
    assert (again["schema"], again["best"]) == ("pellicle.compare/1", "b.toml")
    assert again["verdict"].startswith("b.toml is better than a.toml by Δ ln Z")
    assert again["verdict"].endswith("the data strongly favour A.")
    first, second = again["recipes"]
    # the price of each free number
    points, size = again["effective_points"], 100
    for found, free in ((first, 1), (second, 2)):
        assert found["free"] == free
        # of the points those count that effects leave, and at least e², the price in AIC
        assert -1e-9 < found["bic"] - found["aic"] <= free * (math.log(points) - 2) + 1e-9
    assert 0.5 * size < points <= size
    assert second["delta_bic"] == second["delta_log_evidence"] == 0
    assert first["delta_log_evidence"] < -5
    assert first["probability"] < 0.01
    assert first["delta_bic"] > 6  # an index of 4 % more is eight uncertainties of it
    assert (tmp_path / "out" / "a" / "result.json").exists()
    text = (tmp_path / "out" / "report.txt").read_text()
    assert text.startswith("[[Verdict]]\n    b.toml is better")
    row, _ = [line for line in text.splitlines() if line.strip().startswith("* ")]
    assert row.split()[:5] == ["*", "b.toml", "0.0", "0.0", "0.0"]


@pytest.mark.slow  # compiles a film of Cauchy
def test_data_that_do_not(pellicle, scene_recipe, spectrum_file):
    """The film is 1.46: a free index gains next to nothing, and costs ln n."""
    path = spectrum_file()
    a, b = scene_recipe(name="a.toml"), scene_recipe(name="b.toml", material=CAUCHY)
    [found] = pellicle("compare", path, "--recipe", a, "--recipe", b, "--json").objects
    assert found["best"] == "a.toml"
    assert 0 < found["recipes"][1]["delta_bic"] <= math.log(100) + 0.1
    assert "A is not needed" in found["verdict"] or "prefer a.toml" in found["verdict"]


def test_bad_input_in_one_sentence_before_a_fit(pellicle, scene_recipe, spectrum_file, tmp_path, monkeypatch):
    monkeypatch.setattr("pellicle.api.fits.fitted", lambda *given, **how: pytest.fail("fitted"))
    path, a = spectrum_file(), scene_recipe(name="a.toml")
    narrow = scene_recipe("range = [402, 800]", "narrow.toml")  # 99 points of 100
    robust = scene_recipe('loss = "huber"', "robust.toml")
    for recipes, code, words in (
        ([a], 2, "two recipes or more"),
        ([a, a], 2, "given twice"),
        ([a, tmp_path / "none.toml"], 3, "none.toml: cannot be read"),
        ([a, narrow], 3, "a.toml and narrow.toml do not use the same points"),
        ([a, robust], 3, "robust.toml: a comparison needs least squares"),
    ):
        flags = [word for each in recipes for word in ("--recipe", each)]
        pellicle("compare", path, *flags).refused(code, words)


def test_each_file_has_a_folder_of_its_own(pellicle, scene_recipe, spectrum_file, tmp_path, monkeypatch):
    """Files of one name too; and the same command may be repeated."""
    made = []

    def compared(candidates, position, paths, folder, *how):
        made.append(new_folder(folder).name)
        return 0

    monkeypatch.setattr(importlib.import_module("pellicle.cli.fit"), "_compare", compared)
    (tmp_path / "other").mkdir()
    files = spectrum_file("film.csv"), spectrum_file("other/film.csv")
    recipes = [word for name in ("a.toml", "b.toml") for word in ("--recipe", scene_recipe(name=name))]
    for _ in range(2):
        pellicle("compare", *files, *recipes, "--out", tmp_path / "out", code=0)
    assert made == ["film", "film-2"] * 2


def test_recipes_are_compared_where_all_their_media_are_known(
    pellicle, scene_recipe, spectrum_file, monkeypatch
):
    """PMMA is known from 420 nm on: a film of silica is compared with it from there."""
    seen = {}

    def check(measured):
        seen.update(measured)
        raise ValueError("enough")

    monkeypatch.setattr("pellicle.fitting.comparison.check_same", check)
    a, b = scene_recipe(name="a.toml"), scene_recipe(name="b.toml", material='"PMMA"')
    told = pellicle("compare", spectrum_file(), "--recipe", a, "--recipe", b, code=3).err
    assert [x.wavelength[0] for [x] in seen.values()] == [420, 420]
    assert told.count("points kept") == 1
