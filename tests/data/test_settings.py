"""Azimuths of the sample in files: settings of one measurement, beside angles of incidence."""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum
from pellicle.data.spectrum import Spectrum, named, setting_numbers, settings
from pellicle.data.write_spectrum import write_spectrum
from pellicle.errors import DataError
from tests.data.tables import assert_read

NM = np.tile(np.linspace(400.0, 800.0, 6), 4)
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
    spectrum = read_spectrum(write_columns(header, NM, *SIGNALS[names], ANGLE, AZIMUTH))
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
    twice = [np.tile(column, 2) for column in (NM, *SIGNALS["R"], AZIMUTH, ANGLE)]
    twice[1][24:] += 0.01
    mean = read_spectrum(write_columns("nm,R,azimuth_deg,angle_deg", *twice))
    assert len(mean.sweeps) == 2
    assert len(mean.settings) == 4
    np.testing.assert_allclose(np.sort(mean.values), np.sort(SIGNALS["R"][0] + 0.005), rtol=1e-8)


def test_a_repeated_point_names_its_line(write_columns):
    columns = (np.append(x[:12], x[11]) for x in (NM, *SIGNALS["R"], AZIMUTH))
    path = write_columns("nm,R,azimuth_deg", *columns)
    with pytest.raises(DataError, match="repeats 800 of line 13; within one angle and azimuth"):
        read_spectrum(path)
    with pytest.raises(DataError, match="comes twice at one angle"):
        Spectrum(np.full(2, 500.0), np.full(2, 0.1), "R", azimuth=np.full(2, 30.0))
    assert len(Spectrum(np.full(2, 500.0), np.full(2, 0.1), "R", azimuth=np.array([0.0, 30.0]))) == 2


def test_an_azimuth_in_other_units_is_refused(write_columns):
    with pytest.raises(DataError, match="is in 'rad'; write angles in degrees"):
        read_spectrum(write_columns("nm,R,azimuth [rad]", NM[:6], SIGNALS["R"][0][:6], AZIMUTH[:6]))


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
