"""Lobes against quadrature and closed forms, their limits, and slopes at their edges."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pellicle.brdf import lobes
from pellicle.brdf.directions import direction, half_vector

from ..differences import derivative, jacobian

THETA, WEIGHT = np.polynomial.legendre.leggauss(400)
THETA = 45 * (THETA + 1)
RING = WEIGHT * np.pi / 4 * 2 * np.pi * np.sin(np.deg2rad(THETA)) * np.cos(np.deg2rad(THETA))
AROUND = direction(THETA, 0 * THETA)
UP = direction(0 * THETA, 0 * THETA)


def phong(i, o, exponent):
    return lobes.power(lobes.cosine_to_mirror(i, o), exponent)


@pytest.mark.parametrize("exponent", [1.0, 20.0, 1000.0])
def test_normalisation_of_cosine_lobes(exponent):
    """The mirror lobe at normal incidence, and the lobe of half vectors."""
    for lobe in (phong(UP, AROUND, exponent), lobes.power(AROUND[:, 2], exponent)):
        assert float((exponent + 2) / (2 * np.pi) * lobe @ RING) == pytest.approx(1, rel=1e-10)


@pytest.mark.parametrize("alpha", [0.1, 0.5, 1.0])
def test_ggx_facets_cover_the_surface(alpha):
    assert float(lobes.ggx(AROUND, alpha) @ RING) == pytest.approx(1, rel=1e-6)


def test_smith_equals_the_closed_form():
    """Heitz 2014, eq. 99: G₂ = 1/(1 + Λ(i) + Λ(o)), Λ = (√(1 + α² tan² θ) − 1)/2."""
    theta = np.array([[10.0, 70.0], [35.0, 80.0], [60.0, 60.0]])
    tan, cos = np.tan(np.deg2rad(theta)), np.cos(np.deg2rad(theta))
    shadow = 0.5 * (np.sqrt(1 + (0.3 * tan) ** 2) - 1)
    expected = 1 / (1 + shadow.sum(1)) / (4 * cos.prod(1))
    result = lobes.smith(direction(theta[:, 0], 0.0), direction(theta[:, 1], 130.0), 0.3)
    np.testing.assert_allclose(result, expected, rtol=1e-13)


def test_blinn_phong_is_a_power_of_the_half_vector():
    i, o = direction(20.0, 0.0), direction(50.0, 180.0)
    assert float(lobes.blinn_phong(i, o, 40.0)) == pytest.approx(np.cos(np.deg2rad(15)) ** 40, rel=1e-12)
    assert float(lobes.cosine_to_mirror(i, o)) == pytest.approx(np.cos(np.deg2rad(30)), rel=1e-12)


def test_narrow_ggx_keeps_its_shape_in_float32():
    i, o = direction(np.float32(30), np.float32(0)), direction(np.float32(30.2), np.float32(180))
    exact = lobes.ggx(half_vector(direction(30.0, 0.0), direction(30.2, 180.0)), 0.003)
    narrow = lobes.ggx(half_vector(i, o), np.float32(0.003))
    assert narrow.dtype == np.float32
    assert float(narrow) == pytest.approx(float(exact), rel=1e-3)


LOBES = [(phong, 1.0), (lobes.blinn_phong, 1.0), (phong, 1e5), (lobes.microfacets, 0.003)]


@functools.cache
def compiled(lobe):
    """A lobe, and its slopes in both directions and the width."""
    return jax.jit(lobe), jax.jit(jax.jacfwd(lobe, argnums=(0, 1, 2)))


@pytest.mark.parametrize(
    ("lobe", "width"), [(phong, 30.0), (lobes.blinn_phong, 30.0), (lobes.microfacets, 0.2)]
)
@pytest.mark.parametrize("theta", [0.0, 60.0])
def test_slopes_against_finite_differences(lobe, width, theta):
    arguments = [direction(theta, 0.0), direction(40.0, 150.0), jnp.array(width)]
    run, slopes = compiled(lobe)
    for position, (step, slope) in enumerate(
        zip((1e-6, 1e-6, 1e-6 * width), slopes(*arguments), strict=True)
    ):

        def along(x, position=position):
            return run(*arguments[:position], x, *arguments[position + 1 :])

        x = arguments[position]
        numeric = (jacobian if x.ndim else derivative)(along, x, step)
        np.testing.assert_allclose(slope, numeric, rtol=1e-6, atol=1e-8 * np.max(np.abs(numeric)))


@pytest.mark.parametrize(("lobe", "width"), LOBES)
@pytest.mark.parametrize("theta", [0.0, 60.0, 90.0])
def test_slopes_at_the_edges_of_a_lobe(lobe, width, theta):
    """Finite everywhere; zero with a Phong lobe of width 1 on its dark side."""
    i = direction(theta, 0.0)
    run, slopes = compiled(lobe)
    for o in (i, direction(90.0, 90.0), direction(90.0, 180.0), -i):
        value = run(i, o, width)
        for slope in slopes(i, o, width):
            assert np.all(np.isfinite(slope))
            if lobe is phong and value == 0:
                assert np.all(slope == 0)
