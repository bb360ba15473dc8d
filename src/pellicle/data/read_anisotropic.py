"""Reading of signals of anisotropic samples from a table: Mueller elements, and generalised Ψ and Δ."""

from collections.abc import Sequence

import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.data.spectrum_rows import NOISE_REPLACES, REMEDY, Reading, Rows
from pellicle.data.tabular.column_selection import Selection, error_columns, only, select, without_header
from pellicle.data.tabular.columns import MUELLER, Column, listed
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError
from pellicle.signals.generalised import RATIOS, Generalised, delta_sigma
from pellicle.signals.limits import check_psi_delta, refuse_first
from pellicle.signals.mueller import ELEMENTS, HIGHEST, Mueller, check_element, sign_notes

_ELEMENTS = '`columns=["wavelength", "angle", "m12", "m33", "m34"]`'
_RATIOS = '`columns=["wavelength", "angle", "psi_ane", "delta_ane", "psi_aps", "delta_aps"]`'
_SOME = "standard deviations of some of the {} only ({{}}); add the others, or skip these"
_NORMALISED = 1e-3
"""Deviation of m11 from 1 by rounding."""


def mueller_columns(
    table: Table, columns: Sequence[Column] | None, elements: Sequence[str] | None = None
) -> Selection:
    """Choose the columns of elements, all or those named. Raises DataError or UsageError."""
    if columns is None:
        raise without_header(table, _ELEMENTS)
    present = {role: column for role in MUELLER if (column := only(table, columns, role))}
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
    for column in values:
        if column.unknown_unit or column.unit:
            raise DataError(
                f"{table.path}: {table.label(column.position)} is in "
                f"{column.unknown_unit or column.unit!r}; write elements as fractions of m11, without a unit"
            )
    errors = error_columns(table, columns, values, _SOME.format("elements"))
    one = any(column.role == "sigma" for column in errors)
    meaning = "the standard deviation of each" if one else "their standard deviations"
    notes, m11 = [f"{listed(errors)} read as {meaning}"] if errors else [], present.get("m11")
    signal, noun = Mueller.word, Mueller.noun
    return select(table, columns, signal, values, noun, _ELEMENTS, errors=errors, others=[m11], notes=notes)


def generalised_columns(
    table: Table, columns: Sequence[Column] | None, ratios: Sequence[str] | None = None
) -> Selection:
    """Choose the columns of the ratios, all or those named. Raises DataError or UsageError."""
    if columns is None:
        raise without_header(table, _RATIOS)
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
            f"{listed(columns)}; name the columns in order, as in {_RATIOS}"
        )
    values = [column for name, pair in pairs.items() if ratios is None or name in ratios for column in pair]
    for column in values:
        if column.unknown_unit:
            raise DataError(
                f"{table.path}: {table.label(column.position)} is in {column.unknown_unit!r}; write psi and "
                "delta in degrees"
            )
    errors = error_columns(table, columns, values, _SOME.format("columns"))
    notes = [f"{listed(errors)} read as their standard deviations"] if errors else []
    signal, noun = Generalised.word, Generalised.noun
    return select(table, columns, signal, values, noun, _RATIOS, errors=errors, notes=notes)


def read_anisotropic(table: Table, chosen: Selection, asked: Reading) -> Spectrum:
    """Read the chosen elements or ratios. Raises DataError or UsageError."""
    rows = Rows.read(table, chosen, asked.wavelength_unit).cut(asked.range)
    notes = [NOISE_REPLACES] if chosen.errors and asked.noise is not None else []
    if asked.noise is None:
        rows.check_errors({column.role: column for column in chosen.errors})
    read = _mueller if chosen.signal == Mueller.word else _generalised
    return read(rows, chosen, asked.noise, notes)


def _mueller(rows: Rows, chosen: Selection, noise: float | None, notes: list[str]) -> Spectrum:
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


def _generalised(rows: Rows, chosen: Selection, noise: float | None, notes: list[str]) -> Spectrum:
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
