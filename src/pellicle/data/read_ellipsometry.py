"""Reading of Ψ and Δ from a table: their columns, units and checks.

Both are in degrees, with tan Ψ exp(iΔ) = conj(r_p / r_s) for n + ik: Δ is near 180 for bare silicon
at small angles, as instruments write it. N = cos 2Ψ, C = sin 2Ψ cos Δ, S = sin 2Ψ sin Δ are equivalent;
α and β of a rotating analyser, tan Ψ and cos Δ lack only the sign of S, as does a Δ folded into 0 to 180.
A column of depolarisation, 1 − N² − C² − S², is read with them.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from pellicle.data.repeated_sweeps import sweep_numbers
from pellicle.data.spectrum import Spectrum
from pellicle.data.spectrum_rows import NOISE_REPLACES, REMEDY, Axis, Reading, Rows
from pellicle.data.tabular.column_selection import (
    AxisColumns,
    Selection,
    error_columns,
    first_column,
    only,
    select,
    without_header,
)
from pellicle.data.tabular.columns import Column, listed
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError
from pellicle.signals.folded_delta import can_be_folded, folding_at, folding_note
from pellicle.signals.limits import FOLDED_DELTA, Where, check_depolarisation, check_psi_delta, refuse_first

SIGNAL = "psi-delta"
PSI_DELTA, NCS = ("psi", "delta"), ("N", "C", "S")
ALPHA_BETA, TAN_COS = ("alpha", "beta"), ("tan_psi", "cos_delta")
FORMS = (PSI_DELTA, NCS, ALPHA_BETA, TAN_COS)
"""The columns of each form; where a file has several, the first is read."""
FOLDED_FORMS = (ALPHA_BETA, TAN_COS)
"""Forms that contain cos Δ only."""
POLARISED = (0.5, 1.05)
"""Accepted degrees of polarisation of N, C, S: below, noise dominates; above, the columns are not N, C, S."""
HIGHEST_COSINE = 1.05
"""Noise takes cos Δ this far beyond 1; further, the column is not cos Δ."""
_ROUNDED = 3e-3
"""1 − N² − C² − S² below this is rounding: of three decimals in each it reaches 0.0017."""
_METAL_N, _METAL_K = 13, 80
"""Largest n and k of common metals up to 12 µm (gold), in tables that look like psi and delta."""
_EXAMPLE = '`columns=["wavelength", "angle", "psi", "delta"]`'
_SOME = "the standard deviation of only one of psi and delta; add the other, or skip it"
_SHARES = ("depolarisation", "sigma_depolarisation")


class Angles(NamedTuple):
    """Ψ and Δ in degrees, a sentence on the conversion, and the depolarisation, where it is known."""

    psi: Float[np.ndarray, " points"]
    delta: Float[np.ndarray, " points"]
    note: str | None = None
    depolarisation: Float[np.ndarray, " points"] | None = None


def ellipsometry_columns(table: Table, columns: Sequence[Column] | None) -> Selection:
    """Choose the columns of Ψ and Δ, in any form. Raises DataError or UsageError."""
    if columns is None and table.width == 3:
        named = (Column(1, "", "psi"), Column(2, "", "delta"))
        note = "no header: column 1 read as the wavelength, column 2 as psi, column 3 as delta"
        return Selection(SIGNAL, AxisColumns(first_column(table)), named, notes=(note,))
    if columns is None:
        raise without_header(table, _EXAMPLE)
    roles = {column.role for column in columns}
    form = next((form for form in FORMS if roles & set(form)), PSI_DELTA)
    values = [column for role in form if (column := only(table, columns, role)) is not None]
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
    errors = error_columns(table, columns, values, _SOME) if form == PSI_DELTA else ()
    analyser = only(table, columns, "analyser") if form == ALPHA_BETA else None
    share, error = (only(table, columns, role) for role in _SHARES)
    shares = [column for column in (share, error) if column] if share else []
    notes = [f"{listed(errors)} read as the standard deviation of psi and delta"] if errors else []
    for column, meaning in zip(shares, ("the depolarisation", "its standard deviation"), strict=False):
        if column.unknown_unit:
            raise DataError(
                f"{table.path}: {table.label(column.position)} is in {column.unknown_unit!r}; write a "
                "depolarisation as a fraction, or in percent with % in the column's name"
            )
        unit = "in percent" if column.unit == "percent" else "a fraction"
        notes.append(f"{column.name!r} read as {meaning}, {unit}")
    others, meaning = [*shares, analyser], ", ".join(form)
    return select(
        table, columns, SIGNAL, values, meaning, _EXAMPLE, errors=errors, others=others, notes=notes
    )


def read_ellipsometry(table: Table, chosen: Selection, asked: Reading) -> Spectrum:
    """Read Ψ and Δ of the chosen columns, Δ in 0 to 360. Raises DataError or UsageError."""
    facts, folded = dict(table.declared.facts), asked.folded
    form = tuple(column.role for column in chosen.values)
    if folded is None and facts.get("delta", "").startswith("folded"):
        folded = True
    _check_arguments(table, chosen, form, folded, asked.analyser)
    rows = Rows.read(table, chosen, asked.wavelength_unit)
    psi, delta, note, share = _converted(rows, chosen, form, asked.analyser)
    notes = [note] if note else []
    arrays = {"values": psi, "delta": delta} | ({} if share is None else {"depolarisation": share})
    for column in chosen.others:
        if column.role in _SHARES:
            name = "depolarisation" if column.role == _SHARES[0] else "depolarisation_sigma"
            arrays[name] = rows.columns[column.role] / (100.0 if column.unit == "percent" else 1.0)
    errors = [rows.columns[column.role] for column in chosen.errors]
    if asked.noise is not None:
        notes += [NOISE_REPLACES] if errors else []
        errors = [np.full(psi.size, float(asked.noise))]
    arrays |= dict(zip(("sigma", "delta_sigma"), errors * 2, strict=False))
    if form in (*FOLDED_FORMS, NCS):
        folded = form != NCS
    notes.append("psi and delta in degrees")
    folding = _folding(rows.axis, psi, delta) if folded is None else None
    rows = replace(rows, columns=arrays).cut(asked.range)
    arrays = rows.columns
    _check(rows, chosen, form, bool(folded))
    if folded is None:
        # outside of the range nothing is checked
        folding = folding or _folding(rows.axis, arrays["values"], arrays["delta"])
        folded = folding is not None and can_be_folded(arrays["delta"])
        notes += [folding_note(folding)] if folded and folding else []
    elif folded:
        notes.append("delta is known in 0 to 180 only: cos(delta) is fitted")
    arrays["delta"] = np.clip(arrays["delta"], *FOLDED_DELTA) if folded else arrays["delta"] % 360.0
    transmitted = asked.transmission
    if transmitted is None:
        transmitted = facts.get("light", "").startswith("transmitted")
    notes += ["of transmitted light: conj(t_p/t_s)"] if transmitted else []
    return rows.spectrum(notes, arrays, signal=SIGNAL, folded=folded, transmission=transmitted)


def _folding(axis: Axis, psi: np.ndarray, delta: np.ndarray) -> float | None:
    """The wavelength at which Δ is folded, in any sweep at any setting; None where nothing shows it."""
    if not can_be_folded(delta):
        return None
    number, setting = sweep_numbers(axis.wavelength, axis.setting), axis.setting
    pairs = np.stack([number, number if setting is None else setting])
    curve = np.unique(pairs, axis=1, return_inverse=True)[1]
    return folding_at(axis.wavelength, psi, delta, curve.ravel().astype(float))


def _check_arguments(
    table: Table, chosen: Selection, form: tuple[str, ...], folded: bool | None, analyser: float | None
) -> None:
    """Refuse arguments that do not go with the columns. Raises UsageError."""
    in_file = any(column.role == "analyser" for column in chosen.others)
    if folded and form == NCS:
        raise UsageError(f"{table.path}: N, C and S contain the sign of delta; leave `folded` out")
    if form != ALPHA_BETA:
        if analyser is not None:
            raise UsageError(f"{table.path}: `analyser` goes with columns alpha and beta; leave it out")
    elif analyser is None and not in_file:
        raise UsageError(
            f"{table.path}: alpha and beta need the analyser's angle: give it as in `analyser=45`, or add a "
            "column analyser_deg"
        )
    elif analyser is not None and in_file:
        raise UsageError(
            f"{table.path}: alpha and beta come with a column of analyser angles; leave `analyser` out, or "
            "skip the column analyser_deg"
        )
    elif analyser is not None and not 0 < analyser < 90:
        raise UsageError(f"`analyser` must lie between 0 and 90 degrees, got {analyser:g}")


def _converted(rows: Rows, chosen: Selection, form: tuple[str, ...], analyser: float | None) -> Angles:
    """Ψ and Δ in degrees from the columns that were read. Raises DataError."""
    read, places = rows.stacked(form).T, [rows.places(column) for column in chosen.values]
    if form == PSI_DELTA:
        return Angles(*read)
    if form == NCS:
        return _from_ncs(read, places[0])
    if form == TAN_COS:
        return _from_tan_cos(read, places)
    angles = np.full(read[0].size, analyser, dtype=float)
    for column in chosen.others:
        if column.role == "analyser":
            angles, reason = rows.columns["analyser"], f"is not between 0 and 90 degrees; {REMEDY}"
            refuse_first(angles, (angles <= 0) | (angles >= 90), rows.places(column), reason)
    return _from_alpha_beta(read, angles, places[0])


def _from_ncs(columns: Float[np.ndarray, "3 points"], place: Where) -> Angles:
    """Convert N = cos 2Ψ, C = sin 2Ψ cos Δ, S = sin 2Ψ sin Δ, each times the degree of polarisation.

    Raises DataError for an impossible degree of polarisation.
    """
    polarised = np.sqrt(np.sum(columns**2, axis=0))
    wrong = (polarised < POLARISED[0]) | (polarised > POLARISED[1])
    if wrong.any():
        row = int(np.argmax(wrong))
        raise DataError(
            f"{place(row)}: N, C and S make a degree of polarisation of "
            f"{polarised[row]:.3g}, where about 1 is possible; {REMEDY}"
        )
    psi = np.rad2deg(0.5 * np.arctan2(np.hypot(columns[1], columns[2]), columns[0]))
    delta, share = np.rad2deg(np.arctan2(columns[2], columns[1])), 1 - polarised**2
    note = "N, C, S converted to psi and delta"
    if np.max(np.abs(share)) < _ROUNDED:
        return Angles(psi, delta, note)
    return Angles(psi, delta, f"{note}, and 1 - N² - C² - S² read as the depolarisation", share)


def _from_alpha_beta(
    alpha_beta: Float[np.ndarray, "2 points"], analyser: Float[np.ndarray, " points"], place: Where
) -> Angles:
    """Convert α, β of a rotating analyser; Δ is in 0 to 180, since only cos Δ is measured.

    `analyser` is the angle of the fixed polariser from the plane of incidence. tan Ψ = tan A
    √((1 + α)/(1 − α)) and cos Δ = β/√(1 − α²), the inverse of `optics.ellipsometry.alpha_beta`. Where
    noise takes β beyond √(1 − α²), Δ is 0 or 180. Raises DataError for a contrast above 1.
    """
    alpha, beta = alpha_beta
    contrast = np.hypot(alpha, beta)
    wrong = (contrast > POLARISED[1]) | (np.abs(alpha) > 1)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise DataError(
            f"{place(row)}: alpha {alpha[row]:g} and beta {beta[row]:g} make a contrast of "
            f"{contrast[row]:.3g}, where at most 1 is possible; {REMEDY}"
        )
    psi = np.rad2deg(np.arctan2(np.tan(np.deg2rad(analyser)) * np.sqrt(1 + alpha), np.sqrt(1 - alpha)))
    delta = np.rad2deg(np.arctan2(np.sqrt(np.maximum(1 - contrast**2, 0.0)), beta))
    over = int(np.sum(contrast > 1))
    limited = f"; delta is 0 or 180 at {over} points whose contrast is above 1" if over else ""
    return Angles(psi, delta, f"alpha and beta converted to psi and delta{limited}")


def _from_tan_cos(tan_cos: Float[np.ndarray, "2 points"], places: Sequence[Where]) -> Angles:
    """Convert tan Ψ and cos Δ; Δ is in 0 to 180. Where noise takes cos Δ beyond 1, Δ is 0 or 180.

    Raises DataError for a tangent below 0, or a cosine beyond ±1.05.
    """
    tangent, cosine = tan_cos
    refuse_first(tangent, tangent < 0, places[0], f"is no tan(psi), below zero; {REMEDY}")
    reason = f"is no cos(delta), beyond 1; {REMEDY}, or name the columns psi_deg and delta_deg"
    refuse_first(cosine, np.abs(cosine) > HIGHEST_COSINE, places[1], reason)
    over = int(np.sum(np.abs(cosine) > 1))
    limited = f"; delta is 0 or 180 at {over} points whose cosine is above 1" if over else ""
    delta = np.rad2deg(np.arccos(np.clip(cosine, -1, 1)))
    return Angles(np.rad2deg(np.arctan(tangent)), delta, f"tan(psi) and cos(delta) converted{limited}")


def _check(rows: Rows, chosen: Selection, form: tuple[str, ...], folded: bool) -> None:
    """Refuse Ψ, Δ, depolarisation and errors outside their limits, and radians. Raises DataError."""
    psi, delta = rows.columns["values"], rows.columns["delta"]
    named = chosen.values if form == PSI_DELTA else (chosen.axis.wavelength,) * 2
    at_psi, at_delta = map(rows.places, named)
    check_psi_delta(psi, delta, folded, at_psi, at_delta, REMEDY)
    rows.check_errors(dict(zip(("sigma", "delta_sigma"), chosen.errors * 2, strict=False)))
    path = rows.table.path
    unnamed = not any(column.name for column in chosen.values)
    if unnamed and psi.max() < _METAL_N and delta.min() >= 0 and delta.max() < _METAL_K:
        raise DataError(
            f"{path}: has no header, and its values up to {psi.max():g} and {delta.max():g} may be n "
            "and k; give optical constants as `layer` or `substrate`, or say that they are angles with "
            '`columns=["wavelength", "psi_deg", "delta_deg"]`'
        )
    stated = any(column.unit == "deg" for column in chosen.values) or form != PSI_DELTA
    if not stated and psi.max() < np.pi / 2 and np.abs(delta).max() < 2 * np.pi:
        raise DataError(
            f"{path}: psi is at most {psi.max():g} and delta {np.abs(delta).max():g}, "
            "which look like radians, or tan(psi) and cos(delta); write degrees and name the columns psi_deg "
            "and delta_deg, or name them tan_psi and cos_delta"
        )
    shares = {column.role: column for column in chosen.others if column.role in _SHARES}
    if shares:
        share, error = shares[_SHARES[0]], shares.get(_SHARES[1])
        percent = "if it is in percent, name the column `depolarisation (%)`"
        remedy = REMEDY if share.unit == "percent" else percent
        check_depolarisation(rows.columns["depolarisation"], rows.places(share), remedy)
        rows.check_errors({"depolarisation_sigma": error} if error else {})
