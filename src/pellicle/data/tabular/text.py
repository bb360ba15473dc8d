"""Text files as lines and cells: decoding, comments, and the syntax of numbers."""

import csv
import hashlib
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path

from pellicle.errors import DataError, UsageError

_NUMBER = re.compile(
    r"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?|nan|inf(?:inity)?)", re.IGNORECASE | re.ASCII
)
_COMMA_NUMBER = re.compile(r"[+-]?\d+,\d+(?:e[+-]?\d+)?", re.IGNORECASE | re.ASCII)
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x19\x1b-\x1f\x7f]")  # but the end-of-file mark of DOS, 0x1a
_FILLING = re.compile(rb"(?<![\d.\0])\0+|\0+(?![\d.\0])")  # zero bytes, but between two digits
_BROKEN = re.compile(r"[\d.]\x00+[\d.]")
_SEPARATOR = re.compile(r"\"?sep=\S?\"?\s*", re.IGNORECASE)  # Excel's first line, which names the delimiter
_MOST_ZEROS = 0.1  # share of zero bytes in a text
_HEAD = 4096  # bytes that tell the kind of a file


@dataclass(frozen=True)
class Line:
    """A line that is not blank: its number from 1, its text, and the text before any `#`."""

    number: int
    text: str
    bare: str


@dataclass(frozen=True, eq=False)
class TextFile:
    """A text file: its lines that are not blank, and its comments (without their `#`), in file order."""

    path: str
    sha256: str
    lines: Sequence[Line]
    comments: Sequence[Line] = ()

    @property
    def all_lines(self) -> list[Line]:
        """Lines and comments together, for formats in which `#` does not begin a comment."""
        return sorted((*self.lines, *self.comments), key=lambda line: line.number)


@contextmanager
def open_binary(path: str | os.PathLike[str]) -> Iterator[BufferedReader]:
    """Open a file for reading bytes. Raises DataError for a missing or unreadable file, or a folder."""
    try:
        with Path(path).open("rb") as file:
            yield file
    except FileNotFoundError:
        raise DataError(f"{path}: no such file; check the name and the folder") from None
    except IsADirectoryError:
        raise DataError(f"{path}: is a folder, not a file; name the file in it") from None
    except OSError as error:
        raise DataError(
            f"{path}: cannot be read ({error.strerror}); check its name and permissions"
        ) from None


@contextmanager
def in_file(path: str | os.PathLike[str]) -> Iterator[None]:
    """Put the path of a file in front of errors about its content, unless they begin with it."""
    try:
        yield
    except (DataError, UsageError) as error:
        text, named = str(error), f"{path}: "
        raise type(error)(text if text.startswith(named) else named + text) from None


def read_bytes(path: str | os.PathLike[str]) -> tuple[bytes, str]:
    """Return the content of a file and its SHA-256. Raises DataError as `open_binary` does."""
    with open_binary(path) as file:
        content = file.read()
    return content, hashlib.sha256(content).hexdigest()


def text_file(content: bytes, sha256: str, path: str | os.PathLike[str]) -> TextFile:
    """Split the content of a text file into lines.

    Raises DataError for an empty file and for one that is not a table.
    """
    lines, comments = content_lines(text_of(content, path))
    if not lines:
        raise DataError(f"{path}: has only comments; expected rows of numbers")
    return TextFile(str(path), sha256, lines, comments)


def text_of(content: bytes, path: str | os.PathLike[str]) -> str:
    """Decode the content of a text file, whose lines then end in `\\n`.

    Raises DataError for an empty file, for a binary one, and for a text of another kind than a table.
    """
    if advice := foreign_format(content):
        raise DataError(f"{path}: is {advice}")
    text = decoded(content).replace("\r\n", "\n").replace("\r", "\n").rstrip("\x1a")
    if (broken := _BROKEN.search(text)) and not _CONTROL.search(text.replace("\0", "")):
        line = text.count("\n", 0, broken.start()) + 1
        raise DataError(
            f"{path}: line {line}: a zero byte within a number; the file is damaged, export it again"
        )
    if _CONTROL.search(text):
        raise DataError(f"{path}: is a binary file of an unknown format; export it as text (CSV) first")
    if not text.strip():
        raise DataError(f"{path}: is empty; expected rows of numbers")
    return text


