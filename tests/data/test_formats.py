"""What ellipsometers export: small samples of each format, and the real files of an Accurion EP4."""

import re
from pathlib import Path

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import DataError, UsageError

REAL = Path(__file__).resolve().parents[2] / "measurements" / "ellipsometry"

WVASE = """\
oxide on silicon, 3 zones
VASEmethod[EllipsometerType=5, Isotropic, WVASE=3.688]
Original[oxide.dat]
nm
400.000000\t65.000000\t20.5\t170.25\t0.05\t0.4
410.000000\t65.000000\t21.5\t-10.5\t0.06\t0.5
400.000000\t75.000000\t12.5\t120.25\t0.07\t0.6
"""
COMPLETE_EASE = """\
oxide on silicon
VASEmethod[EllipsometerType=7, Isotropic+Depolarization]
Original[oxide.SE]
eV
E\t3.0\t65.0\t20.5\t170.25\t0.05\t0.4
E\t2.0\t65.0\t21.5\t265.5\t0.06\t0.5
dpolE\t3.0\t65.0\t0.1\t0\t0.01\t0
dpolE\t2.0\t65.0\t0.2\t0\t0.01\t0
"""
SPECTRARAY = """\
; WAVELENGTH 50.20000 50.20000 70.10000 70.10000
400.5 40.1 170.5 30.1 120.5\x20
401.5 40.2 180.5 30.2 121.5\x20
402.5 40.3 190.5 30.3 122.5\x20
"""
ACCURION = """\
#Lambda\tBandwidth\tAOI\tDelta\tPsi\tZone\tROIidx\tX_pos
#nm\tnm\tdeg\tdeg\tdeg\t-\t-\tmm
658.0\t2.0\t50.000\t170.0\t31.0\t1\t000\t-6.980
658.0\t2.0\t50.000\t171.0\t31.2\t2\t000\t-6.980
658.0\t2.0\t60.000\t160.0\t23.0\t1\t000\t-6.978
658.0\t2.0\t60.000\tNaN\tNaN\t2\t000\t-6.978
658.0\t2.0\t50.000\t170.5\t31.1\t0\t000\t-6.980
658.0\t2.0\t60.000\tNaN\tNaN\t0\t000\t-6.978
658.0\t2.0\t70.000\t140.5\t11.1\t0\t000\t-6.973
658.0\t2.0\t50.000\t1.0\t0.2\t5\t000\t-6.980
658.0\t2.0\t60.000\tNaN\tNaN\t5\t000\t-6.978
658.0\t2.0\t70.000\t1.5\t0.3\t5\t000\t-6.973
"""
IMAGE = """\
#ROIidx\tAOI\tLambda\tROI_x\tDelta\tPsi
#-\tdeg\tnm\tµm\tdeg\tdeg
0\t40.000\t365.0\t417.6\t179.75\t32.5
0\t40.000\t370.0\t417.6\t180.25\t33.5
0\t50.000\t365.0\t417.6\t178.75\t24.5
"""


