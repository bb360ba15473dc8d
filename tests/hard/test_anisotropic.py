"""Hard birefringent films against 50 digits (anisotropic.json, by make_anisotropic.py): values, derivatives.

Each is computed twice, in the closed form of uniaxial media and as a tensor of any kind. An error of a
derivative is measured against |derivative| + the largest derivative of the outputs in that parameter + 1e-3.
"""

from __future__ import annotations

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
pytestmark = pytest.mark.slow  # compiles for a minute; tests/optics/test_berreman.py: random stacks

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
    @jax.jit
    def value_and_slope(columns, tangents):
        return jax.jvp(lambda *columns: outputs(as_tensors, *columns), columns, tangents)

    columns = tuple(jnp.asarray(column, dtype) for column in POINTS.T)
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


@pytest.mark.parametrize("as_tensors", [False, True])
def test_values_and_derivatives(as_tensors):
    found = zip(CASES.items(), *computed(as_tensors, np.float64), strict=True)
    wrong = {}
    for (name, case), value, slope in found:
        of_value, of_slope = errors(case, value, slope)
        if not (of_value < VALUE and of_slope < SLOPE):
            wrong[name] = f"{of_value:.1e} {of_slope:.1e}"
    assert not wrong, wrong
