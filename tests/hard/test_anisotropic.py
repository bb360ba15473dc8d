"""Hard birefringent films against 50 digits (anisotropic.json, by make_anisotropic.py): values, derivatives.

Each is computed in the closed form of uniaxial media and as a tensor of any kind. An error of a derivative is
measured against |derivative| + the largest derivative of the outputs in that parameter + 1e-3.
"""

import json
from functools import cache
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp, mpc, mpf

from pellicle.optics.anisotropy import tensor, uniaxial
from pellicle.optics.berreman.matrices import Elements
from pellicle.optics.berreman.stack import polarised, transmittances
from pellicle.optics.ellipsometry import mueller_elements
from pellicle.optics.pair import Pair, imag, real
from pellicle.programs.cache import compiler_options
from pellicle.signals.generalised import Generalised
from pellicle.signals.waves import ratio_sums_of_mueller

TABLE = json.loads(Path(__file__).with_name("anisotropic.json").read_text(encoding="utf-8"))
CASES = TABLE["cases"]
POINTS = np.array([case["at"] for case in CASES.values()])
SLOW = pytest.mark.slow(reason="more programs of the films of test_values_and_reverse_mode")

VALUE, SLOPE = 3e-12, 1e-10
"""Layers of 1 mm need these: 2e4 radians are rounded to 4e-12. All others are within 5e-13 and 1e-11."""


def outputs(as_tensors, d, no, ko, ne, ke, theta, phi, so, se, sk, theta_s, phi_s, n0, angle, wavelength):
    layer = uniaxial(Pair(no, ko), Pair(ne, ke), jnp.deg2rad(theta), jnp.deg2rad(phi))
    substrate = uniaxial(Pair(so, sk), Pair(se, sk), jnp.deg2rad(theta_s), jnp.deg2rad(phi_s))
    if as_tensors:
        layer, substrate = tensor(layer), tensor(substrate)
    found = polarised(n0, [layer], substrate, [2 * jnp.pi * d / wavelength], jnp.deg2rad(angle))
    jones = [part(r) for r in found.reflected for part in (real, imag)]
    return jnp.stack([*jones, *transmittances(found)])


@cache
def computed(as_tensors, dtype):
    def both(columns, tangents):
        return jax.jvp(lambda *columns: outputs(as_tensors, *columns), columns, tangents)

    columns = tuple(jnp.asarray(column, dtype) for column in POINTS.T)
    # an eighth of the compilation time; no digit is lost here
    value_and_slope = jax.jit(both).lower(columns, columns).compile(compiler_options("few"))
    slopes = []
    for i in range(len(columns)):
        tangents = tuple(jnp.full_like(column, i == j) for j, column in enumerate(columns))
        value, slope = value_and_slope(columns, tangents)
        slopes.append(np.asarray(slope))
    return np.asarray(value).T, np.transpose(slopes, (2, 0, 1))


def errors(case, value, slope):
    expected = np.array(case["slope"])
    size = np.abs(expected) + np.max(np.abs(expected), axis=1, keepdims=True) + 1e-3
    return np.max(np.abs(value - case["value"])), np.max(np.abs(slope - expected) / size)


WEIGHTS = np.linspace(1.0, 2.0, 10)
"""Of the ten outputs, in a sum whose gradient has all slopes."""


def called(function, *arguments):
    """function(*arguments), compiled quickly."""
    return jax.jit(function).lower(*arguments).compile(compiler_options("few"))(*arguments)


@pytest.mark.slow
def test_values_and_reverse_mode():
    def weighted(columns):
        found = outputs(False, *columns)
        return jnp.sum(WEIGHTS @ found), found

    gradient, values = called(jax.grad(weighted, has_aux=True), jnp.asarray(POINTS.T))
    expected = np.array([case["value"] for case in CASES.values()])
    assert np.max(np.abs(np.asarray(values).T - expected)) < VALUE
    slopes = np.array([case["slope"] for case in CASES.values()])
    size = np.max(np.abs(slopes), axis=2) + 1e-3
    error = np.abs(np.asarray(gradient).T - slopes @ WEIGHTS) / size
    assert np.max(error) < 3 * SLOPE  # a sum of ten, with weights of 1 to 2


