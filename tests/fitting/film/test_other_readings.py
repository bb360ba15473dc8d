"""Files whose Δ follows another convention."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.film.other_readings import conventions

NM = np.linspace(400.0, 760.0, 64)
PSI, DELTA = (np.asarray(x) for x in pl.ellipsometry(NM, 250.0, "SiO2", "Si", angle=70.0))


def spectrum(delta, **more):
    angle, noise = np.full(64, 70.0), np.random.default_rng(1).normal(0, 0.03, (2, 64))
    return pl.Spectrum(
        NM, PSI + noise[0], "psi-delta", delta=(delta + noise[1]) % 360, angle=angle, folded=False, **more
    )


@pytest.mark.parametrize(
    ("words", "written"),
    [("360 - delta", 360 - DELTA), ("delta + 180", DELTA - 180), ("180 - delta", 180 - DELTA)],
)
def test_each_convention_is_undone(words, written):
    data = spectrum(written)
    again = dict(conventions([data], [20.0]))
    turned = {}
    for name, (read,) in again.items():
        assert isinstance(read, pl.Spectrum)
        turned[name] = np.exp(1j * np.deg2rad(np.asarray(read.delta) - DELTA))
    assert [name for name, turn in turned.items() if np.all(np.abs(turn - 1) < 0.01)] == [words]


def test_small_residuals_and_other_signals_are_not_read_again():
    data = spectrum(DELTA)
    reflectance = pl.Spectrum(NM, np.full(64, 0.3), "R")
    assert list(conventions([data], [1.0])) == []
    assert list(conventions([reflectance], [20.0])) == []


@pytest.mark.slow  # four fits
def test_a_misfit_names_the_convention():
    """Without a given noise, too: C alone is wrong where the file has 180 - delta."""
    fit = pl.fit(spectrum(180 - DELTA), pl.Scene(pl.Layer("SiO2", pl.Free(1, 1000)), "Si"))
    assert fit.status == "misfit"
    assert "with 180 - delta in place of delta it would fit, with thickness 2" in fit.warnings[0]
    assert float(fit.warnings[0].split("thickness ")[1].split()[0]) == pytest.approx(250, abs=0.5)
