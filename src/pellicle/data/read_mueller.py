"""Reading of normalised Mueller elements from a table: their columns, normalisation and checks."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.data.spectrum_rows import REMEDY, Reading, Rows, SeveralColumns, error_columns, without_header
from pellicle.data.tabular.column_names import MUELLER
from pellicle.data.tabular.column_selection import axis_columns, choice_notes, only
from pellicle.data.tabular.columns import Column, listed
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError
from pellicle.signals.limits import refuse_first
from pellicle.signals.mueller import ELEMENTS, HIGHEST, Mueller, check_element, sign_notes

_EXAMPLE = '`columns=["wavelength", "angle", "m12", "m33", "m34"]`'
_SOME = "standard deviations of some of the elements only ({}); add the others, or skip these"
_NORMALISED = 1e-3
"""Deviation of m11 from 1 by rounding."""


@dataclass(frozen=True)
class MuellerColumns(SeveralColumns):
    """Columns of elements, and of m11 (or None); standard deviations are one for each element, one for all,
    or none."""

    m11: Column | None


def mueller_columns(
    table: Table, columns: Sequence[Column] | None, elements: Sequence[str] | None = None
) -> MuellerColumns:
    """Choose the columns of elements, all or those named. Raises DataError or UsageError."""
    if columns is None:
        raise without_header(table, _EXAMPLE)
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
    errors, m11 = error_columns(table, columns, values, _SOME), present["m11"]
    one = any(column.role == "sigma" for column in errors)
    meaning = "the standard deviation of each" if one else "their standard deviations"
    notes = [f"{listed(errors)} read as {meaning}"] if errors else []
    notes = choice_notes(columns, axis, values, "Mueller elements", [*errors, m11], notes)
    return MuellerColumns(axis, values, errors, notes, m11)


def read_mueller(table: Table, chosen: MuellerColumns, asked: Reading) -> Spectrum:
    """Read the chosen elements. Raises DataError or UsageError."""
    cells = (*chosen.values, *chosen.errors, *([chosen.m11] if chosen.m11 else []))
    rows = Rows.read(table, chosen, cells, asked.wavelength_unit).cut(asked.range)
    count, notes = len(chosen.values), []
    values, errors = np.stack(rows.columns[:count], axis=1), rows.columns[count : count + len(chosen.errors)]
    sigma = np.broadcast_to(np.stack(errors, axis=1), values.shape) if errors else None
    if asked.noise is not None:
        sigma = np.full(values.shape, float(asked.noise))
        notes += ["the given noise replaces the columns of errors"] if errors else []
    else:
        rows.check_errors(chosen.errors, errors)
    if chosen.m11 is not None:
        values, sigma, note = _normalised(rows, chosen.m11, values, sigma)
        notes += [note] if note else []
    elements = tuple(column.role for column in chosen.values)
    for i, column in enumerate(chosen.values):
        error = None if sigma is None else sigma[:, i]
        check_element(values[:, i], error, elements[i], rows.places(column), REMEDY)
    values, sigma, elements, note = _without_constants(table, values, sigma, elements)
    notes += [*note, *sign_notes(elements, values)]
    return rows.spectrum(notes, {"values": values, "sigma": sigma}, signal=Mueller.word, elements=elements)


def _normalised(
    rows: Rows, column: Column, values: np.ndarray, sigma: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray | None, str]:
    """Elements and σ over m11, the last column of the rows, with a sentence; as they are where m11 is 1, or
    an intensity beside them."""
    m11 = rows.columns[-1]
    if np.all(np.abs(m11 - 1) < _NORMALISED):
        return values, sigma, ""
    refuse_first(m11, m11 <= 0, rows.places(column), f"is no m11, which is above zero; {REMEDY}")
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
