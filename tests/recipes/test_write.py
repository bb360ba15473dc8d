"""Written recipes read back as the same scene, and what they cannot express is refused by name."""

import tomllib
from itertools import product
from pathlib import Path

import equinox as eqx
import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.cli.reading import measured_scene
from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.empirical import WithExtinction
from pellicle.recipes.media import medium
from pellicle.recipes.python_text import python_text
from pellicle.recipes.read import checked
from pellicle.recipes.write import recipe_text
from pellicle.scene.instrument import Drift

ROOT = Path(__file__).parents[2]
PATTERNS = ("docs/**/*.toml", "fits/**/recipe.toml", "measurements/**/*.toml", "benchmarks/**/*.toml")
# of several scenes; tests are in recipes/test_samples.py and signals/test_mica.py
SEVERAL = {ROOT / "docs/examples" / name for name in ("samples.toml", "mica_flakes.toml")}
RECIPES = sorted({path for pattern in PATTERNS for path in ROOT.glob(pattern)} - SEVERAL)


def equal(one, other) -> bool:
    """Equality without the code under test: Equinox for films, the numbers for surfaces."""
    if isinstance(one, pl.Surface):
        media = [(one.film, other.film), (one.base, other.base)]
        same = all(x is y is None or eqx.tree_equal(x, y) for x, y in media)
        return same and one.free_numbers() == other.free_numbers() and one.model == other.model
    return bool(eqx.tree_equal(one, other))


def test_there_are_recipes_of_all_kinds():
    assert len(RECIPES) > 45


@pytest.mark.parametrize("path", RECIPES, ids=lambda path: str(path.relative_to(ROOT)))
def test_recipe_reads_back_as_the_same_scene(path):
    recipe = pl.read_recipe(path)
    for one in [recipe, *getattr(recipe, "each", [])]:
        scene = one.scene()
        new = path.parent / "written-by-test.toml"  # never made: only its folder counts
        text = recipe_text(scene, new.parent)
        again = _parsed(text, new)
        assert equal(scene, again)
        if isinstance(scene, pl.Surface):
            numbers, others = scene.start_numbers(), again.start_numbers()
            assert numbers.keys() == others.keys()
            assert all(np.array_equal(numbers[key], others[key]) for key in numbers)


def _parsed(text, path):
    return checked(tomllib.loads(text), str(path)).scene()


@pytest.mark.parametrize("path", RECIPES[::3], ids=lambda path: str(path.relative_to(ROOT)))
def test_python_expression_builds_the_same_scene(path):
    scene = pl.read_recipe(path).scene()
    built = eval(python_text(scene), {"pl": pl, "np": np})
    if isinstance(scene, pl.Scene):
        assert recipe_text(built, path.parent) == recipe_text(scene, path.parent)
    else:
        assert equal(scene, built)


FREE, LOG = pl.Free(1.3, 1.7, start=1.4), pl.Free(1.0, 9.0, prior=pl.priors.LogUniform())
D = pl.dispersion
MEDIA = {
    "complex": 2.9 + 0.1j,
    "constant": D.Constant(FREE, pl.Free(0.0, 0.5, prior=pl.priors.HalfNormal(0.1))),
    "cauchy": D.Cauchy(pl.Free(1.3, 1.7, prior=pl.priors.Normal(1.5, 0.1)), 3000.0),
    "urbach": D.CauchyUrbach(1.5, 1e3, 0.0, pl.Free(0.0, 1.0), 0.3),
    "sellmeier": D.Sellmeier((1.1, pl.Free(0.0, 1.0)), (8e3, 2e4)),
    "tauc": D.Oscillators(2.0, (D.TaucLorentz(pl.Free(0.0, 200.0), 4.0, 2.0, 1.5),)),
    "sum": D.Oscillators(pl.Free(1.0, 3.0), (D.Lorentz(1.0, 4.0, 0.5), D.Drude(LOG, 0.1))),
    "spline": D.Spline((400.0, 500.0, 700.0), (1.5, FREE, 1.4), (0.0, 0.1, pl.Free(0.0, 1.0))),
    "kramers": D.KramersKronigSpline((400.0, 600.0), (0.1, 0.2), 1.6),
    "mixture": pl.mixing.Looyenga(pl.medium("SiO2"), D.Cauchy(1.6, 4e3), pl.Free(0.0, 1.0)),
    "graded": pl.Graded("SiO2", 2.0, pl.profile.Spline([0.1, pl.Free(0.0, 1.0), 0.9]), "linear"),
    "uniaxial": pl.Anisotropic("SiO2", 2.6, axis=(30.0, pl.Free(0.0, 90.0))),
    "biaxial": pl.Anisotropic(x=1.5, y=1.6, z=1.7, axis=(10.0, 20.0, 30.0)),
}


@pytest.mark.parametrize("name", MEDIA)
def test_medium_reads_back(name, tmp_path):
    scene = pl.Scene(pl.Layer(MEDIA[name], pl.Free(10.0, 500.0), "film"), "Si")
    path = tmp_path / "film.toml"
    pl.write_recipe(scene, path)
    assert eqx.tree_equal(pl.read_recipe(path).scene(), scene)
    assert recipe_text(eval(python_text(scene), {"pl": pl}), tmp_path) == path.read_text()


def test_several_angles_read_back(tmp_path, write):
    light = pl.Light(angle=[65, 70, 75], signal="psi-delta", azimuth=[0, 45])
    scene = pl.Scene(pl.Layer("SiO2", 100.0), "Si", light=light)
    path = write(recipe_text(scene, tmp_path, wavelength=np.array([400.0, 500.0, 633.0])), "film.toml")
    recipe = pl.read_recipe(path)
    assert eqx.tree_equal(recipe.scene(), scene)
    seen, nm = measured_scene(recipe)
    rows = list(zip(seen.light.angle, seen.light.azimuth, nm, strict=True))
    assert rows == list(product((65, 70, 75), (0, 45), (400, 500, 633)))


