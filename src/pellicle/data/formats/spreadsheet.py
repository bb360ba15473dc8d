"""Sheets of Excel workbooks (`.xlsx`) as text files, read by openpyxl (extra `formats`)."""

import io
import zipfile
from collections.abc import Iterator

from pellicle.data.tabular.text import TextFile, content_lines
from pellicle.errors import DataError, decoding, needs

_LARGEST = 64 << 20
"""Bytes of unpacked XML that are read; a sheet of 100 000 numbers has about 5 MB."""
_MOST_ROWS, _MOST_COLUMNS = 1_000_000, 1000


def is_workbook(content: bytes) -> bool:
    """True for a packed workbook of Excel."""
    if not content.startswith(b"PK\x03\x04"):
        return False
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as packed:
            return "xl/workbook.xml" in packed.namelist()
    except (zipfile.BadZipFile, ValueError, OSError, NotImplementedError):
        return False


def sheets(content: bytes, path: str, sha256: str) -> Iterator[tuple[str, TextFile]]:
    """Yield the name and the rows, cells separated by tabs, of each sheet that is not empty.

    A formula has the value that the program saved. Raises DataError where openpyxl is absent, and for a
    damaged or too large workbook.
    """
    absent = "is an Excel workbook, which needs the package", "; or save its sheet as CSV"
    damaged = decoding("is an Excel workbook that cannot be read", "save its sheet as CSV")
    with needs("formats", *absent, DataError), damaged:
        import openpyxl

        with zipfile.ZipFile(io.BytesIO(content)) as packed:
            if sum(member.file_size for member in packed.infolist()) > _LARGEST:
                raise DataError("is a workbook of more than 64 MB; save its sheet as CSV")
        book = openpyxl.load_workbook(io.BytesIO(content), read_only=True, data_only=True)
        for sheet in book.worksheets:
            cells = sheet.iter_rows(values_only=True, max_row=_MOST_ROWS, max_col=_MOST_COLUMNS)
            text = "\n".join("\t".join(map(_cell, row)).rstrip("\t") for row in cells)
            lines, comments = content_lines(text)
            if lines:
                yield sheet.title, TextFile(path, sha256, lines, comments)


def _cell(value: object) -> str:
    if value is None:
        return ""
    return repr(value) if isinstance(value, int | float) else " ".join(str(value).split())
