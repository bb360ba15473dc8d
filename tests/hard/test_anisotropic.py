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

from pellicle.optics.anisotropy import tensor, uniaxial
from pellicle.optics.berreman.stack import polarised, transmittances
from pellicle.optics.pair import Pair, imag, real

TABLE = json.loads(Path(__file__).with_name("anisotropic.json").read_text(encoding="utf-8"))
CASES = TABLE["cases"]
POINTS = np.array([case["at"] for case in CASES.values()])
SLOW = pytest.mark.slow(reason="more programs of the films of test_values_and_reverse_mode")
QUICKLY = {  # an eighth of the compilation time; no digit is lost here
    "xla_backend_optimization_level": 0,
    "xla_llvm_disable_expensive_passes": True,
    "xla_cpu_use_fusion_emitters": False,
}

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
    value_and_slope = jax.jit(both).lower(columns, columns).compile(QUICKLY)
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
    return jax.jit(function).lower(*arguments).compile(QUICKLY)(*arguments)


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
def test_values_and_derivatives(as_tensors):
    found = zip(CASES.items(), *computed(as_tensors, np.float64), strict=True)
    wrong = {}
    for (name, case), value, slope in found:
        of_value, of_slope = errors(case, value, slope)
        if not (of_value < VALUE and of_slope < SLOPE):
            wrong[name] = f"{of_value:.1e} {of_slope:.1e}"
    assert not wrong, wrong


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
IN_FLOAT32 = {True: (1e-6, 1e-3), False: (5e-4, 5e-3)}
"""Largest errors of a value and of a slope, by whether the layer is thin. A phase of 2e4 radians is rounded
to 1e-3, which an opaque or weakly modulated film divides; found: 9e-7 and 5e-4 (at 89.999 degrees, whose
cosine has five digits), and 7e-5 to 3e-4, by the processor, and 4e-3."""


@SLOW
@pytest.mark.parametrize("as_tensors", [False, True])
def test_float32(as_tensors):
    """Tensors of 1 mm are left out: their exponential is squared 17 times, and loses all seven digits."""
    found = zip(CASES.items(), *computed(as_tensors, np.float32), strict=True)
    wrong = {}
    for (name, case), value, slope in found:
        if as_tensors and case["at"][0] == 1e6:
            continue
        limits = IN_FLOAT32[case["at"][0] <= THICK]
        of_value, of_slope = errors(case, value, slope)
        if not (of_value < limits[0] and of_slope < limits[1]):
            wrong[name] = f"{of_value:.1e} {of_slope:.1e}"
    assert not wrong, wrong
