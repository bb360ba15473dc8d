"""Words of the command line and of recipes: media, constant and birefringent ones, and wrong words."""

import re
from pathlib import Path

import numpy as np
import pytest

from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.dispersion.empirical import Cauchy, Constant, Sellmeier, Shifted
from pellicle.errors import DataError, UsageError
from pellicle.fitting.film.parameters import parameters
from pellicle.recipes import media
from pellicle.recipes.dispersion_models import MODELS, TERMS, build_model
from pellicle.recipes.medium_schema import MediumTable
from pellicle.scene.free import Free, free_leaves

AT = np.array([450.0, 633.0, 850.0])


def free_part(free: Free):
    return free.start, free.lower, free.upper


def test_a_range_is_a_free_thickness_and_a_number_a_fixed_one():
    assert free_part(media.thickness("10:3000")) == (1505, 10, 3000)
    assert media.thickness("120.5") == 120.5
    assert media.thickness("0") == 0
    assert free_part(media.thickness("0:1e3"))[1:] == (0, 1000)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("800:10", "reversed"),
        ("-10:800", "negative"),
        ("-5", "negative"),
        ("a:b", "'a'"),
        ("1:2:3", "LO:HI"),
        ("nan", "finite"),
        ("1:inf", "finite"),
    ],
)
def test_thickness_refused(text, message, refuses):
    refuses(UsageError, message, media.thickness, text)


def test_numbers_are_media():
    assert media.medium("1.46") == Constant(1.46)
    for text in ("2.9+0.1j", "2.9 + 0.1j", "2.9+0.1i"):
        np.testing.assert_allclose(media.medium(text)(AT), 2.9 + 0.1j)


def test_names_and_tables(write):
    np.testing.assert_allclose(media.medium("SiO2")(np.array([633.0])), 1.457, atol=1e-3)
    np.testing.assert_allclose(media.medium("air")(AT), 1.0)
    table = write("wavelength_nm,n,k\n400,1.6,0.02\n600,1.5,0.0\n900,1.5,0.0\n", "resin.csv")
    index = media.medium(str(table))(np.array([400.0, 500.0]))
    np.testing.assert_allclose(index, [1.6 + 0.02j, 1.55 + 0.01j])


def test_a_bare_model_frees_its_parameters_within_documented_bounds():
    cauchy = media.medium("cauchy")
    assert isinstance(cauchy, Cauchy)
    assert free_part(cauchy.A)[1:] == (1.2, 3.0)
    assert free_part(cauchy.B)[1:] == (0.0, 1e5)
    assert cauchy.C == 0
    sellmeier = media.medium("sellmeier")
    assert isinstance(sellmeier, Sellmeier)
    assert free_part(sellmeier.B[0])[1:] == (0.1, 6.0)


@pytest.mark.parametrize(
    ("text", "permittivity"),
    [
        ("cauchy(1.324188,3102.06)", (1.324188 + 3102.06 / AT**2) ** 2),
        ("Cauchy( 1.4 , 3000 , 1e8 )", (1.4 + 3000 / AT**2 + 1e8 / AT**4) ** 2),
        ("cauchy(1.4)", 1.96),
        ("sellmeier(1.1,8000)", 1 + 1.1 * AT**2 / (AT**2 - 8000)),
    ],
)
def test_a_call_fixes_them(text, permittivity):
    np.testing.assert_allclose(media.medium(text)(AT) ** 2, permittivity)


def test_models_by_name():
    assert free_part(build_model("cauchy", {"B": Free(0.0, 10.0)}).B) == (5, 0, 10)
    assert build_model("cauchy", {}).A == 1.5  # missing parameters keep their documented defaults, fixed
    with pytest.raises(UsageError, match=r"has no parameter 'D'.*A, B, C"):
        media.medium(MediumTable.model_validate({"model": "cauchy", "D": 1.0}))


