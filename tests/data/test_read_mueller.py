"""Reading and writing of normalised Mueller elements."""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum
from pellicle.data.spectrum import Spectrum
from pellicle.errors import DataError, UsageError
from tests.data.tables import assert_read

NM = np.linspace(400.0, 800.0, 6)
M12, M33, M34 = np.linspace(-0.9, 0.8, 6), np.linspace(0.3, -0.4, 6), np.linspace(0.1, 0.5, 6)


@pytest.fixture
def write(write_columns):
    return lambda header, *columns: write_columns(header, NM, *columns)


@pytest.mark.parametrize("names", ["m12,m33,m34", "M12,M33,M34", "mm12,mm33,mm34", "m_12,M_33,m_{34}"])
def test_names_of_elements(write, names):
    spectrum = read_spectrum(write(f"wavelength_nm,{names},angle", M12, M33, M34, 65.0))
    assert_read(spectrum, signal="mueller", elements=("m12", "m33", "m34"))
    np.testing.assert_allclose(spectrum.values, np.stack([M12, M33, M34], axis=1), rtol=1e-8)
    assert np.all(spectrum.angle == 65)


def test_elements_are_chosen_in_the_order_of_the_matrix(write):
    path = write("nm,m34,m33,m12", M34, M33, M12)
    assert read_spectrum(path, elements=["m34", "m12"]).elements == ("m12", "m34")
    with pytest.raises(UsageError, match="has no column m44; it has m12, m33, m34"):
        read_spectrum(path, elements=["m44"])
    with pytest.raises(UsageError, match="not 'm11'"):
        read_spectrum(path, elements=["m11"])


def test_elements_are_divided_by_m11(write):
    raw = np.linspace(2000.0, 3000.0, 6)
    path = write("nm,m11,m12,m33,sigma_m12,sigma_m33", raw, raw * M12, raw * M33, 10.0, 20.0)
    spectrum = read_spectrum(path)
    np.testing.assert_allclose(spectrum.values, np.stack([M12, M33], axis=1), rtol=1e-7)
    np.testing.assert_allclose(spectrum.sigma, np.outer(1 / raw, [10, 20]), rtol=1e-8)
    assert "elements divided by m11" in spectrum.notes


def test_an_intensity_in_the_place_of_m11_is_no_divisor(write):
    spectrum = read_spectrum(write("nm,m11,m12", np.linspace(0.2, 0.4, 6), M12))
    np.testing.assert_allclose(spectrum.values[:, 0], M12, rtol=1e-8)
    assert "m11 is an intensity beside normalised elements: ignored" in spectrum.notes


def test_elements_that_were_not_measured_are_left_out(write):
    spectrum = read_spectrum(write("nm,m12,m13,m22,m33", M12, 0.0, 1.0, M33))
    assert spectrum.elements == ("m12", "m33")
    assert "left out as not measured, exactly 0 or 1 at every point: m13, m22" in spectrum.notes
    with pytest.raises(DataError, match="m13, m22 are constant: nothing was measured"):
        read_spectrum(write("nm,m13,m22", 0.0, 1.0))


def test_impossible_elements_are_refused(write):
    with pytest.raises(DataError, match=r"line 7, column 'm12': 1\.2 is beyond 1\.1 for m12"):
        read_spectrum(write("nm,m12,m33", np.where(NM == 800, 1.2, M12), M33))
    # noise reaches as far
    assert len(read_spectrum(write("nm,m12,sigma", np.where(NM == 800, 1.2, M12), 0.05))) == 6
    with pytest.raises(DataError, match="is in 'percent'; write elements as fractions"):
        read_spectrum(write("nm,m12 (%)", 100 * M12))


@pytest.mark.parametrize(
    ("pair", "values", "words"),
    [
        ("m34,m43", (M34, M34), "m34 and m43 have the same sign, and of an isotropic sample they are"),
        ("m12,m21", (M12, -M12), "m12 and m21 have opposite signs"),
        ("m33,m44", (M33, -M33), "m33 and m44 have opposite signs"),
    ],
)
def test_signs_of_another_convention_are_named(write, pair, values, words):
    assert any(words in note for note in read_spectrum(write(f"nm,{pair}", *values)).notes)
    usual = values[0], -values[1]
    assert not any("convention" in note for note in read_spectrum(write(f"nm,{pair}", *usual)).notes)


def test_repeated_sweeps_are_averaged(tmp_path):
    rows = [f"{nm},{m}" for own in (M12 + 0.001, M12 - 0.001) for nm, m in zip(NM, own, strict=True)]
    (tmp_path / "sweeps.csv").write_text("\n".join(["nm,m12", *rows]))
    spectrum = read_spectrum(tmp_path / "sweeps.csv")
    assert len(spectrum.sweeps) == 2
    np.testing.assert_allclose(spectrum.values[:, 0], M12, atol=1e-12)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"elements": ()}, '`elements` go with `signal="mueller"`'),
        ({"elements": ("m12", "m12")}, "are repeated"),
        ({"elements": ("m15", "m12")}, "not 'm15'"),
    ],
)
def test_elements_are_checked(words, message):
    with pytest.raises(UsageError, match=message):
        Spectrum(NM, np.zeros((6, 2)) if words["elements"] else M12, "mueller", **words)
