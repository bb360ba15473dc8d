"""The colours that a growing film runs through: straw, purple, blue, in this order.

Hues are those of CIELAB as colour-science's own names place them: yellow about 90°, red 30°, purple 320°,
blue 270°. Spectra are of the textbook formula in complex NumPy, colours by colour-science.
"""

import colour
import jax
import numpy as np
import pytest

from pellicle.brdf import PRESETS, direction, model
from pellicle.colour import film_colour

from ..airy import airy

HUES = {"straw": (60.0, 105.0), "purple": (285.0, 345.0), "blue": (235.0, 280.0)}
"""Of yellow and orange, of red-violet, and of blue, in degrees of CIELAB."""
FILMS = {
    "tempered steel": (2.9, 2.7 + 2.8j, np.linspace(5.0, 60.0, 56)),
    "film 1.33 on the same base": (1.33, 2.7 + 2.8j, np.linspace(30.0, 150.0, 61)),
    "film 1.33 on glass": (1.33, 1.5, np.linspace(30.0, 150.0, 61)),
}


def hue(lab):
    """CIELAB hue in degrees; grey has none."""
    lab = np.asarray(lab)
    angle = np.rad2deg(np.arctan2(lab[..., 2], lab[..., 1])) % 360
    return np.where(np.hypot(lab[..., 1], lab[..., 2]) > 2.0, angle, np.nan)


def first(hues, name):
    """Where along the film the hue is first the named one."""
    low, high = HUES[name]
    found = np.flatnonzero((hues > low) & (hues < high))
    assert found.size, f"no {name}"
    return found[0]


def by_colour_science(index, base, thickness):
    at = np.arange(380.0, 781.0, 5.0)
    seen = airy(at, thickness[:, None], index, base)
    shape = colour.SpectralShape(380, 780, 5)
    eye = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape)
    lamp = colour.SDS_ILLUMINANTS["D65"].copy().align(shape)
    weights = eye.values * lamp.values[:, None]
    xyz = seen @ weights / weights[:, 1].sum()
    white = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
    return colour.XYZ_to_Lab(xyz, white)


@pytest.mark.slow
@pytest.mark.parametrize("film", FILMS)
def test_straw_then_purple_then_blue(film):
    index, base, thickness = FILMS[film]
    ours = hue(film_colour(thickness, index, base).lab)
    theirs = hue(by_colour_science(index, base, thickness))
    for hues in (ours, theirs):
        straw, purple, blue = (first(hues, name) for name in HUES)
        assert straw < purple < blue
    step = thickness[1] - thickness[0]
    for name in HUES:
        assert abs(first(ours, name) - first(theirs, name)) * step <= 2.0, name


def test_the_surface_itself_runs_through_them():
    """Three wavelengths in a lobe of microfacets: the brightest of R, G, B is R first, and B at the end."""
    steel = PRESETS["tempered steel"][1]
    thickness = np.array([15.0, 28.0, 40.0])
    up = np.broadcast_to(direction(0.0, 0.0), (3, 3))
    seen = jax.jit(lambda *args: model("microfacet-film")(*args))
    red, green, blue = np.asarray(seen({**steel, "thickness": thickness}, up, up)).T
    assert red[0] > green[0] > blue[0]
    assert min(red[1], blue[1]) > green[1]
    assert blue[2] > green[2] > red[2]
