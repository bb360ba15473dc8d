"""The library's front door: traced through every argument, precision, and what it refuses."""

import re
import subprocess
import sys
from functools import partial
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import pellicle as pl
from pellicle.dispersion import Cauchy
from pellicle.dispersion.empirical import Table
from pellicle.errors import UsageError
from pellicle.materials import CLEAR, Material
from pellicle.optics.pair import Pair

FUNCTIONS = {"R": pl.reflectance, "T": pl.transmittance}
BOTH = pytest.mark.parametrize("function", FUNCTIONS.values(), ids=FUNCTIONS)
FILM = {"wavelength": 550.0, "thickness": 130.0, "layer": 2.1 + 0.1j, "substrate": 3.9 + 0.02j}
FILM |= {"ambient": 1.33, "angle": 40.0}
POSITIONAL = ("wavelength", "thickness", "layer", "substrate")


def call(function, polarisation="unpolarised", **film):
    film = FILM | film
    return function(*[film.pop(name) for name in POSITIONAL], **film, polarisation=polarisation)


DIRECTIONS = [(name, 1.0) for name in FILM] + [("layer", 1j), ("substrate", 1j)]


def moved(function):
    """x → the signal with each argument moved by its own x (the last two along i: extinctions)."""

    def signal(x):
        film = dict(FILM)
        for (name, part), step in zip(DIRECTIONS, x, strict=True):
            film[name] = film[name] + part * step
        return call(function, **film)

    return signal


