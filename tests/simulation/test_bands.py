"""BRDF samples whose channels are integrals over bands, against sums in steps of 1 nm in NumPy."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.colour import sensor
from pellicle.scene.surface import Surface
from pellicle.simulation.brdf import Directions, default_directions
from tests.directions import unit

from ..airy import airy

EYE = sensor("1931", "A")
DIRECTIONS = Directions(*(x[:128] for x in default_directions()))
FILM = {"thickness": 320.0, "n": 1.47, "base_n": 2.7, "base_k": 2.8, "roughness": 0.3, "diffuse": 0.05}


def by_hand(directions, eye, numbers):
    """GGX facets with Smith's height-correlated shadowing (Heitz 2014) under a film, and a diffuse part."""
    i, o = (unit(getattr(directions, f"theta_{x}"), getattr(directions, f"phi_{x}")) for x in ("i", "o"))
    h = (i + o) / np.linalg.norm(i + o, axis=-1, keepdims=True)
    a2 = numbers["roughness"] ** 2
    density = a2 / (np.pi * (h[:, 2] ** 2 * (a2 - 1) + 1) ** 2)
    wall = [(np.sqrt(1 + a2 * (1 / v[:, 2] ** 2 - 1)) - 1) / 2 for v in (i, o)]
    lobe = density / (1 + wall[0] + wall[1]) / (4 * i[:, 2] * o[:, 2])
    base = numbers["base_n"] + 1j * numbers["base_k"]
    cosine = np.sum(i * h, axis=-1)[:, None]
    spectrum = airy(eye.wavelength, numbers["thickness"], numbers["n"], base, cosine)
    return lobe[:, None] * (spectrum @ (eye.weights / eye.white)) + numbers["diffuse"]


@pytest.mark.parametrize("count", [pytest.param(128, marks=pytest.mark.slow, id="by nodes"), 12])
def test_bands_are_integrals_in_steps_of_a_nanometre(count):
    directions = Directions(*(x[:count] for x in DIRECTIONS))
    truth = by_hand(directions, EYE, FILM)
    found = pl.simulate(Surface("microfacet-film", FILM, sensor=EYE), directions=directions).values
    np.testing.assert_allclose(found, truth, rtol=2e-4)
    centres = tuple(EYE.wavelength @ (EYE.weights / EYE.white))
    single = pl.simulate(Surface("microfacet-film", FILM, centres), directions=directions).values
    assert np.max(np.abs(single / truth - 1)) > 0.02


def test_layered_lobes_integrate_over_bands_too():
    """Granier and Heidrich's cos² along the mirror direction: its mean over each band, in steps of 1 nm."""
    numbers = {"thickness": 400.0, "n": 1.5, "deviation": 0.0, "diffuse": 0.2}
    at = Directions(*(np.array([x, x]) for x in (0.0, 0.0, 0.0, 180.0)))
    found = pl.simulate(Surface("granier-heidrich-full", numbers, sensor=EYE), directions=at).values[0]
    cosine = np.cos(4 * np.pi * 1.5 * 400.0 / EYE.wavelength) @ (EYE.weights / EYE.white)
    f = 0.04  # eqs. 5, 7, 10: R = f and T = (1 − f)² at normal incidence
    rd = (21 * (1.5**2 + 1) - 38 * 1.5) / (21 * 2.5**2)  # eq. 12
    td = 1 - rd
    lobes = f + (1 - f) ** 2 + 2 * cosine * np.sqrt(f) * (1 - f)
    base = rd + td + 2 * cosine * np.sqrt(rd * td)
    np.testing.assert_allclose(found, lobes + 0.2 * base, rtol=2e-4)
