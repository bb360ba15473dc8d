"""Spectra and BRDF samples made in Python: limits, settings of one measurement, noise as users write it."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.read_spectrum import read_spectrum
from pellicle.data.spectrum import Spectrum, named, setting_numbers, settings
from pellicle.data.write_spectrum import write_spectrum
from pellicle.errors import DataError, UsageError
from pellicle.signals.limits import noise_level
from tests.data.tables import assert_read

NM = np.array([500.0, 600.0, 700.0])
ANGLES = {"signal": "psi-delta", "delta": NM / 10}


@pytest.mark.parametrize(
    ("values", "changes", "message"),
    [
        (30.0, {}, "`values` at 500 nm: 30 is above 1.5 for a reflectance; divide percent by 100, or give"),
        (-0.1, {}, "`values` at 500 nm: -0.1 is a reflectance below zero by more than noise"),
        (np.nan, {}, "`values` at 500 nm: nan is not finite"),
        (0.3, {"sigma": np.zeros(3)}, "`sigma` at 500 nm: 0 is not above zero"),
        (0.3, {"angle": np.full(3, 95.0)}, "`angle` at 500 nm: 95 is not from 0 to 90 degrees"),
        (0.3, {"wavelength": NM - 500}, "`wavelength` at 0 nm: 0 is not above zero"),
        (0.3, {"wavelength": NM.clip(600)}, "`wavelength` at 600 nm: 600 comes twice at one angle"),
        (95.0, ANGLES, "`values` at 500 nm: 95 is not from 0 to 90"),
        (45.0, {"signal": "psi-delta", "delta": NM}, "`delta` at 500 nm: 500 is not from -180 to 360"),
        (45.0, ANGLES | {"depolarisation": np.full(3, 2.3)}, "`depolarisation` at 500 nm: 2.3 is not from"),
        (30.0, {"path": "a.csv", "name": "Rp"}, "a.csv [Rp]: `values` at 500 nm: 30 is"),
        (30.0, {"path": "a.csv", "lines": np.arange(3)}, "a.csv: line 0, `values` at 500 nm: 30 is"),
    ],
)
def test_impossible_values(values, changes, message):
    arguments = {"wavelength": NM, "values": np.full(3, values), "signal": "R"} | changes
    with pytest.raises(DataError) as caught:
        pl.Spectrum(**arguments)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"signal": "Rs"}, "`signal` must be one of R, T, .*, not 'Rs'"),
        ({"polarisation": "x"}, "`polarisation` must be one of s, p, unpolarised, not 'x'"),
        ({"signal": "psi-delta"}, "`delta` goes with `signal"),
        ({"delta": NM}, "`delta` goes with `signal"),
        ({"depolarisation": NM / 1e4}, "`depolarisation` goes with `signal"),
        (ANGLES | {"depolarisation_sigma": NM}, "`depolarisation_sigma` goes with `depolarisation`"),
    ],
)
def test_unknown_words(changes, message):
    with pytest.raises(UsageError, match=message):
        pl.Spectrum(**({"wavelength": NM, "values": np.full(3, 0.3), "signal": "R"} | changes))


def test_any_scale_if_it_is_not_calibrated():
    assert pl.Spectrum(NM, np.full(3, 900.0), "R", calibrated=False).values[0] == 900
    assert pl.Spectrum(NM, np.full(3, 900.0), "counts").values[0] == 900
    noisy = pl.Spectrum(NM, np.full(3, -0.2), "R", sigma=np.full(3, 0.1))
    assert noisy.values[0] == -0.2


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"theta_i": np.array([30.0, 91.0])}, "sample 1: theta_i: 91 degrees is below the horizon"),
        ({"values": np.full((2, 1), -0.1)}, "sample 0: value: -0.1 is a BRDF below zero"),
        ({"values": np.full((2, 1), np.inf)}, "sample 0: value: inf is not finite"),
        ({"phi_o": np.full(2, np.nan)}, "sample 0: phi_o: nan is not finite"),
        ({"sigma": np.zeros((2, 1))}, "sample 0: the standard deviation of value: 0 is not above zero"),
    ],
)
def test_impossible_samples(changes, message):
    angles = dict.fromkeys(("theta_i", "phi_i", "theta_o", "phi_o"), np.full(2, 30.0))
    with pytest.raises(DataError, match=message):
        pl.BrdfSamples(**(angles | {"values": np.ones((2, 1)), "channels": ("value",)} | changes))


ROWS = np.tile(np.linspace(400.0, 800.0, 6), 4)
ANGLE = np.repeat([60.0, 60.0, 70.0, 70.0], 6)
AZIMUTH = np.repeat([0.0, 45.0, 0.0, 45.0], 6)


SIGNALS = {
    "R": [np.linspace(0.1, 0.3, 24)],
    "T": [np.linspace(0.9, 0.8, 24)],
    "psi_deg,delta_deg": [np.linspace(20.0, 40.0, 24), np.linspace(100.0, 300.0, 24)],
    "m12,m33": [np.linspace(-0.5, 0.1, 24), np.linspace(0.2, 0.4, 24)],
    "psi_aps_deg,delta_aps_deg": [np.linspace(1.0, 3.0, 24), np.linspace(100.0, 300.0, 24)],
}


@pytest.mark.parametrize("names", SIGNALS)
def test_several_azimuths_are_one_measurement(write_columns, names, tmp_path):
    """An anisotropic sample has another spectrum at each azimuth: rows at one wavelength are no repeats."""
    header = f"nm,{names},angle_deg,azimuth_deg"
    spectrum = read_spectrum(write_columns(header, ROWS, *SIGNALS[names], ANGLE, AZIMUTH))
    assert not spectrum.sweeps
    assert len(spectrum) == 24
    assert "'azimuth_deg' read as the azimuth of the sample in degrees" in spectrum.notes
    for setting in spectrum.settings:
        rows = (setting.angle == ANGLE) & (setting.azimuth == AZIMUTH)
        own = spectrum.values.reshape(24, -1)[setting.rows, 0]
        np.testing.assert_allclose(own, SIGNALS[names][0][rows], rtol=1e-8)
    back = read_spectrum(write_spectrum(tmp_path / "again.csv", spectrum))
    assert_read(back, values=spectrum.values, azimuth=spectrum.azimuth)


def test_repeats_at_each_azimuth_are_averaged(write_columns):
    twice = [np.tile(column, 2) for column in (ROWS, *SIGNALS["R"], AZIMUTH, ANGLE)]
    twice[1][24:] += 0.01
    mean = read_spectrum(write_columns("nm,R,azimuth_deg,angle_deg", *twice))
    assert len(mean.sweeps) == 2
    assert len(mean.settings) == 4
    np.testing.assert_allclose(np.sort(mean.values), np.sort(SIGNALS["R"][0] + 0.005), rtol=1e-8)


def test_a_repeated_point_names_its_line(write_columns, refused):
    columns = (np.append(x[:12], x[11]) for x in (ROWS, *SIGNALS["R"], AZIMUTH))
    path = write_columns("nm,R,azimuth_deg", *columns)
    refused(path, "repeats 800 of line 13; within one angle and azimuth", error=DataError)
    with pytest.raises(DataError, match="comes twice at one angle"):
        Spectrum(np.full(2, 500.0), np.full(2, 0.1), "R", azimuth=np.full(2, 30.0))
    assert len(Spectrum(np.full(2, 500.0), np.full(2, 0.1), "R", azimuth=np.array([0.0, 30.0]))) == 2


def test_an_azimuth_in_other_units_is_refused(write_columns):
    with pytest.raises(DataError, match="is in 'rad'; write angles in degrees"):
        read_spectrum(write_columns("nm,R,azimuth [rad]", ROWS[:6], SIGNALS["R"][0][:6], AZIMUTH[:6]))


def test_names_of_settings():
    every = settings(ANGLE, AZIMUTH, 24)
    names = [f"{angle}°, azimuth {azimuth}°" for angle in (60, 70) for azimuth in (0, 45)]
    assert [named(one, every) for one in every] == names
    turned = settings(np.full(24, 60.0), AZIMUTH, 24)
    assert [named(one, turned) for one in turned] == ["azimuth 0°", "azimuth 45°"]
    [alone] = settings(None, None, 3)
    assert alone.rows.tolist() == [0, 1, 2]
    assert named(alone, [alone]) is None
    assert setting_numbers(ANGLE, None) is ANGLE


RGB = BrdfSamples(*np.zeros((4, 3)), np.array([[1.0, 2, 4], [10, 20, 40], [0, 2, 4]]), ("R", "G", "B"))


@pytest.mark.parametrize(
    ("given", "value", "relative"),
    [(0.01, 0.01, False), ("0.01", 0.01, False), ("2 %", 0.02, True), ("0.5%", 0.005, True)],
)
def test_a_noise_is_a_number_or_a_share(given, value, relative):
    assert noise_level(given) == pytest.approx((value, relative))


@pytest.mark.parametrize("wrong", [0, -1, "-2 %", "two", "%", "nan", "inf", ""])
def test_a_wrong_noise_is_refused(wrong, refuses):
    refuses(UsageError, "--noise must be a standard deviation above zero", noise_level, wrong, "--noise")


def test_a_share_of_the_signal():
    data = RGB.with_noise("10 %")
    np.testing.assert_allclose(data.sigma[:2], 0.1 * RGB.values[:2])
    assert data.sigma[2, 0] == pytest.approx(0.1 * 1e-3 * 4)  # a thousandth of the median, not zero
    assert data.relative == (0.1, 0.1, 0.1)


def test_a_noise_for_each_channel(refuses):
    data = RGB.with_noise(["10 %", 0.5, "1 %"])
    np.testing.assert_allclose(data.sigma[1], [1.0, 0.5, 0.4])
    assert data.relative == (0.1, 0.0, 0.01)
    assert RGB.with_noise(0.5).relative is None
    refuses(UsageError, "2 numbers for 3 channels", RGB.with_noise, [0.1, 0.2])
