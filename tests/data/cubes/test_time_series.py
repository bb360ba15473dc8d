"""Series of files and tables with a column or a row for each time: times, units, and what is refused."""

import os

import numpy as np
import pytest

from pellicle.data.read_cube import read_cube
from pellicle.errors import DataError, UsageError

NM = np.linspace(500, 700, 11)


def write(folder, name, level=0.3, nm=NM, above=""):
    path = folder / name
    rows = "\n".join(f"{x:.1f},{level:.3f}" for x in nm)
    path.write_text(f"{above}wavelength_nm,R\n{rows}\n")
    return path


def matrix(folder, heads):
    path = folder / "matrix.csv"
    rows = "\n".join(",".join([f"{x:.1f}", *(f"{0.1 * (i + 1):.2f}" for i in range(len(heads)))]) for x in NM)
    path.write_text(f"Wavelength (nm),{','.join(heads)}\n{rows}\n")
    return path


def test_times_are_the_numbers_in_which_names_differ(tmp_path):
    files = [write(tmp_path, f"run2_{s}s_25C.csv", s / 100) for s in (40, 0, 20)]
    cube = read_cube(files)
    assert cube.dims == ("time",)
    assert cube.units["time"] == "s"
    np.testing.assert_array_equal(cube.coords["time"], [0, 20, 40])
    np.testing.assert_allclose(cube.pixels((slice(None),))["values"][:, 0], [0, 0.2, 0.4])


def test_times_of_a_table_of_columns(tmp_path):
    cube = read_cube([matrix(tmp_path, ["0.0 min", "0.5 min", "2 min"])], signal="R")
    assert cube.units["time"] == "min"
    np.testing.assert_array_equal(cube.coords["time"], [0, 0.5, 2])
    np.testing.assert_allclose(cube.pixels((slice(None),))["values"][:, 3], [0.1, 0.2, 0.3])


def test_times_of_a_table_of_columns_between_tabs(tmp_path):
    """A head such as 2.0 s is not a number and a unit beside it, and a file without a head has no times."""
    path = matrix(tmp_path, [f"{2 * i:.1f} s" for i in range(12)])
    path.write_text(path.read_text().replace(",", "\t"))
    cube = read_cube([path], signal="R")
    np.testing.assert_array_equal(cube.coords["time"], 2 * np.arange(12))
    np.testing.assert_allclose(cube.pixels((slice(None),))["values"][7], 0.8)


@pytest.mark.parametrize("unit", [" nm", " nm R", ""])
def test_rows_of_times_are_a_series_of_spectra(tmp_path, unit):
    path = tmp_path / "rows.txt"
    rows = [f"{30 * i}\t" + "\t".join(f"{(i + x / 1e3) / 10:.4f}" for x in NM) for i in range(4)]
    path.write_text("\n".join(["\t".join(["Time (s)", *(f"{x:g}{unit}" for x in NM)]), *rows]))
    cube = read_cube(path, signal="R")
    assert (cube.dims, cube.units["time"], cube.calibrated) == (("time",), "s", True)
    np.testing.assert_allclose(cube.wavelength, NM)
    np.testing.assert_array_equal(cube.coords["time"], [0, 30, 60, 90])
    np.testing.assert_allclose(cube.pixels((slice(None),))["values"][2], (2 + NM / 1e3) / 10)
    if not unit:
        with pytest.raises(UsageError, match="its heads name no quantity"):
            read_cube(path)


def test_columns_are_taken_by_their_times(tmp_path):
    cube = read_cube([matrix(tmp_path, ["0 s", "9 s", "4 s"])], signal="R")
    np.testing.assert_allclose(cube.pixels((slice(None),))["values"][:, 3], [0.1, 0.3, 0.2])
    assert "the times run back at 4 s: the columns are taken by their times" in cube.notes


def test_times_from_dates_headers_and_tables(tmp_path):
    files = [write(tmp_path, f"{x}.csv", above=f"# 2026-05-04T12:0{i}:30\n") for i, x in enumerate("cab")]
    for i, file in enumerate(files):
        os.utime(file, (1e9 + 7 * i, 1e9 + 7 * i))
    assert list(read_cube(files, time_from="mtime").coords["time"]) == [0, 7, 14]
    assert list(read_cube(files, time_from="header").coords["time"]) == [0, 60, 120]
    table = tmp_path / "times.txt"
    table.write_text("file,time (h)\na.csv,3\nb.csv,1\nc.csv,2\n")
    cube = read_cube(files, time_from=str(table))
    assert list(cube.coords["time"]) == [1, 2, 3]
    assert cube.units["time"] == "h"


def test_points_that_one_spectrum_lacks_are_missing(tmp_path):
    files = [write(tmp_path, "0s.csv"), write(tmp_path, "1s.csv", nm=NM[2:]), write(tmp_path, "2s.csv")]
    values = read_cube(files).pixels((slice(None),))["values"]
    assert np.isnan(values[1, :2]).all()
    assert np.isfinite(values).sum() == 31


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (["a.csv"], "a.csv: is one spectrum, whose name states no time"),
        (["a.csv", "b.csv"], "state no times"),
        (["a1.csv", "a2.csv"], "have no unit"),
        (["1s.csv", "1.0s.csv"], "has the time of"),
        (["1s_3V.csv", "2s_4V.csv"], "differ in several numbers"),
    ],
)
def test_names_without_one_time_are_refused(tmp_path, names, told):
    files = [write(tmp_path, name.replace("V", "s")) for name in names]
    with pytest.raises(DataError, match=told):
        read_cube(files)


def test_other_errors_are_one_sentence(tmp_path):
    one, other = write(tmp_path, "0s.csv"), write(tmp_path, "1s.csv", nm=NM + 0.5)
    with pytest.raises(DataError, match="wavelengths differ"):
        read_cube([one, other])
    with pytest.raises(UsageError, match="is no file"):
        read_cube([one, one], time_from="nowhere.csv")
    table = tmp_path / "t.csv"
    table.write_text("file,time (s)\n0s.csv,0\n")
    with pytest.raises(DataError, match="no time of 1s"):
        read_cube([one, other], time_from=str(table))
    table.write_text("file,when\n0s.csv,0\n")
    with pytest.raises(DataError, match="line 1 must name"):
        read_cube([one, other], time_from=str(table))
    table.write_text("file,time (s)\n0s.csv,5\n1s.csv,5\n")
    with pytest.raises(DataError, match="has the time of"):
        read_cube([one, write(tmp_path, "1s.csv")], time_from=str(table))