@SLOW
@pytest.mark.parametrize("as_tensors", [False, True])
def test_vmap_over_films(as_tensors):
    """Under vmap both branches of every condition are computed, for each film with its own test."""
    function = jax.vmap(lambda row: outputs(as_tensors, *row[:14], row[14:]))
    found = np.asarray(called(function, jnp.asarray(POINTS)))[..., 0]
    assert np.max(np.abs(found - [case["value"] for case in CASES.values()])) < VALUE


@pytest.mark.parametrize("as_tensors", [False, True])
def test_float32_stays_float32(as_tensors):
    columns = [jax.ShapeDtypeStruct((3,), np.float32)] * POINTS.shape[1]
    found = jax.eval_shape(lambda *columns: outputs(as_tensors, *columns), *columns)
    assert found.dtype == np.float32


THICK = 3000.0
"""nm; the phase of a thicker layer is rounded to more than 1e-5 in float32."""
IN_FLOAT32 = {True: (2e-6, 1e-3), False: (5e-4, 5e-3)}
"""Largest errors of a value and of a slope, by whether the layer is thin. The phase of 3 µm, 55 radians, is
rounded to 2e-6, one of 2e4 radians to 1e-3, which an opaque or weakly modulated film divides; found, by the
processor: 6e-7 to 1.4e-6 and 5e-4 (at 89.999 degrees, whose cosine has five digits), and 7e-5 to 3e-4 and
4e-3."""


@SLOW
@pytest.mark.parametrize("as_tensors", [False, True])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_values_and_derivatives(as_tensors, dtype):
    """Tensors of 1 mm lose all digits of float32: their exponential is squared 17 times."""
    found, wrong = zip(CASES.items(), *computed(as_tensors, dtype), strict=True), {}
    for (name, case), value, slope in found:
        limits = VALUE, SLOPE
        if dtype == np.float32:
            if as_tensors and case["at"][0] == 1e6:
                continue
            limits = IN_FLOAT32[case["at"][0] <= THICK]
        of_value, of_slope = errors(case, value, slope)
        if not (of_value < limits[0] and of_slope < limits[1]):
            wrong[name] = f"{of_value:.1e} {of_slope:.1e}"
    assert not wrong, wrong


NUMBERS = np.array([case["value"] for case in CASES.values()])[:, :8]
SLOPES = np.array([case["slope"] for case in CASES.values()])[:, :8]


def angles(*numbers):
    """N, C, S of each ratio from the real and imaginary parts of pp, ps, sp, ss."""
    signal, jones = Generalised(), Elements(*(Pair(*numbers[i : i + 2]) for i in range(0, 8, 2)))
    return jnp.stack(signal.of_sums(signal.of_jones(jones)))


@pytest.fixture(scope="module")
def ratios_and_slopes():
    def both(numbers, slopes):
        push = lambda slope: jax.jvp(angles, tuple(numbers), tuple(slope))  # noqa: E731
        value, slope = jax.vmap(push, in_axes=-1, out_axes=(None, -1))(slopes)
        return value, slope

    columns = jnp.asarray(NUMBERS.T), jnp.asarray(np.moveaxis(SLOPES, 1, 0))
    value, slope = jax.jit(both)(*columns)
    return np.asarray(value).T, np.moveaxis(np.asarray(slope), 0, 1)


