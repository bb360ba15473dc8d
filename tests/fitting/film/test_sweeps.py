"""Sweeps of a spectrum, the correlation of residuals along them, and errors of fits of sweeps that drift."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.data.repeated_sweeps import mean_spectrum
from pellicle.fitting.film.sweeps import sweeps

NM = np.linspace(400.0, 800.0, 41)
ANGLES = np.array([20.0, 45.0, 60.0, 70.0])


THERE_AND_BACK = np.concatenate([NM, NM[-2::-1]])
TWICE = np.tile(np.arange(50.0, 71.0), 2)


@pytest.mark.parametrize(
    ("nm", "angle", "expected"),
    [
        (NM, np.zeros(41), [range(41)]),
        (NM[::-1], np.zeros(41), [range(41)]),
        (THERE_AND_BACK, np.zeros(81), [range(41), range(41, 81)]),
        (np.full(42, 658.0), TWICE, [range(21), range(21, 42)]),  # swept along the angle
    ],
)
def test_sweeps_of_one_angle_or_one_wavelength(nm, angle, expected):
    assert [part.tolist() for part in sweeps(nm, angle)] == [list(part) for part in expected]


@pytest.mark.parametrize("interleaved", [True, False])
def test_each_angle_is_a_sweep(interleaved):
    nm, angle = (x.ravel() for x in np.meshgrid(NM, ANGLES, indexing="ij" if interleaved else "xy"))
    result = sweeps(nm, angle)
    assert len(result) == 4
    for part, each in zip(result, ANGLES, strict=True):
        assert (angle[part] == each).all()
        np.testing.assert_array_equal(nm[part], NM)


def test_rows_in_no_order_are_one_sorted_sweep():
    nm = np.random.default_rng(0).permutation(NM)
    [part] = sweeps(nm, np.zeros(41))
    np.testing.assert_array_equal(nm[part], NM)


@pytest.mark.parametrize("interleaved", [True, False])
@pytest.mark.slow  # compiles a scene of its own
def test_a_misfit_does_not_hide_between_angles(interleaved):
    """One measurement in two orders: structured residuals of thirteen angles are no noise."""
    angles = np.linspace(0.0, 60.0, 13)
    nm, angle = (x.ravel() for x in np.meshgrid(NM, angles, indexing="ij" if interleaved else "xy"))
    layers = [pl.Layer("SiO2", 300.0), pl.Layer("TiO2", 60.0)]
    truth = np.concatenate(
        [pl.simulate(pl.Scene(layers, "Si", light=pl.Light(angle=a)), NM).values for a in angles]
    )
    values = truth.reshape(13, 41).T.ravel() if interleaved else truth
    values = values + np.random.default_rng(1).normal(0.0, 0.002, values.size)
    fit = pl.fit(
        pl.Spectrum(nm, values, "R", angle=angle), pl.Scene(pl.Layer("SiO2", pl.Free(100, 600)), "Si")
    )
    assert fit.rms > 0.02
    assert fit.status is pl.Status.MISFIT


@pytest.mark.slow  # compiles fits of its own
def test_residuals_count_along_the_sweep_of_each_angle():
    """Slow errors of one sign at one angle and of the other at the next look like noise in file order."""
    nm, angles = np.linspace(450.0, 800.0, 32), np.array([20.0, 40.0, 50.0, 60.0])
    substrate = pl.dispersion.Constant(3.9, 0.02)
    wavelength, angle = (x.ravel() for x in np.meshgrid(nm, angles, indexing="ij"))
    random = np.random.default_rng(3)
    values = np.empty((32, 4))
    for i, own in enumerate(angles.tolist()):
        scene = pl.Scene(pl.Layer(1.46, 420.0), substrate, light=pl.Light(angle=own))
        values[:, i] = pl.simulate(scene, nm).values + 0.01 * (-1) ** i * (1 + (nm - 450) / 350)
    values += random.normal(0.0, 0.001, values.shape)
    spectrum = pl.Spectrum(wavelength, values.ravel(), "R", angle=angle)
    scenes = {f"{n:g}": pl.Scene(pl.Layer(n, pl.Free(380.0, 460.0)), substrate) for n in (1.46, 1.5)}
    found = pl.compare(spectrum, scenes)
    assert found.best.name == "1.46"
    # the errors of a sweep have one sign: its 32 points count as a few
    assert found.effective_points < 128 / 5
    assert found.effective_points == pytest.approx(found.best.fit.effective_points, rel=0.02)


POINTS = np.linspace(400.0, 800.0, 128)
FILM = pl.Scene(pl.Layer(1.46, pl.Free(250, 350)), 3.9 + 0.02j)
SHIFTS = (-0.4, 0.1, 0.5, -0.3)
"""Errors of the wavelengths of each sweep (nm)."""


def reflectance(shift: float, seed: int) -> pl.Spectrum:
    clean = np.asarray(pl.reflectance(POINTS + shift, 300.0, 1.46, 3.9 + 0.02j))
    return pl.Spectrum(POINTS, clean + np.random.default_rng(seed).normal(0, 0.001, POINTS.size), "R")


def ellipsometry(shift: float, seed: int) -> pl.Spectrum:
    angle, sigma = np.full(POINTS.size, 65.0), np.full(POINTS.size, 0.02)
    psi, delta = pl.ellipsometry(POINTS + shift, 300.0, 1.46, 3.9 + 0.02j, angle=65.0)
    noise = np.random.default_rng(seed).normal(0, 0.02, (2, POINTS.size))
    values, delta = np.asarray(psi) + noise[0], (np.asarray(delta) + noise[1]) % 360
    return pl.Spectrum(POINTS, values, "psi-delta", sigma, delta=delta, delta_sigma=sigma, angle=angle)


MEASURES = [reflectance, pytest.param(ellipsometry, marks=pytest.mark.slow)]  # in the joint fit below too


@pytest.mark.slow
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
