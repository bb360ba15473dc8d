"""Renderers' formulas with changed steps and in transmission, against published code and Airy's formula."""

from functools import partial
from pathlib import Path

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.colour import sensor
from pellicle.colour.spaces import srgb_matrix
from pellicle.rendering.appearance import ANGLES, appearance
from tests.airy import airy
from tests.rendering.test_formulas import published

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
COSINE = np.cos(np.deg2rad([0.0, 40.0, 75.0]))


@pytest.fixture(scope="module")
def changes(modules_of):
    with modules_of(BENCHMARKS, "renderer_changes") as modules:
        yield modules["renderer_changes"]


def linear_srgb(spectrum):
    """Linear sRGB, from 0, under D65 of spectra (..., wavelengths) at the observer's wavelengths."""
    eye = sensor()
    return np.maximum(spectrum @ eye.weights @ srgb_matrix(eye.white).T, 0.0)


def transmittance(wavelength, thickness, layer, substrate, cosine):
    """Unpolarised light that enters a transparent substrate (Born and Wolf, section 1.6), in NumPy."""
    q0 = cosine + 0j
    q1, q2 = (np.sqrt(n**2 - (1 - q0**2) + 0j) for n in (layer, substrate))
    phase, total = 2 * np.pi / wavelength * q1 * thickness, 0.0
    for e1, e2 in ((1, 1), (layer**2, substrate**2)):
        p0, p1, p2 = q0, q1 / e1, q2 / e2
        into = p0 * np.cos(phase) * (1 + p2 / p0) - 1j * np.sin(phase) * (p0 * p2 / p1 + p1)
        total = total + 0.5 * 4 * p0.real * p2.real / np.abs(into) ** 2
    return total


@pytest.mark.parametrize(("thickness", "base"), [(300.0, 1.0), (250.0, 1.8)])
def test_with_the_steps_of_gltf_it_is_the_published_formula(changes, thickness, base):
    look = appearance(pl.Scene(pl.Layer(1.4, thickness), base))
    steps = changes.Steps(changes.GLTF_TRANSFORM, schlick=True, complex_base=False)
    f0 = [((base - 1) / (base + 1)) ** 2] * 3
    found = jax.jit(partial(changes.mended, steps, look))(thickness, COSINE)
    exact = [published(1.4, thickness, x, f0) for x in COSINE]
    np.testing.assert_allclose(found, exact, atol=0.007)  # the code's least product 1e-5 leaves a ripple
    if base > 1:
        np.testing.assert_allclose(found, exact, atol=1e-12)


@pytest.mark.parametrize("base", [1.0, 2.7 + 2.8j])
def test_with_an_exact_transform_and_many_orders_it_is_exact(changes, base):
    """Without dispersion; linear steps of 19 nm in the table leave 0.003."""
    look = appearance(pl.Scene(pl.Layer(1.9, 200.0), base))
    steps = changes.Steps(changes.exact_transform(), orders=12)
    found = jax.jit(partial(changes.mended, steps, look))(200.0, COSINE)
    exact = linear_srgb(airy(sensor().wavelength, 200.0, 1.9, base, COSINE[:, None]))
    np.testing.assert_allclose(found, exact, atol=0.004)


def test_many_wavelengths_are_exact(changes):
    """Reflected by a film that absorbs, and what enters its base, which has no extinction."""
    look = appearance(pl.Scene(pl.Layer(1.9 + 0.2j, 200.0), 1.5))

    def found(**how):
        return jax.jit(partial(changes.spectral, 64, look, absorbs=True, **how))(200.0, COSINE)

    nm = sensor().wavelength
    reflected = linear_srgb(airy(nm, 200.0, 1.9 + 0.2j, 1.5, COSINE[:, None]))
    np.testing.assert_allclose(found(), reflected, atol=1e-3)
    entering = linear_srgb(transmittance(nm, 200.0, 1.9 + 0.2j, 1.5, COSINE[:, None]))
    np.testing.assert_allclose(found(through=True), entering, atol=1e-3)
    at = [np.flatnonzero(np.isclose(np.cos(np.deg2rad(ANGLES)), x))[0] for x in COSINE]
    exact = changes.transmitted(look)[0, at] @ srgb_matrix(sensor().white).T
    np.testing.assert_allclose(exact, entering, atol=1e-3)


@pytest.mark.slow
def test_rules_of_transmitted_light(changes):
    """What is not reflected, by channel or by the brightest of them, and a base without its film."""
    look = appearance(pl.Scene(pl.Layer(2.0, 150.0), 1.5))
    given = look, np.array([[150.0]]), COSINE
    rules = dict(changes.TRANSMITTED)
    seen = np.asarray(changes.GLTF(*given))
    np.testing.assert_allclose(rules["glTF: 1 − R"](*given), 1 - seen, rtol=1e-12)
    greatest = np.repeat(1 - seen.max(axis=-1, keepdims=True), 3, axis=-1)
    np.testing.assert_allclose(rules["glTF's text: 1 − the greatest of R"](*given), greatest, rtol=1e-12)
    glass = airy(550.0, 0.0, 1.5, 1.5, COSINE)
    without = rules["OpenPBR, Standard Surface in MaterialX 1.39.5: as without a film"](*given)
    np.testing.assert_allclose(without, np.broadcast_to((1 - glass)[None, :, None], (1, 3, 3)), rtol=1e-9)


def test_operations_grow_with_the_orders(changes):
    look = appearance(pl.Scene(pl.Layer(2.0, 150.0), 1.5))
    two, three = (
        changes.operations(
            lambda of, d, c, n=n: changes.mended(changes.Steps(changes.REFITTED, orders=n), of, d, c), look
        )
        for n in (2, 3)
    )
    assert 0 < two[0] < three[0]
    assert 0 < two[1] < three[1]
