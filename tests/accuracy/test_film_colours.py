"""Films of a scene for the methods of computing colours, against the simulation of the scene."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.accuracy.colour_methods import COLOUR_METHODS, colour_cost, films_of_scene, reference_program


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
def test_other_films_are_refused(scene, reason):
    with pytest.raises(ValueError, match=reason):
        colour_cost(scene)
