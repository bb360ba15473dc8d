"""Directions: Snell's and the mirror law from vectors, and slopes where roots vanish."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pellicle.brdf import directions as d

RNG = np.random.default_rng(1)
V = d.direction(RNG.uniform(0, 89, 50), RNG.uniform(-180, 180, 50))
NORMAL = d.direction(RNG.uniform(0, 20, 50), RNG.uniform(-180, 180, 50))
Z = jnp.array([0.0, 0.0, 1.0])


def test_a_direction_by_its_angles():
    root = np.sqrt(0.5)
    np.testing.assert_allclose(d.direction(45.0, 90.0), [0, root, root], atol=1e-15)
    np.testing.assert_allclose(d.direction(90.0, 180.0), [-1, 0, 0], atol=1e-15)


def test_frames_turn_to_their_normal():
    theta, phi = RNG.uniform(0, 90, 20), RNG.uniform(-180, 180, 20)
    frames = d.frame(theta, phi)
    np.testing.assert_allclose(frames @ frames.mT, np.broadcast_to(np.eye(3), (20, 3, 3)), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(frames), 1, atol=1e-14)
    np.testing.assert_allclose(frames[:, 2], d.direction(theta, phi))
    np.testing.assert_allclose(d.frame(0.0, 77.0), np.eye(3), atol=1e-15)


def test_the_mirror_law():
    mirrored = d.reflect(V, NORMAL)
    np.testing.assert_allclose(d.dot(mirrored, NORMAL), d.dot(V, NORMAL), atol=1e-14)
    np.testing.assert_allclose(np.cross(mirrored + V, NORMAL), 0, atol=1e-14)


def test_snell_as_vectors():
    """n₁ t × n = n₀ (−v) × n, t is a unit vector, and it points down."""
    index = RNG.uniform(1.05, 2.5, 50)
    t = d.refract(V, NORMAL, index)
    lit = np.asarray(d.dot(V, NORMAL)) > 0
    np.testing.assert_allclose(index[:, None] * np.cross(t, NORMAL), -np.cross(V, NORMAL), atol=1e-14)
    np.testing.assert_allclose(d.length(t), 1, atol=1e-14)
    assert np.all(np.asarray(d.dot(t, NORMAL))[lit] < 0)


def test_refraction_at_its_edges():
    grazing = d.direction(90.0, 0.0)
    np.testing.assert_allclose(d.refract(grazing, Z, 1.0), -grazing, atol=1e-15)
    assert np.all(d.refract(d.direction(60.0, 0.0), Z, 0.8) == 0)
    assert float(d.cosine_inside(0.5, 0.8)) == 0


def test_half_vectors():
    i, o = V[:25], V[25:]
    h = d.half_vector(i, o)
    np.testing.assert_allclose(d.dot(i, h), d.dot(o, h), atol=1e-14)
    np.testing.assert_allclose(d.cosine_to_half(i, o), d.dot(i, h), atol=1e-14)
    np.testing.assert_allclose(d.angle_to_half(i, o), np.arccos(d.dot(i, h)), atol=1e-12)
    assert np.all(d.half_vector(i, -i) == 0)


@pytest.mark.parametrize("theta", [0.0, 90.0])
def test_slopes_are_finite_at_normal_and_grazing(theta):
    v = d.direction(theta, 30.0)
    for function in (
        lambda v: d.refract(v, Z, 1.0),
        lambda v: d.refract(v, Z, 1.5),
        lambda v: d.half_vector(v, v * jnp.array([-1.0, -1.0, 1.0])),
        lambda v: d.half_vector(v, -v),
        lambda v: d.angle_to_half(v, v),
        lambda v: d.reflect(v, Z),
    ):
        assert np.all(np.isfinite(jax.jacfwd(function)(v)))
