"""Joint fits of spectra or colours with BRDF samples of one film."""

import dataclasses

import numpy as np
import pytest

import pellicle as pl
from pellicle.data.colours import Colours
from pellicle.errors import UsageError
from pellicle.fitting.joint import apart

BASE = pl.dispersion.Constant(3.9, 0.02)
SCENE = pl.Scene(pl.Layer(1.46, pl.Free(50, 800)), BASE)
SURFACE = pl.Surface(
    "microfacet-film",
    {
        "thickness": pl.Free(100, 700),
        "n": 1.46,
        "roughness": pl.Free(0.05, 0.5),
        "base_n": 3.9,
        "base_k": 0.02,
    },
)


def spectrum(thickness=432.0):
    scene = pl.Scene(pl.Layer(1.46, thickness), BASE, uncertainty=pl.Uncertainty.none())
    return pl.simulate(scene, np.linspace(500.0, 600.0, 31), noise=0.004)


def samples(thickness=432.0):
    numbers = dict(SURFACE.numbers, thickness=thickness, roughness=0.2)
    return pl.simulate(dataclasses.replace(SURFACE, numbers=numbers), noise="30 %", seed=1)


@pytest.mark.slow
def test_shared_numbers_are_one_and_errors_combine():
    scene = dataclasses.replace(SCENE, uncertainty=pl.Uncertainty.none())
    data = spectrum(), samples()
    alone = [pl.fit(each, own)["thickness"] for each, own in zip(data, (scene, SURFACE), strict=True)]
    fit = pl.fit(list(data), [scene, SURFACE])
    assert [p.name for p in fit.free] == ["thickness", "roughness"]
    assert fit["thickness"].value == pytest.approx(432.0, abs=3 * fit["thickness"].stderr)
    combined = sum(p.stderr_noise**-2 for p in alone) ** -0.5
    assert fit["thickness"].stderr_noise == pytest.approx(combined, rel=0.15)
    posterior = pl.sample(list(data), [scene, SURFACE], steps=2000)
    marginal = posterior.marginals()["thickness"]
    assert marginal.sd == pytest.approx(fit["thickness"].stderr, rel=0.2)
    assert {"brdf-1", "R"} == {part.name for part in fit.parts}


def test_data_and_scenes_must_match(refuses):
    white = np.full((1, 3), 0.5)
    colours = Colours(white, (np.array([500.0, 600.0]), np.full((2, 3), 0.5)))
    own = apart([spectrum(), samples(), colours], [SCENE, SURFACE, SCENE])
    assert (len(own.films), len(own.samples)) == (2, 1)
    refuses(UsageError, "as many scenes", apart, [spectrum(), samples()], [SURFACE, SCENE])
    other = dataclasses.replace(SURFACE)
    refuses(UsageError, "one Surface", apart, [samples(), samples(), spectrum()], [SURFACE, other, SCENE])
