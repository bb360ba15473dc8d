"""One boundary: Fresnel's coefficients, energy, the branch of the root; and both faces of a thick plate."""

import jax
import numpy as np
import pytest

from pellicle.optics import interface, plate
from pellicle.optics.pair import Pair, imag, is_real, real, to_complex, to_pair


def boundary(n1, n2, degrees, letter, kind=to_pair):
    a, q1 = interface.transverse(np.float64(n1), np.deg2rad(np.float64(degrees)))
    n2 = kind(np.complex128(n2))
    arguments = np.float64(n1), q1, n2, interface.normal(n2, a), letter
    return [float(f(*arguments)) for f in (interface.reflectance, interface.transmittance)]


def test_normal_incidence_computes_nothing_oblique():
    a, q0 = interface.transverse(1.5, None)
    assert (a, q0) == (0.0, 1.5)
    layer = Pair(1.46, 0.1)
    assert interface.normal(layer, a) is layer


@pytest.mark.parametrize("letter", "sp")
@pytest.mark.parametrize("n2", [1.5, 0.2 + 3.4j, 2 + 0.1j, 0.7])
@pytest.mark.parametrize("degrees", [0.0, 30.0, 75.0, 90.0])
def test_energy(n2, degrees, letter):
    """With an absorbing second medium too, where one power factor for s and p would be 1 % wrong."""
    reflected, passed = boundary(1.0, n2, degrees, letter)
    assert reflected + passed == pytest.approx(1, abs=1e-15)
    assert 0 <= passed <= 1


@pytest.mark.parametrize("letter", "sp")
def test_no_light_leaves_an_evanescent_wave(letter):
    """Incident waves that carry no power: T is 0, not 0/0, and the derivative stays finite."""
    q = Pair(np.float64(0.0), np.float64(0.8))
    assert interface.transmittance(np.float64(1.0), q, np.float64(1.5), np.float64(1.2), letter) == 0


def test_root_decays():
    q = interface.normal(Pair(np.float64(1.0), np.float64(0.0)), np.float64(1.2))
    assert complex(to_complex(q)) == pytest.approx(1j * np.sqrt(0.44))
    assert imag(interface.normal(Pair(np.float64(1.0), np.float64(-0.0)), np.float64(1.2))) > 0


def test_allow_tunnelling_only_widens_a_real_index():
    wide = interface.allow_tunnelling(1.5)
    assert not is_real(wide)
    assert (float(real(wide)), float(imag(wide))) == (1.5, 0.0)
    absorbing = Pair(1.5, 0.1)
    assert interface.allow_tunnelling(absorbing) is absorbing


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_cosine_of_90_degrees_is_not_negative(dtype):
    """Its slope stays that of the cosine."""

    def q0(angle):
        return interface.transverse(dtype(1.5), angle)[1]

    value, slope = jax.jvp(q0, (np.deg2rad(dtype(90)),), (dtype(1),))
    assert 0 < value < 1e-8
    assert slope == pytest.approx(-1.5)


def test_the_bounces_are_summed():
    front, back, passed, internal = plate.Face(0.2, 0.7, 0.3), 0.5, 0.4, 0.8
    up = [0.7 * (internal**2 * back) ** (m + 1) * front.reflectance_below**m * 0.7 for m in range(60)]
    down = [0.7 * internal * passed * (internal**2 * back * front.reflectance_below) ** m for m in range(60)]
    assert plate.plate_reflectance(front, back, internal) == pytest.approx(0.2 + sum(up))
    assert plate.plate_transmittance(front, back, passed, internal) == pytest.approx(sum(down))


def test_an_opaque_plate_hides_its_back():
    front = plate.Face(0.2, 0.7, 0.3)
    assert plate.plate_reflectance(front, 0.5, 0.0) == 0.2
    assert plate.plate_transmittance(front, 0.5, 0.4, 0.0) == 0


def test_beers_law():
    """α = 4πk/λ: 1 mm of k = 1e-6 at 500 nm has α = 25.13 /m·10³ and passes e^−0.02513."""
    assert plate.internal_transmittance(1e-6, 1.0, 500.0) == pytest.approx(np.exp(-0.0251327412))
    assert plate.internal_transmittance(0.0, 1.0, 500.0) == 1
