"""Numbers of text files as pandas reads them."""

from io import StringIO
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pellicle.data.formats.detect import read_tables
from pellicle.data.read_spectrum import read_spectrum
from pellicle.data.tabular.layout import read_table
from pellicle.errors import DataError

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


def test_a_first_row_that_is_faulty_is_not_text_below_the_rows(write):
    path = write("SE # BETA\n\nAOI 71.5\nSE 241.5 +0.5 0.43\nSE 240.5 0 -.5\n", "faulty.dat")
    with pytest.raises(DataError, match=r"line 4, column 1: expected a number.*'SE'"):
        read_spectrum(path, signal="R")