def decoded(content: bytes) -> str:
    """Decode UTF-8, UTF-16 (by its mark or its zeros), or Latin-1 as older instruments write.

    Single zeros in a text, with which some programs fill fields of fixed length, are left out, but within a
    number. The text of a binary file keeps control characters.
    """
    marked = content.startswith((b"\xff\xfe", b"\xfe\xff"))
    head = content[: min(_HEAD, len(content) & ~1)]
    zeros = [head[start::2].count(0) for start in (0, 1)]
    encoding = "utf-16" if marked else "utf-16-be" if zeros[0] > zeros[1] else "utf-16-le"
    if marked or (max(zeros) > 0.4 * len(head) and min(zeros) < 0.01 * len(head)):
        try:
            return content.decode(encoding)
        except UnicodeDecodeError:
            return content.decode("latin-1")
    if content.count(0) < _MOST_ZEROS * len(content):
        content = _FILLING.sub(b"", content)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def content_lines(text: str) -> tuple[list[Line], list[Line]]:
    """Return the lines that are not blank, and the comments (without their `#`), both in file order."""
    lines, comments = [], []
    for number, raw in enumerate(text.split("\n"), start=1):
        plain = raw.strip(" ")
        if plain.startswith("#"):
            comments.append(Line(number, plain.lstrip("# "), ""))
        elif plain.strip() and not (number == 1 and _SEPARATOR.fullmatch(plain)):
            lines.append(Line(number, plain, plain.partition("#")[0].rstrip(" ")))
    return lines, comments


def is_number(text: str, decimal: str = ".") -> bool:
    """Return True if all of `text` is a number, NaN and infinity included."""
    return bool(_NUMBER.fullmatch(text) or (decimal == "," and _COMMA_NUMBER.fullmatch(text)))


def split(text: str, delimiter: str) -> list[str]:
    """Split a line into cells, without blanks and quotes around them or empty cells at the end."""
    if '"' in text:
        cells = next(csv.reader([text], delimiter=delimiter, skipinitialspace=True))
    else:
        cells = text.split(None if delimiter == " " else delimiter)
    cells = [cell.strip() for cell in cells]
    while cells and not cells[-1]:
        cells.pop()
    return cells


_FOREIGN = {
    rb"\x89PNG|\xff\xd8\xff|II\*\x00|MM\x00\*": "an image; give the numbers behind it, as a CSV",
    rb"....ftyp(hei|hev|mif1|msf1|avi[fs])": "an image in HEIC or AVIF; save it as PNG or TIFF",
    rb"....ftypcrx|FUJIFILMCCD|II(RO|RS|U\0)": "a camera's raw file; develop it, and save it as TIFF",
    rb"GIF8|RIFF....WEBP|BM....\0\0\0\0|\0\0\0\x0cjP": "an image of another kind; save it as PNG or TIFF",
    rb"%PDF": "a PDF; give the numbers in it as a CSV",
    rb"\xd0\xcf\x11\xe0|PK\x03\x04.*(\[Content_Types|spreadsheet)": "an office file; save its sheet as CSV",
    rb"PK\x03\x04|\x1f\x8b|BZh|7z\xbc\xaf|Rar!": "packed; unpack it and give the file inside",
    rb"MATLAB ": "a MATLAB file; save its table as text with a header such as wavelength_nm,n,k",
    rb"AVS8\d": "a binary file of Avantes AvaSoft 8; export it as text in AvaSoft",
    rb"Spectral Data File": "a binary file of Thermo OMNIC; save it as JCAMP-DX or CSV in OMNIC",
    rb"tensor_file\0": "a tensor file of a BRDF; fit it with a `recipe` of the surface",
    rb"\{\\rtf": "a word processor's file; save it as plain text",
    rb"\s*<(!doctype|html|\?xml|svg)": "a web page or XML; export the spectrum as a CSV",
    rb"\s*(\{|\[\s*[\{\[\"])": "JSON; give a CSV with columns as wavelength_nm,R",
    rb"(?=.*\[\[?scene[.\]])(\s*#[^\n]*\n|\s)*\[": "a recipe; give it as `recipe` (Python: pl.read_recipe)",
}
"""First bytes of files of other formats (narrower patterns first), and advice for each."""


def foreign_format(content: bytes) -> str | None:
    """Return what a file is in place of a table of numbers, with advice; None if it may be a table."""
    head = content[:_HEAD]
    flags = re.DOTALL | re.IGNORECASE
    return next((advice for pattern, advice in _FOREIGN.items() if re.match(pattern, head, flags)), None)
