"""A sphere under one light: what the BRDF says of each point of it, and what follows the noise."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.brdf.directions import direction
from pellicle.errors import UsageError
from pellicle.reporting.colour_figures import shown, sphere
from pellicle.synthetic.sphere import in_plane, numbers, render

STEEL = {"n": 2.9, "base_n": 2.7, "base_k": 2.8, "roughness": 0.3, "diffuse": 0.0}
FIXED = pl.Surface("microfacet-film", STEEL | {"thickness": 40.0})
UNEVEN = pl.Surface("microfacet-film", STEEL | {"thickness": pl.Free(10, 70)})


def test_the_middle_of_the_sphere_faces_the_eye():
    image = render(FIXED, (40.0, 0.0), size=31)
    eye = in_plane(FIXED, 40.0, np.array([0.0]))[0]
    np.testing.assert_allclose(image[15, 15], np.pi * eye * np.cos(np.deg2rad(40.0)), rtol=1e-5)
    assert np.isnan(image[0, 0]).all()
    assert np.isnan(image).mean() == pytest.approx(1 - np.pi / 4, abs=0.02)


def test_the_side_away_from_the_light_is_dark():
    image = render(FIXED, (90.0, 0.0), size=31)
    lit = np.nan_to_num(image).sum(axis=(0, 2))
    assert np.all(lit[:15] == 0)
    assert lit[15:].sum() > 0


def test_the_lobe_lies_on_the_mirror_side():
    leaving = np.array([-45.0, 45.0])
    back, mirror = in_plane(FIXED, 45.0, leaving)
    assert np.all(mirror > 2 * back)
    i, o = direction(45.0, 0.0), direction(45.0, 180.0)
    np.testing.assert_allclose(mirror, FIXED.brdf(numbers(FIXED, None), i, o), rtol=1e-6)


def test_a_free_thickness_follows_the_noise():
    even, uneven = (render(s, (35.0, 60.0), size=31) for s in (FIXED, UNEVEN))
    assert np.nanmax(np.abs(even - uneven)) > 0.1
    np.testing.assert_array_equal(render(UNEVEN, (35.0, 60.0), size=31), uneven)


def test_a_picture_is_written_and_needs_three_channels(tmp_path):
    sphere(UNEVEN, tmp_path / "steel.png", (35.0, 60.0))
    assert (tmp_path / "steel.png").read_bytes().startswith(b"\x89PNG")
    grey = pl.Surface("microfacet-film", {}, wavelengths=(550.0,))
    with pytest.raises(UsageError, match="three wavelengths"):
        sphere(grey, tmp_path / "grey.png", (35.0, 60.0))


def test_one_exposure_for_all_channels():
    image = shown(np.array([[[0.1, 0.2, np.nan], [40.0, 20.0, 10.0]]]))
    assert image.shape == (1, 2, 3)
    assert image[0, 1, 0] == pytest.approx(1.0, abs=0.02)
    assert image[0, 1, 1] < 0.8
