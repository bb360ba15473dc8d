"""Reading of generalised Ψ and Δ from a table: the columns of each ratio, their units and checks."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.data.spectrum_rows import REMEDY, Reading, Rows, SeveralColumns, error_columns, without_header
from pellicle.data.tabular.column_selection import axis_columns, choice_notes, only
from pellicle.data.tabular.columns import Column, listed
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError
from pellicle.signals.generalised import RATIOS, Generalised, delta_sigma
from pellicle.signals.limits import check_psi_delta

_EXAMPLE = '`columns=["wavelength", "angle", "psi_ane", "delta_ane", "psi_aps", "delta_aps"]`'
_SOME = "standard deviations of some of the columns only ({}); add the others, or skip these"


@dataclass(frozen=True)
class GeneralisedColumns(SeveralColumns):
    """Columns of Ψ and Δ of the first ratio, then of the next; standard deviations are one for each of these,
    one for every Ψ, or none."""

    ratios: tuple[str, ...]


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
    axis, errors = axis_columns(table, columns, _EXAMPLE), error_columns(table, columns, values, _SOME)
    notes = [f"{listed(errors)} read as their standard deviations"] if errors else []
    notes = choice_notes(columns, axis, values, "generalised psi and delta", errors, notes)
    return GeneralisedColumns(axis, values, errors, notes, chosen)


def read_generalised(table: Table, chosen: GeneralisedColumns, asked: Reading) -> Spectrum:
    """Read Ψ and Δ of the chosen ratios.

    One σ for all, of a column or the noise, is that of Ψ, and Δ has that of `generalised.delta_sigma`.
    Raises DataError or UsageError.
    """
    cells = (*chosen.values, *chosen.errors)
    rows = Rows.read(table, chosen, cells, asked.wavelength_unit).cut(asked.range)
    count, notes = len(chosen.values), []
    psi, delta = (np.stack(rows.columns[i:count:2], axis=1) for i in (0, 1))
    for i, name in enumerate(chosen.ratios):
        at_psi, at_delta = (rows.places(column) for column in chosen.values[2 * i : 2 * i + 2])
        check_psi_delta(psi[:, i], delta[:, i], False, at_psi, at_delta, f"{REMEDY} ({name})")
    errors = rows.columns[count:]
    if asked.noise is None:
        rows.check_errors(chosen.errors, errors)
    else:
        notes += ["the given noise replaces the columns of errors"] if errors else []
        errors = (np.full(len(psi), float(asked.noise)),)
    of_psi = of_delta = None
    if len(errors) > 1:
        of_psi, of_delta = (np.stack(errors[i::2], axis=1) for i in (0, 1))
    elif errors:
        of_psi = np.broadcast_to(errors[0][:, None], psi.shape)
        of_delta = delta_sigma(psi, of_psi)
    arrays = {"values": psi, "sigma": of_psi, "delta": delta % 360.0, "delta_sigma": of_delta}
    return rows.spectrum(notes, arrays, signal=Generalised.word, ratios=chosen.ratios)
