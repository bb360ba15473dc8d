"""The colours of a chart are those of the film, whatever else the scene holds."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.colour import delta_e2000, film_colour
from pellicle.errors import UsageError
from pellicle.simulation.colours import interference_colours
from tests.film_recipes import film_recipe

NM, DEGREES = np.linspace(0.0, 600.0, 7), np.array([0.0, 30.0, 60.0])
FREE = pl.Free(0, 600)


@pytest.fixture(scope="module")
def oxide():
    scene = pl.Scene(pl.Layer("SiO2", FREE, name="oxide"), "Si")
    return scene, interference_colours(scene, NM, DEGREES)


@pytest.mark.slow  # compiles for 3 s
def test_one_layer_is_the_film(oxide):
    """Against the colour package's own film, by other bands."""
    layer, substrate = pl.material("SiO2"), pl.material("Si")
    thickness, angle = np.meshgrid(NM, DEGREES)
    own = film_colour(thickness, layer, substrate, angle=angle, method="uniform-200")
    assert oxide[1].xyz.shape == (3, 7, 3)
    assert np.max(np.asarray(delta_e2000(oxide[1].lab, own.lab))) < 0.1


@pytest.mark.slow
def test_a_stack_varies_the_layer_that_is_named(oxide):
    """An oxide on nothing at all is the oxide; a fixed layer of no thickness is chosen by name only."""
    nothing = pl.Layer(2.0, 0.0, name="nothing")
    stack = pl.Scene([pl.Layer("SiO2", 300.0, name="oxide"), nothing], "Si")
    by_name = interference_colours(stack, NM, DEGREES, "oxide")
    np.testing.assert_allclose(by_name.xyz, oxide[1].xyz, atol=1e-9)
    with pytest.raises(UsageError, match="no layer 'gold' to vary; known: oxide, nothing"):
        interference_colours(stack, NM, DEGREES, "gold")


def test_what_has_no_colour():
    with pytest.raises(UsageError, match="ellipsometry has no colour"):
        interference_colours(pl.Scene(pl.Layer(1.46, FREE), "Si", light=pl.Light(signal="psi-delta")), NM, NM)


@pytest.fixture
def recipe(write):
    return write(film_recipe("", 'material = "SiO2"\nthickness = 300', substrate='"Si"'), "oxide.toml")


def test_the_command_draws_it(pellicle, recipe, tmp_path):
    out = tmp_path / "oxide.png"
    ran = pellicle("chart", recipe, "--out", out)
    assert (ran.code, ran.out) == (0, "")
    assert out.read_bytes().startswith(b"\x89PNG")
    assert "0 to 600 nm, 0 to 80 degrees" in ran.err
    for flags, words in (
        (("--out", out), "exists"),
        (("--out", tmp_path / "a.txt"), "--out"),
        (("--out", tmp_path / "a.png", "--thickness", "9:3"), "--thickness is reversed"),
        (("--out", tmp_path / "a.png", "--angle", "0:95"), "--angle must lie in 0 to 90"),
        (("--out", tmp_path / "a.png", "--illuminant", "F2"), "illuminant 'F2' is unknown"),
    ):
        pellicle("chart", recipe, *flags).refused(3 if "illuminant" in words else 2, words)


def test_a_chart_says_what_varies_and_what_is_kept(pellicle, write, tmp_path):
    layers = 'name = "upper"\nmaterial = 1.5\nthickness = { lower = 1, upper = 400 }\n[[scene.layer]]\n' + (
        'name = "lower"\nmaterial = 2.0\nthickness = { value = 80, lower = 1, upper = 300 }'
    )
    ran = pellicle("chart", write(film_recipe("", layers), "two.toml"), "--out", tmp_path / "a.png")
    assert "upper.thickness from 1 to 400 nm" in ran.err
    assert "kept are lower.thickness = 80 nm" in ran.err


def test_a_chart_has_the_lamp_and_the_observer_of_its_recipe(pellicle, write, tmp_path, monkeypatch):
    from pellicle.reporting import colour_figures

    drawn = []
    monkeypatch.setattr(colour_figures, "chart", lambda *args, **how: drawn.append(how) or 0.0)
    layer = 'material = "SiO2"\nthickness = 300'
    camera = '[camera]\nilluminant = "A"\nobserver = "1964"'
    path = write(film_recipe('signal = "srgb"', layer, substrate='"Si"', end=camera), "lit.toml")
    for flags in ((), ("--illuminant", "E")):
        pellicle("chart", path, "--out", tmp_path / "a.png", *flags)
    assert [(how["illuminant"], how["observer"]) for how in drawn] == [("A", "1964"), ("E", "1964")]


def test_nothing_is_written_where_one_file_of_a_chart_exists(pellicle, recipe, tmp_path):
    image, table = tmp_path / "a.png", tmp_path / "a.csv"
    image.write_text("mine")
    pellicle("chart", recipe, "--out", image, "--invert", table).refused(2, "choose another --out")
    assert not table.exists()
    table.write_text("mine")
    words = pellicle("chart", recipe, "--out", tmp_path / "b.png", "--invert", table)
    words.refused(2, "choose another --invert")
    assert table.read_text() == "mine"


def test_views_that_a_recipe_does_not_have(pellicle, recipe, write, tmp_path):
    surface = write('[scene.surface]\nmodel = "microfacet-film"\n[data]\nsignal = "brdf"\n', "surface.toml")
    for path, flags, words in (
        (surface, ("--view", "balls"), "are for films"),
        (recipe, ("--view", "bubble"), "must be above 0"),
        (recipe, ("--view", "bubble", "--thickness", "50:500"), "same medium on both sides"),
        (recipe, ("--view", "balls", "--invert", "a.csv"), "--invert belongs to a chart"),
        (recipe, ("--view", "methods", "--illuminant", "A"), "under D65"),
    ):
        pellicle("chart", path, "--out", tmp_path / "a.png", *flags).refused(2, words)


@pytest.mark.slow
def test_inverse_of_a_chart(pellicle, recipe, tmp_path):
    """Every likely thickness has the colour of its row, by the film's own colours; probabilities add up."""
    out, table = tmp_path / "oxide.png", tmp_path / "inverse.csv"
    ran = pellicle("chart", recipe, "--out", out, "--thickness", "0:250", "--invert", table)
    assert (ran.code, ran.out) == (0, "")
    assert "% of the colours have more than one" in ran.err
    rows = [line.split(",") for line in table.read_text().splitlines() if not line.startswith("#")]
    assert rows[0] == ["hex", "red", "green", "blue", "thickness_nm", "stderr_nm", "probability", "delta_e"]
    columns = (slice(1, 4), 4, 6, 7)
    rgb, nm, probability, delta_e = (np.array([r[i] for r in rows[1:]], float) for i in columns)
    own = film_colour(nm, pl.material("SiO2"), pl.material("Si"), method="uniform-64")
    sure = probability > 0.2
    assert np.max(np.abs(255 * np.asarray(own.srgb) - rgb)[sure]) < 6  # four times the noise
    assert np.max(delta_e[sure]) < 5
    for colour in {row[0] for row in rows[1:]}:
        assert sum(p for p, r in zip(probability, rows[1:], strict=True) if r[0] == colour) > 0.99
    expected = film_colour(100.0, pl.material("SiO2"), pl.material("Si"), method="uniform-64").srgb
    near = np.argmin(np.abs(rgb - 255 * np.asarray(expected)).sum(axis=1))
    assert abs(nm[near] - 100) < 3
    pellicle("chart", recipe, "--out", tmp_path / "b.png", "--invert", table).refused(2, "exists")
