"""Albedos of lobes of any width, against adaptive quadrature of formulas written out here."""

from itertools import pairwise

import jax
import numpy as np
import pytest
from scipy.integrate import quad

from pellicle.brdf.albedo import ANGLES, albedos, directional_albedo, energy_warning
from pellicle.brdf.models import model

ALPHAS = (0.003, 0.3, *(pytest.param(x, marks=pytest.mark.slow) for x in (0.01, 0.03, 0.1, 1.0)))
N, K = 2.7, 2.8


def _fresnel(cosine):
    """Unpolarised reflectance of a metal in air (Born and Wolf, 14.2)."""
    index = N + 1j * K
    inside = np.sqrt(1 - (1 - cosine**2) / index**2)
    s = (cosine - index * inside) / (cosine + index * inside)
    p = (index * cosine - inside) / (index * cosine + inside)
    return (abs(s) ** 2 + abs(p) ** 2) / 2


def _ring(tilt, alpha, theta):
    """∫ ρ cos θ_o 4 ⟨i, h⟩ sin θ_h dφ of GGX facets at one tilt of the half vector, by 720 azimuths."""
    phi = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    h = np.stack([np.sin(tilt) * np.cos(phi), np.sin(tilt) * np.sin(phi), np.full(720, np.cos(tilt))])
    i = np.array([np.sin(theta), 0.0, np.cos(theta)])
    across = i @ h
    cosine = (2 * across * h - i[:, None])[2]
    density = alpha**2 / (np.pi * np.cos(tilt) ** 4 * (alpha**2 + np.tan(tilt) ** 2) ** 2)
    seen = (across > 0) & (cosine > 1e-12)
    tan2 = [1 / np.where(seen, c, 1.0) ** 2 - 1 for c in (np.full(720, np.cos(theta)), cosine)]
    wall = [(np.sqrt(1 + alpha**2 * np.maximum(x, 0)) - 1) / 2 for x in tan2]
    values = density / (1 + wall[0] + wall[1]) / (4 * np.cos(theta)) * _fresnel(np.abs(across))
    return 2 * np.pi * np.sin(tilt) * np.mean(np.where(seen, values * 4 * across, 0.0))


def _adaptive(alpha, theta):
    """The albedo by adaptive quadrature over the tilt, in pieces about the width of the lobe."""
    ends = [0.0, *(np.arctan(alpha * x) for x in (0.5, 1, 2, 5, 20)), np.pi / 2]
    return sum(
        quad(_ring, a, b, (alpha, np.deg2rad(theta)), epsrel=1e-4, epsabs=1e-6)[0] for a, b in pairwise(ends)
    )


@pytest.fixture(scope="module")
def albedo():
    """Albedo of rough metal without a film, as a compiled function of roughness and angle."""
    metal = {"thickness": 0.0, "n": 1.5, "base_n": N, "base_k": K, "specular": 1.0, "wavelengths": [550.0]}

    def function(alpha, theta):
        return directional_albedo(model("microfacet-film"), {**metal, "roughness": alpha}, theta)[0]

    with jax.enable_x64(True):
        yield jax.jit(function)


@pytest.mark.parametrize("alpha", ALPHAS)
def test_albedo_of_rough_metal_agrees_with_adaptive_quadrature(albedo, alpha):
    for theta in ANGLES:
        assert float(albedo(alpha, theta)) == pytest.approx(_adaptive(alpha, theta), abs=1e-3), theta


@pytest.mark.slow
@pytest.mark.parametrize("alpha", [3e-3, 0.01])
def test_narrow_facets_give_no_false_warning(alpha):
    steel = {**model("microfacet-film").defaults(), "thickness": 0.0, "roughness": alpha, "diffuse": 0.0}
    albedo = jax.jit(lambda numbers: albedos(model("microfacet-film"), numbers))
    assert energy_warning(albedo(steel)) is None
    assert "reflects up to" in str(energy_warning(albedo({**steel, "specular": 3.0})))
