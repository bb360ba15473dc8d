"""Graded layers against closed forms: Airy functions (ε linear in depth), Bessel functions (exponential)."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from pellicle.optics import coherent, response
from pellicle.optics.gradient import Gradient, gauss_points
from pellicle.optics.pair import Pair, to_complex, to_pair

NM, DEPTH, SINE = 500.0, 300.0, 0.8
SUBSTRATE = 3.5 + 0.1j


def matched(solutions, slopes, wavenumber):
    """r of s-polarised light from two solutions E(z) and their slopes at z = 0 and d."""
    q0, q2 = mp.sqrt(1 - SINE**2), mp.sqrt(mp.mpc(SUBSTRATE) ** 2 - SINE**2)
    # E and H = E'/(i k0) at the substrate are 1 and q2
    (u, v), (du, dv) = ([f(DEPTH) for f in pair] for pair in (solutions, slopes))
    det, slope = u * dv - v * du, 1j * wavenumber * q2
    a, b = (dv - v * slope) / det, (u * slope - du) / det
    (u, v), (du, dv) = ([f(0) for f in pair] for pair in (solutions, slopes))
    E, H = a * u + b * v, (a * du + b * dv) / (1j * wavenumber)
    return complex((q0 * E - H) / (q0 * E + H))


def airy(top, bottom):
    """r of ε linear from `top` to `bottom`."""
    k0, slope = 2 * mp.pi / NM, (mp.mpc(bottom) - top) / DEPTH
    scale = (k0**2 * slope) ** (mp.mpf(1) / 3)

    def argument(z):
        return -k0 * k0 * (top - SINE**2 + slope * z) / scale**2

    solutions = [lambda z: mp.airyai(argument(z)), lambda z: mp.airybi(argument(z))]
    slopes = [
        lambda z: -scale * mp.airyai(argument(z), derivative=1),
        lambda z: -scale * mp.airybi(argument(z), derivative=1),
    ]
    return matched(solutions, slopes, k0)


def bessel(top, bottom):
    """r of ε exponential from `top` to `bottom`."""
    k0, rate = 2 * mp.pi / NM, mp.log(mp.mpf(bottom) / top) / DEPTH
    order = 2 * k0 * SINE / rate

    def argument(z):
        return 2 * k0 * mp.sqrt(top) / rate * mp.exp(rate * z / 2)

    def slope_of(f):
        return lambda z: rate / 2 * argument(z) * f(order, argument(z), derivative=1)

    solutions = [lambda z: mp.besselj(order, argument(z)), lambda z: mp.bessely(order, argument(z))]
    return matched(solutions, [slope_of(mp.besselj), slope_of(mp.bessely)], k0)


@jax.jit
def amplitude(points):
    (s,) = coherent.responses(
        1.0, [points], to_pair(jnp.asarray(SUBSTRATE)), [2 * jnp.pi * DEPTH / NM], jnp.arcsin(SINE), "s"
    )
    return to_complex(s.reflected) / to_complex(s.denominator)


def gradient(permittivity, count):
    index = np.sqrt(permittivity(gauss_points(count)) + 0j)
    return Gradient(*(Pair(jnp.asarray(x.real), jnp.asarray(x.imag)) for x in index))


@pytest.mark.parametrize(
    ("top", "bottom"), [(2.1, 4.0), (4.0, 2.1), (4.0 + 0.9j, 2.1 + 0.02j), (0.3, 2.5), (-2.0 + 3.0j, 2.0)]
)
def test_linear_permittivity_has_airy_functions(top, bottom):
    """Also through a turning point (ε = sin²θ inside), and from a metal."""
    found = amplitude(gradient(lambda z: top + (bottom - top) * z, 64))
    assert abs(found - airy(top, bottom)) < 2e-10


def test_exponential_permittivity_has_bessel_functions():
    found = amplitude(gradient(lambda z: 2.1 * np.exp(z * np.log(4.0 / 2.1)), 64))
    assert abs(found - bessel(2.1, 4.0)) < 2e-10


def test_slices_are_of_sixth_order():
    truth = airy(2.1, 4.0)
    errors = [abs(amplitude(gradient(lambda z: 2.1 + 1.9 * z, n)) - truth) for n in (8, 16)]
    assert errors[0] / errors[1] > 50


def test_energy_is_conserved_by_few_slices():
    """Whatever the error of the slices, the matrix of each has determinant 1."""
    z = gauss_points(3)
    points = Gradient(*(jnp.asarray(1.4 + 0.8 * np.sin(5 * x) ** 2)[:, None] for x in z))
    phases = [jnp.array([1.0]), jnp.array([4.0])]
    for each in jax.jit(coherent.responses)(1.0, [1.38, points], 1.52, phases, 0.9):
        assert abs(float(response.reflectance(each)[0] + response.transmittance(each)[0]) - 1) < 1e-14
        assert abs(float(response.reflectance(each)[0] - response.reflectance_below(each)[0])) < 1e-14


@pytest.mark.slow  # compiles stacks of several kinds
def test_equal_points_are_a_homogeneous_layer():
    """Value and slopes, rough faces too, beside a layer without slices."""
    index, rough = jnp.array([1.9, 2.2]), [0.1, 0.2, 0.3]

    def found(index, phase, layer):
        stack = [layer(index), 1.38]
        pair = coherent.responses(
            1.0, stack, Pair(3.9, 0.02), [phase, jnp.array([1.0, 2.0])], 0.9, roughness=rough
        )
        return sum(response.reflectance(x) + 2 * response.transmittance(x) for x in pair)

    def sliced(index):
        return Gradient(*(jnp.broadcast_to(index, (4, 2)) for _ in range(3)))

    ways = [
        jax.jit(jax.value_and_grad(lambda n, k, layer=layer: jnp.sum(found(n, k, layer)), argnums=(0, 1)))(
            index, jnp.array([3.0, 5.0])
        )
        for layer in (sliced, lambda n: n)
    ]
    for one, other in zip(*map(jax.tree.leaves, ways), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)
