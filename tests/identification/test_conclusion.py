"""Structures that are left, from weights that are made up."""

from typing import Any

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.result import Estimate
from pellicle.identification.conclusion import SEVERAL, answer, doubt, plausible, shapeless, survivors
from pellicle.identification.evidence import Weighed
from pellicle.identification.growth import BARE, needed
from pellicle.identification.hypothesis import Hypothesis, SupposedLayer
from pellicle.identification.problem import Attempt, Problem
from pellicle.identification.signal_view import SignalView
from pellicle.identification.structure import OXIDE, Material, Structure


def weighed(films, ln_z, error=1.0, *, most=3000.0, adequate=True, remaining=1.0):
    """Layers (name, thickness) with an error of each thickness; the lowest is `most` nm thick at most."""
    limits = [*[3000.0] * (len(films) - 1), most]
    structure = Structure(tuple(Material(name, own) for (name, _), own in zip(films, limits, strict=True)))
    x = np.array([depth for _, depth in films])
    errors, attempt = np.full(len(x), error), Attempt(structure, x, np.zeros(9), np.zeros((9, len(x))), 0.0)
    changes = (0.0,) * len(x)
    return Weighed(attempt, x, errors, errors, changes, ln_z, remaining, adequate, True, ("scale", 1.0), 1.0)


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


def of_constant_indices(signal, **indices):
    """A spectrum of nine points, with tables of these indices."""
    other: Any = {"delta": np.full(9, 90.0)} if signal == "psi-delta" else {}
    spectrum = pl.Spectrum(np.linspace(450, 950, 9), np.full(9, 0.4), signal, angle=np.full(9, 65.0), **other)
    view = SignalView(spectrum, pl.Scene(pl.Layer("SiO2", 0.0), "Si"))
    view.tables.update((name, np.full(view.wavelength.size, n + 0j)) for name, n in indices.items())
    return Problem((view,), 3000.0)


def test_one_film_under_several_names_is_certain():
    """30 nm of polystyrene in ψ and Δ were undecided between SU-8 and polystyrene, 1 % and 0.7 nm apart."""
    oxides = of_constant_indices("psi-delta", HfO2=1.89, Y2O3=1.95, Ta2O5=2.02)
    best, other = weighed([("HfO2", 35.3)], 0.0), weighed([("Y2O3", 34.5)], -0.5)
    assert doubt(oxides, [best, other]) == ""
    # of one R or T two wrong structures agree more often
    assert doubt(of_constant_indices("R", HfO2=1.89, Y2O3=1.95), [best, other]) == SEVERAL
    assert doubt(oxides, [best, weighed([("Y2O3", 29.0)], -0.5)]) == SEVERAL
    # 5 % of probability is e⁻³
    far = weighed([("Ta2O5", 33.0)], -2.5)
    assert doubt(oxides, [best, other, far]) == ""
    assert doubt(oxides, [best, far]) == SEVERAL
    assert doubt(oxides, [best, other, far._replace(ln_z=-1.0)]) == SEVERAL


def test_two_layers_are_certain_only_where_all_that_are_left_are_these():
    tables = of_constant_indices("psi-delta", MgO=1.73, SiO2=1.46, PMMA=1.48, Ta2O5=2.1)
    best = weighed([("MgO", 60.0), ("SiO2", 120.0)], 0.0)
    assert doubt(tables, [best, weighed([("MgO", 60.0), ("PMMA", 119.0)], -1.0)]) == ""
    assert doubt(tables, [best, weighed([("MgO", 60.0), ("PMMA", 110.0)], -1.0)]) == SEVERAL
    assert doubt(tables, [best, weighed([("Ta2O5", 50.0), ("SiO2", 120.0)], -4.5)]) == SEVERAL
    assert doubt(tables, [best._replace(remaining=1.4)]) == "its residuals are 1.4 times the noise"
    assert doubt(of_constant_indices("R", MgO=1.73, SiO2=1.46), [best]).startswith("one spectrum of R or T")
    one = [weighed([("MgO", 60.0), ("SiO2", 8.0)], 0.0, most=OXIDE, remaining=1.4)]  # on a native oxide
    assert doubt(of_constant_indices("R", MgO=1.73, SiO2=1.46), one) == ""
    thick = [weighed([("MgO", 60.0), ("SiO2", 48.0)], 0.0, most=OXIDE)]  # no native oxide
    assert doubt(of_constant_indices("R", MgO=1.73, SiO2=1.46), thick).startswith("one spectrum of R or T")


def test_the_thickness_of_one_film_covers_all_its_names():
    def film(value, error):
        estimate = Estimate("thickness", value, error, "nm", 0.0, 90.0, free=True, stderr_noise=error)
        layer = SupposedLayer("SiO2", (), (1.4, 1.4), (0.0, 0.0), (estimate,))
        return Hypothesis("film", (layer,), 0.0, 1.0, True, pl.Scene(pl.Layer("SiO2", 0.0), "Si"))

    one = answer([film(30.0, 3.0), film(34.0, 3.0)]).layers[0].thickness
    assert one.value == 30.0
    assert one.stderr == pytest.approx((9 + 16 / 2) ** 0.5)
    assert one.stderr_noise == 3.0
    assert answer([film(30.0, 3.0)]) == film(30.0, 3.0)


def test_usual_errors_are_left_where_more_evidence_needs_unusual_ones():
    strange = weighed([("alumina", 29.0), ("HfO2", 386.0)], 100.0, adequate=False)
    usual = weighed([("SU-8", 24.0), ("HfO2", 398.0)], 90.0)
    assert survivors([strange, usual]) == []
    assert plausible([strange, usual]) == [usual]
    assert plausible([strange, usual._replace(ln_z=85.0)]) == []
    assert plausible([strange, usual._replace(remaining=1.5)]) == []
