"""Thickness of mica flakes through an objective: calibrated on some flakes, tested on others.

The contrasts are simulated by the package tmm, ray by ray: no measured flakes are at hand.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import tmm

import pellicle as pl
from pellicle.recipes.read import FilmRecipe, read_recipe

RECIPE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "mica_flakes.toml"
NM = np.linspace(450.0, 750.0, 61)
NOISE, STRAY = 0.005, 0.025


@cache
def reflectance(*stack) -> np.ndarray:
    """Mean of both polarisations over a pupil lit by exp(−ρ²), of aperture 0.8."""
    nodes, weights = np.polynomial.legendre.leggauss(7)
    square = 0.5 * (nodes + 1)
    silicon = np.asarray(pl.material("Si")(NM))
    silica = np.asarray(pl.material("SiO2")(NM))
    media = [np.ones_like(NM), *(silica if n == "SiO2" else np.full_like(NM, n) for n, _ in stack), silicon]
    depths = [np.inf, *(d for _, d in stack), np.inf]

    def of_ray(sine, i):
        angle, indices = np.arcsin(sine), [complex(n[i]) for n in media]
        return np.mean([tmm.coh_tmm(p, indices, depths, angle, NM[i])["R"] for p in "sp"])

    rays = [[of_ray(sine, i) for i in range(len(NM))] for sine in 0.8 * np.sqrt(square)]
    return np.average(rays, axis=0, weights=weights * np.exp(-square))


def measured(thickness: float, seed: int) -> pl.Spectrum:
    oxide = "SiO2", 285.0
    flake, bare = (reflectance(*stack) + STRAY for stack in (((1.58, thickness), oxide), (oxide,)))
    noise = NOISE * np.random.default_rng(seed).standard_normal(len(NM))
    return pl.Spectrum(NM, (flake - bare) / (flake + bare) + noise, "contrast", sigma=np.full(len(NM), NOISE))


@pytest.mark.slow
def test_flakes_calibrated_by_others_in_one_fit():
    """Oxide, aperture and stray light are shared, and those of the reference."""
    recipe = read_recipe(RECIPE)
    assert isinstance(recipe, FilmRecipe)
    scenes = {x.sample.name: x.scene() for x in recipe.samples if x.sample}
    flakes = {"known31": 31.0, "known77": 77.0, "flake22": 22.0, "flake110": 110.0}
    data = [measured(thickness, seed) for seed, thickness in enumerate(flakes.values())]
    fit = pl.fit(data, [scenes[name] for name in flakes])
    assert fit.status == "converged"
    truth = {f"{name}.mica.thickness": x for name, x in flakes.items()}
    truth |= {"oxide.thickness": 285.0, "instrument.stray_light": STRAY, "instrument.numerical_aperture": 0.8}
    assert {p.name for p in fit.free} == truth.keys()
    for name, x in truth.items():
        assert abs(fit[name].value - x) < 4 * fit[name].stderr_noise < 4 * fit[name].stderr, name
    assert fit["flake22.mica.thickness"].stderr_noise < 0.2
