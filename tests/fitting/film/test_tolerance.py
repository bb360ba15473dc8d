"""Fits that leave out what a tolerance allows, and what they do when that was too much."""

from dataclasses import replace

import numpy as np
import pytest

import pellicle as pl
from pellicle.effects.film_plan import exact
from pellicle.effects.removal import FilmRemoval
from pellicle.fitting.film import fit as fitting
from pellicle.simulation.spectra import simulate_signal

NM = np.linspace(450.0, 850.0, 41)
NOISE = 1e-3


def scene(extinction):
    layer = pl.Layer(1.46 + 1j * extinction, pl.Free(150, 350, start=237.0))
    return pl.Scene(layer, 3.9 + 0.02j)


def spectrum(thing):
    values = simulate_signal(thing, NM, NOISE, seed=1).values
    return pl.Spectrum(NM, values, "R", np.full(NM.shape, NOISE))


@pytest.mark.slow  # two fits of a cone of light
def test_a_fit_leaves_out_what_the_tolerance_allows():
    thing = scene(1e-6)
    data = spectrum(thing)
    whole, cheap = (pl.fit(data, thing, tolerance=t) for t in (0.0, 1e-3))
    assert not cheap.plan.on("absorption")
    assert cheap.plan.on("precision")
    assert cheap.plan.error_bound <= 1e-3
    (exactly,), (nearly,) = whole.free, cheap.free
    assert abs(exactly.value - nearly.value) < 0.1 * exactly.stderr
    assert cheap.warnings == whole.warnings


@pytest.mark.slow  # two fits of different plans
def test_a_fit_beyond_its_tolerance_is_done_again(monkeypatch):
    """As where the design of the plan missed the place that the best fit is at."""
    thing = scene(0.05)
    data = spectrum(thing)

    def careless(scene, tolerance, keep):
        return replace(exact(scene), left_out=(FilmRemoval("absorption"),), tolerance=tolerance)

    monkeypatch.setattr(
        "pellicle.fitting.film.problem.plan", lambda s, t, k: careless(s, t, k) if t else exact(s)
    )
    found = fitting.fit(data, thing, tolerance=1e-3)
    assert found.plan.on("absorption")
    assert "fitted again with every effect" in found.warnings[0]
    (thickness,) = found.free
    assert thickness.value == pytest.approx(237.0, abs=4 * thickness.stderr)
