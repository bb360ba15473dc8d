"""Colours of films by several methods, against the simulation of the scene and the textbook formula."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.accuracy.colour_methods import (
    COLOUR_METHODS,
    COMPARED,
    EXACT,
    colour_cost,
    colour_maps,
    films_of,
    films_of_scene,
    reference_program,
)
from pellicle.colour import delta_e2000, lab, sensor

from ..airy import airy


def test_the_reference_is_the_simulation_of_the_scene():
    scene = pl.Scene(pl.Layer("Fe2O3", pl.Free(50, 200)), "Si", ambient=1.33)
    films = films_of_scene(scene, np.array([0.0, 50.0]))
    thickness = films.numbers["thickness"]
    assert thickness.min() > 50
    assert thickness.max() < 200
    made = reference_program(films).run()
    for draw in (0, 7):
        one = pl.Scene(pl.Layer("Fe2O3", float(thickness[draw])), "Si", ambient=1.33)
        expected = pl.simulate(one, space="xyz", angle=[0.0, 50.0]).values
        np.testing.assert_allclose(made[draw], expected, atol=1e-9)


def test_a_table_of_films_at_normal_incidence():
    films = films_of_scene(pl.Scene(pl.Layer(1.4, pl.Free(50, 80)), 3.9), np.array([0.0]))
    table = next(method for method in COLOUR_METHODS if method.name == "table of the film")
    np.testing.assert_allclose(table.apply(films).run(), reference_program(films).run(), atol=1e-3)


@pytest.mark.parametrize(
    ("scene", "reason"),
    [
        (pl.Scene([pl.Layer(1.4, 10.0), pl.Layer(1.5, 10.0)], 3.9), "one layer"),
        (pl.Scene(pl.Layer(1.4, 10.0), 3.9, light=pl.Light(signal="T")), "reflected"),
        (pl.Scene(pl.Layer(pl.dispersion.Constant(pl.Free(1.3, 1.5)), 10.0), 3.9), "known indices"),
    ],
)
def test_other_films_are_refused(scene, reason, refuses):
    refuses(ValueError, reason, colour_cost, scene)


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
    with pytest.raises(ValueError, match="one coherent layer"):
        films_of(pl.Scene([pl.Layer(1.5, 10.0), pl.Layer(1.4, 10.0)], "BK7"), NM, DEGREES)
