"""Large files are read as a block, with the numbers, lines and messages of the reader of lines."""

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum
from pellicle.data.tabular import layout as bulk
from pellicle.errors import DataError
from tests.data.tables import assert_read

NM = np.round(np.linspace(200, 2000, 500), 3)
VALUES = np.round(0.3 + 0.1 * np.sin(NM / 10), 5)


@pytest.fixture
def large(monkeypatch):
    """Counts any file as large; returns a function that says whether the last file was read as a block."""
    monkeypatch.setattr(bulk, "SMALLEST", 1)
    found = []
    real = bulk._parsed

    def parsed(*arguments):
        found.append(real(*arguments))
        return found[-1]

    monkeypatch.setattr(bulk, "_parsed", parsed)
    return lambda: bool(found)


def text(delimiter=",", decimal=".", end="\n", header="wavelength_nm{}R", extra=""):
    rows = [f"{a}{delimiter}{b}".replace(".", decimal) for a, b in zip(NM, VALUES, strict=True)]
    return end.join([*([header.format(delimiter)] if header else []), *rows, extra])


@pytest.mark.parametrize("with_pandas", [True, False])
@pytest.mark.parametrize(
    ("delimiter", "decimal", "end"),
    [(",", ".", "\n"), (";", ",", "\r\n"), ("\t", ".", "\r\n"), ("  ", ".", "\n"), (", ", ".", "\n")],
)
def test_as_the_reader_of_lines(write, monkeypatch, large, with_pandas, delimiter, decimal, end):
    if with_pandas:
        pytest.importorskip("pandas")
    else:
        monkeypatch.delitem(bulk.sys.modules, "pandas", raising=False)
    path = write(text(delimiter, decimal, end))
    spectrum = read_spectrum(path)
    assert large()
    assert_read(spectrum, wavelength=NM, values=VALUES, lines=np.arange(2, 502))
    monkeypatch.setattr(bulk, "SMALLEST", np.inf)
    assert read_spectrum(path).notes == spectrum.notes


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (f"\n{NM[300]},", "\n,", "line 302, column 'wavelength_nm' is empty"),
        (f"\n{NM[300]},", f"\n{NM[300]},x", "line 302, column 'R': expected a number but found 'x"),
        (f"\n{NM[300]},", f"\n{NM[300]},1,", "line 302 has 3 values where 2 are expected"),
        (f"\n{NM[300]},", "\n1e999,", "line 302, column 'wavelength_nm': 1e999 is not a finite number"),
        (f"\n{NM[300]},", f"\n\n{NM[299]},", "line 303, column 'wavelength_nm': .* repeats .* of line 301"),
    ],
)
def test_an_error_far_down_is_named(write, large, old, new, said, refuses):
    path = write(text().replace(old, new, 1))
    refuses(DataError, said, read_spectrum, path)


def test_a_trailer_and_comments_are_left_to_the_reader_of_lines(write, large):
    spectrum = read_spectrum(write(text(extra=">>>>>End Spectral Data<<<<<")))
    assert len(spectrum) == 500
    assert not large()
