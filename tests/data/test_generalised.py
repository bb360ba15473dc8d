"""Reading, checking and writing of generalised Ψ and Δ."""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum
from pellicle.data.repeated_sweeps import mean_spectrum, repeatability
from pellicle.data.spectrum import Spectrum
from pellicle.errors import DataError, UsageError
from pellicle.signals.generalised import RATIOS, delta_sigma

SIGNAL = "generalised-psi-delta"

NM = np.linspace(400.0, 800.0, 6)
PSI = np.stack([np.linspace(20, 30, 6), np.linspace(0, 2, 6), np.linspace(1, 0.5, 6)], axis=1)
DELTA = np.stack([np.linspace(80, 120, 6), np.linspace(-100, 50, 6), np.linspace(350, 10, 6)], axis=1)
NAMES = "psi_ane,delta_ane,psi_aps,delta_aps,psi_asp,delta_asp"
COLUMNS = np.stack([PSI, DELTA], axis=2).reshape(6, 6).T


@pytest.fixture
def write(write_columns):
    return lambda header, *columns: write_columns(header, NM, *columns)


def test_a_file_may_have_some_of_them(write):
    path = write("nm,Psi(Asp),Delta(Asp),psi_ane_deg,delta_ane_deg", *COLUMNS[4:], *COLUMNS[:2])
    assert read_spectrum(path).ratios == ("ane", "asp")
    one = read_spectrum(path, elements=["asp"])
    np.testing.assert_allclose(one.values, PSI[:, 2:], rtol=1e-8)
    with pytest.raises(UsageError, match="has no ratio aps; it has ane, asp"):
        read_spectrum(path, elements=["aps"])
    with pytest.raises(UsageError, match="must be among ane, aps, asp, not 'm12'"):
        read_spectrum(path, signal=SIGNAL, elements=["m12"])
    with pytest.raises(UsageError, match="must be among ane, aps, asp, not 'xyz'"):
        read_spectrum(path, elements=["ane", "xyz"])
    with pytest.raises(DataError, match="has 'psi_ane' alone, and each ratio needs psi and delta"):
        read_spectrum(write("nm,psi_ane,psi_aps,delta_aps", *COLUMNS[:1], *COLUMNS[2:4]))


def test_standard_deviations(write):
    errors = np.linspace(0.01, 0.06, 6)
    names = ",".join(f"sigma_{name}" for name in NAMES.split(","))
    own = read_spectrum(write(f"nm,{NAMES},{names}", *COLUMNS, *errors))
    np.testing.assert_allclose(own.sigma[0], errors[::2], rtol=1e-8)
    np.testing.assert_allclose(own.delta_sigma[0], errors[1::2], rtol=1e-8)


def test_one_noise_is_that_of_psi_and_the_same_across_it(write):
    """σ of Δ from the distance on the sphere of N, C, S, of random points around each ratio."""
    one = read_spectrum(write(f"nm,{NAMES},sigma", *COLUMNS, 0.05))
    given = read_spectrum(write(f"nm,{NAMES}", *COLUMNS), noise=0.05)
    np.testing.assert_array_equal(one.delta_sigma, given.delta_sigma)
    np.testing.assert_array_equal(given.sigma, 0.05)
    random, psi = np.random.default_rng(0), np.deg2rad(40.0)
    around = np.array([np.cos(psi), np.sin(psi), 0.0]) + np.deg2rad(0.1) * random.normal(size=(20000, 3))
    spread = np.std(np.rad2deg(np.arctan2(around[:, 2], around[:, 1])))
    assert delta_sigma(np.array([20.0]), 0.05)[0] == pytest.approx(spread, rel=0.03)
    assert delta_sigma(np.array([0.0]), 0.05)[0] == pytest.approx(np.rad2deg(1.0))


def test_impossible_values_name_their_place(write):
    wrong = COLUMNS.copy()
    wrong[2, 3] = 91.0
    with pytest.raises(DataError, match=r"line 5.*'psi_aps': 91 is not from 0 to 90 degrees"):
        read_spectrum(write(f"nm,{NAMES}", *wrong))
    with pytest.raises(DataError, match="is in 'rad'; write psi and delta in degrees"):
        read_spectrum(write("nm,psi_ane [rad],delta_ane [rad]", *COLUMNS[:2]))
    with pytest.raises(DataError, match="`aps delta` at 400 nm: nan is not finite"):
        Spectrum(NM, PSI, SIGNAL, delta=np.where(DELTA == -100, np.nan, DELTA), ratios=RATIOS)
    with pytest.raises(UsageError, match="`ratios` go with"):
        Spectrum(NM, PSI[:, :1], "psi-delta", delta=DELTA[:, :1], ratios=("ane",))
    with pytest.raises(ValueError, match="`values`: expected 2 numbers per wavelength"):
        Spectrum(NM, PSI, SIGNAL, delta=DELTA, ratios=("ane", "aps"))


def test_repeats_are_averaged_on_the_spheres():
    random, count = np.random.default_rng(1), 8
    noise = np.deg2rad(0.1)  # of N, C, S: 0.05 degrees of Ψ
    double, delta = 2 * np.deg2rad(PSI), np.deg2rad(DELTA)
    c, s = np.sin(double) * np.cos(delta), np.sin(double) * np.sin(delta)
    sphere = np.stack([np.cos(double), c, s], axis=-1)
    sweeps = []
    for _ in range(count):
        n, c, s = np.moveaxis(sphere + noise * random.normal(size=sphere.shape), -1, 0)
        psi, delta = np.rad2deg(np.arctan2(np.hypot(c, s), n)) / 2, np.rad2deg(np.arctan2(s, c)) % 360
        sweeps.append(Spectrum(NM, psi, SIGNAL, delta=delta, ratios=RATIOS))
    assert repeatability(sweeps) == pytest.approx(0.05, rel=0.2)
    mean = mean_spectrum(sweeps)
    assert mean.ratios == RATIOS
    np.testing.assert_allclose(mean.values, PSI, atol=0.1)  # of Ψ = 0 its noise is always above
