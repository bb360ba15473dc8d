"""Verdicts of made hypotheses."""

import dataclasses
import math

import pellicle as pl
from pellicle.fitting.result import Estimate
from pellicle.identification.evidence import Weighed
from pellicle.identification.hypothesis import Hypothesis, SupposedLayer
from pellicle.identification.words import verdict

AROUND = pl.Scene(pl.Layer("SiO2", 0.0), "Si")
NEAREST = tuple.__new__(Weighed)
"""Of which nothing is said where a hypothesis is left."""


def film(material, like, ln_z, *, depth=300.0, error=2.0, probability=0.0, condition=""):
    thickness = Estimate("thickness", depth, error, "nm", 0.0, 500.0, free=True, stderr_noise=0.1)
    layer = SupposedLayer(material, like, (1.45, 1.47), (0.0, 0.0), (thickness,))
    about = {"condition": condition, "probability": probability}
    return Hypothesis(material, (layer,), ln_z, 1.0, True, AROUND, **about)


def told(kept, excluded, doubt="", alike=1):
    return verdict(kept, [] if doubt else kept[:alike], excluded, doubt, NEAREST, (), "Si")


def test_a_film_is_not_named_after_one_that_is_excluded():
    excluded = [film("Sc2O3", ("Sc2O3",), -11.0), film("alumina", ("alumina",), -90.0)]
    said = told([film("Si3N4", ("Si3N4", "Sc2O3"), 0.0)], excluded)
    assert said.startswith("A film of index 1.45 to 1.47, as Si3N4, 300.0 ± 2.0 nm thick on Si.")
    assert "Excluded: Sc2O3 (Δ ln Z 11), alumina (Δ ln Z 90)." in said
    assert "1.47, near Sc2O3, 300.0" in told([film("cauchy", ("Sc2O3",), 0.0)], excluded)


def test_the_same_film_by_a_free_index_is_not_called_excluded():
    best = film("SiO2", ("SiO2",), 0.0)
    same = film("cauchy", ("SiO2",), -6.5, depth=300.4)
    other = film("cauchy", ("SiO2",), -6.5, depth=420.0)
    assert "Excluded" not in told([best], [same])
    assert "Excluded: cauchy (Δ ln Z 6)" in told([best], [other])


def test_probabilities_of_all_that_are_left_are_in_the_verdict():
    rare = film("PMMA", ("PMMA",), -4.0, probability=0.014)
    assert "Less probable: PMMA (1.4 %)." in told([film("SiO2", ("SiO2",), 0.0, error=3.04), rare], [])
    why = "the reflectance was measured relative to Si"
    said = told([film("SiO2", ("SiO2",), 0.0, condition=why), rare], [], why)
    assert f"If {why}, they may be of this: a film of index" in said
    assert "Also left: PMMA (1 %)." in said


def test_an_oxide_that_nothing_bounds_is_not_thinner_than_nothing():
    for error, said in ((1.0, "No film is seen on Si: an oxide is thinner than 3.6 nm."), (math.inf, "Si.")):
        bare = dataclasses.replace(film("SiO2", (), 0.0, depth=2.0, error=error), name="bare substrate")
        assert told([bare], []).endswith(said)
