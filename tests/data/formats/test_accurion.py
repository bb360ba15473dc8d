"""Data files of Accurion's imaging ellipsometers: small samples, and the real files of an EP4."""

from pathlib import Path

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import UsageError
from tests.data.tables import assert_read, sample

REAL = Path(__file__).resolve().parents[3] / "measurements" / "ellipsometry"

ACCURION, IMAGE = sample("accurion/zones.txt"), sample("accurion/regions.txt")


@pytest.fixture
def refused_file(refusal):
    return lambda path, *said, **reading: refusal(read_spectrum, path, UsageError, *said, **reading)


def test_accurion_with_zones(write):
    spectrum = read_spectrum(write(ACCURION))
    assert_read(spectrum, signal="psi-delta", wavelength=[658, 658], angle=[50, 70], lines=[7, 9])
    assert_read(spectrum, values=[31.1, 11.1], delta=[170.5, 140.5], sigma=None)
    assert spectrum.notes[:3] == (
        "read as an Accurion data file",
        "zone 0, the mean of the zones, taken",
        "1 of 3 points, written NaN, left out",
    )


def test_accurion_without_zones(write):
    spectrum = read_spectrum(write(IMAGE))
    assert_read(spectrum, wavelength=[365, 365, 370], angle=[40, 50, 40])
    assert_read(spectrum, values=[32.5, 24.5, 33.5], delta=[179.75, 178.75, 180.25])


def test_accurion_with_one_zone(write):
    lines = ACCURION.splitlines(keepends=True)
    spectrum = read_spectrum(write("".join(lines[:3] + lines[4:5])))
    np.testing.assert_array_equal(spectrum.values, [31.0, 23.0])
    assert "measured in zone 1 only" in spectrum.notes


def test_accurion_files_that_are_refused(refused):
    lines = ACCURION.splitlines(keepends=True)
    refused("".join(lines[:2] + lines[5:6]), "no point with psi and delta")
    refused(IMAGE.replace("#-\tdeg\tnm", "#-\tdeg\tum"), "Lambda in 'um', not in 'nm'")
    refused(IMAGE.replace("\t24.5", ""), "line 5 has fewer values")
    refused(IMAGE.replace("24.5", "94.5"), "line 5, column 'psi_deg': 94.5")


def test_zones_without_their_mean_are_averaged(write):
    lines = ACCURION.splitlines(keepends=True)
    spectrum = read_spectrum(write("".join(lines[:6]).replace("170.0", "359.0").replace("171.0", "3.0")))
    assert_read(spectrum, angle=[50], values=[31.1], delta=[1.0])  # 60 degrees lack a balance in zone 2
    assert "the mean of zones 1, 2 taken" in spectrum.notes


@pytest.mark.parametrize("name", ["15-1-1", "19-1-1", "post_synthesis_spot_1"])
def test_the_mean_of_the_zones_is_zone_0(write, name):
    rows = (REAL / f"{name}.dat").read_text().splitlines(keepends=True)
    expected = read_spectrum(REAL / f"{name}.dat")
    without = write("".join(row for row in rows if row.startswith("#") or row.split("\t")[5] != "0"))
    found = read_spectrum(without)
    np.testing.assert_array_equal(found.angle, expected.angle)
    np.testing.assert_allclose(found.values, expected.values, atol=0.002)  # zone 0 is written to 0.001
    np.testing.assert_allclose(found.delta, expected.delta, atol=0.002)


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


def test_a_file_of_several_spots_lists_them(write, refused_file):
    lines = ACCURION.splitlines(keepends=True)
    again = write(ACCURION + lines[6])
    refused_file(again, "2 spots or times", ": 1 from line 7; 2 from line 13;", "from `spot=1` to `spot=2`")
    other = "1\t40.000\t365.0\t417.6\t179.8\t32.5\n1\t60.000\t365.0\t417.6\t139.8\t22.5\n"
    region = write(IMAGE + other, "image.dat")
    refused_file(region, ": 1 in region 0; 2 in region 1;")
    refused_file(REAL / "post_synthesis.dat", "32 spots", ": 1 at -18.183, -30.305 mm; 2 at")
    assert read_spectrum(again, spot=2).lines.tolist() == [13]
    assert read_spectrum(region, spot=2).lines.tolist() == [6, 7]


def test_spots_measured_by_turns_at_each_angle(write, refused):
    """A stage that drifts by micrometres is still at its spot, in whatever order the rows come."""
    head = ACCURION.splitlines(keepends=True)[:2]
    row = "658.0\t2.0\t{}\t170.0\t{}\t0\t000\t{}\n".format
    given = [row(a, 10 * s + i, 6 * s + 0.004 * i) for i, a in enumerate((50, 60, 70)) for s in (1, 2)]
    path = write("".join([*head, *given]))
    for spot in (1, 2):
        spectrum = read_spectrum(path, spot=spot)
        assert spectrum.values.tolist() == [10 * spot + i for i in range(3)]
        assert f"spot {spot} of 2 at {6 * spot} mm" in spectrum.notes

    refused("".join([*head, *given[1:]]), "line 4 lies 6 mm from line 3")


def test_a_spot_that_is_not_there(write, refused_file):
    refused_file(REAL / "post_synthesis.dat", "choose one, from `spot=1` to `spot=32`", spot=33)
    refused_file(write(ACCURION), "has one spot only; leave `spot` out", spot=2)
    refused_file(write("; WAVELENGTH 70 70\n500 20 170\n"), "`spot` selects a spot of an", spot=1)


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
