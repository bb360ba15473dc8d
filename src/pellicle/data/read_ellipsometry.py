"""Ψ and Δ of a table: their columns, their units and whether they can be what they say.

Both are in degrees, with tan Ψ exp(iΔ) = conj(r_p / r_s) for n + ik: Δ is near 180 for bare silicon
at small angles, as instruments write it. N = cos 2Ψ, C = sin 2Ψ cos Δ, S = sin 2Ψ sin Δ say the same;
α and β of a rotating analyser say all but the sign of S, as does a Δ that is folded into 0 to 180.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pellicle.data.ellipsometry_angles import ALPHA_BETA, FORMS, NCS, PSI_DELTA, from_alpha_beta, from_ncs
from pellicle.data.spectrum import Spectrum
from pellicle.data.tabular.column_selection import listed, named_columns, only, wavelength_and_angle
from pellicle.data.tabular.columns import Column
from pellicle.data.tabular.table import Table
from pellicle.data.tabular.wavelength_axis import axis_note, axis_unit, read_axis
from pellicle.errors import DataError, UsageError

SIGNAL = "psi-delta"
PSI = (0.0, 90.0)
DELTA = (-180.0, 360.0)
"""Degrees: -180 to 180, -90 to 270 and 0 to 360 are all in use."""
FOLDED = (0.0, 180.0)
"""Degrees: what an instrument without a compensator, which sees cos Δ only, can tell."""


@dataclass(frozen=True)
class Chosen:
    """The columns to read: those of one form; the errors of Ψ and Δ, or none; what was decided."""

    wavelength: Column
    angle: Column | None
    form: tuple[str, ...]
    values: tuple[Column, ...]
    analyser: Column | None
    errors: tuple[Column, ...]
    notes: tuple[str, ...]


def is_ellipsometry(table: Table, columns: Sequence[Column] | None, signal: str | None) -> bool:
    """True if Ψ and Δ are to be read, in any form. Raises UsageError where there is a reflectance too."""
    roles = {column.role for column in columns or ()}
    there = bool(roles & set(PSI_DELTA)) or any(roles.issuperset(form) for form in FORMS)
    if signal is not None or not there:
        return signal == SIGNAL
    others = sorted(roles & {"R", "T", "intensity"})
    if others:
        raise UsageError(
            f"{table.path}: holds psi and delta as well as {', '.join(others)}; "
            "say which to read with --signal"
        )
    return True


def read_ellipsometry(
    table: Table,
    spec: str | Sequence[str] | None,
    wavelength_unit: str | None,
    noise: float | None,
    range: tuple[float, float] | None,
    folded: bool = False,
    analyser: float | None = None,
) -> Spectrum:
    """The Ψ and Δ of a table as a `Spectrum`, Δ in 0 to 360. Raises DataError or UsageError."""
    chosen = _chosen(table, named_columns(table, spec))
    _check_form(table, chosen, folded, analyser)
    unit = axis_unit(table, chosen.wavelength, wavelength_unit)
    columns = (*chosen.values, *([chosen.analyser] if chosen.analyser else []), *chosen.errors)
    wavelength, angle, read = read_axis(table, chosen.wavelength, chosen.angle, columns, unit)
    psi, delta, *said = _turned(table, chosen, read, analyser)
    errors = read[len(columns) - len(chosen.errors) :]
    errors = errors if noise is None else [np.full(psi.size, float(noise))] * 2
    if noise is not None and chosen.errors:
        said.append("the columns of errors give way to --noise")
    folded = folded or chosen.form == ALPHA_BETA
    if folded:
        said.append("delta is known in 0 to 180 only: cos(delta) is fitted")
    spectrum = Spectrum(
        wavelength,
        psi,
        SIGNAL,
        sigma=errors[0] if errors else None,
        angle=angle,
        path=table.path,
        sha256=table.sha256,
        notes=(*table.notes, *chosen.notes, axis_note(unit), *said, "psi and delta in degrees"),
        lines=table.lines,
        delta=delta,
        delta_sigma=errors[-1] if errors else None,
        folded=folded,
    )
    if range is not None:
        spectrum = spectrum.cut(*range)
    _check(spectrum, table, chosen)
    assert spectrum.delta is not None
    return dataclasses.replace(spectrum, delta=spectrum.delta % 360.0)


def _check_form(table: Table, chosen: Chosen, folded: bool, analyser: float | None) -> None:
    """Refuses what does not go with the columns. UsageError."""
    if folded and chosen.form == NCS:
        raise UsageError(f"{table.path}: N, C and S hold the sign of delta; leave --folded out")
    if chosen.form != ALPHA_BETA:
        if analyser is not None:
            raise UsageError(f"{table.path}: --analyser goes with columns alpha and beta; leave it out")
    elif (analyser is None) == (chosen.analyser is None):
        wanted = (
            "need the analyser's angle: add --analyser 45, say, analyser = 45 under [data] in a recipe, or"
        )
        surplus = "come with a column of analyser angles; leave --analyser out, or skip"
        raise UsageError(
            f"{table.path}: alpha and beta {wanted if analyser is None else surplus} a column analyser_deg"
        )
    elif analyser is not None and not 0 < analyser < 90:
        raise UsageError(f"--analyser must lie between 0 and 90 degrees, got {analyser:g}")


def _turned(
    table: Table, chosen: Chosen, read: Sequence[np.ndarray], analyser: float | None
) -> tuple[np.ndarray, np.ndarray, *tuple[str, ...]]:
    """Ψ and Δ in degrees of the columns that were read, and what was done to them."""
    position = chosen.values[0].position
    if chosen.form == NCS:
        return from_ncs(table, position, np.array(read[:3]))
    if chosen.form == PSI_DELTA:
        return read[0], read[1]
    angles = read[2] if chosen.analyser else np.full(read[0].size, analyser)
    wrong = (angles <= 0) | (angles >= 90)
    if chosen.analyser and wrong.any():
        row = int(np.argmax(wrong))
        raise DataError(
            f"{table.where(row, chosen.analyser.position)}: {angles[row]:g} is not between 0 and 90 degrees; "
            "correct or delete that row"
        )
    return from_alpha_beta(table, position, np.array(read[:2]), angles)


def _chosen(table: Table, columns: Sequence[Column] | None) -> Chosen:
    if columns is None:
        return _by_position(table)
    roles = {column.role for column in columns}
    form = next((form for form in FORMS if roles & set(form)), PSI_DELTA)
    found = tuple(column for role in form if (column := only(table, columns, role)) is not None)
    if len(found) != len(form):
        raise DataError(
            f"{table.path}: psi and delta, or N, C and S, or alpha and beta, are not all among "
            f"{listed(columns)}; name the columns in order with --columns, e.g. --columns "
            "wavelength,angle,psi,delta"
        )
    for column in found:
        if column.unknown_unit or column.unit == "percent":
            raise DataError(
                f"{table.path}: {table.label(column.position)} is in {column.unknown_unit or '%'!r}; write "
                "psi and delta in degrees, the others without a unit"
            )
    wavelength, angle = wavelength_and_angle(table, columns, "wavelength,angle,psi,delta")
    errors = _errors(table, columns) if form == PSI_DELTA else ()
    analyser = only(table, columns, "analyser") if form == ALPHA_BETA else None
    read = [wavelength, *found, *errors, *([angle] if angle else []), *([analyser] if analyser else [])]
    ignored = [c for c in columns if c not in read and c.name not in ("_", "")]
    said = [f"{listed([wavelength])} read as the wavelength, {listed(found)} as {', '.join(form)}"]
    said += [f"{listed(errors)} read as the standard deviation of psi and delta"] if errors else []
    said += [f"{listed([angle])} read as the angle of incidence in degrees"] if angle else []
    said += [f"ignored: {listed(ignored)}"] if ignored else []
    return Chosen(wavelength, angle, form, found, analyser, errors, tuple(said))


def _by_position(table: Table) -> Chosen:
    if table.layout.width != 3:
        raise UsageError(
            f"{table.path}: has {table.layout.width} columns and no header; say which are psi and delta with "
            "--columns, e.g. --columns wavelength,angle,psi,delta"
        )
    wavelength, psi, delta = (Column(i, "", role) for i, role in enumerate(("wavelength", "psi", "delta")))
    note = "no header: column 1 read as the wavelength, column 2 as psi, column 3 as delta"
    return Chosen(wavelength, None, PSI_DELTA, (psi, delta), None, (), (note,))


def _errors(table: Table, columns: Sequence[Column]) -> tuple[Column, ...]:
    """The errors of Ψ and Δ, or one `sigma` for both; either both or none."""
    psi, delta = only(table, columns, "sigma_psi"), only(table, columns, "sigma_delta")
    both = only(table, columns, "sigma")
    if psi and delta:
        return psi, delta
    if psi or delta:
        raise DataError(
            f"{table.path}: gives the standard deviation of only one of psi and delta; add the other, or "
            "leave it out with _ in --columns"
        )
    return (both,) if both else ()


def _check(spectrum: Spectrum, table: Table, chosen: Chosen) -> None:
    """Refuses Ψ and Δ out of range, errors that are none, and what looks like radians. DataError."""
    delta = spectrum.delta
    assert delta is not None
    named = chosen.values if chosen.form == PSI_DELTA else (chosen.wavelength,) * 2
    limits, of_delta = (
        (PSI, FOLDED if spectrum.folded else DELTA),
        "a folded delta" if spectrum.folded else "delta",
    )
    for column, values, (low, high), name in zip(
        named, (spectrum.values, delta), limits, ("psi", of_delta), strict=True
    ):
        why = f"is not from {low:g} to {high:g} degrees, as {name} is; correct or delete that row"
        _refuse(spectrum, table, column, values, (values < low) | (values > high), why)
    errors = (spectrum.sigma, spectrum.delta_sigma)
    for column, values in zip((chosen.errors * 2)[:2], errors, strict=False):
        if values is not None:
            why = "is a standard deviation not above zero; correct or delete that row"
            _refuse(spectrum, table, column, values, values <= 0, why)
    stated = any(column.unit == "deg" for column in chosen.values) or chosen.form != PSI_DELTA
    if not stated and spectrum.values.max() < np.pi / 2 and np.abs(delta).max() < 2 * np.pi:
        raise DataError(
            f"{spectrum.path}: psi is at most {spectrum.values.max():g} and delta {np.abs(delta).max():g}, "
            "which look like radians, or tan(psi) and cos(delta); write degrees, and name the columns "
            "psi_deg and delta_deg"
        )


def _refuse(
    spectrum: Spectrum, table: Table, column: Column, values: np.ndarray, wrong: np.ndarray, why: str
) -> None:
    if wrong.any():
        row = int(np.argmax(wrong))
        line = "" if spectrum.lines is None else f"line {spectrum.lines[row]}, "
        raise DataError(f"{spectrum.path}: {line}{table.label(column.position)}: {values[row]:g} {why}")