@pytest.fixture
def write(tmp_path):
    def write(text, name="export.dat"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


def refused(path, *said):
    with pytest.raises(DataError) as caught:
        read_spectrum(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    for words in said:
        assert words in message.removeprefix(str(path)), message
    assert "\n" not in message


def assert_read(spectrum, **expected):
    assert spectrum.signal == "psi-delta"
    for name, values in expected.items():
        np.testing.assert_allclose(getattr(spectrum, name), values, rtol=1e-12, err_msg=name)


def test_wvase(write):
    spectrum = read_spectrum(write(WVASE))
    assert_read(
        spectrum,
        wavelength=[400, 400, 410],
        angle=[65, 75, 65],
        values=[20.5, 12.5, 21.5],
        delta=[170.25, 120.25, 349.5],
        sigma=[0.05, 0.07, 0.06],
        delta_sigma=[0.4, 0.6, 0.5],
        lines=[5, 7, 6],
    )
    assert spectrum.notes[0] == "read as a Woollam (WVASE, CompleteEASE) text file"


def test_rows_without_errors(write):
    text = re.sub(r"(?m)^(4.*)\t[\d.]+\t[\d.]+$", r"\1", WVASE)
    spectrum = read_spectrum(write(text))
    np.testing.assert_array_equal(spectrum.values, [20.5, 12.5, 21.5])
    assert spectrum.sigma is None
    assert spectrum.delta_sigma is None


def test_angstroms_are_converted(write):
    text = re.sub(r"(?m)^(4\d\d)\.000000", r"\g<1>0.0", WVASE).replace("\nnm", "\nAngstroms")
    np.testing.assert_allclose(read_spectrum(write(text)).wavelength, [400, 400, 410])


def test_complete_ease(write):
    spectrum = read_spectrum(write(COMPLETE_EASE))
    assert_read(
        spectrum,
        wavelength=1239.8419843320026 / np.array([3.0, 2.0]),
        angle=[65, 65],
        values=[20.5, 21.5],
        delta=[170.25, 265.5],
        sigma=[0.05, 0.06],
        delta_sigma=[0.4, 0.5],
        lines=[5, 6],
    )
    assert "rows of other quantities ignored: dpolE" in spectrum.notes


def test_rows_with_a_label_need_no_method_above_them(write):
    text = "\n".join(["title", *COMPLETE_EASE.splitlines()[3:]])
    assert len(read_spectrum(write(text))) == 2


def test_errors_that_are_all_zero_are_none(write):
    zero = re.sub(r"\t[\d.]+\t[\d.]+$", "\t0\t0.0000", WVASE, flags=re.MULTILINE)
    spectrum = read_spectrum(write(zero))
    assert spectrum.sigma is None
    assert "errors that are all zero ignored" in spectrum.notes


def test_woollam_files_that_are_refused(write):
    refused(write(WVASE.replace("nm\n", "nm  TRIG\n")), "line 4", "tan(psi) and cos(delta)")
    refused(write(COMPLETE_EASE.replace("E\t", "mm12\t").replace("dpolmm12", "dpolE")), "mm12, dpolE", "psi")
    refused(write(WVASE + "420\t65\t20\n"), "looks like a Woollam file")
    refused(write(WVASE.replace("21.5", "91.5")), "line 6, column 'psi_deg': 91.5", "0 to 90")
    refused(write(WVASE.replace("21.5", "x")), "line 6, column 'psi_deg': expected a number", "'x'")
    refused(write(WVASE.replace("410.", "400.")), "line 6", "400 repeats 400 of line 5")


def test_a_lone_unit_alone_makes_no_woollam_file(write):
    spectrum = read_spectrum(write("nm\n400 0.1 0.01\n500 0.2 0.01\n"), signal="R")
    assert spectrum.signal == "R"


def test_spectraray(write):
    spectrum = read_spectrum(write(SPECTRARAY))
    assert_read(
        spectrum,
        wavelength=[400.5, 400.5, 401.5, 401.5, 402.5, 402.5],
        angle=[50.2, 70.1] * 3,
        values=[40.1, 30.1, 40.2, 30.2, 40.3, 30.3],
        delta=[170.5, 120.5, 180.5, 121.5, 190.5, 122.5],
        lines=[2, 2, 3, 3, 4, 4],
    )
    assert spectrum.sigma is None
    assert spectrum.notes[0] == "read as a SpectraRay file of 50.20000, 70.10000 degrees"


def test_spectraray_of_one_angle_with_decimal_commas(write):
    text = "; WAVELENGTH 70.06 70.06\n319.8 1.75 20.5\n320.2 2.25 352.0\n"
    spectrum = read_spectrum(write(text.replace(".", ",")))
    assert_read(
        spectrum, wavelength=[319.8, 320.2], angle=[70.06] * 2, values=[1.75, 2.25], delta=[20.5, 352]
    )


def test_spectraray_in_energies(write):
    spectrum = read_spectrum(write("; ENERGY 70 70\n2.0 20 170\n2.5 21 171\n"))
    np.testing.assert_allclose(spectrum.wavelength, 1239.8419843320026 / np.array([2.5, 2.0]))


def test_spectraray_files_that_are_refused(write):
    refused(write(SPECTRARAY.replace("70.10000 70.10000", "70.1 70.2")), "line 1", "each angle", "twice")
    refused(write(SPECTRARAY.replace(" 70.10000 70.10000", " 70.10000")), "line 1", "each angle", "twice")
    apart = SPECTRARAY.replace("50.20000 70.10000", "70.10000 50.20000", 1)
    refused(write(apart), "line 1", "50.20000 70.10000 50.20000 70.10000")
    refused(write(SPECTRARAY.replace("70.10000", "50.20000")), "line 1", "each angle", "twice")
    refused(write(SPECTRARAY.replace(" 121.5", "")), "line 3 has 4 values", "make 5")
    refused(write("; WAVELENGTH 70 70\n"), "no rows")
    refused(write(SPECTRARAY.replace("30.2", "nan")), "line 3, column 'psi_deg': nan")


def test_accurion_with_zones(write):
    spectrum = read_spectrum(write(ACCURION))
    assert_read(
        spectrum,
        wavelength=[658, 658],
        angle=[50, 70],
        values=[31.1, 11.1],
        delta=[170.5, 140.5],
        lines=[7, 9],
    )
    assert spectrum.sigma is None
    assert spectrum.notes[:3] == (
        "read as an Accurion data file",
        "zone 0, the mean of the zones, taken",
        "1 of 3 points, written NaN, left out",
    )


def test_accurion_without_zones(write):
    spectrum = read_spectrum(write(IMAGE))
    assert_read(
        spectrum,
        wavelength=[365, 365, 370],
        angle=[40, 50, 40],
        values=[32.5, 24.5, 33.5],
        delta=[179.75, 178.75, 180.25],
    )


def test_accurion_with_one_zone(write):
    lines = ACCURION.splitlines(keepends=True)
    spectrum = read_spectrum(write("".join(lines[:3] + lines[4:5])))
    np.testing.assert_array_equal(spectrum.values, [31.0, 23.0])
    assert "measured in zone 1 only" in spectrum.notes


def test_accurion_files_that_are_refused(write):
    lines = ACCURION.splitlines(keepends=True)
    refused(write("".join(lines[:6])), "zones 1, 2 without their mean", "one zone")
    refused(write(IMAGE.replace("#-\tdeg\tnm", "#-\tdeg\tum")), "Lambda in 'um', not in 'nm'")
    refused(write(IMAGE.replace("\t24.5", "")), "line 5 has fewer values")
    refused(write(IMAGE.replace("24.5", "94.5")), "line 5, column 'psi_deg': 94.5")
    refused(write("".join(lines[:2] + lines[5:6])), "no point with psi and delta")


@pytest.mark.parametrize(("name", "points"), [("15-1-1", 8), ("19-1-1", 11), ("post_synthesis_spot_1", 5)])
def test_real_accurion_files(name, points):
    spectrum = read_spectrum(REAL / f"{name}.dat")
    assert len(spectrum) == points
    np.testing.assert_array_equal(spectrum.wavelength, 658)
    assert np.all(np.diff(spectrum.angle) > 0)
    assert np.all(np.diff(spectrum.delta) < 0)  # from near 180 at small angles down, as instruments write
    zones = [row.split("\t") for row in (REAL / f"{name}.dat").read_text().splitlines()[2:]]
    for angle, psi, delta in zip(spectrum.angle, spectrum.values, spectrum.delta, strict=True):
        four = [row for row in zones if float(row[2]) == angle and row[5] in "1234"]
        assert abs(np.mean([float(row[4]) for row in four]) - psi) < 0.002
        assert abs(np.mean([float(row[3]) for row in four]) - delta) < 0.002


def refused_words(path, *said, **kwargs):
    with pytest.raises(UsageError) as caught:
        read_spectrum(path, **kwargs)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert all(words in message for words in said), message
    assert "\n" not in message


def test_a_file_of_several_spots_lists_them(write):
    lines = ACCURION.splitlines(keepends=True)
    again = write(ACCURION + lines[6])
    refused_words(
        again, "2 spots or times", ": 1 from line 7; 2 from line 13; choose one, from `spot=1` to `spot=2`"
    )
    other = "1\t40.000\t365.0\t417.6\t179.8\t32.5\n1\t60.000\t365.0\t417.6\t139.8\t22.5\n"
    region = write(IMAGE + other, "image.dat")
    refused_words(region, ": 1 in region 0; 2 in region 1;")
    refused_words(
        REAL / "post_synthesis.dat", "32 spots", ": 1 at -18.183, -30.305 mm; 2 at -6.061, -30.305 mm;"
    )
    assert read_spectrum(again, spot=2).lines.tolist() == [13]
    assert read_spectrum(region, spot=2).lines.tolist() == [6, 7]


def test_spots_measured_by_turns_at_each_angle(write):
    """A stage that drifts by micrometres is still at its spot, in whatever order the rows come."""
    head = ACCURION.splitlines(keepends=True)[:2]
    row = "658.0\t2.0\t{}\t170.0\t{}\t0\t000\t{}\n".format
    given = [row(a, 10 * s + i, 6 * s + 0.004 * i) for i, a in enumerate((50, 60, 70)) for s in (1, 2)]
    path = write("".join([*head, *given]))
    for spot in (1, 2):
        spectrum = read_spectrum(path, spot=spot)
        assert spectrum.values.tolist() == [10 * spot + i for i in range(3)]
        assert f"spot {spot} of 2 at {6 * spot} mm" in spectrum.notes

    refused(write("".join([*head, *given[1:]])), "line 4 lies 6 mm from line 3")


def test_a_spot_that_is_not_there(write):
    refused_words(REAL / "post_synthesis.dat", "choose one, from `spot=1` to `spot=32`", spot=33)
    refused_words(write(ACCURION), "has one spot only; leave `spot` out", spot=2)
    refused_words(write(SPECTRARAY), "`spot` selects a spot of an Accurion file", spot=1)


def test_the_first_spot_is_a_part_of_the_whole():
    """And is what `spot = 1` reads of it."""
    whole, first = (read_spectrum(REAL / f"post_synthesis{end}.dat", spot=1) for end in ("", "_spot_1"))
    for name in ("wavelength", "angle", "values", "delta"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(first, name))
    whole = (REAL / "post_synthesis.dat").read_text().splitlines()
    part = (REAL / "post_synthesis_spot_1.dat").read_text().splitlines()
    assert len(part) == 2 + 5 * 6
    assert part == [line for line in whole if line in set(part)]
    assert len({tuple(line.split("\t")[11:13]) for line in part[2:]}) == 1
