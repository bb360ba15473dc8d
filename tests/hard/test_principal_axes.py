"""R, T and their slopes for media with principal axes along the laboratory's, against 50 digits."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from pellicle.optics.anisotropy import Principal
from pellicle.optics.coherent import responses
from pellicle.optics.pair import Pair
from pellicle.optics.response import reflectance, transmittance

DEGREE = np.pi / 180

# phase k₀d, angle of incidence in degrees, n and k of the layer along x, y and z, and of the substrate
CASES = {
    "mica": (12.0, 60.0, (1.594, 0), (1.600, 0), (1.563, 0), (3.9, 0.02), (3.9, 0.02), (3.9, 0.02)),
    "rutile on glass": (3.0, 70.0, (2.61, 0), (2.61, 0), (2.9, 0), (1.5, 0), (1.5, 0), (1.5, 0)),
    "glass on calcite": (2.0, 75.0, (1.5, 0), (1.5, 0), (1.5, 0), (1.66, 0), (1.66, 0), (1.49, 0)),
    "dichroic": (2.5, 50.0, (1.6, 0.5), (1.5, 0), (1.55, 0.1), (2.0, 0.3), (1.8, 0), (1.7, 0.2)),
    "no thickness": (0.0, 50.0, (1.6, 0.5), (1.5, 0), (1.55, 0.1), (2.0, 0.3), (1.8, 0), (1.7, 0.2)),
    "opaque to p": (800.0, 45.0, (1.6, 2.0), (1.5, 0), (1.6, 2.0), (2.0, 0.1), (1.8, 0), (1.7, 0.2)),
    "p at its critical angle": (2.0, 30.0, (1.3, 0), (1.4, 0), (0.5, 0), (1.8, 0), (1.7, 0), (1.6, 0)),
    "s at its critical angle": (2.0, 30.0, (1.3, 0), (0.5, 0), (1.4, 0), (1.8, 0), (1.7, 0), (1.6, 0)),
    "p evanescent": (1.5, 60.0, (1.3, 0), (1.4, 0), (0.6, 0), (1.8, 0), (1.7, 0), (1.6, 0)),
    "p reflected by the substrate": (2.0, 80.0, (1.5, 0), (1.4, 0), (1.6, 0), (1.4, 0), (1.2, 0), (0.7, 0)),
    "near grazing": (2.0, 89.9999, (1.6, 0), (1.5, 0), (1.55, 0), (2.0, 0.3), (1.8, 0), (1.7, 0.2)),
    "hyperbolic": (1.0, 40.0, (0.05, 2.0), (1.4, 0.1), (1.5, 0.1), (1.8, 0), (1.7, 0), (1.6, 0)),
    "nearly the ambient": (3.0, 50.0, (1 + 1e-9, 0), (1 + 1e-9, 0), (1 - 1e-9, 0), (1, 0), (1, 0), (1, 0)),
}


def truth(numbers: list[mp.mpf]) -> list[mp.mpf]:
    """R and T of s, then of p, by characteristic matrices in 50 digits."""
    phase, angle, *parts = numbers
    x, y, z, x2, y2, z2 = (mp.mpc(n, k) for n, k in zip(parts[::2], parts[1::2], strict=True))
    a, found = mp.sin(angle), []

    def down(q: mp.mpc) -> mp.mpc:
        # of a real index moved a step towards gain, the root next to the one without gain
        return -q if q.imag < -1e-12 or (q.imag < 1e-12 and q.real < 0) else q

    for q, e, q2, e2 in (
        (mp.sqrt(y * y - a * a), 1, mp.sqrt(y2 * y2 - a * a), 1),
        (x * mp.sqrt(1 - a * a / (z * z)), x * x, x2 * mp.sqrt(1 - a * a / (z2 * z2)), x2 * x2),
    ):
        q2, q0 = down(q2), mp.cos(angle)
        c, f = mp.cos(q * phase), (mp.sin(q * phase) / q if abs(q) > mp.mpf("1e-30") else phase)
        E, H = c - 1j * f * e * q2 / e2, c * q2 / e2 - 1j * f * q * q / e
        found += [abs((q0 * E - H) / (q0 * E + H)) ** 2, 4 * q0 * mp.re(q2 / e2) / abs(q0 * E + H) ** 2]
    return found


@jax.jit
@jax.vmap
def values_and_slopes(numbers):
    def powers(numbers):
        phase, angle, *parts = numbers
        indices = [Pair(n, k) for n, k in zip(parts[::2], parts[1::2], strict=True)]
        media = Principal(*indices[:3]), Principal(*indices[3:])
        both = responses(jnp.ones(()), media[:1], media[1], [phase], angle)
        return jnp.stack([power(each) for each in both for power in (reflectance, transmittance)])

    return powers(numbers), jax.jacfwd(powers)(numbers)


@pytest.fixture(scope="module")
def computed():
    with jax.enable_x64(True):
        numbers = np.array([_numbers(case) for case in CASES.values()])
        values, slopes = values_and_slopes(jnp.asarray(numbers))
        return dict(zip(CASES, zip(np.asarray(values), np.asarray(slopes), strict=True), strict=True))


def _numbers(case) -> list[float]:
    phase, degrees, *media = case
    return [phase, degrees * DEGREE, *(part for medium in media for part in medium)]


@pytest.mark.parametrize("name", CASES)
def test_value_and_slope_in_every_number(name, computed):
    values, slopes = computed[name]
    numbers, step = _numbers(CASES[name]), mp.mpf("1e-18")
    with mp.workdps(50):
        exact = [mp.mpf(x) for x in numbers]
        np.testing.assert_allclose(values, [float(x) for x in truth(exact)], rtol=2e-12, atol=1e-15)
        for i in range(len(exact)):
            one, other = ([x + way * step * (j == i) for j, x in enumerate(exact)] for way in (1, -1))
            slope = [float((u - v) / (2 * step)) for u, v in zip(truth(one), truth(other), strict=True)]
            if name == "p at its critical angle" and i == 1:  # the numbers round to either side of 0.5
                continue
            np.testing.assert_allclose(slopes[:, i], slope, rtol=1e-9, atol=1e-11, err_msg=f"number {i}")


@pytest.mark.slow
def test_equal_indices_are_an_isotropic_medium_to_the_last_digits():
    with jax.enable_x64(True):
        angle, phase = jnp.linspace(0.0, 1.57, 64), jnp.linspace(0.0, 20.0, 64)
        layer, below = Pair(jnp.array(1.8), jnp.array(0.01)), Pair(jnp.array(3.9), jnp.array(0.02))
        equal = [Principal(n, n, n) for n in (layer, below)]
        for count in (1, 3):
            own = responses(1.0, [equal[0]] * count, equal[1], [phase] * count, angle)
            isotropic = responses(1.0, [layer] * count, below, [phase] * count, angle)
            for a, b in zip(own, isotropic, strict=True):
                np.testing.assert_allclose(reflectance(a), reflectance(b), rtol=1e-12)
                np.testing.assert_allclose(transmittance(a), transmittance(b), rtol=1e-12)
