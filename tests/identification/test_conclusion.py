"""Structures that are left, from weights that are made up."""

import numpy as np

from pellicle.identification.conclusion import doubt, shapeless, survivors
from pellicle.identification.evidence import Weighed
from pellicle.identification.growth import BARE, needed
from pellicle.identification.problem import Attempt, Problem
from pellicle.identification.structure import OXIDE, Material, Structure


def weighed(films, ln_z, error=1.0, *, most=3000.0, adequate=True):
    """Layers (name, thickness) with an error of each thickness; the lowest is `most` nm thick at most."""
    limits = [*[3000.0] * (len(films) - 1), most]
    structure = Structure(tuple(Material(name, own) for (name, _), own in zip(films, limits, strict=True)))
    x = np.array([depth for _, depth in films])
    errors, attempt = np.full(len(x), error), Attempt(structure, x, np.zeros(9), np.zeros((9, len(x))), 0.0)
    return Weighed(attempt, x, errors, errors, (0.0,), ln_z, 1.0, adequate, True, ("scale", 1.0), 1.0)


def test_two_layers_of_unknown_thickness_stay_beside_those_that_are_known():
    vague = weighed([("PMMA", 60.0), ("SiO2", 130.0)], 100.0, error=30.0)
    known = weighed([("SU-8", 24.0), ("SiO2", 164.0)], 98.0, error=4.0)
    single = weighed([("SiO2", 188.0)], 70.0, adequate=False)
    assert survivors([vague, known, single]) == [vague, known]
    close = single._replace(ln_z=95.0)  # so near that two layers are not demanded
    assert survivors([vague, known, close]) == [known]


def test_an_oxide_at_its_largest_thickness_is_a_film():
    assert needed(weighed([("alumina", 113.0), ("SiO2", 50.0)], 0.0, most=OXIDE, error=9.5))
    assert not needed(weighed([("alumina", 113.0), ("SiO2", OXIDE)], 0.0, most=OXIDE, error=9.5))


def test_a_model_that_a_bound_holds_is_left_where_nothing_else_is():
    held = weighed([("alumina", 113.0), ("SiO2", OXIDE)], 100.0, most=OXIDE)
    other = weighed([("alumina", 120.0)], 60.0, adequate=False)
    assert shapeless([held, other]) == [held]
    needless = other._replace(ln_z=98.0)
    assert shapeless([held, needless]) == [needless]


def test_a_film_that_may_be_absent_is_not_determined():
    """34 nm of ITO in R were identified as a free index of 13 ± 35 nm, and bare silicon as 10 ± 5 nm of
    SiO2."""
    problem = Problem((), 3000.0)
    assert doubt(problem, [weighed([("alumina", 13.0)], 0.0, error=5.0)]) == "a thickness is not determined"
    assert doubt(problem, [weighed([("alumina", 13.0)], 0.0, error=1.0)]) == ""
    assert doubt(problem, [weighed([("SiO2", 2.0)], 0.0, error=20.0, most=BARE)]) == ""
