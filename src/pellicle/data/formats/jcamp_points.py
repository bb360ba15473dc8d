"""Points of a JCAMP-DX table: abscissae and ordinates, checked against the records above it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pellicle.data.formats.jcamp_values import Point, ordinates, plain_numbers
from pellicle.data.tabular.text import Line
from pellicle.errors import DataError

MOST_POINTS = 10_000_000
"""Largest NPOINTS that is accepted; instruments write some 10⁴."""


@dataclass(frozen=True)
class Table:
    """A table: its form, as `(X++(Y..Y))`, the line that declares it, and its rows without comments."""

    form: str
    line: Line
    rows: list[tuple[Line, str]] = field(default_factory=list)


@dataclass(frozen=True)
class Scales:
    """Abscissa and factors of a table: None where the block does not state them."""

    first: float | None
    last: float | None
    step: float | None
    points: int | None
    x_factor: float
    y_factor: float
    decimal: str


def points_of(table: Table, scales: Scales, path: str) -> tuple[Sequence[float], Sequence[Point]]:
    """Abscissae and ordinates of a table. Raises DataError where they contradict the records."""
    form = re.sub(r"\s", "", table.form).upper()
    if form.startswith("(XY..XY)"):
        x, y = _pairs(table, scales, path)
    elif re.match(r"\(\w\+\+\(\w\.\.\w\)\)", form):
        x, y = _even(table, scales, path)
    else:
        raise DataError(
            f"{path}: line {table.line.number}: a table {table.form!r} is not read, only (X++(Y..Y)) and "
            "(XY..XY); export it as CSV"
        )
    return x, [(value * scales.y_factor, line) for value, line in y]


def _pairs(table: Table, scales: Scales, path: str) -> tuple[list[float], list[Point]]:
    x: list[float] = []
    y: list[Point] = []
    for line, text in table.rows:
        numbers = plain_numbers(line, text, scales.decimal, path)
        if len(numbers) % 2:
            raise DataError(
                f"{path}: line {line.number} has {len(numbers)} numbers where pairs of x and y are expected; "
                "correct that line"
            )
        x += [value * scales.x_factor for value in numbers[::2]]
        y += [(value, line) for value in numbers[1::2]]
    _check_number(len(y), scales, table, path)
    step = abs(x[-1] - x[0]) / max(len(x) - 1, 1) if x else 0.0
    ends = ((scales.first, x[0], "FIRSTX"), (scales.last, x[-1], "LASTX")) if x else ()
    for stated, found, label in ends:
        if stated is not None and abs(stated - found) > step + 1e-3 * abs(found):
            raise DataError(
                f"{path}: {label} is {stated:g}, but the table has {found:g} there; check its decimal "
                "marks, or export it as CSV"
            )
    return x, y


def _even(table: Table, scales: Scales, path: str) -> tuple[Sequence[float], list[Point]]:
    most = scales.points or MOST_POINTS
    y, starts = ordinates(table.rows, most, scales.decimal, path)
    _check_number(len(y), scales, table, path)
    if not y:
        return [], []
    first, last = scales.first, scales.last
    if first is None or (last is None and scales.step is None):
        raise DataError(
            f"{path}: line {table.line.number}: the table needs FIRSTX and LASTX above it, which give its "
            "axis; export it as CSV"
        )
    if last is None:
        last = first + (scales.step or 0.0) * (len(y) - 1)
    step = (last - first) / max(len(y) - 1, 1)
    if scales.step is not None and abs(abs(scales.step) - abs(step)) > 0.01 * abs(step):
        raise DataError(
            f"{path}: DELTAX is {scales.step:g}, but {len(y)} points from FIRSTX {first:g} to LASTX "
            f"{last:g} are {step:g} apart; export it again"
        )
    _check_starts(table, starts, (first, step), scales.x_factor, path)
    return np.linspace(first, last, len(y)).tolist(), y


def _check_starts(
    table: Table, starts: Sequence[tuple[float, int]], axis: tuple[float, float], factor: float, path: str
) -> None:
    """Refuse a line whose abscissa is not where FIRSTX, LASTX and NPOINTS put it."""
    first, step = axis
    for (line, _), (abscissa, at) in zip(table.rows, starts, strict=True):
        expected = first + step * at
        room = 0.3 * abs(step) + abs(factor) + 1e-6 * abs(expected)
        # some programs write the abscissae of a table without the factor
        if min(abs(abscissa * factor - expected), abs(abscissa - expected)) > room:
            raise DataError(
                f"{path}: line {line.number} begins at {abscissa * factor:g}, where FIRSTX, LASTX and "
                f"NPOINTS put {expected:g}; points are missing or the records are wrong, so export it again"
            )


def _check_number(found: int, scales: Scales, table: Table, path: str) -> None:
    if scales.points is not None and found != scales.points:
        raise DataError(
            f"{path}: the table from line {table.line.number} has {found} points where NPOINTS states "
            f"{scales.points}; the file is cut short or damaged, so export it again"
        )
