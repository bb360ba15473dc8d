"""Thickness of mica flakes through an objective: calibrated on some flakes, tested on others.

The contrasts are simulated by the package tmm, ray by ray: no measured flakes are at hand.
"""

from functools import cache
from pathlib import Path

import equinox as eqx
import numpy as np
import tmm

import pellicle as pl
from pellicle.recipes.read import read_recipe
from pellicle.scene.priors import Normal

RECIPE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "mica.toml"
NM = np.linspace(450.0, 750.0, 61)
NOISE, STRAY = 0.005, 0.025
KNOWN, TESTED = (12.0, 31.0, 77.0), (6.0, 22.0, 54.0, 110.0)


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


def test_flakes_tested_with_the_stray_light_of_others():
    scene = read_recipe(RECIPE).scene()

    def fitted(thickness, seed, *priors):
        numbers = pl.Free(0.5, 150, prior=priors[0]), pl.Free(0, 0.1, start=0.02, prior=priors[1])
        own = eqx.tree_at(lambda s: (s.layers[0].thickness, s.instrument.stray_light), scene, numbers)
        return pl.fit(measured(thickness, seed), own).parameters

    known = [fitted(d, seed, Normal(d, 1.0), None) for seed, d in enumerate(KNOWN)]
    strays = [x["instrument.stray_light"] for x in known]
    weights = np.array([1 / x.stderr**2 for x in strays])
    stray = Normal(
        float(np.average([x.value for x in strays], weights=weights)), float(weights.sum() ** -0.5)
    )
    assert abs(stray.mean - STRAY) < 3 * stray.sd < 0.01
    for seed, thickness in enumerate(TESTED, len(KNOWN)):
        result = fitted(thickness, seed, None, stray)["mica.thickness"]
        assert abs(result.value - thickness) < 4 * result.stderr_noise < result.stderr