def test_freeing_a_number_replaces_it():
    """n ± 0.5 but at least 1 where nothing is absorbed, k from 0 to 1, started where the number was."""
    layer = media.medium("1.46", ["n", "k"])
    assert isinstance(layer, Constant)
    assert free_part(layer.n) == pytest.approx((1.46, 1.0, 1.96))
    assert free_part(layer.k)[1:] == (0, 1)
    assert free_part(media.medium("2.9+0.1j", ["n", "k"]).n) == pytest.approx((2.9, 2.4, 3.4))
    assert media.medium("2.9+0.1j", ["k"]).k.start == 0.1
    assert media.medium("2.9+0.1j", ["n"]).k == 0.1
    assert free_part(media.medium("0.2+3j", ["n"]).n) == pytest.approx((0.2, 0.01, 0.7))


def test_own_bounds():
    assert free_part(media.medium("1.46", ["n=1.3:1.7"]).n) == (1.46, 1.3, 1.7)
    assert free_part(media.medium("1.2", ["n=1.3:1.7"]).n) == (1.3, 1.3, 1.7)
    assert free_part(media.medium("1.46", ["k=0:0.01"]).k)[1:] == (0, 0.01)
    cauchy = media.medium("cauchy(1.4,3000)", ["A=1.3:1.5"])
    assert free_part(cauchy.A)[1:] == (1.3, 1.5)
    assert cauchy.B == 3000
    assert free_part(media.medium("cauchy(1.4)", ["C"]).C)[1:] == (-1e10, 1e10)


def test_freeing_a_table_adds_a_constant():
    """As far as the sum stays at least 1."""
    layer = media.medium("SiO2", ["n", "k"])
    assert isinstance(layer, Shifted)
    value, lower, upper = free_part(layer.n)
    assert (value, upper) == (0, 0.5)
    assert lower == pytest.approx(1 - 1.44, abs=0.01)
    assert free_part(layer.k)[1:] == (0, 1)
    titania = media.medium("TiO2", ["n"])
    assert free_part(titania.n) == (0, -0.5, 0.5)
    gold = media.medium("Au", ["n"])  # below 1 as it is
    assert -0.5 < gold.n.lower < 0
    assert free_part(media.medium("SiO2", ["n=0.01:0.1"]).n) == (0.01, 0.01, 0.1)


@pytest.mark.parametrize(
    ("layer", "free", "message"),
    [
        ("-1.5", (), "`layer` must be n"),
        ("1.5-0.1j", (), "`layer` must be n"),
        ("nan", (), "`layer` must be n"),
        ("1,46", (), r"an index has a decimal point: 1\.46"),
        ("SiO3", (), "SiO2"),
        ("cauchy(1,2,3,4)", (), "1 to 3 numbers"),
        ("cauchy()", (), "got 0"),
        ("cauchy(a)", (), "'a'"),
        ("1.46", ["q"], "n and k can always be freed"),
        ("cauchy", ["D"], "A, B and C"),
        ("1.46", ["k=-1:1"], "negative"),
        ("1.46", ["n=1.7:1.3"], "reversed"),
        ("1.46", ["n=1.7"], "LO:HI"),
        ("SiO2", ["n=1.3:1.7"], "added to the index"),
        ("1.5", ["n=-0.1:0.1"], r"those of the index itself, as in n=1\.35:1\.65"),
    ],
)
def test_media_refused(layer, free, message, refuses):
    refuses(UsageError, message, media.medium, layer, free)


def test_scale_and_offset(refuses):
    assert media.drift("free", "`scale`") == "free"
    assert media.drift("slow", "`scale`") == "slow"
    assert media.drift("0.98", "`scale`") == 0.98
    refuses(UsageError, "`scale` must be a number, not 'loose'", media.drift, "loose", "`scale`")


def test_free_or_a_number():
    default = Free(0.0, 20.0, start=2.0, limits=(0.0, 50.0))
    assert media.free_or_number("free", "`bandwidth`", default) is default
    assert free_part(media.free_or_number("1:3", "`bandwidth`", default)) == (2, 1, 3)
    assert media.free_or_number("4", "`bandwidth`", default) == 4


