"""Reading and checking of normalised Mueller elements, and of generalised Ψ and Δ."""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectra, read_spectrum
from pellicle.data.repeated_sweeps import mean_spectrum, repeatability
from pellicle.data.spectrum import Spectrum
from pellicle.errors import DataError, UsageError
from pellicle.signals.generalised import RATIOS, delta_sigma
from tests.data.tables import assert_read

NM = np.linspace(400.0, 800.0, 6)
M12, M33, M34 = np.linspace(-0.9, 0.8, 6), np.linspace(0.3, -0.4, 6), np.linspace(0.1, 0.5, 6)


@pytest.fixture
def file_of(write_columns):
    return lambda header, *columns: write_columns(header, NM, *columns)


@pytest.mark.parametrize("names", ["m12,m33,m34", "M12,M33,M34", "mm12,mm33,mm34", "m_12,M_33,m_{34}"])
def test_names_of_elements(file_of, names):
    spectrum = read_spectrum(file_of(f"wavelength_nm,{names},angle", M12, M33, M34, 65.0))
    assert_read(spectrum, signal="mueller", elements=("m12", "m33", "m34"))
    np.testing.assert_allclose(spectrum.values, np.stack([M12, M33, M34], axis=1), rtol=1e-8)
    assert np.all(spectrum.angle == 65)


def test_elements_are_chosen_in_the_order_of_the_matrix(file_of, refused, refuses):
    path = file_of("nm,m34,m33,m12", M34, M33, M12)
    assert read_spectrum(path, elements=["m34", "m12"]).elements == ("m12", "m34")
    refused(path, "has no column m44; it has m12, m33, m34", error=UsageError, elements=["m44"])
    refuses(UsageError, "not 'm11'", read_spectrum, path, elements=["m11"])


def test_elements_are_divided_by_m11(file_of):
    raw = np.linspace(2000.0, 3000.0, 6)
    path = file_of("nm,m11,m12,m33,sigma_m12,sigma_m33", raw, raw * M12, raw * M33, 10.0, 20.0)
    spectrum = read_spectrum(path)
    np.testing.assert_allclose(spectrum.values, np.stack([M12, M33], axis=1), rtol=1e-7)
    np.testing.assert_allclose(spectrum.sigma, np.outer(1 / raw, [10, 20]), rtol=1e-8)
    assert "elements divided by m11" in spectrum.notes


def test_an_intensity_in_the_place_of_m11_is_no_divisor(file_of):
    spectrum = read_spectrum(file_of("nm,m11,m12", np.linspace(0.2, 0.4, 6), M12))
    np.testing.assert_allclose(spectrum.values[:, 0], M12, rtol=1e-8)
    assert "m11 is an intensity beside normalised elements: ignored" in spectrum.notes


def test_elements_that_were_not_measured_are_left_out(file_of, refused):
    spectrum = read_spectrum(file_of("nm,m12,m13,m22,m33", M12, 0.0, 1.0, M33))
    assert spectrum.elements == ("m12", "m33")
    assert "left out as not measured, exactly 0 or 1 at every point: m13, m22" in spectrum.notes
    refused(file_of("nm,m13,m22", 0.0, 1.0), "m13, m22 are constant: nothing was measured", error=DataError)


def test_impossible_elements_are_refused(file_of, refused):
    with pytest.raises(DataError, match=r"line 7, column 'm12': 1\.2 is beyond 1\.1 for m12"):
        read_spectrum(file_of("nm,m12,m33", np.where(NM == 800, 1.2, M12), M33))
    # noise reaches as far
    assert len(read_spectrum(file_of("nm,m12,sigma", np.where(NM == 800, 1.2, M12), 0.05))) == 6
    refused(file_of("nm,m12 (%)", 100 * M12), "is in 'percent'; write elements as fractions", error=DataError)


@pytest.mark.parametrize(
    ("pair", "values", "words"),
    [
        ("m34,m43", (M34, M34), "m34 and m43 have the same sign, and of an isotropic sample they are"),
        ("m12,m21", (M12, -M12), "m12 and m21 have opposite signs"),
        ("m33,m44", (M33, -M33), "m33 and m44 have opposite signs"),
    ],
)
def test_signs_of_another_convention_are_named(file_of, pair, values, words):
    assert any(words in note for note in read_spectrum(file_of(f"nm,{pair}", *values)).notes)
    usual = values[0], -values[1]
    assert not any("convention" in note for note in read_spectrum(file_of(f"nm,{pair}", *usual)).notes)


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


SIGNAL = "generalised-psi-delta"

PSI = np.stack([np.linspace(20, 30, 6), np.linspace(0, 2, 6), np.linspace(1, 0.5, 6)], axis=1)
DELTA = np.stack([np.linspace(80, 120, 6), np.linspace(-100, 50, 6), np.linspace(350, 10, 6)], axis=1)
NAMES = "psi_ane,delta_ane,psi_aps,delta_aps,psi_asp,delta_asp"
COLUMNS = np.stack([PSI, DELTA], axis=2).reshape(6, 6).T


