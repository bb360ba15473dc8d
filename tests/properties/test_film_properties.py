"""What holds for every film: energy, limits, reciprocity, and that nothing is ever not finite."""

from functools import cache

import jax
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import pellicle as pl
from pellicle.optics import interface
from pellicle.optics.pair import to_pair

SIGNALS = {"R": pl.reflectance, "T": pl.transmittance}


@cache
def compiled(signal, letter):
    """(wavelength, thickness, layer, substrate, ambient, angle) → signal; complex indices, scalars."""

    def one(wavelength, thickness, layer, substrate, ambient, angle):
        return SIGNALS[signal](
            wavelength, thickness, layer, substrate, ambient=ambient, angle=angle, polarisation=letter
        )

    return jax.jit(one)


def both(letter, *film):
    return [float(compiled(signal, letter)(*film)) for signal in "RT"]


def real_numbers(low, high):
    return st.floats(low, high, allow_subnormal=False)


extinction = st.one_of(st.just(0.0), real_numbers(1e-8, 1e-2), real_numbers(1e-2, 8.0))
refraction = real_numbers(0.05, 5.0)
index = st.builds(complex, refraction, extinction)
transparent = st.builds(complex, refraction, st.just(0.0))
absorbing = st.builds(complex, refraction, real_numbers(0.05, 8.0))
thickness = st.one_of(st.just(0.0), real_numbers(1e-3, 1e3), real_numbers(1e3, 1e5))
wavelength = real_numbers(100.0, 1e4)
ambient = real_numbers(1.0, 2.5)
angle = st.one_of(st.just(0.0), real_numbers(1e-3, 89.99), st.just(90.0))
letters = st.sampled_from("sp")


@given(wavelength, thickness, index, index, ambient, angle, letters)
def test_energy(wavelength, thickness, layer, substrate, ambient, angle, letter):
    reflected, passed = both(letter, wavelength, thickness, layer, substrate, ambient, angle)
    assert -1e-15 <= reflected <= 1 + 1e-12
    assert passed >= -1e-15
    assert reflected + passed <= 1 + 1e-12


@given(wavelength, thickness, transparent, index, ambient, angle, letters)
def test_a_transparent_film_takes_nothing(wavelength, thickness, layer, substrate, ambient, angle, letter):
    """What it does not reflect enters the substrate, absorbing or not: there p has its own power factor."""
    reflected, passed = both(letter, wavelength, thickness, layer, substrate, ambient, angle)
    assert reflected + passed == pytest.approx(1, abs=1e-11)


def bare(letter, medium, ambient, angle):
    a, q0 = interface.transverse(np.float64(ambient), np.deg2rad(np.float64(angle)))
    medium = to_pair(np.complex128(medium))
    return float(interface.reflectance(np.float64(ambient), q0, medium, interface.normal(medium, a), letter))


@given(wavelength, index, index, ambient, real_numbers(0.0, 89.9), letters)
def test_without_thickness_only_the_substrate_is_seen(wavelength, layer, substrate, ambient, angle, letter):
    reflected, _ = both(letter, wavelength, 0.0, layer, substrate, ambient, angle)
    assert reflected == pytest.approx(bare(letter, substrate, ambient, angle), abs=1e-12)
    nearly, _ = both(letter, wavelength, 1e-9, layer, substrate, ambient, angle)
    assert nearly == pytest.approx(reflected, abs=1e-6)


@given(wavelength, absorbing, index, ambient, real_numbers(0.0, 89.9), letters)
def test_a_thick_absorbing_film_hides_its_substrate(wavelength, layer, substrate, ambient, angle, letter):
    reflected, passed = both(letter, wavelength, 1e6, layer, substrate, ambient, angle)
    assert reflected == pytest.approx(bare(letter, layer, ambient, angle), abs=1e-11)
    assert passed < 1e-10


@given(wavelength, thickness, index, index, ambient)
def test_s_is_p_at_normal_incidence(wavelength, thickness, layer, substrate, ambient):
    film = (wavelength, thickness, layer, substrate, ambient, 0.0)
    np.testing.assert_allclose(both("s", *film), both("p", *film), atol=1e-11)


@given(wavelength, thickness, transparent, real_numbers(1.0, 3.0), ambient, real_numbers(0.0, 80.0), letters)
def test_turning_a_lossless_film_over_keeps_its_transmittance(
    wavelength, thickness, layer, substrate, ambient, angle, letter
):
    sine = ambient * np.sin(np.deg2rad(angle)) / substrate
    assume(sine < 0.999)
    refracted = np.rad2deg(np.arcsin(sine))
    _, down = both(letter, wavelength, thickness, layer, complex(substrate), ambient, angle)
    _, up = both(letter, wavelength, thickness, layer, complex(ambient), substrate, refracted)
    assert down == pytest.approx(up, rel=1e-9, abs=1e-14)


@given(wavelength, thickness, index, index, ambient, angle, letters, real_numbers(0.1, 10.0))
def test_only_the_ratio_of_thickness_and_wavelength_counts(
    wavelength, thickness, layer, substrate, ambient, angle, letter, unit
):
    one = both(letter, wavelength, thickness, layer, substrate, ambient, angle)
    two = both(letter, unit * wavelength, unit * thickness, layer, substrate, ambient, angle)
    np.testing.assert_allclose(one, two, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("layers", "dtype"), [(1, np.float64), (1, np.float32), (3, np.float64)])
def test_random_scenes_have_finite_slopes_and_conserve_energy(load_script, layers, dtype):
    """A few of those that `make properties` draws by the million."""
    properties = load_script("benchmarks/properties.py")
    rows = properties.scenes(np.random.default_rng(3), 5000, layers).astype(dtype)
    for law, bad in properties.violations(rows, layers).items():
        assert not np.any(bad), (law, rows[bad][0].tolist())