@pytest.mark.parametrize(("name", "specs"), MODELS.items())
def test_the_documented_defaults_are_these(name, specs):
    """Of each parameter that docs/reference/recipes.md lists; rows may refer to another row."""
    page = (Path(__file__).parents[2] / "docs" / "reference" / "recipes.md").read_text("utf-8")
    row = next(line for line in page.splitlines() if line.startswith(f"| `{name}` |"))
    listed = re.findall(r"(\**)(\w+)\1 (\S+) \((\S+) to (\S+)\)", row.split("|")[2])
    assert listed or "as `" in row
    for bold, key, *numbers in listed:
        spec = specs[key]
        assert (bool(bold), *map(float, numbers)) == (spec.free, spec.value, spec.lower, spec.upper)
    others = specs.keys() - {key for _, key, *_ in listed}
    assert others <= {"eps_inf"} or "as " in row
    limits = re.findall(r"((?:\w+, )*\w+) (\S+) to ([^\s,;]+)", row.split("|")[3])
    assert limits
    for keys, *ends in limits:
        for key in keys.split(", "):
            assert specs[key].limits == tuple(map(float, ends))


EVERY = [*MODELS.items(), *((name, specs) for name, specs in TERMS.items())]


@pytest.mark.parametrize(("name", "specs"), EVERY)
def test_every_default_lies_within_its_bounds_and_these_within_their_limits(name, specs):
    for key, spec in specs.items():
        assert spec.limits[0] <= spec.lower <= spec.value <= spec.upper <= spec.limits[1], key


def limits_in(dispersion):
    return [free.limits for _, free in free_leaves(dispersion)]


@pytest.mark.parametrize(
    ("layer", "free", "limits"),
    [
        ("cauchy", (), [(1.0, 4.5), (0.0, 5e5)]),
        ("cauchy(1.5,3000)", ("A", "B=0:2e4"), [(1.0, 4.5), None]),
        ("1.46", ("n", "k"), [(1.0, 5.0), (0.0, 20.0)]),
        ("0.4+3j", ("n",), [(0.01, 10.0)]),
        ("1.46", ("n=1.3:1.6", "k=0:1"), [None, None]),
        ("SiO2", ("n=-0.1:0.1",), [None]),
    ],
)
def test_only_default_bounds_may_be_widened(layer, free, limits):
    assert limits_in(media.medium(layer, free)) == limits


def test_a_shift_of_a_known_index_may_not_go_below_vacuum():
    [(lower, upper)] = limits_in(media.medium("SiO2", ["n"]))
    least = float(np.real(media.medium("SiO2")(np.linspace(250.0, 1700.0, 200))).min())
    assert lower == pytest.approx(1 - least, abs=1e-3)
    assert upper == 2.0


FREE = "{ model = 'constant', n = { lower = 1.5, upper = 2 } }"
TURNED = f"{{ ordinary = 1.5, extraordinary = {FREE}, axis = AXIS }}"
BIREFRINGENT = "{ ordinary = 1.5, extraordinary = 1.6 }"


def test_uniaxial_layer_with_a_free_index_and_a_free_angle(scene_of):
    own = scene_of(TURNED.replace("AXIS", "[{ lower = 0, upper = 90 }, 20]"))
    found = [(p.name, p.unit, p.lower, p.upper) for p in parameters(own)]
    assert found == [("extraordinary.n", "", 1.5, 2.0), ("axis_theta", "deg", 0.0, 90.0)]
    assert own.layers[0].material.order is None


def test_biaxial_layer_of_named_media_along_the_laboratory_axes(scene_of):
    own = scene_of("{ x = 'SiO2', y = 1.6, z = 1.5, axis = [90, 0, 0] }").layers[0].material
    assert isinstance(own, Anisotropic)
    assert own.order == (2, 1, 0)
    assert own.x.name == "SiO2"


@pytest.mark.parametrize(
    ("material", "message"),
    [
        ("{ ordinary = 1.5, extraodinary = 1.6 }", "did you mean 'extraordinary'"),
        ("{ ordinary = 1.5, extraordinary = 1.6, axs = [0, 0] }", "did you mean 'axis'"),
        ("{ ordinary = 1.5 }", "lacks extraordinary"),
        ("{ x = 1.5, y = 1.6 }", "lacks z"),
        ("{ ordinary = 1.5, extraordinary = 1.6, axis = 30 }", "axis must be"),
        ("{ ordinary = 1.5, extraordinary = 1.6, axis = [1, 2, 3] }", "axis must be"),
        ("{ ordinary = 'no such thing', extraordinary = 1.6 }", "unknown material"),
        (f"{{ mix = 'linear', host = {BIREFRINGENT}, inclusion = 1, fraction = 0.5 }}", "isotropic media"),
    ],
)
def test_what_is_wrong_is_named(scene_of, material, message, refuses):
    refuses(DataError, message, scene_of, material)


