"""Folders of spectra with a table of their positions."""

import numpy as np
import pytest

from pellicle.data.read_cube import read_cube
from pellicle.errors import DataError, UsageError

NM = np.linspace(400.0, 800.0, 9)


@pytest.fixture
def wafer(tmp_path, values):
    """Three spectra, a table of their positions in mm; returns the folder."""
    rows = ["file,x (mm),y (mm),name"]
    for i, name in enumerate(("centre", "left", "edge")):
        lines = [f"{nm:g},{r:.6f}" for nm, r in zip(NM, values[i, 0], strict=True)]
        (tmp_path / f"site_{i}.csv").write_text("\n".join(["wavelength_nm,R", *lines]) + "\n")
        rows.append(f"site_{i}.csv,{10 * i},{-5 * i},{name}")
    (tmp_path / "positions.csv").write_text("\n".join(rows) + "\n")
    return tmp_path


@pytest.mark.parametrize("name", ["", "positions.csv"])
def test_folder_or_its_table(wafer, values, same, name):
    cube = same(wafer / name, expected=values[:3, 0].astype("f8"))
    assert cube.dims == ("site",)
    np.testing.assert_array_equal(cube.coords["x"], [0, 10, 20])
    np.testing.assert_array_equal(cube.coords["y"], [0, -5, -10])
    assert cube.coords["name"].tolist() == ["centre", "left", "edge"]
    assert cube.units == {"x": "mm", "y": "mm"}
    part = cube.coarse(2)
    assert part.coords["name"].tolist() == ["left"]


def test_units_are_assumed_with_a_note(wafer):
    table = wafer / "positions.csv"
    table.write_text(table.read_text().replace(" (mm)", ""))
    cube = read_cube(wafer)
    assert cube.units == {"x": "mm", "y": "mm"}
    assert "positions in mm, assumed" in cube.notes
    table.write_text(table.read_text().replace("x,y", "x_um,y_um"))
    assert read_cube(wafer).units == {"x": "um", "y": "um"}


def test_other_wavelengths_name_the_file(wafer, refused):
    path = wafer / "site_2.csv"
    path.write_text(path.read_text().replace("800,", "810,"))
    refused(wafer, str(path), "810 nm", "site_0.csv", error=DataError)


def test_other_quantity_names_the_file(wafer, refused):
    path = wafer / "site_1.csv"
    path.write_text(path.read_text().replace(",R", ",T"))
    refused(wafer, str(path), "has T", error=DataError)


def test_sites_whose_files_do_not_exist(wafer, values, refused):
    (wafer / "site_0.csv").unlink()
    cube = read_cube(wafer)
    assert cube.coords["name"].tolist() == ["centre", "left", "edge"]
    read = np.asarray(cube.arrays["values"])
    assert np.isnan(read[0]).all()
    np.testing.assert_allclose(read[1:], values[1:3, 0], atol=1e-6)
    assert "1 site without data, for lack of a file: site_0.csv" in cube.notes
    (wafer / "site_1.csv").unlink()
    refused(wafer, "2 of its 3 files", "site_0.csv", error=DataError)


def test_folders_that_are_no_wafer(tmp_path, refused):
    refused(tmp_path, "is an empty folder", error=DataError)
    for name in ("dark.hdr", "white.hdr"):
        (tmp_path / name).write_text("ENVI\n")
        refused(tmp_path, "ENVI", name, error=DataError)
        (tmp_path / name).unlink()
    for name in ("450nm.tif", "460nm.tif"):
        (tmp_path / name).write_bytes(b"II*")
    refused(tmp_path, "2 images", "one TIFF stack", error=DataError)


def test_bad_tables(wafer, refused):
    table = wafer / "positions.csv"
    good = table.read_text()
    table.write_text(good.replace(",10,", ",ten,"))
    refused(wafer, "line 3", "'ten'", error=DataError)
    table.write_text(good.replace("site_2.csv,20,-10,edge", "site_2.csv,20"))
    refused(wafer, "line 4", "too few", error=DataError)
    table.write_text(good.splitlines()[0] + "\n")
    refused(wafer, "no rows", error=DataError)
    table.write_text(good)
    (wafer / "copy.csv").write_text(good)
    refused(wafer, "copy.csv, positions.csv", error=UsageError)
