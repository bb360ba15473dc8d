"""Reading of normalised Mueller elements from a table: their columns, normalisation and checks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pellicle.data.repeated_sweeps import of_rows, sweep_numbers
from pellicle.data.spectrum import Spectrum, inside_range
from pellicle.data.tabular.axis_and_signal import axis_note, axis_unit, read_axis
from pellicle.data.tabular.column_names import MUELLER
from pellicle.data.tabular.column_selection import AxisColumns, axis_columns, only
from pellicle.data.tabular.columns import Column, listed
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError
from pellicle.signals.limits import refuse_first
from pellicle.signals.mueller import ELEMENTS, HIGHEST, Mueller, check_element, sign_notes

_REMEDY = "correct or delete that row"
_EXAMPLE = '`columns=["wavelength", "angle", "m12", "m33", "m34"]`'
_NORMALISED = 1e-3
"""Deviation of m11 from 1 by rounding."""


@dataclass(frozen=True)
class MuellerColumns:
    """Columns of elements, of m11 (or None), and of standard deviations (one for each element, one for all,
    or none), and sentences on the choice."""

    axis: AxisColumns
    values: tuple[Column, ...]
    m11: Column | None
    errors: tuple[Column, ...]
    notes: tuple[str, ...]

    @property
    def elements(self) -> tuple[str, ...]:
        return tuple(column.role for column in self.values)


def has_mueller(columns: Sequence[Column] | None) -> bool:
    """Return True if elements of a Mueller matrix are among the columns."""
    return any(column.role in ELEMENTS for column in columns or ())


def mueller_columns(
    table: Table, columns: Sequence[Column] | None, elements: Sequence[str] | None = None
) -> MuellerColumns:
    """Choose the columns of elements, all or those named. Raises DataError or UsageError."""
    if columns is None:
        raise UsageError(
            f"{table.path}: has {table.layout.width} columns and no header; name them in order, as in "
            f"{_EXAMPLE}"
        )
    present = {role: only(table, columns, role) for role in MUELLER}
    if elements is not None:
        Mueller(tuple(elements))
        if absent := [name for name in elements if present[name] is None]:
            have = ", ".join(name for name in ELEMENTS if present[name]) or "no elements"
            raise UsageError(f"{table.path}: has no column {', '.join(absent)}; it has {have}")
    wanted = ELEMENTS if elements is None else [name for name in ELEMENTS if name in elements]
    values = tuple(column for name in wanted if (column := present[name]) is not None)
    if not values:
        raise DataError(
            f"{table.path}: no element of a Mueller matrix (m12 to m44) is among {listed(columns)}; name the "
            f"columns in order, as in {_EXAMPLE}"
        )
    for column in values:
        if column.unknown_unit or column.unit:
            raise DataError(
                f"{table.path}: {table.label(column.position)} is in "
                f"{column.unknown_unit or column.unit!r}; write elements as fractions of m11, without a unit"
            )
    axis = axis_columns(table, columns, _EXAMPLE)
    errors, notes = _error_columns(table, columns, values)
    m11 = present["m11"]
    read = [*values, *errors, *(column for column in (*axis, m11) if column)]
    ignored = [c for c in columns if c not in read and c.name not in ("_", "")]
    said = [
        f"{listed([axis.wavelength])} read as the wavelength, {listed(values)} as Mueller elements",
        *notes,
    ]
    said += axis.notes
    said += [f"ignored: {listed(ignored)}"] if ignored else []
    return MuellerColumns(axis, values, m11, errors, tuple(said))


def _error_columns(
    table: Table, columns: Sequence[Column], values: Sequence[Column]
) -> tuple[tuple[Column, ...], list[str]]:
    """A standard deviation of each element, one `sigma` for all, or none, with a sentence."""
    own = [only(table, columns, f"sigma_{column.role}") for column in values]
    stated = tuple(column for column in own if column is not None)
    if stated and len(stated) < len(values):
        raise DataError(
            f"{table.path}: gives standard deviations of some of the elements only ({listed(stated)}); add"
            " the others, or skip these with _ in `columns`"
        )
    if stated:
        return stated, [f"{listed(stated)} read as their standard deviations"]
    both = only(table, columns, "sigma")
    return ((both,), [f"{listed([both])} read as the standard deviation of each"]) if both else ((), [])


def read_mueller(
    table: Table,
    chosen: MuellerColumns,
    wavelength_unit: str | None,
    noise: float | None,
    range: tuple[float, float] | None,
) -> Spectrum:
    """Read the chosen elements; other arguments as in `read_spectrum`. Raises DataError or UsageError."""
    unit = axis_unit(table, chosen.axis.wavelength, wavelength_unit)
    cells = (*chosen.values, *chosen.errors, *([chosen.m11] if chosen.m11 else []))
    axis, read = read_axis(table, chosen.axis, cells, unit)
    count = len(chosen.values)
    values, errors = np.stack(read[:count], axis=1), read[count : count + len(chosen.errors)]
    sigma = np.broadcast_to(np.stack(errors, axis=1), values.shape) if errors else None
    notes = [*table.notes, *chosen.notes, axis_note(unit)]
    if noise is not None:
        sigma = np.full(values.shape, float(noise))
        notes += ["the given noise replaces the columns of errors"] if errors else []
    rows = np.arange(len(values))
    if range is not None:
        inside, note = inside_range(axis.wavelength, range, table.path)
        rows, notes = rows[inside], [*notes, note]
    values, sigma = values[rows], None if sigma is None else sigma[rows]
    if chosen.m11 is not None:
        values, sigma, note = _normalised(table, chosen.m11, rows, read[-1][rows], values, sigma)
        notes += [note] if note else []
    elements = chosen.elements
    if sigma is not None:
        for i, column in enumerate(chosen.errors if noise is None else ()):
            reason = f"is a standard deviation not above zero; {_REMEDY}"
            refuse_first(sigma[:, i], sigma[:, i] <= 0, table.places(column.position, rows), reason)
    for i, column in enumerate(chosen.values):
        where = table.places(column.position, rows)
        check_element(values[:, i], None if sigma is None else sigma[:, i], elements[i], where, _REMEDY)
    values, sigma, elements, note = _without_constants(table, values, sigma, elements)
    notes += [*note, *sign_notes(elements, values)]
    axis = axis.taken(rows)
    return of_rows(
        sweep_numbers(axis.wavelength, axis.setting),
        {**axis._asdict(), "values": values, "sigma": sigma, "lines": table.source_lines(rows)},
        signal=Mueller.word,
        elements=elements,
        path=table.path,
        sha256=table.sha256,
        notes=tuple(notes),
    )


def _normalised(
    table: Table,
    column: Column,
    rows: np.ndarray,
    m11: np.ndarray,
    values: np.ndarray,
    sigma: np.ndarray | None,
) -> tuple[np.ndarray, np.ndarray | None, str]:
    """Elements and σ over m11, with a sentence; as they are where m11 is 1, or an intensity beside them."""
    if np.all(np.abs(m11 - 1) < _NORMALISED):
        return values, sigma, ""
    reason = f"is no m11, which is above zero; {_REMEDY}"
    refuse_first(m11, m11 <= 0, table.places(column.position, rows), reason)
    divided = values / m11[:, None]
    if np.max(np.abs(values)) <= HIGHEST and np.max(np.abs(divided)) > HIGHEST:
        return values, sigma, "m11 is an intensity beside normalised elements: ignored"
    sigma = None if sigma is None else sigma / m11[:, None]
    return divided, sigma, "elements divided by m11"


def _without_constants(
    table: Table, values: np.ndarray, sigma: np.ndarray | None, elements: tuple[str, ...]
) -> tuple[np.ndarray, np.ndarray | None, tuple[str, ...], list[str]]:
    """The elements that were measured: programs write exactly 0 or 1 at every point for the others."""
    constant = np.all((values == values[0]) & np.isin(values, (-1.0, 0.0, 1.0)), axis=0)
    if not constant.any() or len(values) < 2:
        return values, sigma, elements, []
    kept = np.flatnonzero(~constant)
    left_out = [name for name, gone in zip(elements, constant, strict=True) if gone]
    if not kept.size:
        raise DataError(f"{table.path}: {', '.join(left_out)} are constant: nothing was measured")
    note = f"left out as not measured, exactly 0 or 1 at every point: {', '.join(left_out)}"
    sigma = None if sigma is None else sigma[:, kept]
    return values[:, kept], sigma, tuple(elements[i] for i in kept), [note]
