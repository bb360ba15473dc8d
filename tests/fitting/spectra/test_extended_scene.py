"""Scenes extended by what a fit takes for granted."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.spectra.extended_scene import ExtendedScene
from pellicle.fitting.spectra.fit import measurements
from pellicle.fitting.spectra.problem import make
from pellicle.scene.layers import Interface

NM = np.linspace(400, 800, 9)


@pytest.mark.parametrize(
    ("film", "mixes"),
    [(1.6, True), (pl.Anisotropic(1.6, 1.7, axis=(20.0, 10.0)), True), (pl.Anisotropic(1.46, 1.5), False)],
)
def test_mixed_interface_under_a_birefringent_film(film, mixes):
    """An oxide between film and silicon mixes with it; a film that is like an oxide has none beneath it."""
    scene = pl.Scene(pl.Layer(film, pl.Free(50, 400, start=200.0)), "Si", light=pl.Light(angle=60.0))
    (view,) = make(*measurements(pl.simulate(scene, NM, noise=0.01), scene)).views
    extended = ExtendedScene(view, np.array([200.0]))
    assert (extended.mixture is not None) == mixes
    interfaces = [
        [type(x) is Interface for x in program.scene.layers] for program in extended.programs().values()
    ]
    assert any(map(any, interfaces)) == mixes
