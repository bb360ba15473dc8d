"""Raw counts of a sample and a reference turned into reflectance."""

import numpy as np
import pytest

from pellicle.data.read_counts import read_counts, reflectance_from_counts
from pellicle.data.spectrum import Spectrum
from pellicle.errors import DataError, UsageError
from tests.data.tables import assert_read

GRID = np.array([400.0, 500.0, 600.0, 700.0, 800.0])


def counts(values, wavelength=GRID, path="counts.csv"):
    values, lines = np.asarray(values, float), np.arange(2, 7)
    return Spectrum(wavelength, values, "counts", calibrated=False, path=path, lines=lines)


def test_counts_of_any_name_and_any_value(write):
    path = write("wavelength_nm,counts_ratio_percent\n400,-370.6\n500,6700\n600,1\n", "raw.csv")
    read = read_counts(path)
    assert_read(read, signal="counts", calibrated=False, values=[-370.6, 6700, 1])
    path.write_text("400 -370.6\n500 6700\n600 1\n")
    np.testing.assert_array_equal(read_counts(path).values, read.values)


def test_counts_of_several_columns_are_ambiguous(write, refused):
    path = write("wavelength,lamp,sample\n400,1,2\n500,1,2\n", "raw.csv")
    refused(path, "'lamp', 'sample'", "`columns=[", read=read_counts, error=UsageError)
    assert read_counts(path, columns="wavelength,_,counts").values[0] == 2


def test_quotient_of_counts_less_the_dark():
    known = np.array([0.5, 0.4, 0.35, 0.33, 0.32])
    truth = np.array([0.1, 0.2, 0.3, 0.2, 0.1])
    lamp, dark = np.array([50.0, 200, 400, 300, 90]), np.array([5.0, 6, 7, 6, 5])
    sample = counts(lamp * truth + dark, path="film.csv")
    spectrum = reflectance_from_counts(sample, counts(lamp * known + dark), known, counts(dark), noise=0.01)
    assert_read(spectrum, values=truth, sigma=0.01, signal="R", calibrated=True, path="film.csv")
    assert any("counts.csv" in note for note in spectrum.notes)


def test_a_reference_on_another_grid_is_interpolated():
    reference = counts([350, 450, 550, 650, 850], np.array([350.0, 450, 550, 650, 850]))
    spectrum = reflectance_from_counts(counts(0.5 * GRID), reference, np.ones(5))
    np.testing.assert_allclose(spectrum.values, 0.5, rtol=1e-14)


def test_a_reference_that_does_not_cover_the_sample():
    reference = counts(np.ones(5), GRID + 50, path="silicon.csv")
    with pytest.raises(DataError, match=r"silicon\.csv: the reference covers 450 to 850 nm.*`range`"):
        reflectance_from_counts(counts(np.ones(5)), reference, np.ones(5))
    with pytest.raises(DataError, match="the dark covers 450 to 850 nm"):
        reflectance_from_counts(counts(np.ones(5)), counts(np.ones(5)), np.ones(5), reference)


def test_a_reference_without_counts():
    reference = counts([10, 10, 0, 10, -4], path="silicon.csv")
    with pytest.raises(DataError, match=r"silicon\.csv: the reference has no counts at 600 nm.*`range`"):
        reflectance_from_counts(counts(np.ones(5)), reference, np.ones(5))
    with pytest.raises(DataError, match="no counts above the dark at 400 nm"):
        reflectance_from_counts(counts(np.ones(5)), counts(np.ones(5)), np.ones(5), counts(np.ones(5)))


def test_a_quotient_that_is_no_reflectance_cites_the_line():
    with pytest.raises(DataError, match=r"film\.csv: line 4, .*: 3 is above 1\.5 for a .*`range`"):
        reflectance_from_counts(counts([1, 1, 3, 1, 1], path="film.csv"), counts(np.ones(5)), np.ones(5))


def test_arguments():
    with pytest.raises(ValueError, match=r"one number per wavelength of the sample \(5,\), got \(4,\)"):
        reflectance_from_counts(counts(np.ones(5)), counts(np.ones(5)), np.ones(4))
    with pytest.raises(UsageError, match=r"`noise` must be .* got 0"):
        reflectance_from_counts(counts(np.ones(5)), counts(np.ones(5)), np.ones(5), noise=0)