def exact_ratios(numbers, slopes):
    """N, C, S of each ratio and their derivatives in each parameter, with tan Ψ exp(iΔ) = conj(x/y)."""
    pp, ps, sp, ss = (mpc(*map(mpf, numbers[i : i + 2])) for i in range(0, 8, 2))
    dpp, dps, dsp, dss = ([mpc(*map(mpf, d)) for d in slopes[i : i + 2].T] for i in range(0, 8, 2))
    value, slope = [], []
    # r_ps of Woollam is the reflected s of incident p: row s, column p
    for x, dx, y, dy in ((pp, dpp, ss, dss), (sp, dsp, pp, dpp), (ps, dps, ss, dss)):
        size = abs(x) ** 2 + abs(y) ** 2
        cross = 2 * mp.conj(x) * y
        value += [(abs(y) ** 2 - abs(x) ** 2) / size, cross.real / size, cross.imag / size]
        rows = []
        for a, b in zip(dx, dy, strict=True):
            p, s = 2 * mp.re(mp.conj(x) * a), 2 * mp.re(mp.conj(y) * b)
            turned = 2 * (mp.conj(a) * y + mp.conj(x) * b)
            n = (s - p) / size - (abs(y) ** 2 - abs(x) ** 2) * (p + s) / size**2
            both = turned / size - cross * (p + s) / size**2
            rows.append([n, both.real, both.imag])
        slope += np.transpose(rows).tolist()
    return np.array(value, dtype=float), np.array(slope, dtype=float)


@pytest.mark.parametrize(("row", "name"), list(enumerate(CASES)))
def test_ratios_and_their_derivatives(ratios_and_slopes, row, name):
    with mp.workdps(50):
        value, slope = exact_ratios(NUMBERS[row], SLOPES[row])
    np.testing.assert_allclose(ratios_and_slopes[0][row], value, rtol=0, atol=2e-15 * 10)
    assert np.all(np.isfinite(ratios_and_slopes[1][row]))
    size = np.abs(slope) + np.max(np.abs(slope), axis=0, keepdims=True) + 1e-3
    assert np.max(np.abs(ratios_and_slopes[1][row] - slope) / size) < 1e-12


def test_some_films_do_not_mix_s_and_p(ratios_and_slopes):
    apart = [i for i in range(len(CASES)) if np.max(np.abs(NUMBERS[i, 2:6])) < 1e-30]
    assert len(apart) >= 2
    none = [1.0, 0.0, 0.0] * 2
    np.testing.assert_allclose(ratios_and_slopes[0][apart, 3:], np.tile(none, (len(apart), 1)), atol=1e-30)


def test_sums_of_the_mueller_matrix():
    """Two films whose light adds: the sums of both are those of the added Mueller matrices."""
    jones = [Elements(*(Pair(*NUMBERS[row, i : i + 2]) for i in range(0, 8, 2))) for row in (0, 3)]
    added = np.sum([mueller_elements(*own) for own in jones], axis=0)
    exact_ratios = np.sum([Generalised().of_jones(own) for own in jones], axis=0)
    np.testing.assert_allclose(ratio_sums_of_mueller(added.tolist()), exact_ratios, atol=1e-15)


def test_slopes_where_nothing_turns_p_into_s():
    """C + iS of Aps is 2 conj(r_ps) r_pp/|r_pp|² to first order: its derivative in r_ps is 2/r_pp."""
    still = tuple(jnp.asarray(x) for x in (0.5, 0.0, 0.0, 0.0, 0.0, 0.0, -0.4, 0.0))
    moved = tuple(jnp.asarray(float(i == 4)) for i in range(8))  # the real part of sp, Woollam's r_ps
    value, slope = jax.jvp(angles, still, moved)
    np.testing.assert_allclose(value[3:], [1.0, 0.0, 0.0, 1.0, 0.0, 0.0], atol=0)
    np.testing.assert_allclose(slope, [0, 0, 0, 0, 4.0, 0, 0, 0, 0], atol=1e-15)
    dark = tuple(jnp.zeros(()) for _ in range(8))
    value, slope = jax.jvp(angles, dark, moved)
    np.testing.assert_array_equal(value, 0.0)
    assert np.all(np.isfinite(slope))