ARRAYS = {
    "np.linspace(1.0, 2.0, 3)": [1, 1.5, 2],
    "np.array([633.0])": [633],
    "np.array([1.0, 2.0, 4.0])": [1, 2, 4],
    "np.repeat([65.0, 70.0], 3)": [65] * 3 + [70] * 3,
    "np.repeat([5.0], 2)": [5, 5],
    "np.array([1.0, 1.0, 2.0, 2.0, 3.0])": [1, 1, 2, 2, 3],
    "np.tile(np.linspace(1.0, 3.0, 3), 2)": [1, 2, 3] * 2,
    "np.tile(np.array([1.0, 2.0, 4.0]), 2)": [1, 2, 4] * 2,
    "np.array([1.0, 2.0, 4.0, 1.0])": [1, 2, 4, 1],
}


@pytest.mark.parametrize("text", ARRAYS)
def test_an_array_is_written_in_short(text):
    assert python_text(np.array(ARRAYS[text], float)) == text
    assert eval(text, {"np": np}).tolist() == ARRAYS[text]


def test_every_part_of_a_scene_reads_back(tmp_path):
    (tmp_path / "own.csv").write_text("wavelength_nm,n,k\n300,1.5,0.1\n900,1.4,0.0\n")
    scene = pl.Scene(
        [
            pl.Layer(str(tmp_path / "own.csv"), 20.0, 'a "quoted" name é', 2.0, pl.Free(0.0, 9.0), 0.02),
            pl.Interface(4.0, 3, "linear", "between"),
            pl.Layer(1.7, 300.0),
            pl.Plate("BK7", 2.5, "glass"),
            pl.Layer("SiO2", pl.Free(1.0, 5.0, start=2.0), roughness=1.0),
        ],
        pl.Substrate(1.52, back="air", plate_mm=0.7, roughness=3.0),
        ambient="water",
        light=pl.Light(angle=pl.Free(50.0, 70.0), signal="R", polarisation="s"),
        instrument=pl.Instrument("slow", 0.01, pl.Free(0.0, 9.0), angle_spread=2.0, wavelength_shift=-0.3),
        uncertainty=pl.Uncertainty(index=0.0, psi=0.2, interlayer=0.0),
    )
    path = tmp_path / "film.toml"
    pl.write_recipe(scene, path, files=[tmp_path / "data.csv"])
    recipe = pl.read_recipe(path)
    assert eqx.tree_equal(recipe.scene(), scene)
    assert recipe.files == [str(tmp_path / "data.csv")]
    assert 'material = "own.csv"' in path.read_text()  # relative to the recipe


def test_wavelengths_stand_in_the_data(tmp_path):
    film = pl.Layer("SiO2", 100.0)
    even = pl.Scene(film, "Si", light=pl.Light(np.arange(400.0, 801.0, 2.0)))
    grid = pl.read_recipe(_written(even, tmp_path / "even.toml")).tables.data.wavelengths
    assert (grid.start, grid.stop, grid.step) == (400.0, 800.0, 2.0)
    odd = pl.Scene(film, "Si", light=pl.Light(np.array([400.0, 500.0, 700.0])))
    assert pl.read_recipe(_written(odd, tmp_path / "odd.toml")).tables.data.wavelengths == [400, 500, 700]


def _written(scene, path):
    pl.write_recipe(scene, path)
    return path


def test_flags_that_free_by_default_read_back():
    for word, free in (("cauchy", []), ("SiO2", ["n", "k"]), ("1.46", ["n"]), ("spline(400,600,800)", [])):
        scene = pl.Scene(pl.Layer(medium(word, free), 100.0), "Si")
        text = recipe_text(scene)
        assert eqx.tree_equal(_parsed(text, Path("x.toml")), scene), text


def test_a_scene_of_flags_reads_back_after_jax_is_set_to_float64():
    """A command parses its flags before that, and writes the recipe after it."""
    with jax.enable_x64(False):
        scene = pl.Scene(pl.Layer(medium("SiO2", ["n"]), 100.0), "Si")
    with jax.enable_x64(True):
        assert eqx.tree_equal(_parsed(recipe_text(scene), Path("x.toml")), scene)


class _Own(AbstractDispersion):
    def index(self, wavelength):
        return 1.5


@pytest.mark.parametrize(
    ("scene", "named"),
    [
        (pl.Scene(pl.Layer(_Own(), 100.0, "top"), "Si"), "top: a recipe cannot express a medium .* _Own"),
        (pl.Scene(pl.Layer(1.5, 9.0), WithExtinction(pl.medium(1.5), pl.medium(0.1))), "the substrate"),
        (pl.Scene(pl.Layer(1.5, 9.0), "Si", instrument=pl.Instrument(scale=Drift(1))), "scale"),
        (pl.Scene(pl.Layer(1.5, 9.0), "Si", light=pl.Light([500.0, 600.0], [0.0, 9.0])), "angle"),
        (pl.Scene(pl.Layer(D.Spline((400.0, 700.0), (1.5, 1.4)), 9.0), "Si"), "layer 1: .* Spline"),
    ],
)
def test_what_a_recipe_cannot_express_is_refused_by_name(scene, named, tmp_path, refuses):
    path = tmp_path / "film.toml"
    refuses(ValueError, named, pl.write_recipe, scene, path)
    assert not path.exists()
