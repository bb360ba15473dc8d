"""The public verbs: the same for a film and for a surface."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.effects import film_plan, surface_plan
from pellicle.effects.surface_plan import REMOVABLE
from pellicle.scene.surface import surface_view
from pellicle.simulation.brdf import default_directions, simulate_samples
from pellicle.simulation.spectra import simulate_spectrum

FILM = pl.Scene(pl.Layer("SiO2", pl.Free(400, 600)), "Si")
STEEL = pl.Surface("microfacet-film", {"thickness": pl.Free(20, 80), "n": 2.3, "base_n": 2.9, "base_k": 3.0})
DIRECTIONS = default_directions(50)


def test_simulate_takes_a_film_or_a_surface():
    wavelength = [500.0, 600.0]
    spectrum = pl.simulate(FILM, wavelength, noise=0.01, seed=2)
    assert np.array_equal(spectrum.values, simulate_spectrum(FILM, wavelength, noise=0.01, seed=2).values)
    samples = pl.simulate(STEEL, directions=DIRECTIONS, noise=0.01, seed=2)
    assert np.array_equal(samples.values, simulate_samples(STEEL, DIRECTIONS, 0.01, 2).samples.values)


def test_plan_takes_a_film_or_a_surface():
    assert pl.plan(FILM) == film_plan.plan(FILM)
    keep = [effect for effect in REMOVABLE if effect != "precision"]  # each that may go is compiled
    found = pl.plan(STEEL, 1e-2, directions=DIRECTIONS, keep=keep)
    assert [effect.effect for effect in found.left_out] == ["precision"]
    assert found == surface_plan.plan(surface_view(STEEL, DIRECTIONS), 1e-2, keep)


@pytest.mark.parametrize(
    ("verb", "scene", "arguments", "message"),
    [
        ("simulate", STEEL, {"wavelength": [500.0]}, "`wavelength` has no meaning for a Surface"),
        ("simulate", FILM, {"directions": DIRECTIONS}, "`directions` has no meaning for a Scene"),
        ("plan", FILM, {"directions": DIRECTIONS}, "`directions` has no meaning for a Scene"),
        ("cost", STEEL, {"noise": 0.1}, "`noise` has no meaning for a Surface"),
        ("cost", FILM, {"directions": DIRECTIONS}, "`directions` has no meaning for a Scene"),
    ],
)
def test_arguments_of_the_other_kind_are_refused(verb, scene, arguments, message, refuses):
    refuses(TypeError, message, getattr(pl, verb), scene, **arguments)
