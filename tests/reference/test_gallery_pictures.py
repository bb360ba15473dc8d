"""Pictures of the gallery, small, against spectra in steps of 1 nm, by the package and by Airy's formula."""

import numpy as np
import pytest

from pellicle.colour import delta_e2000, lab, sensor
from pellicle.colour.spaces import srgb_matrix
from pellicle.simulation.environment import EYE, studio
from tests.airy import airy

MOST = 0.5
"""Mean ΔE2000 of a picture that is kept."""


@pytest.fixture(scope="module")
def gallery(load_script):
    return load_script("scripts/gallery_pictures.py")


def test_the_wing_has_the_colours_of_airys_formula(gallery):
    """Also before a background, of which a film without extinction passes what it does not reflect."""
    wing, some, behind = gallery.dragonfly_wing(96), slice(None, None, 9), 0.3
    found = wing.linear(behind, some=some)
    normal, eye = wing.normal[some], sensor()
    cosine = normal @ EYE
    spectrum = airy(eye.wavelength, wing.thickness[some, None], 1.56, 1.0, np.clip(cosine, 0.05, 1)[:, None])
    light = studio().radiance(2 * cosine[:, None] * normal - EYE)[:, None]
    xyz = (spectrum * light + (1 - spectrum) * behind) @ eye.weights * wing.shade[some, None]
    scale, to_xyz = gallery.exposure(found), np.linalg.inv(srgb_matrix(eye.white)).T
    difference = delta_e2000(*(lab(scale * x, eye.white) for x in (found @ to_xyz, xyz)))
    assert np.mean(difference) < MOST


@pytest.mark.slow  # compiles a stack of 16 layers twice
def test_pictures_are_those_of_the_spectrum(gallery):
    assert {name: mean for name, mean in gallery.differences().items() if mean > MOST} == {}
