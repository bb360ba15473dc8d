"""The model of Granier and Heidrich against its equations by vectors, mpmath and quadrature."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

from pellicle.brdf import granier_heidrich as gh
from pellicle.brdf.albedo import albedos, directional_albedo, energy_warning
from pellicle.brdf.directions import direction
from pellicle.brdf.models import PRESETS, model

from ..differences import derivative
from ..directions import unit

RNG = np.random.default_rng(5)
N = 40
I = direction(RNG.uniform(0, 85, N), RNG.uniform(-180, 180, N))
O = direction(RNG.uniform(0, 85, N), RNG.uniform(-180, 180, N))
WAVELENGTHS = np.array([645.0, 525.0, 445.0])
SURFACE = {
    "thickness": 71.0,
    "n": np.array([1.4, 1.45, 1.6]),
    "exponent_reflection": 3.0,
    "exponent_transmission": 5.0,
    "deviation": 10.0,
    "azimuth": 25.0,
    "specular": 1.3,
    "diffuse": 0.2,
}


def jitted(name):
    return jax.jit(lambda s, i, o: model(name)(s, i, o))


PUBLISHED, RECIPROCAL = jitted("granier-heidrich"), jitted("granier-heidrich-reciprocal")


def downward(v, index):
    """Return the refracted direction by angles: it points down, and its azimuth is reversed."""
    inside = np.arcsin(np.hypot(v[0], v[1]) / index)
    return -unit(np.rad2deg(inside), np.rad2deg(np.arctan2(v[1], v[0])))


def by_hand(s, i, o, index, wavelength):
    """Evaluate eqs. 3 and 5 to 10 by vectors, for one channel of one pair of directions."""
    n0, n1 = np.array([0, 0, 1.0]), unit(s["deviation"], s["azimuth"])
    down_i, down_o = downward(i, index), downward(o, index)
    f = ((1 - index) / (1 + index)) ** 2
    F = f + (1 - f) * (1 - i @ n0) ** 5
    T_o = (1 - f) * (1 - (1 + down_o @ n0) ** 5)
    mirrored = 2 * (i @ n0) * n0 - i
    mirrored_inside = down_i - 2 * (down_i @ n1) * n1
    lobe = mirrored_inside @ -down_o
    null = down_i @ n1 >= 0 or down_o @ n1 >= 0 or lobe <= 0
    R = F * max(mirrored @ o, 0) ** s["exponent_reflection"]
    T = 0 if null else (1 - F) * T_o * lobe ** s["exponent_transmission"]
    phase = np.pi * index * s["thickness"] / wavelength * ((down_i + down_o) @ -n0)
    return s["specular"] * (R + T + 2 * np.cos(2 * phase) * np.sqrt(R * T)) + s["diffuse"]


def test_equations_of_the_paper_by_vectors():
    expected = [
        [by_hand(SURFACE, i, o, *channel) for channel in zip(SURFACE["n"], WAVELENGTHS, strict=True)]
        for i, o in zip(np.asarray(I), np.asarray(O), strict=True)
    ]
    np.testing.assert_allclose(PUBLISHED(SURFACE, I, O), expected, rtol=1e-11)


def test_only_the_reciprocal_variant_is_reciprocal():
    there, back = RECIPROCAL(SURFACE, I, O), RECIPROCAL(SURFACE, O, I)
    np.testing.assert_allclose(there, back, rtol=1e-12)
    there, back = PUBLISHED(SURFACE, I, O), PUBLISHED(SURFACE, O, I)
    assert float(jnp.max(jnp.abs(there - back) / jnp.maximum(there, back))) > 0.1


@pytest.mark.parametrize("n", [1.0, 1.5, 2.2])
def test_diffuse_reflectance_is_the_average_of_schlick(n):
    f = ((1 - n) / (1 + n)) ** 2
    average = mpmath.quad(lambda c: 2 * c * (f + (1 - f) * (1 - c) ** 5), [0, 1])
    assert float(gh.diffuse_reflectance(n)) == pytest.approx(float(average), rel=1e-14)
    assert float(gh.diffuse_reflectance(n) + gh.diffuse_transmittance(n)) == pytest.approx(1, rel=1e-14)


@pytest.mark.slow  # compiles for 2 s
def test_diffuse_part_is_eq_16():
    n, T = SURFACE["n"], 80 / 21 * SURFACE["n"] / (1 + SURFACE["n"]) ** 2
    expected = 1 + 2 * np.cos(4 * np.pi * n * 71.0 / WAVELENGTHS) * np.sqrt(T * (1 - T))
    diffuse = model("granier-heidrich-diffuse")({"thickness": 71.0, "n": n, "diffuse": 0.7}, I, O)
    np.testing.assert_allclose(diffuse, np.broadcast_to(0.7 * expected, (N, 3)), rtol=1e-12)
    bare = PUBLISHED({**SURFACE, "diffuse": 0.0}, I, O)
    full = model("granier-heidrich-full")({**SURFACE, "diffuse": 0.7}, I, O)
    np.testing.assert_allclose(full, bare + diffuse, rtol=1e-12)


def test_without_interference_is_the_mean_over_thickness():
    """cos 2Φ averages to zero over whole periods of one direction and channel."""
    i, o, n = I[0], I[0] * jnp.array([-1.0, -1.0, 1.0]), 1.5
    inside = np.sqrt(1 - (1 - float(i[2]) ** 2) / n**2)
    heights = np.arange(64) / 64 * 525.0 / (2 * n * inside)
    s = {**SURFACE, "n": n}
    waves = PUBLISHED({**s, "thickness": heights}, i[None], o[None])[:, 1].mean()
    flat = model("granier-heidrich").without_interference()(s, i, o)
    assert float(waves) == pytest.approx(float(flat[1]), rel=1e-12)


def test_energy_exceeds_one_as_published():
    """The peak is (√F + 1 − F)² = 1.346 for F = 0.04; with exponents of 1 the albedo is far above 1."""
    up = direction(0.0, 0.0)
    s = {**SURFACE, "n": 1.5, "thickness": 0.0, "deviation": 0.0, "specular": 1.0, "diffuse": 0.0}
    np.testing.assert_allclose(PUBLISHED(s, up, up), (0.2 + 0.96) ** 2, rtol=1e-12)
    broad = {**s, "exponent_reflection": 1.0, "exponent_transmission": 1.0}
    assert jax.jit(lambda: albedos(PUBLISHED, broad))().max() > 2


@pytest.mark.slow  # integrates over the hemisphere
def test_the_energy_warning_gives_the_albedo():
    """Figure 3 has weights 1 and 0.7; here light at the normal, summed over the hemisphere by quadrature."""
    name, figure = PRESETS["granier-heidrich figure 3, parallel"]
    node, weight = np.polynomial.legendre.leggauss(200)
    theta = 45 * (node + 1)
    ring = weight * np.pi / 4 * 2 * np.pi * np.cos(np.deg2rad(theta)) * np.sin(np.deg2rad(theta))
    lobes = {**figure, "diffuse": 0.0}
    red = [by_hand(lobes, unit(0, 0), unit(each, 0), 1.4, 645.0) for each in theta] @ ring
    T = 80 / 21 * 1.4 / 2.4**2
    red += np.pi * 0.7 * (1 + 2 * np.cos(4 * np.pi * 1.4 * 71 / 645) * np.sqrt(T * (1 - T)))
    assert float(directional_albedo(model(name), figure, 0.0)[0]) == pytest.approx(red, rel=1e-6)
    warning = energy_warning(albedos(model(name), figure))
    assert float(warning.split("up to ")[1].split()[0]) >= round(red, 2) > 1
    assert energy_warning(albedos(PUBLISHED, SURFACE | {"specular": 0.01, "diffuse": 0.1})) is None


KEYS = ("thickness", "exponent_reflection", "exponent_transmission", "deviation", "azimuth", "n")


@jax.jit
def slopes(s, i, o):
    return jax.jacfwd(lambda free: PUBLISHED({**s, **free}, i, o))({key: s[key] for key in KEYS})


def test_slopes_against_finite_differences():
    for key, slope in slopes(SURFACE, I, O).items():
        step = 1e-5 * np.max(SURFACE[key])
        expected = derivative(lambda x, key=key: PUBLISHED({**SURFACE, key: x}, I, O), SURFACE[key], step)
        # each channel has an index of its own
        found = slope.sum(axis=-1) if key == "n" else slope
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-7 * np.max(np.abs(expected)))


def test_value_and_slopes_are_finite_at_the_edges():
    """Parallel boundaries, exponents at their bounds, grazing and normal light, no layer, no contrast."""
    edge = direction(np.array([0.0, 90.0, 88.0, 45.0, 45.0]), np.array([0.0, 0.0, 10.0, 0.0, 0.0]))
    other = direction(np.array([0.0, 90.0, 88.0, 45.0, 90.0]), np.array([0.0, 180.0, 10.0, 0.0, 90.0]))
    for n in (1.0, 1.05, 1.41, 2.5):
        for exponent in (1.0, 1000.0):
            s = {**SURFACE, "n": n * np.ones(3), "deviation": 0.0, "thickness": 0.0}
            s |= {"exponent_reflection": exponent, "exponent_transmission": exponent}
            assert np.all(np.asarray(PUBLISHED(s, edge, other)) >= 0)
            assert all(np.all(np.isfinite(x)) for x in jax.tree.leaves(slopes(s, edge, other)))
