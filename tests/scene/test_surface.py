"""Numbers of a surface: free ones for each channel, defaults, and what is refused."""

import numpy as np
import pytest

from pellicle.colour import sensor
from pellicle.errors import DataError, UsageError
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface

RGB = Surface(
    "granier-heidrich",
    {"thickness": Free(0, 1000), "n": Free(1.05, 2.5), "deviation": Free(0, 20), "specular": Free(0, 100)},
)


def test_a_key_that_differs_by_channel_is_one_free_number_each():
    names = ["thickness", "n_r", "n_g", "n_b", "deviation", "specular"]
    assert [number.name for number in RGB.free_numbers()] == names
    grey = Surface("granier-heidrich", {"n": Free(1.2, 2)}, wavelengths=(550.0,))
    assert [number.name for number in grey.free_numbers()] == ["n"]


def test_missing_keys_keep_the_defaults_of_the_model():
    fixed = RGB.fixed_numbers()
    assert fixed["exponent_transmission"] == 170.0
    assert fixed["wavelengths"].tolist() == [645.0, 525.0, 445.0]
    assert "n" not in fixed
    listed = Surface("microfacet-film", {"roughness": [0.1], "k": [0.1, 0.2, 0.3]}).fixed_numbers()
    assert listed["roughness"].shape == ()  # a list of one is a number
    assert listed["k"].tolist() == [0.1, 0.2, 0.3]


def test_a_medium_gives_the_index_at_each_wavelength():
    """Silicon of Aspnes and Studna and fused silica of Malitson, from their published tables."""
    coated = Surface("microfacet-film", {"thickness": 100.0}, film="SiO2", base="Si").fixed_numbers()
    at = np.array([0.645, 0.525, 0.445]) ** 2  # Malitson 1965, eq. 1
    terms = ((0.6961663, 0.0684043), (0.4079426, 0.1162414), (0.8974794, 9.896161))
    malitson = np.sqrt(1 + sum(b * at / (at - c**2) for b, c in terms))
    np.testing.assert_allclose(coated["n"], malitson, atol=2e-4)
    np.testing.assert_array_equal(coated["k"], 0.0)
    np.testing.assert_allclose(coated["base_n"], [3.86, 4.17, 4.80], atol=0.05)
    glass = Surface("blinn-phong-film", {}, base="BK7").fixed_numbers()
    assert "base_k" not in glass
    np.testing.assert_allclose(glass["base_n"], 1.52, atol=0.01)


def test_bands_take_media_and_single_free_indices():
    bare = Surface("granier-heidrich", {"n": Free(1.3, 1.7)}, sensor=sensor("1931", "D65"))
    assert [number.name for number in bare.free_numbers()] == ["n"]
    assert bare.channels == 3
    fixed = Surface("microfacet-film", {}, sensor=sensor("1931", "A"), film="SiO2", base=2.0).fixed_numbers()
    assert fixed["n"].shape == fixed["wavelengths"].shape == fixed["base_n"].shape
    assert fixed["weights"].shape == (fixed["wavelengths"].size, 3)
    np.testing.assert_allclose(fixed["weights"].sum(axis=0), 1.0)  # a white surface is 1 in each channel
    start = bare.at_start()
    assert not start.free_numbers()
    assert start.numbers["n"] == 1.5


EYE = sensor("1931", "D65")


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("granier-heidrik", {}, "did you mean 'granier-heidrich'"),
        ("microfacet-film", {"numbers": {"roughnes": 0.1}}, "did you mean 'roughness'"),
        ("granier-heidrich", {"numbers": {"n": [1.4, 1.5]}}, "2 numbers for 3 wavelengths"),
        ("microfacet-film", {"numbers": {"roughness": [0.1] * 3}}, "roughness: one number for all channels"),
        (
            "granier-heidrich",
            {"numbers": {"thickness": [300, 300]}},
            "thickness: one number for all channels",
        ),
        ("microfacet-film", {"numbers": {"thickness": -50.0}}, "thickness must not be negative, got -50 nm"),
        (
            "microfacet-film",
            {"numbers": {"thickness": Free(-9, 9)}},
            "thickness must not be negative, got -9",
        ),
        ("microfacet-film", {"numbers": {"n": [1.5, np.nan, 1.5]}}, "n must be finite"),
        ("microfacet-film", {"numbers": {"roughness": 0.0}}, "roughness must be above 0"),
        ("microfacet-film", {"sensor": EYE, "wavelengths": (600.0, 550.0, 450.0)}, "wavelengths or a sensor"),
        ("microfacet-film", {"sensor": EYE, "numbers": {"n": [1.4, 1.5, 1.6]}}, "n: 3 numbers for bands"),
        ("microfacet-film", {"base": "Si", "numbers": {"base_k": 1.0}}, "base and base_k exclude each other"),
        ("microfacet-film", {"base": Free(2.0, 3.0)}, "base cannot be free: give base_n"),
        ("granier-heidrich", {"base": "Si"}, "granier-heidrich has no base"),
        ("granier-heidrich", {"film": "Au"}, "film: granier-heidrich knows no extinction there"),
        ("blinn-phong-film", {"base": "Al"}, "base: blinn-phong-film knows no extinction there"),
    ],
)
def test_wrong_numbers_media_and_sensors_are_refused(name, given, message, refuses):
    refuses(UsageError, message, Surface, name, **given)
    with pytest.raises(DataError, match="is known from"):  # no data in the bands
        Surface("microfacet-film", wavelengths=(50.0, 60.0, 70.0), base="Si")
