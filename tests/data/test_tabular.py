"""Tables: units, what a column's name says, numbers as pandas reads them."""

from io import StringIO
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pellicle.data.formats.detect import read_tables
from pellicle.data.tabular.columns import is_header, recognise
from pellicle.data.tabular.layout import read_table
from pellicle.data.tabular.units import HC_EV_NM, to_nm, wavelength_unit
from pellicle.errors import DataError


def test_product_of_the_constants():
    # CODATA 2018: hc = 1.239841984... eV µm, exact
    assert pytest.approx(1239.8419843320026, rel=1e-15) == HC_EV_NM


@pytest.mark.parametrize("unit", ["nm", "um", "A", "eV", "cm-1"])
def test_one_wavelength_in_every_unit(unit):
    value = {"nm": 500.0, "um": 0.5, "A": 5000.0, "eV": HC_EV_NM / 500, "cm-1": 20000.0}[unit]
    assert to_nm(np.array([value]), unit)[0] == pytest.approx(500, rel=1e-15)


def test_an_unknown_unit_is_none_as_text_and_an_error_as_a_unit():
    assert wavelength_unit("furlong") is None
    with pytest.raises(ValueError, match="expected one of nm, um, A, eV, cm-1, THz, got 'furlong'"):
        to_nm(np.ones(1), "furlong")


ROLES = {
    ("wavelength", "nm"): ("wavelength (nm)", "wavelength_nm", "lambda / nm", "λ (nm)", "nm"),
    ("wavelength", "um"): ("Wavelength [um]", "Wavelength [µm]"),
    ("wavelength", "A"): ("Wavelength (Å)",),
    ("wavelength", None): ("WAVELENGTH", "lambda", "wl"),
    ("wavelength", "eV"): ("energy", "energy (eV)", "photon energy (eV)"),
    ("wavelength", "cm-1"): ("wavenumber (1/cm)", "wavenumber_cm-1", "Wavenumber [cm⁻¹]"),
    ("R", None): ("R", "r"),
    ("R", "percent"): ("R (%)", "%R", "R%", "% Reflectance", "R_percent", "Reflectance (%)"),
    ("R", "fraction"): ("R_fraction", "Reflectance [-]"),
    ("T", None): ("T", "T (Abs)"),
    ("T", "percent"): ("%T", "Transmittance / %"),
    ("intensity", None): ("intensity", "Intensity (a.u.)"),
    ("sigma", None): ("sigma",),
    ("sigma", "percent"): ("sigma (%)",),
    ("angle", "deg"): ("angle_deg", "angle", "AOI (°)", "aoi_deg"),
    ("psi", "deg"): ("psi_deg",),
    ("delta", None): ("delta",),
    ("other", None): ("R_sigma_as_stated", "Rubbish", "temperature", ""),
    ("T", "absorbance"): ("A", "Abs", "Absorbance (AU)"),
    ("R", "absorbance"): ("log(1/R)",),
    ("wavelength", "THz"): ("frequency (THz)",),
}
"""Names of columns by the role and the unit that they state."""


@pytest.mark.parametrize(("role", "unit"), ROLES)
def test_role_and_unit_of_a_name(role, unit):
    for name in ROLES[role, unit]:
        column = recognise(name)
        assert (column.role, column.unit) == (role, unit), name


@pytest.mark.parametrize("name", ["Rs", "Rp (%)", "T_s", "tp", "R", "Reflectance_s"])
def test_polarisation_of_a_name(name):
    column, letters = recognise(name), name.removesuffix(" (%)")
    polarisation = letters[-1] if len(letters) > 1 else None
    assert (column.role, column.polarisation) == (name[0].upper(), polarisation)


def test_a_unit_in_brackets_that_is_not_known_is_kept_for_the_message():
    assert recognise("wavelength (pm)").unknown_unit == "pm"
    assert recognise("R (dB)").unknown_unit == "db"


@pytest.mark.parametrize("names", [["Integration time", "1 ms"], ["energy", "range"], ["380", "0.4"], []])
def test_free_text_is_no_header(names):
    assert not is_header(names)


ROOT = Path(__file__).resolve().parents[2]
FILES = [*(ROOT / "measurements").rglob("*nm*.csv"), *(ROOT / "measurements").rglob("*.txt")]


def by_pandas(table):
    """Every column."""
    cells = table.cells
    text = StringIO("\n".join(line.bare for line in cells.rows))
    marks = {"sep": r"\s+" if cells.delimiter == " " else cells.delimiter, "decimal": cells.decimal}
    plain = {"header": None, "index_col": False, "skipinitialspace": True}
    frame = pd.read_csv(text, names=list(range(cells.raw_width)), **marks, **plain)
    return [frame[i].to_numpy() for i in range(table.width)]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_measurements(path):
    [table] = read_tables(path)
    expected = by_pandas(table)
    plain = [i for i, x in enumerate(expected) if x.dtype.kind in "fiu" and np.isfinite(x).all()]
    assert plain
    for own, other in zip(table.numbers(plain), [expected[i] for i in plain], strict=True):
        np.testing.assert_array_equal(own, other)


number = st.floats(-1e9, 1e9, allow_nan=False).map(lambda x: f"{x:.9g}") | st.integers(-99, 9999).map(str)


@given(
    rows=st.lists(st.tuples(number, number, number), min_size=2, max_size=6),
    delimiter=st.sampled_from([",", ";", "\t", " ", ", ", ";  "]),
    comma=st.booleans(),
    quoted=st.booleans(),
    closed=st.booleans(),
)
def test_delimiters_decimals_and_quotes(tmp_path_factory, rows, delimiter, comma, quoted, closed):
    mark = delimiter.strip() or delimiter
    comma = comma and mark != ","
    quoted = quoted and mark != " "
    rows = [[cell.replace(".", ",") if comma else cell for cell in row] for row in rows]
    end = mark if closed and mark != " " else ""
    lines = [delimiter.join(f'"{cell}"' if quoted else cell for cell in row) + end for row in rows]
    path = tmp_path_factory.mktemp("table") / "rows.csv"
    path.write_text("\n".join(lines))
    table = read_table(path)
    for own, other in zip(table.numbers([0, 1, 2]), by_pandas(table), strict=False):
        np.testing.assert_array_equal(own, other)


def test_a_first_row_that_is_faulty_is_not_text_below_the_rows(write, refused):
    path = write("SE # BETA\n\nAOI 71.5\nSE 241.5 +0.5 0.43\nSE 240.5 0 -.5\n", "faulty.dat")
    refused(path, "line 4, column 1: expected a number", "'SE'", error=DataError, signal="R")
