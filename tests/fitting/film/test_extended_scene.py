"""Scenes extended by what a fit takes for granted."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.film.extended_scene import extended
from pellicle.fitting.film.fit import measurements
from pellicle.fitting.film.problem import make
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
    scene = extended(view, np.array([200.0]))
    assert (scene.mixture is not None) == mixes
    interfaces = [
        [type(x) is Interface for x in program.scene.layers] for program in scene.programs().values()
    ]
    assert any(map(any, interfaces)) == mixes


def test_a_shift_of_wavelengths_at_the_ends_of_a_table_beside_a_free_index():
    """The table of HfO2 ends at 250 and 900 nm; beyond, its index goes on with its slope there."""
    nm = np.linspace(250, 900, 66)
    film = pl.dispersion.Shifted(pl.material("HfO2"), pl.Free(-0.3, 0.3, start=0.0))
    scene = pl.Scene(pl.Layer(film, 120.0), 1.5)
    (view,) = make(*measurements(pl.Spectrum(nm, np.full(66, 0.1), "R"), scene)).views
    at = np.array([0.05])
    shift = extended(view, at).wavelength
    assert shift is not None
    changes = [(shift, x) for x in (0.5, 0.0, -0.5)]
    longer, as_is, shorter = extended(view, at).signals(view.data, at, changes)[:, :66]

    known = np.real(pl.material("HfO2")(nm)) + 0.05

    def reflectance(shift):
        return np.asarray(pl.reflectance(nm + shift, 120.0, known + shift * np.gradient(known, nm), 1.5))

    np.testing.assert_allclose(as_is, reflectance(0.0), atol=1e-9)
    np.testing.assert_allclose(longer - shorter, reflectance(0.5) - reflectance(-0.5), atol=3e-5)
