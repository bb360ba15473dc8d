"""Cycles' film formula against renders of Blender, and against Airy's formula with its sensor."""

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.colour.observers import columns
from pellicle.optics.pair import Pair
from pellicle.rendering.appearance import appearance
from pellicle.rendering.blender import DIELECTRIC, METAL, cycles_formula, film
from pellicle.rendering.formula import effective, physical

COMPILED = jax.jit(film)
COSINE = np.cos(np.deg2rad([0.0, 45.0, 75.0]))
RENDERED = [
    # film nm, index, base, linear sRGB at 0, 45 and 75 degrees
    (
        *(120.0, 2.4, [2.9 + 3.1j, 2.6 + 2.8j, 2.3 + 2.4j]),
        [[0.591302, 0.440668, 0.00875], [0.579305, 0.493747, 0.091477], [0.483693, 0.500722, 0.434263]],
    ),
    (
        *(900.0, 1.46, [3.8 + 0.02j, 4.1 + 0.04j, 4.7 + 0.15j]),
        [[0.168069, 0.255943, 0.312486], [0.272315, 0.258375, 0.330031], [0.357032, 0.344012, 0.384984]],
    ),
    (
        *(400.0, 1.33, [1.0, 1.0, 1.0]),
        [[0.053656, 0.000442, 0.064029], [0.107403, 0.078, 0.0], [0.246283, 0.498846, 0.500458]],
    ),
    (
        *(0.6, 2.0, [1.5, 1.5, 1.5]),
        [[0.040039, 0.040054, 0.040083], [0.050278, 0.050292, 0.050319], [0.253101, 0.253115, 0.253142]],
    ),
]
"""Smooth squares under a white sky, rendered by bpy 5.0.1 in float32: Metallic BSDF, and Principled without
transmission on a black base."""


def seen(nm, index, base):
    base = Pair(np.real(base), np.imag(base))
    with jax.enable_x64(True):
        return np.asarray(COMPILED(np.asarray(index), base, np.full(3, nm), COSINE))


@pytest.mark.parametrize(("nm", "index", "base", "rgb"), RENDERED)
def test_renders_of_blender(nm, index, base, rgb):
    np.testing.assert_allclose(seen(nm, index, base), rgb, atol=2e-6)


def test_weak_interference_is_the_integral_over_the_spectrum():
    """Airy's formula in complex numbers, weighted by red, green and blue in white of equal energy."""
    table = columns("observers.csv")
    to_rgb = [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.969266, 1.8760108, 0.041556],
        [0.0556434, -0.2040259, 1.0572252],
    ]
    weights = np.stack([table[f"{axis}_1931"] for axis in "xyz"], axis=1) @ np.transpose(to_rgb)
    n = np.array([1.0, 1.8, 1.5])
    q = np.sqrt(n[:, None] ** 2 - 1 + COSINE**2)  # (media, angles)
    turn = np.exp(4j * np.pi * 250.0 * q[1, :, None] / table["wavelength_nm"])
    total = 0.0
    for power in (0, 2):  # s and p
        y = q / n[:, None] ** power
        upper, lower = ((y[i] - y[i + 1]) / (y[i] + y[i + 1]) for i in (0, 1))
        amplitude = (upper[:, None] + lower[:, None] * turn) / (1 + (upper * lower)[:, None] * turn)
        total = total + 0.5 * np.abs(amplitude) ** 2
    expected = total @ (weights / weights.sum(axis=0))
    np.testing.assert_allclose(seen(250.0, 1.8, [1.5] * 3), expected, atol=2e-3)  # interpolated table


@pytest.fixture(scope="module")
def steel():
    return appearance(pl.Scene(pl.Layer(2.9, 40.0), pl.material("Fe")))


@pytest.mark.slow  # solves for 3 s; the other formulas are solved in the same way
def test_solved_numbers_come_closer(steel):
    assert cycles_formula(steel) is METAL
    own, solved = physical(METAL, steel), effective(METAL, steel)
    np.testing.assert_allclose(own.numbers["base_extinction"], steel.base.imag)
    assert solved.error.mean < 0.5 * own.error.mean
    assert solved.error.mean <= solved.error.largest


def test_a_transparent_base_has_one_index():
    look = appearance(pl.Scene(pl.Layer(1.47, 400.0), 1.52))
    assert cycles_formula(look) is DIELECTRIC
    assert physical(DIELECTRIC, look).numbers == {"ior": 1.47, "base_ior": 1.52}
