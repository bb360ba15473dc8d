"""Reading of ellipsometry from a table: Ψ and Δ, also generalised, and Mueller elements, with their checks.

Ψ and Δ are in degrees, with tan Ψ exp(iΔ) = conj(r_p / r_s) for n + ik: Δ is near 180 for bare silicon
at small angles, as instruments write it. N = cos 2Ψ, C = sin 2Ψ cos Δ, S = sin 2Ψ sin Δ are equivalent;
α and β of a rotating analyser, tan Ψ and cos Δ lack only the sign of S, as does a Δ folded into 0 to 180.
A column of depolarisation, 1 − N² − C² − S², is read with them.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pellicle.data.repeated_sweeps import sweep_numbers
from pellicle.data.spectrum import Spectrum
from pellicle.data.spectrum_rows import NOISE_REPLACES, REMEDY, Axis, Reading, Rows
from pellicle.data.tabular import column_selection as selection
from pellicle.data.tabular.columns import MUELLER, Column, listed
from pellicle.data.tabular.table import Table
from pellicle.data.tabular.units import SIGNAL_UNITS
from pellicle.errors import DataError, UsageError
from pellicle.signals.folded_delta import can_be_folded, folding_at, folding_note
from pellicle.signals.generalised import RATIOS, Generalised, delta_sigma
from pellicle.signals.limits import (
    FOLDED_DELTA,
    check_depolarisation,
    check_psi_delta,
    noise_of,
    refuse_first,
)
from pellicle.signals.mueller import ELEMENTS, HIGHEST, Mueller, check_element, sign_notes
from pellicle.signals.registry import KINDS
from pellicle.signals.sphere import Angles, from_alpha_beta, from_ncs, from_tan_cos

SIGNAL = "psi-delta"
PSI_DELTA, NCS = ("psi", "delta"), ("N", "C", "S")
ALPHA_BETA, TAN_COS = ("alpha", "beta"), ("tan_psi", "cos_delta")
FORMS = (PSI_DELTA, NCS, ALPHA_BETA, TAN_COS)
"""The columns of each form; where a file has several, the first is read."""
FOLDED_FORMS = (ALPHA_BETA, TAN_COS)
"""Forms that contain cos Δ only."""
_METAL_N, _METAL_K = 13, 80
"""Largest n and k of common metals up to 12 µm (gold), in tables that look like psi and delta."""
_EXAMPLE = '`columns=["wavelength", "angle", "psi", "delta"]`'
_SOME = "the standard deviation of only one of psi and delta; add the other, or skip it"
_SHARES = ("depolarisation", "sigma_depolarisation")


def ellipsometry_columns(
    table: Table, columns: Sequence[Column] | None, _: Sequence[str] | None = None
) -> selection.Selection:
    """Choose the columns of Ψ and Δ, in any form. Raises DataError or UsageError."""
    if columns is None and table.width == 3:
        named = (Column(1, "", "psi"), Column(2, "", "delta"))
        note = "no header: column 1 read as the wavelength, column 2 as psi, column 3 as delta"
        return selection.Selection(
            SIGNAL, selection.AxisColumns(selection.first_column(table)), named, notes=(note,)
        )
    if columns is None:
        raise selection.without_header(table, _EXAMPLE)
    roles = {column.role for column in columns}
    form = next((form for form in FORMS if roles & set(form)), PSI_DELTA)
    values = [column for role in form if (column := selection.only(table, columns, role)) is not None]
    if len(values) != len(form):
        raise DataError(
            f"{table.path}: psi and delta, N, C and S, alpha and beta, or tan_psi and cos_delta are not all "
            f"among {listed(columns)}; name the columns in order, as in {_EXAMPLE}"
        )
    known = "convert both to degrees" if form == PSI_DELTA else "write plain numbers, as 0.5"
    selection.refuse_units(table, values, known, "percent")
    errors = selection.error_columns(table, columns, values, _SOME) if form == PSI_DELTA else ()
    analyser = selection.only(table, columns, "analyser") if form == ALPHA_BETA else None
    share, error = (selection.only(table, columns, role) for role in _SHARES)
    shares = [column for column in (share, error) if column] if share else []
    notes = [f"{listed(errors)} read as the standard deviation of psi and delta"] if errors else []
    fraction = "write a depolarisation as a fraction, or in percent with % in the column's name"
    selection.refuse_units(table, shares, fraction)
    for column, meaning in zip(shares, ("the depolarisation", "its standard deviation"), strict=False):
        unit = "in percent" if column.unit == "percent" else "a fraction"
        notes.append(f"{column.name!r} read as {meaning}, {unit}")
    others, meaning = [*shares, analyser], ", ".join(form)
    return selection.select(
        table, columns, SIGNAL, values, meaning, _EXAMPLE, errors=errors, others=others, notes=notes
    )


def read_ellipsometry(table: Table, chosen: selection.Selection, asked: Reading) -> Spectrum:
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
        errors = [np.full(psi.size, noise_of("psi and delta", asked.noise))]
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
    table: Table,
    chosen: selection.Selection,
    form: tuple[str, ...],
    folded: bool | None,
    analyser: float | None,
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


def _converted(
    rows: Rows, chosen: selection.Selection, form: tuple[str, ...], analyser: float | None
) -> Angles:
    """Ψ and Δ in degrees from the columns that were read. Raises DataError."""
    read, places = rows.stacked(form).T, [rows.places(column) for column in chosen.values]
    if form == PSI_DELTA:
        return Angles(*read)
    if form == NCS:
        return from_ncs(read, places[0], REMEDY)
    if form == TAN_COS:
        return from_tan_cos(read, places, REMEDY)
    angles = np.full(read[0].size, analyser, dtype=float)
    for column in chosen.others:
        if column.role == "analyser":
            angles, reason = rows.columns["analyser"], f"is not between 0 and 90 degrees; {REMEDY}"
            refuse_first(angles, (angles <= 0) | (angles >= 90), rows.places(column), reason)
    return from_alpha_beta(read, angles, places[0], REMEDY)


def _check(rows: Rows, chosen: selection.Selection, form: tuple[str, ...], folded: bool) -> None:
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


_ELEMENTS = '`columns=["wavelength", "angle", "m12", "m33", "m34"]`'
_RATIOS = '`columns=["wavelength", "angle", "psi_ane", "delta_ane", "psi_aps", "delta_aps"]`'
_SOME_OF = "standard deviations of some of the {} only ({{}}); add the others, or skip these"
_NORMALISED = 1e-3
"""Deviation of m11 from 1 by rounding."""


def mueller_columns(
    table: Table, columns: Sequence[Column] | None, elements: Sequence[str] | None = None
) -> selection.Selection:
    """Choose the columns of elements, all or those named. Raises DataError or UsageError."""
    if columns is None:
        raise selection.without_header(table, _ELEMENTS)
    present = {role: column for role in MUELLER if (column := selection.only(table, columns, role))}
    if elements is not None:
        Mueller(tuple(elements))
        if absent := [name for name in elements if name not in present]:
            have = ", ".join(name for name in ELEMENTS if name in present) or "no elements"
            raise UsageError(f"{table.path}: has no column {', '.join(absent)}; it has {have}")
    values = [present[x] for x in ELEMENTS if x in present and (elements is None or x in elements)]
    if not values:
        raise DataError(
            f"{table.path}: no element of a Mueller matrix (m12 to m44) is among {listed(columns)}; name the "
            f"columns in order, as in {_ELEMENTS}"
        )
    fractions = "write elements as fractions of m11, without a unit"
    selection.refuse_units(table, values, fractions, *SIGNAL_UNITS)
    errors = selection.error_columns(table, columns, values, _SOME_OF.format("elements"))
    one = any(column.role == "sigma" for column in errors)
    meaning = "the standard deviation of each" if one else "their standard deviations"
    notes, m11 = [f"{listed(errors)} read as {meaning}"] if errors else [], present.get("m11")
    signal, noun = Mueller.word, Mueller.noun
    return selection.select(
        table, columns, signal, values, noun, _ELEMENTS, errors=errors, others=[m11], notes=notes
    )


def generalised_columns(
    table: Table, columns: Sequence[Column] | None, ratios: Sequence[str] | None = None
) -> selection.Selection:
    """Choose the columns of the ratios, all or those named. Raises DataError or UsageError."""
    if columns is None:
        raise selection.without_header(table, _RATIOS)
    if ratios is not None:
        Generalised(tuple(ratios))
    pairs: dict[str, tuple[Column, Column]] = {}
    for name in RATIOS:
        psi, delta = (selection.only(table, columns, f"{angle}_{name}") for angle in ("psi", "delta"))
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
            f"{listed(columns)}; name the columns in order, as in {_RATIOS}"
        )
    values = [column for name, pair in pairs.items() if ratios is None or name in ratios for column in pair]
    selection.refuse_units(table, values, "write psi and delta in degrees")
    errors = selection.error_columns(table, columns, values, _SOME_OF.format("columns"))
    notes = [f"{listed(errors)} read as their standard deviations"] if errors else []
    signal, noun = Generalised.word, Generalised.noun
    return selection.select(table, columns, signal, values, noun, _RATIOS, errors=errors, notes=notes)


def read_anisotropic(table: Table, chosen: selection.Selection, asked: Reading) -> Spectrum:
    """Read the chosen elements or ratios. Raises DataError or UsageError."""
    rows = Rows.read(table, chosen, asked.wavelength_unit).cut(asked.range)
    notes = [NOISE_REPLACES] if chosen.errors and asked.noise is not None else []
    if asked.noise is None:
        rows.check_errors({column.role: column for column in chosen.errors})
    read = _mueller if chosen.signal == Mueller.word else _generalised
    noise = None if asked.noise is None else noise_of(KINDS[chosen.signal].noun, asked.noise)
    return read(rows, chosen, noise, notes)


def _mueller(rows: Rows, chosen: selection.Selection, noise: float | None, notes: list[str]) -> Spectrum:
    """Elements over m11, checked, without those that were not measured."""
    elements = tuple(column.role for column in chosen.values)
    values, sigma = rows.stacked(elements), None
    if noise is not None:
        sigma = np.full(values.shape, float(noise))
    elif chosen.errors:
        sigma = np.broadcast_to(rows.stacked([column.role for column in chosen.errors]), values.shape)
    for m11 in chosen.others:
        values, sigma, note = _normalised(rows, m11, values, sigma)
        notes += [note] if note else []
    for i, column in enumerate(chosen.values):
        error = None if sigma is None else sigma[:, i]
        check_element(values[:, i], error, elements[i], rows.places(column), REMEDY)
    constant = np.all((values == values[0]) & np.isin(values, (-1.0, 0.0, 1.0)), axis=0)
    if constant.any() and len(values) > 1:  # programs write exactly 0 or 1 for what was not measured
        left_out = ", ".join(np.array(elements)[constant])
        if constant.all():
            raise DataError(f"{rows.table.path}: {left_out} are constant: nothing was measured")
        notes.append(f"left out as not measured, exactly 0 or 1 at every point: {left_out}")
        elements = tuple(np.array(elements)[~constant].tolist())
        values, sigma = values[:, ~constant], None if sigma is None else sigma[:, ~constant]
    notes += sign_notes(elements, values)
    return rows.spectrum(notes, {"values": values, "sigma": sigma}, signal=chosen.signal, elements=elements)


def _normalised(
    rows: Rows, column: Column, values: np.ndarray, sigma: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray | None, str]:
    """Elements and σ over m11, with a sentence; as they are where m11 is 1, or an intensity beside them."""
    m11 = rows.columns[column.role]
    if np.all(np.abs(m11 - 1) < _NORMALISED):
        return values, sigma, ""
    refuse_first(m11, m11 <= 0, rows.places(column), f"is no m11, which is above zero; {REMEDY}")
    divided = values / m11[:, None]
    if np.max(np.abs(values)) <= HIGHEST and np.max(np.abs(divided)) > HIGHEST:
        return values, sigma, "m11 is an intensity beside normalised elements: ignored"
    return divided, None if sigma is None else sigma / m11[:, None], "elements divided by m11"


def _generalised(rows: Rows, chosen: selection.Selection, noise: float | None, notes: list[str]) -> Spectrum:
    """Ψ and Δ of each ratio. One σ for all, of a column or the noise, is that of Ψ, and Δ has that of
    `generalised.delta_sigma`."""
    roles, errors = ([column.role for column in columns] for columns in (chosen.values, chosen.errors))
    ratios = tuple(role.removeprefix("psi_") for role in roles[::2])
    psi, delta = rows.stacked(roles[::2]), rows.stacked(roles[1::2])
    for i, name in enumerate(ratios):
        at_psi, at_delta = (rows.places(column) for column in chosen.values[2 * i : 2 * i + 2])
        check_psi_delta(psi[:, i], delta[:, i], False, at_psi, at_delta, f"{REMEDY} ({name})")
    of_psi = of_delta = None
    if noise is None and len(errors) > 1:
        of_psi, of_delta = rows.stacked(errors[::2]), rows.stacked(errors[1::2])
    elif noise is not None or errors:
        one = rows.stacked(errors) if noise is None else float(noise)
        of_psi = np.broadcast_to(one, psi.shape)
        of_delta = delta_sigma(psi, of_psi)
    arrays = {"values": psi, "sigma": of_psi, "delta": delta % 360.0, "delta_sigma": of_delta}
    return rows.spectrum(notes, arrays, signal=chosen.signal, ratios=ratios)


COLUMNS = {SIGNAL: ellipsometry_columns, Mueller.word: mueller_columns, Generalised.word: generalised_columns}
"""Choice of the columns of each signal of ellipsometry, by its word."""
READERS = {SIGNAL: read_ellipsometry, Mueller.word: read_anisotropic, Generalised.word: read_anisotropic}
"""Readers of these; other signals are powers."""
