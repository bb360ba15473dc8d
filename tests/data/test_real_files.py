"""Every spectrum kept beside the repository is read, or refused for the right reason."""

import numpy as np
import pytest

from pellicle.data.read_counts import read_counts, reflectance_from_counts
from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import DataError, UsageError
from tests.data.tables import assert_read

CALIBRATED = {
    "regresspro_filmetrics_F20/quartz_reflectance.csv": ("R", 1341),
    "regresspro_filmetrics_F20/reflectance.csv": ("R", 1341),
    "regresspro_fsg_oxide_on_si/reflectance.csv": ("R", 119),
    "thinfilmstools_oxides/hafnia_T.csv": ("T", 890),
    "thinfilmstools_oxides/scandia_T.csv": ("T", 889),
    "thinfilmstools_oxides/scandia2_T.csv": ("T", 911),
    "thinfilmstools_oxides/porousSi_microcavity_R.csv": ("R", 601),
}


@pytest.mark.parametrize("name", CALIBRATED)
def test_calibrated_spectra(shared_data, name):
    spectrum = read_spectrum(shared_data / name)
    assert (spectrum.signal, len(spectrum)) == CALIBRATED[name]
    assert spectrum.calibrated
    expected = np.loadtxt(shared_data / name, delimiter=",", skiprows=1, usecols=(0, 1))
    assert_read(spectrum, wavelength=expected[:, 0], values=expected[:, 1])


def test_a_column_that_only_looks_like_sigma_is_ignored_and_said(shared_data):
    spectrum = read_spectrum(shared_data / "regresspro_fsg_oxide_on_si" / "reflectance.csv")
    assert spectrum.sigma is None
    assert "ignored: 'R_sigma_as_stated'" in spectrum.notes


def test_soap_films_need_to_be_told_what_was_measured(shared_data, refused):
    files = sorted((shared_data / "soap_films").glob("*.csv"))
    assert files
    for file in files:
        refused(file, "uncalibrated; ", '`signal="R"`', error=UsageError)
        spectrum = read_spectrum(file, signal="R", range=(510, 910))
        assert not spectrum.calibrated
        assert spectrum.wavelength[0] >= 510


def test_wavelengths_rounded_until_they_repeat_are_refused(shared_data, refused):
    file = shared_data / "thinfilmstools_oxides" / "porousSi_bragg_R.csv"
    refused(file, "line 4, ", "401 repeats 401 of line 3", error=DataError)


def test_ellipsometry_of_hafnia(shared_data, refused):
    path = shared_data / "thinfilmstools_oxides" / "hafnia_psi_delta.csv"
    spectrum = read_spectrum(path)
    expected = np.loadtxt(path, delimiter=",", skiprows=1)
    expected = expected[np.argsort(expected[:, 0])]
    assert spectrum.signal == "psi-delta"
    np.testing.assert_array_equal(spectrum.wavelength, expected[:, 0])
    np.testing.assert_array_equal(spectrum.angle, expected[:, 1])
    np.testing.assert_array_equal(spectrum.values, expected[:, 2])
    np.testing.assert_allclose(spectrum.delta, expected[:, 3] % 360, rtol=1e-15)
    refused(path, "has psi and delta, which contradicts `signal=", error=UsageError, signal="R")


@pytest.mark.parametrize("pair", ["SL1", "SL2"])
def test_raw_counts_of_porous_silicon(shared_data, pair, refused):
    folder = shared_data / "thinfilmstools_oxides"
    refused(folder / f"{pair}sample_raw.csv", "'counts_ratio_percent'", "`columns=", error=DataError)
    sample = read_counts(folder / f"{pair}sample_raw.csv", range=(450, 950))
    reference = read_counts(folder / f"{pair}reference_raw.csv")
    spectrum = reflectance_from_counts(sample, reference, np.full(len(sample), 0.35))
    assert -0.01 < spectrum.values.min() < 0.2 < spectrum.values.max() < 1
    whole = read_counts(folder / f"{pair}sample_raw.csv")
    with pytest.raises(DataError, match=r"reference has no counts at .* nm; .*`range`"):
        reflectance_from_counts(whole, reference, np.full(len(whole), 0.35))


def test_other_tables_are_refused(shared_data):
    for file in sorted((shared_data / "brdf").glob("*.csv")):
        with pytest.raises(
            (DataError, UsageError), match=r"samples of a BRDF|(no column is|state no quantity).*`columns="
        ):
            read_spectrum(file)
    teal = shared_data / "brdf" / "teal_spectra_300_700nm.csv"
    assert len(read_spectrum(teal, columns="wavelength,R_percent")) == 401
