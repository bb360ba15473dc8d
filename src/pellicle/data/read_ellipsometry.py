"""Reading of Ψ and Δ from a table: their columns, units and checks.

Both are in degrees, with tan Ψ exp(iΔ) = conj(r_p / r_s) for n + ik: Δ is near 180 for bare silicon
at small angles, as instruments write it. N = cos 2Ψ, C = sin 2Ψ cos Δ, S = sin 2Ψ sin Δ are equivalent;
α and β of a rotating analyser, tan Ψ and cos Δ lack only the sign of S, as does a Δ folded into 0 to 180.
A column of depolarisation, 1 − N² − C² − S², is read with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pellicle.data import depolarisation
from pellicle.data.ellipsometry_angles import (
    ALPHA_BETA,
    FOLDED_FORMS,
    FORMS,
    NCS,
    PSI_DELTA,
    TAN_COS,
    PsiDelta,
    from_alpha_beta,
    from_ncs,
    from_tan_cos,
)
from pellicle.data.repeated_sweeps import of_rows, sweep_numbers
from pellicle.data.spectrum import Spectrum, inside_range
from pellicle.data.tabular.axis_and_signal import Axis, axis_note, axis_unit, read_axis
from pellicle.data.tabular.column_selection import AxisColumns, axis_columns, first_column, only
from pellicle.data.tabular.columns import Column, listed
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError
from pellicle.signals.folded_delta import can_be_folded, folding_at, folding_note
from pellicle.signals.limits import FOLDED_DELTA, check_psi_delta, refuse_first

SIGNAL = "psi-delta"
_METAL_N, _METAL_K = 13, 80
"""Largest n and k of common metals up to 12 µm (gold), in tables that look like psi and delta."""
_REMEDY = "correct or delete that row"
_EXAMPLE = '`columns=["wavelength", "angle", "psi", "delta"]`'


@dataclass(frozen=True)
class EllipsometryColumns:
    """Columns of one form, with the errors of Ψ and Δ or none, the depolarisation (and its error) or none,
    and sentences on the choice."""

    axis: AxisColumns
    form: tuple[str, ...]
    values: tuple[Column, ...]
    analyser: Column | None
    errors: tuple[Column, ...]
    depolarisation: tuple[Column, ...]
    notes: tuple[str, ...]


def has_ellipsometry(columns: Sequence[Column] | None) -> bool:
    """Return True if Ψ and Δ are among the columns, in any form."""
    roles = {column.role for column in columns or ()}
    return bool(roles & set(PSI_DELTA)) or any(roles.issuperset(form) for form in FORMS)


def read_ellipsometry(
    table: Table,
    chosen: EllipsometryColumns,
    wavelength_unit: str | None,
    noise: float | None,
    range: tuple[float, float] | None,
    folded: bool | None = None,
    analyser: float | None = None,
) -> Spectrum:
    """Read Ψ and Δ of the chosen columns, Δ in 0 to 360; other arguments as in `read_spectrum`.

    Raises DataError or UsageError.
    """
    _check_form(table, chosen, folded, analyser)
    unit = axis_unit(table, chosen.axis.wavelength, wavelength_unit)
    cells = (*chosen.values, *([chosen.analyser] if chosen.analyser else []), *chosen.errors)
    axis, every = read_axis(table, chosen.axis, (*cells, *chosen.depolarisation), unit)
    read, shares = every[: len(cells)], every[len(cells) :]
    psi, delta, note, share = _psi_delta(table, chosen, read, analyser)
    errors = read[len(cells) - len(chosen.errors) :]
    shares = depolarisation.fractions(chosen.depolarisation, shares)
    if not shares and share is not None:
        shares = [share]
    notes = [*table.notes, *chosen.notes, axis_note(unit), *([note] if note else [])]
    if noise is not None:
        errors = [np.full(psi.size, float(noise))] * 2
        notes += ["the given noise replaces the columns of errors"] if chosen.errors else []
    if chosen.form in FOLDED_FORMS:
        folded = True
    elif chosen.form == NCS:
        folded = False
    notes.append("psi and delta in degrees")
    folding = None
    if folded is None:
        folding = _folding(axis, psi, delta)
    rows = np.arange(psi.size)
    if range is not None:
        inside, note = inside_range(axis.wavelength, range, table.path)
        rows, notes = rows[inside], [*notes, note]
    sigma = [error[rows] for error in errors]
    shares = [share[rows] for share in shares]
    axis = axis.taken(rows)
    _check(table, chosen, rows, psi[rows], delta[rows], sigma, bool(folded))
    depolarisation.check(table, chosen.depolarisation, rows, shares)
    if folded is None:
        # outside of the range nothing is checked
        folding = folding or _folding(axis, psi[rows], delta[rows])
        folded = folding is not None and can_be_folded(delta[rows])
        notes += [folding_note(folding)] if folded and folding else []
    elif folded:
        notes.append("delta is known in 0 to 180 only: cos(delta) is fitted")
    arrays = {
        **axis._asdict(),
        "values": psi[rows],
        "delta": np.clip(delta[rows], *FOLDED_DELTA) if folded else delta[rows] % 360.0,
    }
    errors = {"sigma": sigma[0] if sigma else None, "delta_sigma": sigma[-1] if sigma else None}
    errors |= dict(zip(("depolarisation", "depolarisation_sigma"), shares, strict=False))
    return of_rows(
        sweep_numbers(axis.wavelength, axis.setting),
        arrays | errors | {"lines": table.source_lines(rows)},
        signal=SIGNAL,
        path=table.path,
        sha256=table.sha256,
        notes=tuple(notes),
        folded=folded,
    )


def _folding(axis: Axis, psi: np.ndarray, delta: np.ndarray) -> float | None:
    """The wavelength at which Δ is folded, in any sweep at any setting; None where nothing shows it."""
    if not can_be_folded(delta):
        return None
    number, setting = sweep_numbers(axis.wavelength, axis.setting), axis.setting
    pairs = np.stack([number, number if setting is None else setting])
    curve = np.unique(pairs, axis=1, return_inverse=True)[1]
    return folding_at(axis.wavelength, psi, delta, curve.ravel().astype(float))


def _check_form(
    table: Table, columns: EllipsometryColumns, folded: bool | None, analyser: float | None
) -> None:
    """Refuse arguments that do not go with the columns. Raises UsageError."""
    if folded and columns.form == NCS:
        raise UsageError(f"{table.path}: N, C and S contain the sign of delta; leave `folded` out")
    if columns.form != ALPHA_BETA:
        if analyser is not None:
            raise UsageError(f"{table.path}: `analyser` goes with columns alpha and beta; leave it out")
    elif analyser is None and columns.analyser is None:
        raise UsageError(
            f"{table.path}: alpha and beta need the analyser's angle: give it as in `analyser=45`, or add a "
            "column analyser_deg"
        )
    elif analyser is not None and columns.analyser is not None:
        raise UsageError(
            f"{table.path}: alpha and beta come with a column of analyser angles; leave `analyser` out, or "
            "skip the column analyser_deg"
        )
    elif analyser is not None and not 0 < analyser < 90:
        raise UsageError(f"`analyser` must lie between 0 and 90 degrees, got {analyser:g}")


def _psi_delta(
    table: Table, columns: EllipsometryColumns, read: Sequence[np.ndarray], analyser: float | None
) -> PsiDelta:
    """Ψ and Δ in degrees from the columns that were read."""
    position = columns.values[0].position
    if columns.form == NCS:
        return from_ncs(table, position, np.array(read[:3]))
    if columns.form == PSI_DELTA:
        return PsiDelta(read[0], read[1])
    if columns.form == TAN_COS:
        return from_tan_cos(table, [column.position for column in columns.values], np.array(read[:2]))
    if columns.analyser is None:
        angles = np.full(read[0].size, analyser, dtype=float)
        return from_alpha_beta(table, position, np.array(read[:2]), angles)
    angles, reason = read[2], f"is not between 0 and 90 degrees; {_REMEDY}"
    refuse_first(angles, (angles <= 0) | (angles >= 90), table.places(columns.analyser.position), reason)
    return from_alpha_beta(table, position, np.array(read[:2]), angles)


def ellipsometry_columns(table: Table, columns: Sequence[Column] | None) -> EllipsometryColumns:
    """Choose the columns of Ψ and Δ, in any form. Raises DataError or UsageError."""
    if columns is None:
        return _by_position(table)
    roles = {column.role for column in columns}
    form = next((form for form in FORMS if roles & set(form)), PSI_DELTA)
    values = tuple(column for role in form if (column := only(table, columns, role)) is not None)
    if len(values) != len(form):
        raise DataError(
            f"{table.path}: psi and delta, N, C and S, alpha and beta, or tan_psi and cos_delta are not all "
            f"among {listed(columns)}; name the columns in order, as in {_EXAMPLE}"
        )
    for column in values:
        if column.unknown_unit or column.unit == "percent":
            known = "convert both to degrees" if form == PSI_DELTA else "write plain numbers, as 0.5"
            raise DataError(
                f"{table.path}: {table.label(column.position)} is in {column.unknown_unit or '%'!r}; {known}"
            )
    axis = axis_columns(table, columns, _EXAMPLE)
    errors = _error_columns(table, columns) if form == PSI_DELTA else ()
    analyser = only(table, columns, "analyser") if form == ALPHA_BETA else None
    shares = depolarisation.columns(table, columns)
    read = [*values, *errors, *shares, *(column for column in (*axis, analyser) if column)]
    ignored = [c for c in columns if c not in read and c.name not in ("_", "")]
    notes = [f"{listed([axis.wavelength])} read as the wavelength, {listed(values)} as {', '.join(form)}"]
    notes += [f"{listed(errors)} read as the standard deviation of psi and delta"] if errors else []
    notes += depolarisation.notes(shares)
    notes += axis.notes
    notes += [f"ignored: {listed(ignored)}"] if ignored else []
    return EllipsometryColumns(axis, form, values, analyser, errors, shares, tuple(notes))


def _by_position(table: Table) -> EllipsometryColumns:
    if table.layout.width != 3:
        raise UsageError(
            f"{table.path}: has {table.layout.width} columns and no header; name them in order, as in "
            f"{_EXAMPLE}"
        )
    axis = AxisColumns(first_column(table))
    psi, delta = (Column(i, "", role) for i, role in ((1, "psi"), (2, "delta")))
    note = "no header: column 1 read as the wavelength, column 2 as psi, column 3 as delta"
    return EllipsometryColumns(axis, PSI_DELTA, (psi, delta), None, (), (), (note,))


def _error_columns(table: Table, columns: Sequence[Column]) -> tuple[Column, ...]:
    """The errors of Ψ and Δ, or one `sigma` for both; either both or none."""
    psi, delta = only(table, columns, "sigma_psi"), only(table, columns, "sigma_delta")
    if psi and delta:
        return psi, delta
    if psi or delta:
        raise DataError(
            f"{table.path}: gives the standard deviation of only one of psi and delta; add the other, or "
            "skip it with _ in `columns`"
        )
    both = only(table, columns, "sigma")
    return (both,) if both else ()


def _check(
    table: Table,
    columns: EllipsometryColumns,
    rows: np.ndarray,
    psi: np.ndarray,
    delta: np.ndarray,
    sigma: Sequence[np.ndarray],
    folded: bool,
) -> None:
    """Refuse Ψ, Δ and errors outside their limits, and values in radians. Raises DataError."""
    named = columns.values if columns.form == PSI_DELTA else (columns.axis.wavelength,) * 2
    at_psi, at_delta = (table.places(column.position, rows) for column in named)
    check_psi_delta(psi, delta, folded, at_psi, at_delta, _REMEDY)
    for column, values in zip((columns.errors * 2)[:2], sigma, strict=False):
        where = table.places(column.position, rows)
        refuse_first(values, values <= 0, where, f"is a standard deviation not above zero; {_REMEDY}")
    unnamed = not any(column.name for column in columns.values)
    if unnamed and psi.max() < _METAL_N and delta.min() >= 0 and delta.max() < _METAL_K:
        raise DataError(
            f"{table.path}: has no header, and its values up to {psi.max():g} and {delta.max():g} may be n "
            "and k; give optical constants as `layer` or `substrate`, or say that they are angles with "
            '`columns=["wavelength", "psi_deg", "delta_deg"]`'
        )
    stated = any(column.unit == "deg" for column in columns.values) or columns.form != PSI_DELTA
    if not stated and psi.max() < np.pi / 2 and np.abs(delta).max() < 2 * np.pi:
        raise DataError(
            f"{table.path}: psi is at most {psi.max():g} and delta {np.abs(delta).max():g}, "
            "which look like radians, or tan(psi) and cos(delta); write degrees and name the columns psi_deg "
            "and delta_deg, or name them tan_psi and cos_delta"
        )