@pytest.mark.slow
@BOTH
def test_every_argument_is_traced(function):
    """jit, vmap, jacfwd and grad, against the plain call and its central differences."""
    signal, h = moved(function), 1e-5 * np.eye(len(DIRECTIONS))
    values = jax.jit(jax.vmap(signal))(np.concatenate([0 * h, h, -h])).reshape(3, -1)
    np.testing.assert_allclose(values[0], float(call(function)), rtol=1e-13)
    numeric = (values[1] - values[2]) / 2e-5
    forward, reverse = jax.jit(lambda x: (jax.jacfwd(signal)(x), jax.grad(signal)(x)))(h[0] * 0)
    np.testing.assert_allclose(forward, numeric, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(reverse, forward, rtol=1e-10)
    assert np.all(np.abs(numeric) > 1e-5)


@BOTH
def test_holomorphic_style_gradient_of_a_complex_index(function):
    """jax.grad in a complex index gives ∂/∂n − i ∂/∂k, JAX's own convention."""
    slope = jax.jit(jax.grad(lambda layer: call(function, layer=layer)))(FILM["layer"])
    along = jax.jit(jax.grad(lambda x, p: call(function, layer=FILM["layer"] + p * x)))
    dn, dk = (along(0.0, p) for p in (1.0 + 0j, 1j))
    assert complex(slope) == pytest.approx(complex(dn, -dk), rel=1e-12)


def test_arrays_of_jax_are_known_in_a_program():
    """An array that a program closes over is no argument of it, but JAX traces what is computed of it."""
    wavelength, wafer = jnp.array([500.0, 600.0]), jnp.array([3.9 + 0.02j, 4.1 + 0.04j])
    for below in (3.9, wafer):
        traced = jax.eval_shape(lambda d, below=below: pl.reflectance(wavelength, d, 1.46, below), 300.0)
        assert traced.shape == (2,)
    amplifying = wafer.conj()
    with pytest.raises(UsageError, match="which is gain"):
        jax.eval_shape(lambda d: pl.reflectance(wavelength, d, 1.46, amplifying), 300.0)


@BOTH
def test_arguments_broadcast(function):
    wavelength, thickness = np.linspace(400, 800, 5), np.array([[10.0], [300.0]])
    angle = np.array([0.0, 20.0, 60.0])[:, None, None]
    layer = np.linspace(1.5, 2, 5) + 0.1j
    arrays = {"wavelength": wavelength, "thickness": thickness, "layer": layer, "angle": angle}
    found = jax.jit(lambda film: call(function, **film))(arrays)
    assert found.shape == (3, 2, 5)
    alone = call(function, wavelength=wavelength[3], thickness=300.0, layer=layer[3], angle=60.0)
    assert float(found[2, 1, 3]) == pytest.approx(float(alone), rel=1e-13)


@pytest.mark.slow
@BOTH
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_precision_follows_the_input(function, dtype):
    """Python numbers, and materials, take the precision of the arrays beside them."""
    wavelength = np.linspace(400, 800, 3, dtype=dtype)
    for media in ((1.46, 3.9), (2.1 + 0.1j, 3.9 + 0.02j), ("SiO2", "Si"), (Cauchy(1.45, 3e3), 1.5)):
        for angle in (0.0, 30.0, dtype(30)):
            assert function(wavelength, 100.0, *media, angle=angle).dtype == dtype


@BOTH
@pytest.mark.parametrize("ambient", [1.33 + 0.1j, np.array([1.33 + 0j]), "Au"])
def test_an_absorbing_ambient_is_refused(function, ambient, refuses):
    refuses(ValueError, "the ambient must not absorb: give it a real index", call, function, ambient=ambient)


def test_an_ambient_of_little_absorption_is_its_real_part():
    """What that leaves out, by the exact film in an ambient of k = CLEAR: R, N, C and S change by less."""
    wavelength, angle = np.array([450.0, 600.0, 800.0]), np.deg2rad(65.0)
    table = Table(np.array([400.0, 900.0]), np.array([1.34, 1.33]), np.array([0.9, 0.9]) * CLEAR)
    water = Material(table, "water", "water.csv", "", (400.0, 900.0), True)
    n0, n1, n2 = np.interp(wavelength, [400, 900], [1.34, 1.33]), 1.46, 3.9 + 0.02j
    found = pl.reflectance(wavelength, 120.0, n1, n2, ambient=water, angle=65.0, polarisation="p")
    psi, delta = pl.ellipsometry(wavelength, 120.0, n1, n2, ambient=water, angle=65.0)
    s, p = (_film(n0 + 0.9j * CLEAR, n1, n2, n0 * np.sin(angle), 120.0, wavelength, x) for x in "sp")
    np.testing.assert_allclose(found, abs(p) ** 2, atol=2 * CLEAR, rtol=0)
    assert np.max(np.abs(found - abs(p) ** 2)) > 1e-9  # it is left out
    ratio = np.tan(np.deg2rad(psi)) * np.exp(1j * np.deg2rad(delta))
    np.testing.assert_allclose(ratio, np.conj(-p / s), atol=5 * CLEAR, rtol=0)


def _film(n0, n1, n2, transverse, thickness, wavelength, polarisation):
    """r of one layer by Airy's formula, of p as the ratio of magnetic fields."""
    roots = [np.sqrt((n + 0j) ** 2 - transverse**2) for n in (n0, n1, n2)]
    media = zip(roots, (n0, n1, n2), strict=True)
    terms = [q if polarisation == "s" else (n + 0j) ** 2 / q for q, n in media]
    first, second = ((a - b) / (a + b) for a, b in pairwise(terms))
    turn = np.exp(4j * np.pi / wavelength * roots[1] * thickness)
    return (first + second * turn) / (1 + first * second * turn)


@pytest.mark.parametrize("function", [pl.reflectance, pl.ellipsometry])
def test_water_as_ambient_where_it_is_clear(function):
    call = partial(function, thickness=100.0, layer="SiO2", substrate="Si", angle=60.0)
    seen = jax.jit(lambda nm: call(nm, ambient="H2O"))(np.array([550.0, 1450.0]))
    for one, other in zip(jax.tree.leaves(seen), jax.tree.leaves(call(550.0, ambient=1.333)), strict=True):
        np.testing.assert_allclose(one, [other, np.nan], rtol=1e-4)
    with pytest.raises(ValueError, match=r"must not absorb: H2O has k = 0\.00012 at 1450 nm"):
        call(np.array([550.0, 1450.0]), ambient="H2O")


@BOTH
def test_an_unknown_polarisation_is_refused(function, refuses):
    refuses(ValueError, "polarisation` must be one of unpolarised, s, p, not 'TE'", call, function, "TE")


@BOTH
def test_names_are_materials(function):
    wavelength = np.array([500.0, 600.0])
    found = function(wavelength, 100.0, "SiO2", "Si")
    by_hand = function(wavelength, 100.0, pl.material("SiO2"), pl.material("Si")(wavelength))
    np.testing.assert_allclose(found, by_hand, rtol=1e-14)
    assert 0 < float(found[0]) < 1


def test_the_index_of_whatever_a_layer_may_be(refuses):
    np.testing.assert_array_equal(pl.refractive_index(np.array([500.0, 600.0]), 1.5 + 0.1j), 1.5 + 0.1j)
    assert pl.refractive_index(np.array([500.0, 600.0]), 1.5).shape == (2,)
    n = pl.refractive_index(550.0, Cauchy(1.5, 3000.0))
    assert complex(n) == pytest.approx(1.5 + 3000 / 550**2)
    refuses(ValueError, "not at 90", pl.refractive_index, 90.0, "Au")


@BOTH
def test_wavelengths_outside_a_table_are_refused(function):
    """The message names the material, its range and the offending wavelengths."""
    low, high = pl.material("Si").wavelength_range
    wavelength = np.array([500.0, high + 100, high + 200])
    with pytest.raises(ValueError) as caught:  # noqa: PT011 (the parts are checked one by one)
        function(wavelength, 100.0, 1.46, "Si")
    for part in ("Si", f"{low:g} to {high:g} nm", f"{high + 100:g} to {high + 200:g} nm"):
        assert part in str(caught.value)


@BOTH
def test_outside_a_table_a_traced_wavelength_gives_nan(function):
    high = pl.material("Si").wavelength_range[1]
    found = jax.jit(lambda w: function(w, 100.0, 1.46, "Si"))(np.array([500.0, high + 100]))
    np.testing.assert_array_equal(np.isnan(found), [False, True])


def test_gradient_through_a_material():
    """The wavelength reaches the index too: the derivative contains the dispersion."""
    material = Cauchy(1.45, 3e4)

    def signal(wavelength):
        return pl.reflectance(wavelength, 400.0, material, 3.9)

    numeric = (signal(550.001) - signal(549.999)) / 2e-3
    assert float(jax.grad(signal)(550.0)) == pytest.approx(float(numeric), rel=1e-6)
    by_parameter = jax.grad(lambda a: pl.reflectance(550.0, 400.0, Cauchy(a, 3e4), 3.9))(1.45)
    n = complex(material(550.0)).real
    direct = jax.grad(lambda n: pl.reflectance(550.0, 400.0, n, 3.9))(n)
    assert float(by_parameter) == pytest.approx(float(direct), rel=1e-12)


def test_a_film_of_no_extinction_still_feels_one():
    """k = 0 in a complex index: dR/dk there is that of a film that could absorb."""
    slope = jax.grad(lambda k: pl.reflectance(550.0, 200.0, 1.46 + 1j * k, 3.9))(0.0)
    up, mid = (pl.reflectance(550.0, 200.0, 1.46 + 1j * k, 3.9) for k in (1e-6, 0.0))
    assert float(slope) == pytest.approx(float((up - mid) / 1e-6), rel=1e-4)
    assert abs(float(slope)) > 0.1


ONCE = """
import warnings
import numpy as np
import pellicle as pl
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("default")
    for _ in range(3):
        found = pl.reflectance(np.linspace(400.0, 800.0, 3), 100.0, 1.46, 3.9)
    pl.transmittance(np.float32(550), np.float32(100), 1.46, 3.9)
print(found.dtype, len(caught), caught[0].category.__name__, caught[0].filename)
print(caught[0].message)
"""


@pytest.mark.slow
def test_lost_precision_is_said_once():
    """float64 input while JAX computes in float32; Python numbers and float32 say nothing."""
    run = subprocess.run([sys.executable, "-c", ONCE], capture_output=True, text=True, check=True)
    first, second = run.stdout.splitlines()
    assert first == "float32 1 UserWarning <string>"
    assert second.startswith("float64 input is computed in float32: jax.config.update(")


@pytest.mark.parametrize("whole", [np.asarray, jnp.asarray])
def test_known_media_are_known_under_jit_too(whole):
    """Arrays that a traced function closes over, of NumPy and of JAX, above and below the critical angle."""
    wavelength, angle = np.array([500.0, 600.0]), whole(np.array([30.0, 70.0]))
    layer, substrate = whole(np.array([1.3, 1.4])), whole(np.array([1.46, 1.1]))

    def signal(thickness):
        return pl.reflectance(wavelength, thickness, layer, substrate, ambient=1.5, angle=angle)

    given = pl.reflectance(wavelength, 100.0, layer + 0j, substrate + 0j, ambient=1.5, angle=angle)
    np.testing.assert_allclose(jax.jit(signal)(100.0), given, rtol=1e-12)
    np.testing.assert_allclose(signal(100.0), given, rtol=1e-12)


def test_principal_indices_of_a_birefringent_medium(refuses):
    """Against each medium alone; handbooks give 1.6584 and 1.4864 for calcite."""
    NM = np.array([500.0, 589.3])
    two = pl.Anisotropic(Cauchy(1.5, 3000.0), 1.7 + 0.1j, axis=(40.0, 0.0))(NM)
    np.testing.assert_allclose(two, np.stack([Cauchy(1.5, 3000.0)(NM), np.full(2, 1.7 + 0.1j)], axis=-1))
    named = pl.Anisotropic("calcite", "calcite-e")
    np.testing.assert_allclose(pl.refractive_index(589.3, named), [1.6584, 1.4864], atol=5e-4)
    assert pl.Anisotropic(x=1.5, y=1.6, z=1.7)(NM).shape == (2, 3)
    refuses(ValueError, "refractive_index", named, 589.3)
    for call in (
        lambda: pl.refractive_index(50.0, named),
        lambda: pl.jones(50.0, 1.0, named, 1.5, angle=9.0),
    ):
        refuses(ValueError, "50", call)


@pytest.mark.parametrize(
    ("arguments", "named", "said"),
    [
        ((500.0, 100.0, 1.46 - 0.1j, 3.9), {}, "1.46-0.1j has a negative imaginary part"),
        ((500.0, 100.0, 1.46, np.array([3.9 - 0.1j])), {}, "3.9-0.1j has a negative imaginary part"),
        ((500.0, 100.0, 1.46, -3.9), {}, "index -3.9 has a negative real part"),
        ((500.0, 100.0, -1.5 + 1j, 3.9), {}, "index -1.5+1j has a negative real part"),
        ((500.0, 100.0, 1.46, 3.9), {"ambient": -1.0}, "index -1 has a negative real part"),
        ((500.0, 100.0, np.array([1.46, 0.0]), 3.9), {}, "index 0 is that of no medium"),
        ((500.0, -1.0, 1.46, 3.9), {}, "`thickness` must not be negative, got -1 nm"),
        ((500.0, [10.0, -1.0], [1.46, 2.0], 3.9), {}, "`thickness` must not be negative"),
        ((0.55, 100.0, 1.46, 3.9), {}, "0.55 is like one in µm: write 550"),
        ((np.array([np.nan, 500.0]), 100.0, 1.46, 3.9), {}, "`wavelength` must be above zero"),
        ((500.0, 100.0, 1.46, 3.9), {"angle": 120.0}, "`angle` must be 0 to 90 degrees, got 120"),
    ],
)
def test_impossible_numbers_are_refused(arguments, named, said, refuses):
    refuses(UsageError, re.escape(said), pl.reflectance, *arguments, **named)


def test_wavelengths_of_an_index_may_be_a_list():
    found = pl.refractive_index([500, 600.0], "Au")
    np.testing.assert_array_equal(found, pl.refractive_index(np.array([500.0, 600.0]), "Au"))
    traced = jax.jit(lambda nm: pl.refractive_index(nm, "Au"))(jnp.array([500.0, 600.0]))
    np.testing.assert_allclose(found, traced, rtol=1e-12)
    np.testing.assert_array_equal(pl.refractive_index([500, 600], 1.5), [1.5, 1.5])
    assert pl.refractive_index((500, 600), pl.Anisotropic(1.6, 1.7)).shape == (2, 2)


def test_an_index_of_a_material_converts_to_complex():
    silicon = pl.material("Si")
    expected = complex(pl.refractive_index(550.0, "Si"))
    assert complex(silicon.index(550.0)) == pytest.approx(expected)
    assert np.asarray(silicon.index(np.array([550.0]))) == pytest.approx([expected])
    assert complex(Pair(1.5, None)) == 1.5
