"""The measurements that come with the repository: made as they say, and their fits find the truth."""

import csv
import re
import tomllib
from pathlib import Path

import pytest

import pellicle as pl
from pellicle.recipes.read import read_recipe

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "measurements"
RECIPES = sorted((FOLDER / "recipes").glob("*.toml"))


@pytest.fixture(scope="module")
def script(load_script):
    return load_script("scripts/make_measurements.py")


def test_there_are_hematite_cadmium_sulfide_and_gold():
    assert {recipe.stem.split("_")[0] for recipe in RECIPES} >= {"hematite", "cds", "gold"}


def test_every_file_is_what_its_recipe_and_seed_give(script, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("PELLICLE_CACHE", "off")
    (tmp_path / "INDEX.csv").write_text((FOLDER / "INDEX.csv").read_text())
    script.main(tmp_path)
    made, kept = ({path.name: _without_version(path) for path in x.glob("*.csv")} for x in (tmp_path, FOLDER))
    assert made == kept


def _without_version(path):
    return re.sub(r"pellicle \d\S*", "pellicle", path.read_text())


def test_the_index_lists_every_file():
    with (FOLDER / "INDEX.csv").open() as text:
        rows = list(csv.DictReader(text))
    files = {*FOLDER.glob("*.csv"), *FOLDER.glob("ellipsometry/*.dat"), *FOLDER.glob("wvase/*.txt")}
    files.remove(FOLDER / "INDEX.csv")
    assert {row["file"] for row in rows} == {path.relative_to(FOLDER).as_posix() for path in files}
    for row in rows:
        if row["kind"] in ("measured", "computed"):
            assert row["source"].startswith("refellips 0.0.6")
            assert row["licence"] == "BSD-3-Clause"
            continue
        assert row["kind"] == "synthetic"
        assert (FOLDER / row["recipe"]).is_file()
        head = (FOLDER / row["file"]).read_text().split("wavelength_nm")[0]
        assert "SYNTHETIC" in head
        assert f"recipe {Path(row['recipe']).name}, seed {row['seed']}" in head
        assert row["truth"].replace("thickness", "thickness =") in head


def fitted(recipe: Path):
    """The recipe's fit of its own file, and the true thickness."""
    found = read_recipe(recipe)
    (layer,) = tomllib.loads(recipe.read_text())["scene"]["layer"]
    noise = found.tables.data.noise
    (file,) = found.files
    return pl.fit(pl.read_spectrum(file, noise=noise), found.scene()), layer["thickness"]["value"]


@pytest.mark.parametrize(
    "recipe",
    [
        pytest.param(r, marks=[pytest.mark.slow] if "gold" in r.stem else [], id=r.stem)  # compiles alone
        for r in RECIPES
        if r.stem != "gold_on_glass_300nm"
    ],
)
def test_the_fit_finds_the_truth(recipe):
    found, truth = fitted(recipe)
    assert found.status == "converged"
    assert abs(found["thickness"].value - truth) < 4 * found["thickness"].stderr_noise
    assert found["thickness"].stderr < 0.02 * truth
    assert 0.5 < found.chi2_reduced < 1.5


def test_opaque_gold_gets_a_lower_limit_and_no_error():
    found, truth = fitted(FOLDER / "recipes" / "gold_on_glass_300nm.toml")
    thickness = found["thickness"]
    assert found.status == "not-identifiable"
    assert thickness.stderr == float("inf")
    assert 50 < thickness.lower_limit < truth
    assert thickness.upper_limit is None
