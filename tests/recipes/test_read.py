"""Reading recipes: both kinds, and files that are no recipe."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.errors import DataError
from pellicle.recipes.read import FilmRecipe, SurfaceRecipe

FILM = '[data]\nfiles = ["oxide.csv"]\n[scene]\nsubstrate = "Si"\n[[scene.layer]]\nmaterial = "SiO2"\n'
FILM += "thickness = { lower = 10, upper = 3000 }\n"
SURFACE = '[data]\nfiles = ["paint.csv"]\nnoise = 0.1\n[scene.surface]\nmodel = "microfacet-film"\n'
SURFACE += "thickness = { lower = 0, upper = 500 }\nn = [1.5, 1.6, 1.7]\n"


def test_a_film_and_a_surface(write, tmp_path):
    film = pl.read_recipe(write(FILM))
    assert isinstance(film, FilmRecipe)
    assert isinstance(film.scene(), pl.Scene)
    assert film.files == [str(tmp_path / "oxide.csv")]
    surface = pl.read_recipe(str(write(SURFACE)))
    assert isinstance(surface, SurfaceRecipe)
    assert isinstance(surface.scene(), pl.Surface)
    assert surface.files == [str(tmp_path / "paint.csv")]
    np.testing.assert_array_equal(surface.scene().fixed_numbers()["n"], [1.5, 1.6, 1.7])


def test_the_signal_alone_makes_a_surface(write):
    with pytest.raises(DataError, match=r"scene\.surface is missing"):
        pl.read_recipe(write('[data]\nsignal = "brdf"\n[scene]\n'))


def test_a_byte_order_mark(write):
    assert pl.read_recipe(write(b"\xef\xbb\xbf" + FILM.encode())).scene().layers[0].thickness.upper == 3000


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"\xff\xfe\x00", "is not UTF-8 text, and a recipe is a TOML file; data files are arguments"),
        ("[scene\n", "is not TOML, as a recipe must be: "),
        ("a = " + "[" * 5000, "is not a recipe: its brackets are nested too deeply"),
        (SURFACE.replace("model", "modle"), "scene.surface.model is missing"),
        (SURFACE.replace("noise", "noize"), "unknown key 'data.noize' (did you mean 'noise'?)"),
        (
            FILM + "[scene.instrument]\nscale = 1\n",
            "'scene.instrument': write [instrument], a table of its own",
        ),
        (FILM + "[instrument]\nroughness = 1\n", "'instrument.roughness': it stands under [[scene.layer]]"),
        (FILM.replace("[scene]", "[scene]\nscale = 1"), "'scene.scale': it stands under [instrument]"),
        (SURFACE.replace("[data]", "[Data]"), "unknown key 'Data' (did you mean 'data'?)"),
    ],
)
def test_refused_in_one_sentence(refused, text, message):
    refused(text, message)


def test_errors_of_a_surface_name_the_recipe(refused):
    refused(SURFACE.replace("thickness", "thicknes"), "scene.surface: microfacet-film has no 'thicknes'")


def test_files_that_are_no_recipe(tmp_path, refuses):
    refuses(DataError, "is a folder; give the recipe's TOML file", pl.read_recipe, tmp_path)
    refuses(DataError, r"cannot be read \(No such file", pl.read_recipe, tmp_path / "gone.toml")


def test_mixtures_nested_too_deeply(write, refuses):
    host = '"air"'
    for _ in range(500):
        host = f'{{ mix = "linear", host = {host}, inclusion = "air", fraction = 0.5 }}'
    path = write(FILM.replace('"SiO2"', host))
    refuses(DataError, "nested too deeply", lambda: pl.read_recipe(path).scene())


def test_the_base_of_a_surface_is_fixed(write):
    """By a constant index as by any other medium, once its numbers are fixed."""
    surface = SURFACE + 'base = { model = "constant", n = 2.9, k = 3.1 }\n'
    fixed = pl.read_recipe(write(surface)).scene().fixed_numbers()
    assert (fixed["base_n"].tolist(), fixed["base_k"].tolist()) == ([2.9] * 3, [3.1] * 3)
    metal = pl.read_recipe(write(SURFACE + 'base = "Fe"\n')).scene().fixed_numbers()
    assert np.all((metal["base_n"] > 2) & (metal["base_n"] < 3.2) & (metal["base_k"] > 2))
    with pytest.raises(DataError, match=r"scene\.surface: base cannot be free: give base_n and base_k"):
        pl.read_recipe(write(surface.replace("3.1", "{ lower = 0, upper = 4 }"))).scene()


@pytest.mark.parametrize(
    ("angle", "said"),
    [
        ('"x"', r"data\.angle: .* a valid number"),
        ("95", r"data\.angle: .* 0 to 89.9 degrees, got 95"),
        ("[10, 95]", r"data\.angle: .* 0 to 89.9 degrees, got 95"),
        ('[10, "x"]', r"data\.angle\.1: .* a valid number, .*got 'x'"),
        ("[]", r"data\.angle: .* at least 1 item"),
    ],
)
def test_wrong_angles_are_named_without_the_types_that_were_tried(write, angle, said, refuses):
    refuses(DataError, said, pl.read_recipe, write(FILM.replace("[scene]", f"angle = {angle}\n[scene]")))


def test_a_recipe_has_a_limit_of_layers_in_words(tmp_path, refuses):
    path = tmp_path / "many.toml"
    path.write_text('[scene]\nsubstrate = "Si"\n' + "[[scene.layer]]\nmaterial = 1.5\nthickness = 9\n" * 501)
    refuses(DataError, r"501 layers.*at most 500.*\[\[scene.group\]\] with repeat", pl.read_recipe, path)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('substrate = "Si"', "substrate = Si", r'line 4: .*quotation marks: write substrate = "Si"'),
        ('= "Si"', '= "Si"\nlayer = "SiO2"', r"line 6: \[\[scene.layer\]\] defines again what a line above"),
        ('= "Si"', '= "Si"\n[scene]', r"line 5: \[scene\] defines again"),
        ("[[scene.layer]]", "[scene.layer]", r"write \[\[scene.layer\]\] with two brackets"),
        ("lower = 10, upper", "min = 10, max", "thickness.min': write lower"),
        ('"SiO2"', '{ mixture = "bruggeman", parts = [] }', "key model, mix .*not mixture, parts"),
        ('["oxide.csv"]', '"oxide.csv"', r'write files = \["oxide.csv"\]'),
    ],
)
def test_what_is_written_otherwise_elsewhere_is_named(write, old, new, said):
    with pytest.raises(DataError, match=said):
        pl.read_recipe(write(FILM.replace(old, new)))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("10 to 800", r"thickness: '10 to 800' is a range: write { lower = 10, upper = 800 }"),
        ("10-800", "thickness: .*write { lower = 10, upper = 800 }"),
        ("2 apples", "thickness: '2 apples' is neither a number nor an expression"),
    ],
)
def test_a_text_in_place_of_bounds_is_named(write, text, said):
    with pytest.raises(DataError, match=said):
        pl.read_recipe(write(FILM.replace("{ lower = 10, upper = 3000 }", f'"{text}"'))).scene()


def test_a_table_in_place_of_a_recipe_is_named(write, refuses):
    refuses(DataError, "is a table, and a recipe is a TOML", pl.read_recipe, write("nm,R\n400,1\n", "a.csv"))
