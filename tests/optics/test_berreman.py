"""The 4×4 method against eigenvectors of Berreman's matrix, the 2×2 method, and laws of physics."""

import jax
import numpy as np
import pytest
from scipy.linalg import expm

from pellicle.optics import anisotropy, coherent, response
from pellicle.optics.anisotropy import Principal, axis_direction, uniaxial
from pellicle.optics.berreman.stack import polarised, transmittances
from pellicle.optics.pair import to_complex, to_pair

from .lens_reference import berreman, permittivity

COUNT = 30


def by_eigenvectors(n0, layers, substrate, phases, angle):
    """Jones matrix and T of p and s, by scipy's matrix exponential: for layers that are not opaque."""
    a, cosine = n0 * np.sin(angle), np.cos(angle)
    q, waves = np.linalg.eig(berreman(substrate, a))
    flux = np.real(waves[0] * waves[1].conj() + waves[2] * waves[3].conj())
    below = waves[:, np.argsort(-np.where(abs(q.imag) > 1e-9, q.imag, flux))[:2]]
    fields = below
    for e, k in reversed(list(zip(layers, phases, strict=True))):
        fields = expm(-1j * k * berreman(e, a)) @ fields
    q0 = n0 * cosine
    p_s_down_up = np.array([[cosine, 0, -cosine, 0], [n0, 0, n0, 0], [0, 1, 0, 1], [0, q0, 0, -q0]])
    amplitudes = np.linalg.solve(p_s_down_up, fields)
    per_incident = np.linalg.inv(amplitudes[:2])
    Ex, Hy, Ey, Hx = below @ per_incident
    return amplitudes[2:] @ per_incident, np.real(Ex * Hy.conj() + Ey * Hx.conj()) / q0


@jax.jit
def computed(n, turns, k, n0, angle):
    """Jones matrices and (T_p, T_s) of a uniaxial, an isotropic and a biaxial layer on a uniaxial crystal."""
    n = [to_pair(x) for x in n]
    layers = [
        uniaxial(n[0], n[1], turns[0], turns[1]),
        n[2],
        anisotropy.permittivity(Principal(n[3], n[4], n[5]), turns[2], turns[3], turns[4]),
    ]
    substrate = uniaxial(n[6], n[7], turns[5], turns[6])
    found = polarised(n0, layers, substrate, list(k), angle, dichroic=False)
    jones = jax.numpy.stack([to_complex(x) for x in found.reflected], axis=-1).reshape(-1, 2, 2)
    return jones, jax.numpy.stack(transmittances(found), axis=-1)


@pytest.fixture(scope="module")
def stacks():
    """Random stacks: indices, angles of the axes, phases, ambient, angle of incidence."""
    rng = np.random.default_rng(3)
    n = rng.uniform(1.3, 2.4, (8, COUNT)) + 1j * rng.uniform(0, 0.3, (8, COUNT))
    turns, k = rng.uniform(0, np.pi, (7, COUNT)), rng.uniform(0, 5, (3, COUNT))
    return n, turns, k, rng.uniform(1, 1.6, COUNT), rng.uniform(0, 1.5, COUNT)


def compare(n, turns, k, n0, angle):
    jones, T = map(np.asarray, computed(n, turns, k, n0, angle))
    for i in range(COUNT):
        t, m = np.rad2deg(turns[:, i]), n[:, i]
        layers = [permittivity(m[:2], *t[:2]), np.eye(3) * m[2] ** 2, permittivity(m[3:6], *t[2:5])]
        expected = by_eigenvectors(n0[i], layers, permittivity(m[6:], *t[5:]), k[:, i], angle[i])
        np.testing.assert_allclose(jones[i], expected[0], rtol=0, atol=1e-10)
        np.testing.assert_allclose(T[i], expected[1], rtol=0, atol=1e-10)


@pytest.mark.slow
def test_absorbing_stacks(stacks):
    compare(*stacks)


def test_transparent_stacks(stacks):
    n, *others = stacks
    compare(n.real, *others)  # real media take real arithmetic
    jones, T = computed(n.real, *others)
    # also beyond total reflection in the substrate
    np.testing.assert_allclose(np.sum(np.abs(jones) ** 2, axis=1) + T, 1, rtol=0, atol=1e-12)


@pytest.mark.slow  # compiles for 6 s
def test_isotropic_media_are_those_of_the_2x2_method(stacks):
    n, turns, k, n0, angle = stacks
    n = n[[0, 0, 2, 3, 3, 3, 6, 6]]
    jones, T = computed(n, turns, k, n0, angle)
    layers = [to_pair(n[i]) for i in (0, 2, 3)]
    s, p = jax.jit(coherent.responses)(n0, layers, to_pair(n[6]), list(k), angle)
    for i, one in enumerate((p, s)):
        expected = to_complex(one.reflected) / to_complex(one.denominator)
        np.testing.assert_allclose(jones[:, i, i], expected, rtol=0, atol=1e-12)
        np.testing.assert_allclose(T[:, i], response.transmittance(one), rtol=0, atol=1e-12)
    np.testing.assert_allclose(jones[:, 0, 1], 0, atol=1e-12)
    np.testing.assert_allclose(jones[:, 1, 0], 0, atol=1e-12)


@pytest.mark.slow  # the program of the test before
def test_reciprocity(stacks):
    """With the plane of incidence turned by 180° light retraces its path: r_ps and −r_sp change places."""
    n, turns, k, n0, angle = stacks
    there, _ = computed(n, turns, k, n0, angle)
    half_turn = np.array([0, np.pi, 0, np.pi, 0, 0, np.pi])[:, None]
    back, _ = computed(n, turns + half_turn, k, n0, angle)
    np.testing.assert_allclose(
        np.swapaxes(back, 1, 2) * np.array([[1, -1], [-1, 1]]), there, rtol=0, atol=1e-12
    )


def test_aligned_axes_keep_p_and_s_apart():
    n = np.array([1.6 + 0.1j, 1.9, 1.4 + 0.2j])
    crystal = Principal(*map(to_pair, n))
    found = jax.jit(lambda k: polarised(1.0, [crystal], crystal, [k], 1.0))(2.0)
    expected, T = by_eigenvectors(1.0, [np.diag(n**2)], np.diag(n**2), [2.0], 1.0)
    jones = np.reshape([to_complex(x) for x in found.reflected], (2, 2))
    np.testing.assert_allclose(jones, expected, rtol=0, atol=1e-14)
    np.testing.assert_allclose(transmittances(found), T, rtol=0, atol=1e-14)
    assert jones[0, 1] == jones[1, 0] == 0


def test_axis_direction():
    np.testing.assert_allclose(axis_direction(np.pi / 2, 0.0), (1, 0, 0), atol=1e-16)
    np.testing.assert_allclose(axis_direction(np.pi / 2, np.pi / 2), (0, 1, 0), atol=1e-16)
