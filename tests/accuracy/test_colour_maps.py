"""Colours of a film by several methods, against colours by the textbook formula in complex NumPy."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.accuracy.colour_methods import COMPARED, EXACT, colour_maps, films_of
from pellicle.colour import delta_e2000, lab, sensor
from pellicle.errors import UsageError

from ..airy import airy

NM, DEGREES = np.linspace(0.0, 600.0, 16), np.array([0.0, 60.0])
SOAP = pl.Scene(pl.Layer(1.33, 300.0), 1.0)


@pytest.mark.slow  # compiles five programs; pages' commands show the figure
def test_methods_against_the_formula():
    maps = {found.name: found for found in colour_maps(SOAP, NM, DEGREES)}
    assert tuple(maps) == COMPARED
    eye, cosine = sensor(), np.cos(np.deg2rad(DEGREES))[:, None]
    exact = airy(eye.wavelength, NM[:, None, None], 1.33, 1.0, cosine) @ eye.weights
    np.testing.assert_allclose(maps[EXACT].xyz, exact, atol=1e-9)
    white = sensor().white
    for found in maps.values():
        own = delta_e2000(lab(np.asarray(found.xyz, float), white), lab(exact, white))
        np.testing.assert_allclose(found.delta_e, own, atol=1e-3)
        assert found.seconds > 0
    sizes = [maps[name].delta_e.mean() for name in COMPARED]
    assert sizes == sorted(sizes)


def test_films_of_a_scene():
    films = films_of(pl.Scene(pl.Layer("Fe2O3", 300.0), "BK7"), NM, DEGREES)
    assert films.absorbs
    assert films.thickest == 600.0
    np.testing.assert_allclose(films.angle, np.deg2rad(DEGREES))
    at = np.array([550.0])
    assert films.numbers["k"].index(at)[0] == pytest.approx(np.imag(pl.medium("Fe2O3")(at))[0])
    assert films.numbers["base_n"].index(at)[0] == pytest.approx(np.real(pl.medium("BK7")(at))[0])
    assert not films_of(SOAP, NM, DEGREES).absorbs
    with pytest.raises(UsageError, match="one coherent layer"):
        films_of(pl.Scene([pl.Layer(1.5, 10.0), pl.Layer(1.4, 10.0)], "BK7"), NM, DEGREES)
