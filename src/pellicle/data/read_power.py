"""Reading of reflectance, transmittance and counts from a table: their columns, units and checks."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pellicle.data.detector_overlap import detectors, joined
from pellicle.data.noisy_edges import noisy_edges, readable_range
from pellicle.data.repeated_sweeps import one_way
from pellicle.data.signal_scale import check_percent, signal_scale
from pellicle.data.spectrum import Spectrum
from pellicle.data.spectrum_rows import Reading, Rows, axis_unit
from pellicle.data.tabular import column_selection as selection
from pellicle.data.tabular.columns import (
    COUNTERS,
    COUNTS,
    MUELLER,
    RATIO_COLUMNS,
    SIGNALS,
    Column,
    listed,
)
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError
from pellicle.signals.limits import refuse_first
from pellicle.signals.one_column import OneColumn
from pellicle.signals.registry import KINDS

_EITHER_SIGNAL = '`signal="R"` or `signal="T"`'
_EXAMPLE = '`columns=["wavelength", "R"]`'
_SEVERAL_COLUMNS = {
    "psi and delta": ("psi", "delta"),
    "elements of a Mueller matrix": MUELLER,
    "generalised psi and delta": RATIO_COLUMNS,
}
"""Roles of the signals that have several columns."""


def power_columns(
    table: Table, columns: str | Sequence[str] | None, signal: str | None, polarisation: str | None
) -> list[selection.Selection]:
    """Find the reflectances and transmittances of a table; arguments as in `read_spectra`.

    Several are returned where the arguments do not tell them apart. Raises UsageError or DataError where
    there is none, with the argument that settles it.
    """
    named = selection.named_columns(table, columns)
    if named is None:
        if signal is None:
            raise UsageError(f"{table.path}: {_ask_without_header(table.width)}")
        return [by_position(table, signal)]
    chosen = _signals(table, named, signal, polarisation, by_caller=columns is not None)
    if [column.role for column in chosen] != ["sample counts"]:
        return [beside_wavelength(table, named, column) for column in chosen]
    # the transmittance that counts of a sample, a reference and possibly the dark make
    of_sample = beside_wavelength(table, named, chosen[0])
    reference, dark = (
        selection.only(table, named, "reference counts"),
        selection.only(table, named, "dark counts"),
    )
    assert reference is not None
    formula = "(sample - dark) / (reference - dark)" if dark else "sample / reference"
    notes = (*of_sample.notes, f"transmittance computed from counts: {formula}")
    values = (replace(chosen[0], role="T", unit="fraction", unknown_unit=None),)
    others = (reference, dark) if dark else (reference,)
    return [replace(of_sample, signal="T", values=values, others=others, notes=notes)]


def _ask_without_header(width: int) -> str:
    """Ask what the columns of a table without a header are."""
    names = '`columns=["wavelength", "angle", "psi", "delta"]`'
    if width <= 2:
        return f"has no header, so say what its second column is with {_EITHER_SIGNAL}"
    if width == 3:
        return (
            f"has 3 columns and no header; say what the second is with {_EITHER_SIGNAL} (the third then is "
            f'its error), or that they are psi and delta with `signal="psi-delta"`, or name them: {names}'
        )
    return (
        f"has {width} columns and no header; name them in order, _ to skip one, as in "
        f'`columns=["wavelength", "R_percent", "_"]` or {names}'
    )


def by_position(table: Table, role: str) -> selection.Selection:
    """Select the columns of a table without a header: wavelength, signal, sigma. Raises UsageError."""
    width = table.width
    if width > 4:
        raise UsageError(
            f"{table.path}: has {width} columns and no header; name them in order, as in "
            '`columns=["wavelength", "R", "_", "sigma"]`'
        )
    errors = (Column(2, "", "sigma"),) if width > 2 and role != "counts" else ()
    notes = [f"no header: column 1 read as the wavelength, column 2 as {role}"]
    if errors:
        notes.append("column 3 read as sigma, the standard deviation of the signal")
    if width > 3:
        notes.append("column 4 (by custom the error of the wavelength) ignored")
    axis = selection.AxisColumns(selection.first_column(table))
    return selection.Selection(role, axis, (Column(1, "", role),), errors, notes=tuple(notes))


def beside_wavelength(table: Table, columns: Sequence[Column], signal: Column) -> selection.Selection:
    """Select one signal with its sigma. Raises DataError as `select` does."""
    if signal.role in COUNTS:  # the others are not ignored
        columns = [c for c in columns if c.role not in COUNTS or c is signal]
    sigma = selection.only(table, columns, "sigma")
    errors = [sigma] if sigma else []
    notes = [f"{listed(errors)} read as the standard deviation of the signal"] if errors else []
    return selection.select(
        table, columns, signal.role, [signal], "the signal", _EXAMPLE, errors=errors, notes=notes
    )


def _signals(
    table: Table,
    columns: Sequence[Column],
    signal: str | None,
    polarisation: str | None,
    by_caller: bool,
) -> list[Column]:
    """The columns that may be meant. Raises UsageError or DataError where none is."""
    measured = [c for c in columns if c.role in SIGNALS]
    absorbed = [c for c in measured if c.role == "T" and c.unit == "absorbance"]
    if signal == "R" and measured and measured == absorbed and not by_caller:
        known = {"wavelength": "wavelength", "sigma": "sigma", "angle": "angle", "azimuth": "azimuth"}
        renamed = ",".join("log(1/R)" if c is absorbed[0] else known.get(c.role, "_") for c in columns)
        raise UsageError(
            f"{table.path}: {listed(measured)} is an absorbance, read as T = 10^-A, which contradicts "
            '`signal="R"`; leave that out, or if it is log(1/R), say so with '
            f'`columns="{renamed}"`'
        )
    measured = [c for c in measured if signal in (None, c.role)]
    if not measured:
        return _unnamed_signals(table, columns, signal)
    wanted = [c for c in measured if polarisation and (c.polarisation or "unpolarised") == polarisation]
    measured = wanted or measured
    stated = {c.polarisation for c in measured}
    if polarisation and None not in stated and len(stated) == 1 and stated != {polarisation}:
        raise UsageError(
            f"{table.path}: {listed(measured)} is measured in {measured[0].polarisation} light, which "
            f'contradicts `polarisation="{polarisation}"`; leave that out'
        )
    return measured


def _unnamed_signals(table: Table, columns: Sequence[Column], signal: str | None) -> list[Column]:
    """An intensity, or columns whose names state no quantity, where the caller states it."""
    intensity = selection.only(table, columns, "intensity")
    if intensity and signal is None:
        raise UsageError(
            f"{table.path}: {listed([intensity])} is uncalibrated; state the signal with {_EITHER_SIGNAL}"
        )
    if intensity:
        return [intensity]
    roles = {c.role for c in columns}
    if other := next((role for role in SIGNALS if role in roles), None):
        raise UsageError(f'{table.path}: has {other}, which contradicts `signal="{signal}"`; correct that')
    for name, known in _SEVERAL_COLUMNS.items():
        if roles & set(known):
            raise UsageError(
                f'{table.path}: has {name}, which contradicts `signal="{signal}"`; leave that out'
            )
    named = [c for c in columns if c.name not in ("_", "")]
    processed = [c for c in named if c.role == "processed"]
    free = [c for c in named if c.role in ("other", "value")]
    foreign = [c for c in columns if c.role in ("foreign", "counts", *COUNTS)]
    counters = [] if foreign else free
    unnamed = processed or [c for c in free if c.name.strip().lower() not in COUNTERS] or counters
    angles = [c for c in unnamed if c.name.strip().lower().startswith(("psi", "delta", "ψ", "δ"))]
    if len(angles) > 1:
        raise DataError(
            f"{table.path}: {listed(angles)} may be psi and delta at several angles; choose two with "
            '`columns=["wavelength", "psi", "delta", "_"]` and `angle=70`, or write them below each other '
            "with a column angle_deg"
        )
    if signal is not None and unnamed and "wavelength" in roles:
        return [replace(c, role=signal) for c in unnamed]
    sample = selection.only(table, columns, "sample counts")
    if sample and "reference counts" in roles and signal == "T":
        return [sample]
    if sample and "reference counts" in roles and not processed:
        raise UsageError(
            f'{table.path}: has counts of a sample and a reference; `signal="T"` takes their quotient, and a '
            'reflectance needs the material of the reference as well, as in `reference_material="Si"`'
        )
    raise _no_signal(table, columns, unnamed if "wavelength" in roles else [], foreign)


def _no_signal(
    table: Table, columns: Sequence[Column], unnamed: Sequence[Column], foreign: Sequence[Column]
) -> DataError | UsageError:
    """The error of a table whose columns name no signal: `unnamed` may be one, `foreign` are none."""
    if unnamed:
        percent = any(column.unit == "percent" for column in unnamed)
        unit = "" if percent else ' (unit: `signal_unit="percent"`, ...)'
        states = "states" if len(unnamed) == 1 else "state"
        return UsageError(
            f"{table.path}: {listed(unnamed)} {states} no quantity; state it with {_EITHER_SIGNAL}{unit}"
            ', or name the columns, as in `columns=["wavelength", "R"]`'
        )
    if foreign:
        names, verb = listed(foreign).replace("declared ", ""), "is" if len(foreign) == 1 else "are"
        return DataError(
            f"{table.path}: {names} {verb} neither a reflectance nor a transmittance; export one of these or "
            "psi and delta, give raw counts with `reference`, or if it is one, name it: "
            '`columns=["wavelength", "R"]`'
        )
    return DataError(
        f"{table.path}: no column is a signal (R, T, Rs, Rp, Ts, Tp, absorbance or intensity) among "
        f'{listed(columns)}; name the columns in order, as in `columns=["wavelength", "R"]`'
    )


def read_power(table: Table, chosen: selection.Selection, asked: Reading) -> Spectrum:
    """Read a reflectance or transmittance, cut to the range before its values are checked.

    Raises DataError or UsageError.
    """
    [column], kind, calibrated = chosen.values, asked.signal or chosen.signal, asked.calibrated
    if calibrated is None:
        calibrated = column.role != "intensity"
    declared, named = table.declared.polarisation, column.polarisation
    if declared is not None and not named and asked.polarisation not in (None, declared):
        raise UsageError(
            f"{table.path}: declares {declared} light, which contradicts "
            f'`polarisation="{asked.polarisation}"`; leave that out'
        )
    axis_unit(table, chosen.axis.wavelength, asked.wavelength_unit)  # asked for before that of the signal
    scale = signal_scale(table, chosen, asked.signal_unit)
    rows = read_signal(table, chosen, asked.wavelength_unit, detectors)
    check_percent(table, rows, column, asked.signal_unit)
    columns, notes = scale.fractions(**rows.columns), [scale.note(kind, calibrated)]
    if asked.noise is not None:
        notes += ["the given noise replaces the column of standard deviations"] if chosen.errors else []
        columns["sigma"], note = scale.noise(asked.noise, columns["values"])
        notes += [note] if note else []
    rows = replace(rows, columns=columns, notes=(*rows.notes, *notes))
    overlap = None if rows.axis.setting is not None else detectors(rows.axis.wavelength)
    if overlap is not None:
        rows = joined(rows, *overlap)
    rows = rows.cut(asked.range)
    words: dict[str, Any] = {"signal": kind, "calibrated": calibrated}
    if asked.range is None and not chosen.errors and one_way(rows.axis.wavelength):
        light = None if overlap else _light(table, asked)
        good = noisy_edges(rows.axis.wavelength, rows.columns["values"], light, calibrated=calibrated)
        if good is not None:
            rows, words["left_out"] = rows.taken(good.rows, good.note), good.left_out
    _check(rows, chosen, kind, calibrated, scale.stated)
    words["polarisation"] = named or declared or asked.polarisation or "unpolarised"
    return rows.spectrum((), rows.columns, **words)


def _light(table: Table, asked: Reading) -> np.ndarray | None:
    """Counts of the reference less the dark, None where the file has no such columns."""
    named = selection.named_columns(table, asked.columns) or ()
    counts = [column.position for role in COUNTS[1:] for column in named if column.role == role]
    try:
        reference, dark = table.numbers(counts) if len(counts) == 2 else (None, None)
    except DataError:
        return None
    return None if reference is None else reference - dark


def read_signal(
    table: Table,
    chosen: selection.Selection,
    unit: str | None,
    overlapping: Callable[[np.ndarray], object] = lambda _: False,
) -> Rows:
    """Read `values` and, if there is one, their `sigma`, against an axis in the `unit` that the user gives.

    A quotient of counts is infinite where the reference has none. `overlapping` and errors as of `Rows.read`.
    """
    rows = Rows.read(table, chosen, unit, overlapping)
    values, *sigma = (rows.columns[column.role] for column in (*chosen.values, *chosen.errors))
    if chosen.others:
        reference, background = rows.columns["reference counts"], rows.columns.get("dark counts", 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            quotient = (values - background) / (reference - background)
        values = np.where(reference > background, quotient, np.inf)
    return replace(rows, columns={"values": values} | ({"sigma": sigma[0]} if sigma else {}))


def _check(rows: Rows, chosen: selection.Selection, signal: str, calibrated: bool, unit_stated: bool) -> None:
    """Check σ and the values of these rows, naming line and column. Raises DataError."""
    table, values, sigma = rows.table, rows.columns["values"], rows.columns.get("sigma")
    for column in chosen.errors:
        assert sigma is not None
        if not column.name and np.median(sigma) > np.abs(values).max():
            raise DataError(
                f"{table.path}: has no header, and its third column, by custom the standard deviation, is "
                "larger than the signal; name the columns, or give n and k as `layer` or `substrate`"
            )
        reason = "is not above zero; correct or delete that row"
        refuse_first(sigma, sigma <= 0, rows.places(column), reason)
    [column] = chosen.values
    if not calibrated:
        if values.max() <= 0:
            raise DataError(
                f"{table.path}: {table.label(column.position)} is nowhere positive; check what it holds"
            )
        return
    readable = readable_range(rows.axis.wavelength, values)
    limits = "`range`" if readable is None else "`range=({:g}, {:g})`".format(*readable)
    remedy = f"leave it out with {limits}, or correct that row"
    too_high = (
        'if the file is in percent or an absorbance, say so with `signal_unit="percent"` or '
        '`signal_unit="absorbance"`, or in its header'
        + ("" if readable is None else f"; if it is noise, leave it out with {limits}")
    )
    kind = KINDS[signal]()
    assert isinstance(kind, OneColumn)
    kind.check_values(values, sigma, rows.places(column), remedy if unit_stated else too_high, remedy)
