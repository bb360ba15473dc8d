"""Numbers of a surface: free ones for each channel, defaults, and what is refused."""

from __future__ import annotations

import pytest

from pellicle.errors import UsageError
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
    listed = Surface("granier-heidrich", {"n": [1.4, 1.5, 1.6]})
    assert listed.fixed_numbers()["n"].tolist() == [1.4, 1.5, 1.6]


@pytest.mark.parametrize(
    ("name", "numbers", "message"),
    [
        ("granier-heidrik", {}, "did you mean 'granier-heidrich'"),
        ("microfacet-film", {"roughnes": 0.1}, "did you mean 'roughness'"),
        ("granier-heidrich", {"n": [1.4, 1.5]}, "2 numbers for 3 wavelengths"),
        ("microfacet-film", {"roughness": [0.1, 0.1, 0.1]}, "roughness: one number for all channels"),
        ("granier-heidrich", {"thickness": [300, 300]}, "thickness: one number for all channels"),
    ],
)
def test_a_wrong_surface_is_refused(name, numbers, message):
    with pytest.raises(UsageError, match=message):
        Surface(name, numbers)


def test_a_list_of_one_is_a_number():
    fixed = Surface("microfacet-film", {"roughness": [0.1], "k": [0.1, 0.2, 0.3]}).fixed_numbers()
    assert fixed["roughness"].shape == ()
    assert fixed["k"].tolist() == [0.1, 0.2, 0.3]
