"""Optical constants of a material file: lines and rows of its text, checks, and n + ik against nm."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pellicle.data.tabular.table import Table, plain_columns
from pellicle.data.tabular.text import Line, content_lines, is_number, open_binary, text_of
from pellicle.data.tabular.units import to_nm
from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.empirical import Table as InterpolatedTable
from pellicle.dispersion.empirical import WithExtinction
from pellicle.errors import DataError

LARGEST_FILE = 64 * 2**20
"""Largest material file, in bytes: a million rows."""
LONGEST_NM = 1e11
LARGEST = 1e10
"""Bounds of wavelengths and of n, k, ε₁ and ε₂, beyond all data: refractiveindex.info has water up to 10 m,
and metals in the far infrared have |ε| of 1e6."""

NOISE_IN_K = 1e-4
"""A k between this much below zero and zero is noise about zero."""


class MaterialFile(NamedTuple):
    """A dispersion from a source, its range (nm) and whether the source has k, and what was understood of it.

    `format` is the kind of file, `columns` the columns and unit as they were read, `assumed` a sentence on
    what the file does not state, `title`, `citation` and `comments` what it says of the material.
    """

    dispersion: AbstractDispersion
    wavelength_range: tuple[float, float]
    has_extinction: bool
    format: str = ""
    columns: str = ""
    assumed: str = ""
    title: str = ""
    citation: str = ""
    comments: str = ""


def table(nm: Any, n: Any, k: Any = None) -> MaterialFile:
    """Make a published table fit for linear interpolation.

    Points are sorted, those at the same wavelength averaged. A k slightly below zero is set to zero;
    rows where it is truly negative (Querry's far infrared, where his inversion fails) are left out.
    A k that is zero throughout makes a table that cannot absorb.
    """
    nm, columns = np.asarray(nm, dtype=float), [np.asarray(n, dtype=float)]
    if k is not None:
        columns.append(np.asarray(k, dtype=float))
        keep = columns[1] >= -NOISE_IN_K
        nm, columns = nm[keep], [column[keep] for column in columns]
        columns[1] = np.maximum(columns[1], 0.0)
    distinct, where, count = np.unique(nm, return_inverse=True, return_counts=True)
    columns = [np.bincount(where, column) / count for column in columns]
    if len(columns) == 2 and not columns[1].any():
        columns.pop()
    for array in (distinct, *columns):
        array.flags.writeable = False
    known = float(distinct[0]), float(distinct[-1])
    return MaterialFile(InterpolatedTable(distinct, *columns), known, k is not None)


def combine(n: MaterialFile, nm: Any, k: Any) -> MaterialFile:
    """Return n from one source and the table of k from another, where both are known."""
    extinction = table(nm, np.zeros(len(nm)), k)
    (first, last), (lowest, highest) = n.wavelength_range, extinction.wavelength_range
    low, high = max(first, lowest), min(last, highest)
    if low >= high:
        raise DataError(
            f"n is known from {first:g} to {last:g} nm and k from {lowest:g} to {highest:g} nm, "
            "which do not overlap: choose another page"
        )
    absorbs = isinstance(extinction.dispersion, InterpolatedTable) and extinction.dispersion.k is not None
    both = WithExtinction(n.dispersion, extinction.dispersion) if absorbs else n.dispersion
    return MaterialFile(both, (low, high), True)


_ROW = "correct or delete that row"


@dataclass(frozen=True)
class MaterialText:
    """Text of a material file, and its lines up to any `#`, without blank ones."""

    path: str
    text: str
    lines: tuple[Line, ...]

    @property
    def suffix(self) -> str:
        """Suffix of the file in lower case, as `.mat`."""
        return Path(self.path).suffix.lower()


def read_text(path: str | Path) -> MaterialText:
    """Read a text file: UTF-8, UTF-16 or Latin-1.

    Raises DataError for a file that is missing, empty, too large or not a text.
    """
    with open_binary(path) as file:
        content = file.read(LARGEST_FILE + 1)
    if len(content) > LARGEST_FILE:
        raise DataError(
            f"{path}: is larger than {LARGEST_FILE >> 20} MB, which is no table of optical constants"
        )
    text = text_of(content, path)
    bare = ((line.number, line.bare.strip()) for line in content_lines(text)[0])
    return MaterialText(str(path), text, tuple(Line(number, line, line) for number, line in bare if line))


def cells(text: str) -> list[str]:
    """Split a row at blanks, tabs and semicolons, else at commas; a decimal comma becomes a point."""
    separated = re.split(r"[\s;]+", text.strip().strip(";").strip())
    if len(separated) == 1:
        return [cell.strip() for cell in text.rstrip(",").split(",")]
    return [cell.removesuffix(",").replace(",", ".") for cell in separated]


def is_row(text: str) -> bool:
    """Return True for a line of two or more numbers and nothing else."""
    numbers = cells(text)
    return len(numbers) >= 2 and all(map(is_number, numbers))


def read_rows(lines: Sequence[Line], names: Sequence[str], optional: int = 0) -> Table:
    """Return a table of lines with the columns `names`, of which all rows may lack the last `optional`.

    Raises DataError for no rows, and for a row of another length.
    """
    if not lines:
        raise DataError(f"ends without a row of {', '.join(names)}; export it again")
    rows = [(line, cells(line.text)) for line in lines]
    width = len(rows[0][1])
    if not len(names) - optional <= width <= len(names):
        raise DataError(
            f"line {lines[0].number} has {width} values where {', '.join(names)} are expected; "
            "correct that line"
        )
    for line, row in rows:
        if len(row) != width:
            raise DataError(
                f"line {line.number} has {len(row)} value{'s' * (len(row) != 1)} where {width} are "
                "expected; correct or delete that line"
            )
    return plain_columns(names[:width], rows, [])


class OpticalConstants(NamedTuple):
    """Columns of a file: the axis in `unit`, then n and k or, where `dielectric`, eps1 and eps2.

    `names` are those of the three columns in messages, `where` gives line and column of a number by
    row and name. `second` is None for a table of n alone.
    """

    axis: np.ndarray
    unit: str
    first: np.ndarray
    second: np.ndarray | None
    dielectric: bool
    names: tuple[str, str, str]
    where: Callable[[int, str], str]


def constants_of(
    rows: Table, unit: str, dielectric: bool = False, axis: np.ndarray | None = None
) -> OpticalConstants:
    """Return the columns of rows of axis, n and k, or eps1 and eps2; of n and k with their `axis` (rows,).

    Raises DataError for a cell that is no finite number.
    """
    values = rows.numbers(range(rows.width))
    first, second = ("eps1", "eps2") if dielectric else ("n", "k")
    named = "axis" if axis is not None else rows.names[0] if rows.names else "wavelength"
    values = values if axis is None else [axis, *values]
    return OpticalConstants(
        values[0],
        unit,
        values[1],
        values[2] if len(values) > 2 else None,
        dielectric,
        (named, first, second),
        lambda row, name: f"{rows.place(row)}, column {name!r}",
    )


def nk_from_dielectric(eps1: np.ndarray, eps2: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return n and k (N,) of eps1 + i·eps2 (N,), the square of n + ik; to rounding also where eps2 is small.

    2n² = |ε| + ε₁ and 2k² = |ε| − ε₁ cancel for small ε₂, one on either side of ε₁ = 0; the other of the two
    follows from ε₂ = 2nk.
    """
    larger = np.sqrt((np.hypot(eps1, eps2) + np.abs(eps1)) / 2)
    smaller = np.divide(eps2, 2 * larger, out=np.zeros_like(larger), where=larger > 0)
    return np.where(eps1 >= 0, larger, smaller), np.where(eps1 >= 0, smaller, larger)


def material_file(constants: OpticalConstants, kind: str, title: str = "", assumed: str = "") -> MaterialFile:
    """Check the columns of a file and make a dispersion of them.

    Raises DataError, one sentence with file, line, column and remedy.
    """
    axis, first, second = constants.names

    def refuse(name: str, values: np.ndarray, wrong: np.ndarray, expected: str, remedy: str = _ROW) -> None:
        if wrong.any():
            row = int(np.argmax(wrong))
            raise DataError(
                f"{constants.where(row, name)}: expected {name} {expected}, found {values[row]:g}; {remedy}"
            )

    refuse(axis, constants.axis, constants.axis <= 0, "above 0")
    steps = np.diff(constants.axis)
    if not steps.size:
        raise DataError("expected at least two rows, found one; add the others")
    wrong = steps * np.sign(steps[0]) <= 0
    if wrong.any():
        row = int(np.argmax(wrong)) + 1
        raise DataError(
            f"{constants.where(row, constants.names[0])}: expected wavelengths that only rise or only fall, "
            f"found {constants.axis[row]:g} after {constants.axis[row - 1]:g}; sort the rows and delete "
            "repeated ones"
        )
    with np.errstate(over="ignore"):
        nm = np.round(to_nm(constants.axis, constants.unit), 9)
    refuse(axis, constants.axis, ~((nm > 0) & (nm < LONGEST_NM)), "of a wavelength of light")
    n, k = constants.first, constants.second
    for name, values in ((first, n), (second, k)):
        if values is not None:
            refuse(name, values, np.abs(values) > LARGEST, f"up to {LARGEST:g}")
    if k is not None:
        sign = "absorption is n + ik with k ≥ 0 here, so turn its sign"
        refuse(second, k, k < -NOISE_IN_K, "0 or above", sign)
    if constants.dielectric:
        assert k is not None
        n, k = nk_from_dielectric(n, np.maximum(k, 0.0))
        refuse(first, constants.first, n <= 0, "of an index n above 0")
    else:
        refuse(first, n, n <= 0, "above 0")
    columns = f"{axis} in {constants.unit}, {first}{f', {second}' if k is not None else ''}; {len(nm)} rows"
    return table(nm, n, k)._replace(format=kind, columns=columns, assumed=assumed, title=title)
