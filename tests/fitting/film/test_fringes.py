"""Thicknesses by the period of fringes, of signals written out here and of simulated films."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.film.fringes import fringes

X = 2 * 1.5 / np.linspace(900.0, 400.0, 256)
"""2 n / λ of a film of index 1.5 (1/nm)."""
NOISE = np.random.default_rng(4).standard_normal(256)


def suggestions(fit):
    return [warning for warning in fit.warnings if "period of the fringes" in warning]


@pytest.mark.parametrize("thickness", [700.0, 1234.0, 5000.0])
def test_the_frequency_is_the_thickness(thickness):
    lamp = 1 + 0.3 * np.sin(1 + 600 * X)
    for signal in (np.cos(2 * np.pi * thickness * X), 1 / (1.4 + np.cos(2 * np.pi * thickness * X))):
        found = fringes(X, lamp * (3 + signal) + 0.02 * NOISE)
        assert found.thickness == pytest.approx(thickness, rel=0.03)
        assert found.number == pytest.approx(thickness * np.ptp(X), rel=0.05)


@pytest.mark.parametrize(
    "values",
    [
        0.1 * NOISE,
        3 + np.sin(900 * X) + 0.01 * NOISE,  # one fringe
        1 + 0.05 * np.cos(2 * np.pi * 1500.0 * X) + 0.3 * NOISE,
        np.cos(2 * np.pi * 1500.0 * X) + np.cos(2 * np.pi * 2210.0 * X),  # no period
        np.zeros_like(X),
    ],
    ids=["noise", "one fringe", "below the noise", "two periods", "no light"],
)
def test_no_clear_fringes(values):
    assert fringes(X, values) is None


@pytest.mark.slow  # compiles a fit of its own
def test_a_fit_that_misses_the_fringes_says_what_they_suggest(film, measured):
    """The bounds of the thickness exclude the truth."""
    seen = {"substrate": pl.dispersion.Constant(1.46), "light": pl.Light(signal="T")}
    scenes = [film(pl.Free(*ends), 2.2, **seen) for ends in ((10, 500), (10, 3000))]
    data = measured(scenes[0], 1300.0)
    fits = [pl.fit(data, scene) for scene in scenes]
    assert [fit.status for fit in fits] == ["misfit", "converged"]
    wrong, right = map(suggestions, fits)
    assert len(wrong) == 1
    thickness = float(wrong[0].partition("thickness of ")[2].partition(" nm")[0])
    assert thickness == pytest.approx(1300.0, rel=0.02)
    assert right == []


@pytest.mark.slow
def test_fringes_with_dispersion_and_a_wrong_start_raise_no_alarm(film, measured):
    cauchy = pl.dispersion.Cauchy(pl.Free(1.3, 1.95), pl.Free(0.0, 4e4))
    scene = film(pl.Free(10, 3000), cauchy)
    assert suggestions(pl.fit(measured(scene, 1.5, 2e4, 1800.0), scene)) == []