def test_a_file_may_have_some_of_them(file_of, refused):
    path = file_of("nm,Psi(Asp),Delta(Asp),psi_ane_deg,delta_ane_deg", *COLUMNS[4:], *COLUMNS[:2])
    assert read_spectrum(path).ratios == ("ane", "asp")
    one = read_spectrum(path, elements=["asp"])
    np.testing.assert_allclose(one.values, PSI[:, 2:], rtol=1e-8)
    refused(path, "has no ratio aps; it has ane, asp", error=UsageError, elements=["aps"])
    for signal, elements in ((SIGNAL, ["m12"]), (None, ["ane", "xyz"])):
        with pytest.raises(UsageError, match=f"must be among ane, aps, asp, not '{elements[-1]}'"):
            read_spectrum(path, signal=signal, elements=elements)
    with pytest.raises(DataError, match="has 'psi_ane' alone, and each ratio needs psi and delta"):
        read_spectrum(file_of("nm,psi_ane,psi_aps,delta_aps", *COLUMNS[:1], *COLUMNS[2:4]))


def test_standard_deviations(file_of):
    errors = np.linspace(0.01, 0.06, 6)
    names = ",".join(f"sigma_{name}" for name in NAMES.split(","))
    own = read_spectrum(file_of(f"nm,{NAMES},{names}", *COLUMNS, *errors))
    np.testing.assert_allclose(own.sigma[0], errors[::2], rtol=1e-8)
    np.testing.assert_allclose(own.delta_sigma[0], errors[1::2], rtol=1e-8)


def test_one_noise_is_that_of_psi_and_the_same_across_it(file_of):
    """σ of Δ from the distance on the sphere of N, C, S, of random points around each ratio."""
    one = read_spectrum(file_of(f"nm,{NAMES},sigma", *COLUMNS, 0.05))
    given = read_spectrum(file_of(f"nm,{NAMES}", *COLUMNS), noise=0.05)
    np.testing.assert_array_equal(one.delta_sigma, given.delta_sigma)
    np.testing.assert_array_equal(given.sigma, 0.05)
    random, psi = np.random.default_rng(0), np.deg2rad(40.0)
    around = np.array([np.cos(psi), np.sin(psi), 0.0]) + np.deg2rad(0.1) * random.normal(size=(20000, 3))
    spread = np.std(np.rad2deg(np.arctan2(around[:, 2], around[:, 1])))
    assert delta_sigma(np.array([20.0]), 0.05)[0] == pytest.approx(spread, rel=0.03)
    assert delta_sigma(np.array([0.0]), 0.05)[0] == pytest.approx(np.rad2deg(1.0))


def test_impossible_values_name_their_place(file_of):
    wrong = COLUMNS.copy()
    wrong[2, 3] = 91.0
    with pytest.raises(DataError, match=r"line 5.*'psi_aps': 91 is not from 0 to 90 degrees"):
        read_spectrum(file_of(f"nm,{NAMES}", *wrong))
    with pytest.raises(DataError, match="is in 'rad'; write psi and delta in degrees"):
        read_spectrum(file_of("nm,psi_ane [rad],delta_ane [rad]", *COLUMNS[:2]))
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


OF_ELEMENTS = np.linspace(-0.9, 0.8, 6), np.linspace(0.3, -0.4, 6)
OF_RATIOS = np.linspace(20, 30, 6), np.linspace(80, 120, 6), np.linspace(0, 2, 6), np.linspace(200, 350, 6)
SIGNALS = {
    "mueller": ("m12,m33", OF_ELEMENTS, "m33", ("m33",)),
    "generalised-psi-delta": ("psi_ane,delta_ane,psi_aps,delta_aps", OF_RATIOS, "aps", ("aps",)),
}
"""Names and columns, one of the parts, and how a spectrum names it."""


@pytest.fixture(params=SIGNALS)
def signal(request):
    return request.param


@pytest.fixture
def file(write_columns, signal):
    """Write these columns with others, and return the path."""
    names, columns, *_ = SIGNALS[signal]
    return lambda more="", *others: write_columns(f"nm,{names}{more}", NM, *columns, *others)


def test_psi_and_delta_come_first(file, signal):
    path = file(",psi_deg,delta_deg", 45.0, np.linspace(100, 170, 6))
    assert read_spectrum(path).signal == "psi-delta"
    assert read_spectrum(path, signal=signal).signal == signal
    part, parts = SIGNALS[signal][2:]
    one = read_spectrum(path, elements=[part])
    assert (one.elements or one.ratios) == parts


def test_a_reflectance_beside_them_is_of_the_same_film(file, signal, refused):
    path = file(",R", 0.3)
    refused(path, "as well as R; choose one with `signal`", error=UsageError, read=read_spectrum)
    assert [one.signal for one in read_spectra(path)] == [signal, "R"]
    assert read_spectrum(path, signal="R").signal == "R"
    refused(file(), 'contradicts `signal="R"`', error=UsageError, signal="R")


def test_one_standard_deviation_is_that_of_every_column(file, signal, refused):
    both = read_spectrum(file(",sigma", 0.01))
    assert both.sigma.shape == (6, 2)
    assert np.all(both.sigma == 0.01)
    assert np.all(read_spectrum(file(",sigma", 0.01), noise=0.002).sigma == 0.002)
    first = SIGNALS[signal][0].split(",")[0]
    with pytest.raises(DataError, match=r"of some of the (columns|elements) only"):
        read_spectrum(file(f",sigma_{first}", 0.01))
    refused(file(",sigma", 0.0), "is a standard deviation not above zero", error=DataError)
