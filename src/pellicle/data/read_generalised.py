"""Reading of generalised Ψ and Δ from a table: the columns of each ratio, their units and checks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.data.spectrum_rows import REMEDY, Rows, error_columns, without_header
from pellicle.data.tabular.column_names import RATIO_COLUMNS
from pellicle.data.tabular.column_selection import AxisColumns, axis_columns, choice_notes, only
from pellicle.data.tabular.columns import Column, listed
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError
from pellicle.signals.generalised import RATIOS, Generalised, delta_sigma
from pellicle.signals.limits import check_psi_delta

_EXAMPLE = '`columns=["wavelength", "angle", "psi_ane", "delta_ane", "psi_aps", "delta_aps"]`'


@dataclass(frozen=True)
class GeneralisedColumns:
    """Columns of Ψ and Δ of each ratio, of their standard deviations or none, and sentences on the choice."""

    axis: AxisColumns
    ratios: tuple[str, ...]
    values: tuple[Column, ...]  # Ψ and Δ of the first ratio, then of the next
    errors: tuple[Column, ...]
    notes: tuple[str, ...]


def has_generalised(columns: Sequence[Column] | None) -> bool:
    """Return True if Ψ or Δ of one of the ratios is among the columns."""
    return any(column.role in RATIO_COLUMNS for column in columns or ())


def generalised_columns(
    table: Table, columns: Sequence[Column] | None, ratios: Sequence[str] | None = None
) -> GeneralisedColumns:
    """Choose the columns of the ratios, all or those named. Raises DataError or UsageError."""
    if columns is None:
        raise without_header(table, _EXAMPLE)
    if ratios is not None:
        Generalised(tuple(ratios))
    pairs: dict[str, tuple[Column, Column]] = {}
    for name in RATIOS:
        psi, delta = (only(table, columns, f"{angle}_{name}") for angle in ("psi", "delta"))
        if psi and delta:
            pairs[name] = psi, delta
        elif psi or delta:
            raise DataError(
                f"{table.path}: has {listed([c for c in (psi, delta) if c])} alone, and each ratio needs psi"
                " and delta; add the other, or skip it with _ in `columns`"
            )
    if absent := [name for name in ratios or () if name not in pairs]:
        raise UsageError(
            f"{table.path}: has no ratio {', '.join(absent)}; it has {', '.join(pairs) or 'none'}"
        )
    if not pairs:
        raise DataError(
            f"{table.path}: no generalised psi and delta (psi_ane and delta_ane, or of aps or asp) are among "
            f"{listed(columns)}; name the columns in order, as in {_EXAMPLE}"
        )
    chosen = tuple(name for name in pairs if ratios is None or name in ratios)
    values = tuple(column for name in chosen for column in pairs[name])
    for column in values:
        if column.unknown_unit:
            raise DataError(
                f"{table.path}: {table.label(column.position)} is in {column.unknown_unit!r}; write psi and "
                "delta in degrees"
            )
    axis, errors = axis_columns(table, columns, _EXAMPLE), error_columns(table, columns, values, "columns")
    notes = [f"{listed(errors)} read as their standard deviations"] if errors else []
    notes = choice_notes(columns, axis, values, "generalised psi and delta", errors, notes)
    return GeneralisedColumns(axis, chosen, values, errors, notes)


def _sigmas(errors: Sequence[np.ndarray], psi: np.ndarray) -> tuple[np.ndarray | None, np.ndarray | None]:
    """σ of Ψ and of Δ (rows, ratios) from the columns of `errors`; None without any."""
    if len(errors) > 1:
        of_psi, of_delta = (np.stack(errors[i::2], axis=1) for i in (0, 1))
        return of_psi, of_delta
    if not errors:
        return None, None
    of_psi = np.broadcast_to(errors[0][:, None], psi.shape)
    return of_psi, delta_sigma(psi, of_psi)


def read_generalised(
    table: Table,
    chosen: GeneralisedColumns,
    wavelength_unit: str | None,
    noise: float | None,
    range: tuple[float, float] | None,
) -> Spectrum:
    """Read Ψ and Δ of the chosen ratios; other arguments as in `read_spectrum`.

    One σ for all, of a column or the `noise`, is that of Ψ, and Δ has that of `generalised.delta_sigma`.
    Raises DataError or UsageError.
    """
    cells = (*chosen.values, *chosen.errors)
    rows = Rows.read(table, chosen.axis, cells, wavelength_unit, chosen.notes).cut(range)
    count, notes = len(chosen.values), []
    psi, delta = (np.stack(rows.columns[i:count:2], axis=1) for i in (0, 1))
    for i, name in enumerate(chosen.ratios):
        at_psi, at_delta = (rows.places(column) for column in chosen.values[2 * i : 2 * i + 2])
        check_psi_delta(psi[:, i], delta[:, i], False, at_psi, at_delta, f"{REMEDY} ({name})")
    if noise is None:
        rows.check_errors(chosen.errors, rows.columns[count:])
        psi_sigma, delta_error = _sigmas(rows.columns[count:], psi)
    else:
        psi_sigma = np.full(psi.shape, float(noise))
        delta_error = delta_sigma(psi, psi_sigma)
        notes += ["the given noise replaces the columns of errors"] if chosen.errors else []
    arrays = {"values": psi, "sigma": psi_sigma, "delta": delta % 360.0, "delta_sigma": delta_error}
    return rows.spectrum(notes, arrays, signal=Generalised.word, ratios=chosen.ratios)
