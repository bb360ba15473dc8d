"""Ψ and Δ of a table: their columns, their units and whether they can be what they say.

Both are in degrees, with tan Ψ exp(iΔ) = conj(r_p / r_s) for n + ik: Δ is near 180 for bare silicon
at small angles, as instruments write it. N = cos 2Ψ, C = sin 2Ψ cos Δ, S = sin 2Ψ sin Δ say the same.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pellicle.errors import DataError, UsageError
from pellicle.io.axis import axis_note, axis_unit, read_axis
from pellicle.io.choose import listed, named_columns, only, wavelength_and_angle
from pellicle.io.columns import Column
from pellicle.io.spectrum import Spectrum
from pellicle.io.table import Table

SIGNAL = "psi-delta"
PSI = (0.0, 90.0)
DELTA = (-180.0, 360.0)
"""Degrees: -180 to 180, -90 to 270 and 0 to 360 are all in use."""
POLARISED = (0.5, 1.05)
"""Degrees of polarisation that N, C, S may have: below, noise rules; above, they are something else."""


@dataclass(frozen=True)
class Chosen:
    """The columns to read: Ψ and Δ, or N, C and S; the errors of Ψ and Δ, or none; what was decided."""

    wavelength: Column
    angle: Column | None
    values: tuple[Column, ...]
    errors: tuple[Column, ...]
    notes: tuple[str, ...]


def is_ellipsometry(table: Table, columns: Sequence[Column] | None, signal: str | None) -> bool:
    """True if Ψ and Δ are to be read. Raises UsageError where a reflectance is there as well."""
    roles = {column.role for column in columns or ()}
    there = bool(roles & {"psi", "delta"}) or {"N", "C", "S"} <= roles
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
) -> Spectrum:
    """The Ψ and Δ of a table as a `Spectrum`, Δ in 0 to 360. Raises DataError or UsageError."""
    chosen = _chosen(table, named_columns(table, spec))
    unit = axis_unit(table, chosen.wavelength, wavelength_unit)
    columns = (*chosen.values, *chosen.errors)
    wavelength, angle, read = read_axis(table, chosen.wavelength, chosen.angle, columns, unit)
    count = len(chosen.values)
    psi, delta, said = read[0], read[1], ()
    if count == 3:
        psi, delta, said = _from_ncs(table, chosen.values, np.array(read[:3]))
    errors = read[count:] if noise is None else [np.full(psi.size, float(noise))] * 2
    if noise is not None and chosen.errors:
        said = (*said, "the columns of errors give way to --noise")
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
    )
    if range is not None:
        spectrum = spectrum.cut(*range)
    _check(spectrum, table, chosen)
    assert spectrum.delta is not None
    return dataclasses.replace(spectrum, delta=spectrum.delta % 360.0)


def _chosen(table: Table, columns: Sequence[Column] | None) -> Chosen:
    if columns is None:
        return _by_position(table)
    names, values = ("psi", "delta"), [only(table, columns, role) for role in ("psi", "delta")]
    if values == [None, None]:
        names, values = ("N", "C", "S"), [only(table, columns, role) for role in ("N", "C", "S")]
    found = tuple(column for column in values if column is not None)
    if len(found) != len(names):
        raise DataError(
            f"{table.path}: psi and delta, or N, C and S, are not all among {listed(columns)}; name the "
            "columns in order with --columns, e.g. --columns wavelength,angle,psi,delta"
        )
    for column in found:
        if column.unknown_unit or column.unit == "percent":
            raise DataError(
                f"{table.path}: {table.label(column.position)} is in {column.unknown_unit or '%'!r}; write "
                "psi and delta in degrees, N, C and S without a unit"
            )
    wavelength, angle = wavelength_and_angle(table, columns, "wavelength,angle,psi,delta")
    errors = _errors(table, columns) if len(found) == 2 else ()
    read = [wavelength, *found, *errors, *([angle] if angle else [])]
    ignored = [c for c in columns if c not in read and c.name not in ("_", "")]
    said = [f"{listed([wavelength])} read as the wavelength, {listed(found)} as {', '.join(names)}"]
    said += [f"{listed(errors)} read as the standard deviation of psi and delta"] if errors else []
    said += [f"{listed([angle])} read as the angle of incidence in degrees"] if angle else []
    said += [f"ignored: {listed(ignored)}"] if ignored else []
    return Chosen(wavelength, angle, found, errors, tuple(said))


def _by_position(table: Table) -> Chosen:
    if table.layout.width != 3:
        raise UsageError(
            f"{table.path}: has {table.layout.width} columns and no header; say which are psi and delta with "
            "--columns, e.g. --columns wavelength,angle,psi,delta"
        )
    wavelength, psi, delta = (Column(i, "", role) for i, role in enumerate(("wavelength", "psi", "delta")))
    note = "no header: column 1 read as the wavelength, column 2 as psi, column 3 as delta"
    return Chosen(wavelength, None, (psi, delta), (), (note,))


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


def _from_ncs(
    table: Table, columns: Sequence[Column], ncs: np.ndarray
) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """Ψ and Δ in degrees of N, C, S, whatever their common factor, the degree of polarisation."""
    polarised = np.sqrt(np.sum(ncs**2, axis=0))
    wrong = (polarised < POLARISED[0]) | (polarised > POLARISED[1])
    if wrong.any():
        row = int(np.argmax(wrong))
        raise DataError(
            f"{table.where(row, columns[0].position)}: N, C and S make a degree of polarisation of "
            f"{polarised[row]:.3g}, where about 1 is possible; correct or delete that row"
        )
    psi = np.rad2deg(0.5 * np.arctan2(np.hypot(ncs[1], ncs[2]), ncs[0]))
    span = f"{polarised.min():.4g} to {polarised.max():.4g}"
    note = f"N, C, S turned into psi and delta; their degree of polarisation, {span}, was divided out"
    return psi, np.rad2deg(np.arctan2(ncs[2], ncs[1])), (note,)


def _check(spectrum: Spectrum, table: Table, chosen: Chosen) -> None:
    """Refuses Ψ and Δ out of range, errors that are none, and what looks like radians. DataError."""
    delta = spectrum.delta
    assert delta is not None
    named = chosen.values if len(chosen.values) == 2 else (chosen.wavelength,) * 2
    for column, values, (low, high), name in zip(
        named, (spectrum.values, delta), (PSI, DELTA), ("psi", "delta"), strict=True
    ):
        why = f"is not from {low:g} to {high:g} degrees, as {name} is; correct or delete that row"
        _refuse(spectrum, table, column, values, (values < low) | (values > high), why)
    errors = (spectrum.sigma, spectrum.delta_sigma)
    for column, values in zip((chosen.errors * 2)[:2], errors, strict=False):
        if values is not None:
            why = "is a standard deviation not above zero; correct or delete that row"
            _refuse(spectrum, table, column, values, values <= 0, why)
    stated = any(column.unit == "deg" for column in chosen.values) or len(chosen.values) == 3
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
