"""Errors of fits of sweeps that drift, against fits of every sweep by itself."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.data.repeated_sweeps import mean_spectrum

NM = np.linspace(400.0, 800.0, 128)
FILM = pl.Scene(pl.Layer(1.46, pl.Free(250, 350)), 3.9 + 0.02j)
SHIFTS = (-0.4, 0.1, 0.5, -0.3)
"""Errors of the wavelengths of each sweep (nm)."""


def reflectance(shift: float, seed: int) -> pl.Spectrum:
    clean = np.asarray(pl.reflectance(NM + shift, 300.0, 1.46, 3.9 + 0.02j))
    return pl.Spectrum(NM, clean + np.random.default_rng(seed).normal(0, 0.001, NM.size), "R")


def ellipsometry(shift: float, seed: int) -> pl.Spectrum:
    angle, sigma = np.full(NM.size, 65.0), np.full(NM.size, 0.02)
    psi, delta = pl.ellipsometry(NM + shift, 300.0, 1.46, 3.9 + 0.02j, angle=65.0)
    noise = np.random.default_rng(seed).normal(0, 0.02, (2, NM.size))
    values, delta = np.asarray(psi) + noise[0], (np.asarray(delta) + noise[1]) % 360
    return pl.Spectrum(NM, values, "psi-delta", sigma, delta=delta, delta_sigma=sigma, angle=angle)


MEASURES = [reflectance, pytest.param(ellipsometry, marks=pytest.mark.slow)]  # in the joint fit below too


@pytest.mark.parametrize("measure", MEASURES)
def test_the_scatter_between_sweeps_is_that_of_their_own_fits(measure):
    """To first order: within 5 %, where residuals alone state a third of it or less."""
    sweeps = [measure(shift, seed) for seed, shift in enumerate(SHIFTS)]
    found = pl.fit(mean_spectrum(sweeps), FILM)
    own = [pl.fit(sweep, FILM)["thickness"] for sweep in sweeps]
    expected = np.std([p.value for p in own], ddof=1) / 2
    assert own[0].stderr_noise < expected / 2
    assert found["thickness"].stderr_noise == pytest.approx(expected, rel=0.05)
    # the sweeps are all that speaks of this noise: three degrees of freedom, and little from the residuals
    assert 3 <= found["thickness"].degrees_of_freedom < 4
    [warning] = [text for text in found.warnings if "drift" in text]
    assert warning.startswith("the sweeps drift: thickness differs by ")


@pytest.mark.parametrize("measure", MEASURES)
def test_noise_between_sweeps_changes_nothing(measure):
    mean = mean_spectrum([measure(0.0, seed) for seed in range(4)])
    found = pl.fit(mean, FILM)
    alone = pl.fit(
        pl.Spectrum(
            **{
                name: getattr(mean, name)
                for name in ("wavelength", "values", "signal", "sigma", "angle", "delta", "delta_sigma")
            }
        ),
        FILM,
    )
    assert found["thickness"].stderr == alone["thickness"].stderr
    assert not any("drift" in text for text in found.warnings)


@pytest.mark.slow  # a joint fit of its own
def test_one_of_two_spectra_drifts():
    """In a joint fit the error grows by what the drifting sweeps contribute to it."""
    steady = mean_spectrum([ellipsometry(0.0, seed) for seed in range(4)])
    drifting = mean_spectrum([reflectance(8 * shift, seed) for seed, shift in enumerate(SHIFTS)])
    quiet = mean_spectrum([reflectance(0.0, seed) for seed in range(4)])
    both, calm = (pl.fit([steady, r], FILM) for r in (drifting, quiet))
    [warning] = [text for text in both.warnings if "drift" in text]
    assert warning.startswith("the sweeps of R drift: thickness differs by ")
    assert not any("drift" in text for text in calm.warnings)
    assert both["thickness"].stderr_noise > calm["thickness"].stderr_noise