@pytest.mark.parametrize("free", ["n", "axis_theta"])
def test_free_numbers_that_need_bounds_are_refused(scene_of, free, refuses):
    refuses(
        DataError,
        "birefringent layer",
        scene_of,
        TURNED.replace("AXIS", "[0, 0]"),
        f"free = ['{free}']",
    )


LAYER = '[[scene.layer]]\nmaterial = "SiO2"\nthickness = { lower = 10, upper = 3000 }\n'
BASE = f'[scene]\nsubstrate = "Si"\n{LAYER}'
N, K = "{ lower = 1.5, upper = 2.5 }", "{ lower = 0, upper = 0.5 }"
CONSTANT = f'{{ model = "constant", n = {N}, k = {K} }}'

CLEAR = f'model = "constant", n = {N}'
LINEAR = 'mix = "linear", inclusion = 1.0, fraction = 0.1'


def film(material: str) -> str:
    return BASE.replace('"SiO2"', material)


def test_a_constant_index_of_a_layer(scene):
    """n fixed and k free, or both free; missing keys are n = 1.5 and no absorption."""
    found = lambda text: scene(text).layers[0].material  # noqa: E731
    assert found(film(f'{{ model = "constant", n = 1.8, k = {K} }}')) == Constant(1.8, Free(0, 0.5))
    assert found(film(CONSTANT)) == Constant(Free(1.5, 2.5), Free(0, 0.5))
    assert found(film('{ model = "constant" }')) == Constant(1.5)
    freed = Constant(Free(1.7, 1.9, start=1.9), Free(0, 1, start=0.25, limits=(0, 20)))
    assert found(film(CONSTANT) + 'free = ["n=1.7:1.9", "k"]\n') == freed


@pytest.mark.parametrize(
    ("text", "free"),
    [
        (BASE.replace('"Si"', CONSTANT), ["thickness", "substrate.n", "substrate.k"]),
        (BASE.replace('"Si"', f"{{ material = 1.5, back = {CONSTANT} }}"), ["thickness", "back.n", "back.k"]),
        (BASE.replace("[scene]", f"[scene]\nambient = {{ {CLEAR} }}"), ["thickness", "ambient.n"]),
        (film(f"{{ host = {CONSTANT}, {LINEAR} }}"), ["host.n", "host.k", "thickness"]),
    ],
    ids=["substrate", "back", "ambient", "mixture"],
)
def test_a_constant_index_elsewhere(scene, text, free):
    assert [p.name for p in parameters(scene(text))] == free


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (film(f'{{ model = "constant", k = {K.replace("0,", "-1,")} }}'), "k must not be negative, got -1"),
        (film('{ model = "constant", n = -1.5 }'), "n must not be negative, got -1.5"),
        (film('{ model = "constant", m = 1.5 }'), "constant has no parameter 'm'"),
        (BASE.replace("[scene]", f"[scene]\nambient = {CONSTANT}"), "the ambient must not absorb"),
    ],
)
def test_constant_indices_refused(refused, text, message):
    refused(text, message)


def test_more_free_numbers_than_a_fit_takes(refused):
    knots = [400.0 + 5 * i for i in range(50)]
    spline = f'{{ model = "spline", knots = {knots}, n = {N}, k = {K} }}'
    refused(film(spline), "101 parameters are free, more than the 64 that a fit takes")


def test_an_index_is_added_to_a_model_whose_own_numbers_are_free():
    freed = media.medium("cauchy(1.40,3600)", ["B=0:9000", "n"])
    swapped = media.medium("cauchy(1.40,3600)", ["n", "B=0:9000"])
    assert isinstance(freed, Shifted)
    assert isinstance(swapped, Shifted)
    assert isinstance(freed.base, Cauchy)
    assert free_part(freed.base.B) == (4500, 0, 9000)
    # B starts at 4500 there and at 3600 here; the sum stays at least 1
    assert freed.n.lower == pytest.approx(1 - (1.40 + 4500 / 780**2), abs=1e-12)
    assert swapped.n.lower == pytest.approx(1 - (1.40 + 3600 / 780**2), abs=1e-12)
