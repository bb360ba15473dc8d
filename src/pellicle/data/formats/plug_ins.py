"""Readers of other packages: entry points of the group `pellicle.readers`.

Each entry point is an object with `detect(content: bytes) -> bool` and `read(content: bytes)`, which returns
`{spectrum: {column: numbers}}`: columns are named as in the header of a CSV file, `wavelength (nm)` and
`R (%)`, and the spectrum of a file with one may be "". Their units, axes and values are then checked as those
of any file.
"""

from collections.abc import Mapping
from functools import cache
from importlib.metadata import entry_points
from typing import Any

import numpy as np

from pellicle.data.tabular.table import Table, array_columns
from pellicle.errors import DataError

GROUP = "pellicle.readers"


@cache
def plug_ins() -> tuple[tuple[str, Any], ...]:
    """Load the readers of other packages, with their names. Raises DataError for one that fails to load."""
    loaded = []
    for point in entry_points(group=GROUP):
        try:
            reader = point.load()
            loaded.append((point.name, reader() if isinstance(reader, type) else reader))
        except Exception as error:
            raise DataError(
                f"cannot be read while the reader {point.name!r} ({point.value}) of another package fails to "
                f"load ({error}); repair or uninstall that package"
            ) from None
    return tuple(loaded)


def read(content: bytes) -> list[Table] | None:
    """Return the tables of the first reader that detects the file, None without one.

    Raises DataError where that reader fails, or returns what is no columns of numbers of one length.
    """
    for name, reader in plug_ins():
        failed = f"the reader {name!r} of another package fails"
        try:
            spectra = reader.read(content) if reader.detect(content) else None
        except Exception as error:
            raise DataError(f"{failed} on it ({error or type(error).__name__}); export it as CSV") from None
        if spectra is None:
            continue
        try:
            tables = [_table(name, spectrum, columns) for spectrum, columns in spectra.items()]
        except (TypeError, ValueError, AttributeError) as error:
            raise DataError(f"{failed}: it must return {{spectrum: {{column: numbers}}}} ({error})") from None
        if not tables:
            raise DataError(f"{failed}: it finds no spectrum; export it as CSV")
        return tables
    return None


def _table(reader: str, spectrum: str, columns: Mapping[str, Any]) -> Table:
    """The table of a spectrum. Raises ValueError for columns of several lengths, or none."""
    arrays = [np.asarray(column, dtype=np.float64) for column in columns.values()]
    if not arrays or arrays[0].size == 0 or any(x.ndim != 1 or x.shape != arrays[0].shape for x in arrays):
        raise ValueError(f"shapes {[x.shape for x in arrays]} of {spectrum!r}")
    facts = [("format", reader)]
    return array_columns(list(columns), arrays, [f"read by {reader}"], name=str(spectrum), facts=facts)
