"""Directions: Snell's law, the law of reflection by vectors, and slopes where roots vanish."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pellicle.brdf import directions as d

from ..differences import jacobian

RNG = np.random.default_rng(1)
V = d.direction(RNG.uniform(0, 89, 50), RNG.uniform(-180, 180, 50))
NORMAL = d.direction(RNG.uniform(0, 20, 50), RNG.uniform(-180, 180, 50))
Z = jnp.array([0.0, 0.0, 1.0])


def test_direction_from_angles():
    root = np.sqrt(0.5)
    np.testing.assert_allclose(d.direction(45.0, 90.0), [0, root, root], atol=1e-15)
    np.testing.assert_allclose(d.direction(90.0, 180.0), [-1, 0, 0], atol=1e-15)


def test_frames_are_tilted_to_their_normal():
    theta, phi = RNG.uniform(0, 90, 20), RNG.uniform(-180, 180, 20)
    frames = d.frame(theta, phi)
    np.testing.assert_allclose(frames @ frames.mT, np.broadcast_to(np.eye(3), (20, 3, 3)), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(frames), 1, atol=1e-14)
    np.testing.assert_allclose(frames[:, 2], d.direction(theta, phi))
    np.testing.assert_allclose(d.frame(0.0, 77.0), np.eye(3), atol=1e-15)


def test_law_of_reflection():
    mirrored = d.reflect(V, NORMAL)
    np.testing.assert_allclose(d.dot(mirrored, NORMAL), d.dot(V, NORMAL), atol=1e-14)
    np.testing.assert_allclose(np.cross(mirrored + V, NORMAL), 0, atol=1e-14)


def test_snells_law():
    """n₁ sin θ₁ = n₀ sin θ₀; no light is refracted in total reflection."""
    index, cosine = RNG.uniform(1.05, 2.5, 50), RNG.uniform(0, 1, 50)
    sine = index * np.sqrt(1 - np.asarray(d.cosine_inside(cosine, index)) ** 2)
    np.testing.assert_allclose(sine, np.sqrt(1 - cosine**2), atol=1e-14)
    assert float(d.cosine_inside(0.5, 0.8)) == 0


def test_half_vectors():
    i, o = V[:25], V[25:]
    h = d.half_vector(i, o)
    np.testing.assert_allclose(d.dot(i, h), d.dot(o, h), atol=1e-14)
    np.testing.assert_allclose(d.cosine_to_half(i, o), d.dot(i, h), atol=1e-14)
    np.testing.assert_allclose(d.angle_to_half(i, o), np.arccos(d.dot(i, h)), atol=1e-12)
    assert np.all(d.half_vector(i, -i) == 0)


@pytest.mark.parametrize("theta", [0.0, 40.0, 90.0])
def test_slopes_at_normal_and_grazing_incidence(theta):
    v = d.direction(theta, 30.0)
    smooth = [lambda v: d.reflect(v, Z)]
    if theta < 90:  # at 90 degrees both vectors are opposite
        smooth.append(lambda v: d.half_vector(v, v * jnp.array([-1.0, -1.0, 1.0])))
    for function in smooth:
        run, slopes = jax.jit(function), jax.jit(jax.jacfwd(function))
        np.testing.assert_allclose(slopes(v), jacobian(run, v, 1e-6), atol=1e-8)


def test_slopes_are_zero_where_a_root_vanishes():
    """The true slopes depend on the direction of the step."""
    grazing = d.direction(90.0, 30.0)
    for function in (lambda v: d.half_vector(v, -v), lambda v: d.angle_to_half(v, v)):
        assert np.all(jax.jit(jax.jacfwd(function))(grazing) == 0)
