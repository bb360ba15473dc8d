"""Reading of Ψ and Δ from a table: their columns, units and checks.

Both are in degrees, with tan Ψ exp(iΔ) = conj(r_p / r_s) for n + ik: Δ is near 180 for bare silicon
at small angles, as instruments write it. N = cos 2Ψ, C = sin 2Ψ cos Δ, S = sin 2Ψ sin Δ are equivalent;
α and β of a rotating analyser, tan Ψ and cos Δ lack only the sign of S, as does a Δ folded into 0 to 180.
A column of depolarisation, 1 − N² − C² − S², is read with them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

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
from pellicle.data.repeated_sweeps import sweep_numbers
from pellicle.data.spectrum import Spectrum
from pellicle.data.spectrum_rows import REMEDY, Reading, Rows, SeveralColumns, error_columns, without_header
from pellicle.data.tabular.axis_and_signal import Axis
from pellicle.data.tabular.column_selection import (
    AxisColumns,
    axis_columns,
    choice_notes,
    first_column,
    only,
)
from pellicle.data.tabular.columns import Column, listed
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError
from pellicle.signals.folded_delta import can_be_folded, folding_at, folding_note
from pellicle.signals.limits import FOLDED_DELTA, check_depolarisation, check_psi_delta, refuse_first

SIGNAL = "psi-delta"
_METAL_N, _METAL_K = 13, 80
"""Largest n and k of common metals up to 12 µm (gold), in tables that look like psi and delta."""
_EXAMPLE = '`columns=["wavelength", "angle", "psi", "delta"]`'
_SOME = "the standard deviation of only one of psi and delta; add the other, or skip it"


@dataclass(frozen=True)
class EllipsometryColumns(SeveralColumns):
    """Columns of one form, with the errors of Ψ and Δ or none, and the depolarisation (and its error) or
    none."""

    form: tuple[str, ...] = PSI_DELTA
    analyser: Column | None = None
    depolarisation: tuple[Column, ...] = ()


def read_ellipsometry(table: Table, chosen: EllipsometryColumns, asked: Reading) -> Spectrum:
    """Read Ψ and Δ of the chosen columns, Δ in 0 to 360. Raises DataError or UsageError."""
    facts, folded = dict(table.layout.declared.facts), asked.folded
    if folded is None and facts.get("delta", "").startswith("folded"):
        folded = True
    _check_form(table, chosen, folded, asked.analyser)
    cells = (*chosen.values, *([chosen.analyser] if chosen.analyser else []))
    every = (*cells, *chosen.errors, *chosen.depolarisation)
    rows = Rows.read(table, chosen, every, asked.wavelength_unit)
    psi, delta, note, share = _psi_delta(table, chosen, rows.columns, asked.analyser)
    errors = rows.columns[len(cells) : len(cells) + len(chosen.errors)]
    pairs = zip(chosen.depolarisation, rows.columns[len(cells) + len(errors) :], strict=True)
    shares = [x / 100.0 if column.unit == "percent" else x for column, x in pairs]
    if not shares and share is not None:
        shares = [share]
    notes = [note] if note else []
    if asked.noise is not None:
        errors = (np.full(psi.size, float(asked.noise)),) * 2
        notes += ["the given noise replaces the columns of errors"] if chosen.errors else []
    if chosen.form in (*FOLDED_FORMS, NCS):
        folded = chosen.form != NCS
    notes.append("psi and delta in degrees")
    folding = _folding(rows.axis, psi, delta) if folded is None else None
    rows = replace(rows, columns=(psi, delta, *errors, *shares)).cut(asked.range)
    psi, delta, *rest = rows.columns
    sigma, shares = rest[: len(errors)], rest[len(errors) :]
    _check(rows, chosen, psi, delta, sigma, bool(folded))
    _check_depolarisation(rows, chosen.depolarisation, shares)
    if folded is None:
        # outside of the range nothing is checked
        folding = folding or _folding(rows.axis, psi, delta)
        folded = folding is not None and can_be_folded(delta)
        notes += [folding_note(folding)] if folded and folding else []
    elif folded:
        notes.append("delta is known in 0 to 180 only: cos(delta) is fitted")
    arrays = {"values": psi, "delta": np.clip(delta, *FOLDED_DELTA) if folded else delta % 360.0}
    arrays |= {"sigma": sigma[0] if sigma else None, "delta_sigma": sigma[-1] if sigma else None}
    arrays |= dict(zip(("depolarisation", "depolarisation_sigma"), shares, strict=False))
    spectrum = rows.spectrum(notes, arrays, signal=SIGNAL, folded=folded)
    transmitted = facts.get("light", "").startswith("transmitted")
    if transmitted if asked.transmission is None else asked.transmission:
        sweeps = tuple(replace(sweep, transmission=True) for sweep in spectrum.sweeps)
        notes = (*spectrum.notes, "of transmitted light: conj(t_p/t_s)")
        spectrum = replace(spectrum, transmission=True, notes=notes, sweeps=sweeps)
    return spectrum


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
    angles, reason = read[2], f"is not between 0 and 90 degrees; {REMEDY}"
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
    errors = error_columns(table, columns, values, _SOME) if form == PSI_DELTA else ()
    analyser = only(table, columns, "analyser") if form == ALPHA_BETA else None
    shares = _depolarisation_columns(table, columns)
    notes = [f"{listed(errors)} read as the standard deviation of psi and delta"] if errors else []
    notes += [
        f"{column.name!r} read as {meaning}, {'in percent' if column.unit == 'percent' else 'a fraction'}"
        for column, meaning in zip(shares, ("the depolarisation", "its standard deviation"), strict=False)
    ]
    notes = choice_notes(columns, axis, values, ", ".join(form), [*errors, *shares, analyser], notes)
    return EllipsometryColumns(axis, values, errors, notes, form, analyser, shares)


def _by_position(table: Table) -> EllipsometryColumns:
    if table.layout.width != 3:
        raise without_header(table, _EXAMPLE)
    axis = AxisColumns(first_column(table))
    psi, delta = (Column(i, "", role) for i, role in ((1, "psi"), (2, "delta")))
    note = "no header: column 1 read as the wavelength, column 2 as psi, column 3 as delta"
    return EllipsometryColumns(axis, (psi, delta), (), (note,))


def _depolarisation_columns(table: Table, columns: Sequence[Column]) -> tuple[Column, ...]:
    """The depolarisation and, if there is one, its standard deviation. Raises DataError."""
    share, error = only(table, columns, "depolarisation"), only(table, columns, "sigma_depolarisation")
    if share is None:
        return ()
    chosen = (share, error) if error else (share,)
    for column in chosen:
        if column.unknown_unit:
            raise DataError(
                f"{table.path}: {table.label(column.position)} is in {column.unknown_unit!r}; write a "
                "depolarisation as a fraction, or in percent with % in the column's name"
            )
    return chosen


def _check_depolarisation(rows: Rows, columns: Sequence[Column], values: Sequence[np.ndarray]) -> None:
    """Refuse a depolarisation that is no fraction, or errors of it not above zero. Raises DataError."""
    if columns:
        percent = "if it is in percent, name the column `depolarisation (%)`"
        remedy = REMEDY if columns[0].unit == "percent" else percent
        check_depolarisation(values[0], rows.places(columns[0]), remedy)
        rows.check_errors(columns[1:], values[1:])


def _check(
    rows: Rows,
    columns: EllipsometryColumns,
    psi: np.ndarray,
    delta: np.ndarray,
    sigma: Sequence[np.ndarray],
    folded: bool,
) -> None:
    """Refuse Ψ, Δ and errors outside their limits, and values in radians. Raises DataError."""
    named = columns.values if columns.form == PSI_DELTA else (columns.axis.wavelength,) * 2
    at_psi, at_delta = map(rows.places, named)
    check_psi_delta(psi, delta, folded, at_psi, at_delta, REMEDY)
    rows.check_errors((columns.errors * 2)[:2], sigma)
    path = rows.table.path
    unnamed = not any(column.name for column in columns.values)
    if unnamed and psi.max() < _METAL_N and delta.min() >= 0 and delta.max() < _METAL_K:
        raise DataError(
            f"{path}: has no header, and its values up to {psi.max():g} and {delta.max():g} may be n "
            "and k; give optical constants as `layer` or `substrate`, or say that they are angles with "
            '`columns=["wavelength", "psi_deg", "delta_deg"]`'
        )
    stated = any(column.unit == "deg" for column in columns.values) or columns.form != PSI_DELTA
    if not stated and psi.max() < np.pi / 2 and np.abs(delta).max() < 2 * np.pi:
        raise DataError(
            f"{path}: psi is at most {psi.max():g} and delta {np.abs(delta).max():g}, "
            "which look like radians, or tan(psi) and cos(delta); write degrees and name the columns psi_deg "
            "and delta_deg, or name them tan_psi and cos_delta"
        )
