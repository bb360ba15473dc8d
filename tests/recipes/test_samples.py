"""Recipes of several samples: what each has of its own, what is shared, and errors in one sentence."""

import tomllib
from pathlib import Path
from typing import Any

import pytest

import pellicle as pl
from pellicle.errors import DataError, UsageError
from pellicle.fitting.film.samples import joined
from pellicle.recipes.read import FilmRecipe, checked
from pellicle.recipes.write import samples_text

HEAD = """
[scene]
substrate = "Si"
[[scene.layer]]
name = "film"
material = { model = "cauchy", A = { lower = 1.3, upper = 2.2 }, B = { lower = 0, upper = 3e4 } }
thickness = { lower = 20, upper = 900 }
"""
TWO = """
[[sample]]
name = "thin"
files = ["thin.csv"]
film.thickness = { lower = 50, upper = 200 }
[[sample]]
name = "thick"
files = ["thick.csv"]
signal = "psi-delta"
angle = 70
substrate = "BK7"
[[sample.layer]]
name = "film"
thickness = 400
[[sample.layer]]
name = "cap"
after = 0
material = "SiO2"
thickness = { lower = 1, upper = 9 }
"""


def recipe(tmp_path: Path, text: str) -> FilmRecipe:
    path = tmp_path / "recipe.toml"
    path.write_text(HEAD + text, encoding="utf-8")
    read = pl.read_recipe(path)
    assert isinstance(read, FilmRecipe)
    return read


def test_each_sample_has_its_layers_and_shares_the_rest(tmp_path):
    read = recipe(tmp_path, TWO)
    thin, thick = (one.scene() for one in read.each)
    assert [Path(file).name for file in read.files] == ["thin.csv", "thick.csv"]
    assert [layer.name for layer in thick.layers] == ["cap", "film"]
    assert (thin.layers[0].thickness.upper, thick.layers[1].thickness) == (200.0, 400.0)
    assert (thin.light.signal, thick.light.signal, thick.light.angle) == ("R", "psi-delta", 70.0)
    assert [s.sample.shared for s in joined([thin, thick], ["", ""], None)] == [("film.A", "film.B")] * 2


def test_the_kept_recipe_is_the_same(tmp_path):
    """Scenes and files are those of the recipe, from another folder."""
    read, folder = recipe(tmp_path, TWO), tmp_path / "deep" / "out"
    folder.mkdir(parents=True)
    (folder / "recipe.toml").write_text(samples_text(read, {"noise": 0.01}, {}, folder), encoding="utf-8")
    kept = pl.read_recipe(folder / "recipe.toml")
    assert isinstance(kept, FilmRecipe)
    assert [Path(x).resolve() for x in kept.files] == [Path(x).resolve() for x in read.files]
    assert [one.scene() for one in kept.each] == [one.scene() for one in read.each]
    assert [one.reading["noise"] for one in kept.each] == [0.01, 0.01]


def test_the_kept_recipe_shares_the_same_numbers(tmp_path):
    path = Path(__file__).parents[2] / "docs" / "examples" / "mica_flakes.toml"
    read = pl.read_recipe(path)
    assert isinstance(read, FilmRecipe)
    kept = tomllib.loads(samples_text(read, {}, {}, tmp_path))
    assert kept["shared"] == ["instrument.numerical_aperture", "instrument.stray_light"]
    assert checked(kept, str(tmp_path / "recipe.toml")).tables.shared == kept["shared"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[[sample]]\nname = "a"\n', "sample a has no files"),
        ('[[sample]]\nname = "a"\nfiles = ["a.csv"]\n' * 2, "recipe.toml: two samples have the name"),
        ('[data]\nfiles = ["b.csv"]\n[[sample]]\nname = "a"\nfiles = ["a.csv"]\n', "exclude each other"),
        (
            '[[sample]]\nname = "a"\nfiles = ["a.csv"]\nfilm.thicknes = 3\n',
            "'film.thicknes' is no key and no",
        ),
        ('[[sample]]\nname = "a"\nfiles = ["a.csv"]\nwithout = ["fim"]\n', "no layer of the scene is named"),
        (
            '[[sample]]\nname = "a"\nfiles = ["a.csv"]\n[[sample.layer]]\nname = "new"\nthickness = 3\n',
            "sample a: layer new: a layer has a material",
        ),
        (
            '[[sample]]\nname = "a"\nfiles = ["a.csv"]\n[[sample.layer]]\nname = "new"\nafter = 9\n'
            'material = "SiO2"\nthickness = 3\n',
            "layer new: after: 9 layers cannot lie above it: there are 1",
        ),
    ],
)
def test_errors_are_one_sentence(tmp_path, text, said, refuses):
    refuses(DataError, said, lambda: [one.scene() for one in recipe(tmp_path, text).each])


def test_shared_names_of_the_instrument():
    """Each sample has them, under one name; a wrong one is refused."""
    loaded = tomllib.loads(HEAD + TWO) | {"instrument": {"bandwidth": {"lower": 1, "upper": 9}}}
    read: Any = checked(loaded | {"shared": ["instrument.bandwidth"]}, "recipe.toml")
    of_all = [one.scene().sample.shared for one in read.samples]
    assert all("instrument.bandwidth" in shared for shared in of_all)
    with pytest.raises(UsageError, match=r"did you mean 'instrument\.bandwidth'"):
        checked(loaded | {"shared": ["instrument.bandwith"]}, "recipe.toml")


def test_one_scene_of_several_samples_is_refused(tmp_path, refuses):
    refuses(DataError, r"has \[\[sample\]\] tables \(thin, thick\)", recipe(tmp_path, TWO).scene)


def test_the_example():
    examples = Path(__file__).parents[2] / "docs" / "examples"
    read = pl.read_recipe(examples / "samples.toml")
    assert isinstance(read, FilmRecipe)
    assert len(tomllib.loads((examples / "samples.toml").read_text("utf-8"))["sample"]) == len(read.each) == 3
    [shared] = {s.sample.shared for s in joined([one.scene() for one in read.each], [""] * 3, None)}
    assert shared == ("film.A", "film.B")
