"""Reading of reflectance and transmittance from a table: their units and checks."""

from dataclasses import replace

import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.data.spectrum_rows import Reading, Rows, read_signal
from pellicle.data.tabular.axis_and_signal import axis_unit, signal_scale
from pellicle.data.tabular.column_selection import SpectrumColumns
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError
from pellicle.signals.limits import refuse_first
from pellicle.signals.one_column import OneColumn
from pellicle.signals.registry import KINDS


def read_power(table: Table, columns: SpectrumColumns, asked: Reading) -> Spectrum:
    """Read a reflectance or transmittance, cut to the range before its values are checked.

    Raises DataError or UsageError.
    """
    kind, calibrated = asked.signal or columns.signal.role, asked.calibrated
    if calibrated is None:
        calibrated = columns.signal.role != "intensity"
    polarisation = _polarisation(table, columns, asked.polarisation)
    axis_unit(table, columns.axis.wavelength, asked.wavelength_unit)  # asked for before that of the signal
    scale = signal_scale(table, columns, asked.signal_unit)
    rows = read_signal(table, columns, asked.wavelength_unit)
    values, sigma = scale.fractions(rows.columns[0], rows.columns[1] if len(rows.columns) > 1 else None)
    notes = [scale.note(kind, calibrated)]
    if asked.noise is not None:
        notes += [] if sigma is None else ["the given noise replaces the column of standard deviations"]
        sigma = np.full(values.shape, float(asked.noise))
    read = (values,) if sigma is None else (values, sigma)
    rows = replace(rows, columns=read, notes=(*rows.notes, *notes)).cut(asked.range)
    values, sigma = rows.columns[0], rows.columns[1] if len(rows.columns) > 1 else None
    _check(rows, columns, kind, values, sigma, calibrated, scale.stated)
    arrays = {"values": values, "sigma": sigma}
    return rows.spectrum((), arrays, signal=kind, polarisation=polarisation, calibrated=calibrated)


def _polarisation(table: Table, columns: SpectrumColumns, asked: str | None) -> str:
    """The polarisation that column, file or caller state. Raises UsageError where they differ."""
    declared, named = table.layout.declared.polarisation, columns.signal.polarisation
    if declared is not None and not named and asked not in (None, declared):
        raise UsageError(
            f'{table.path}: declares {declared} light, which contradicts `polarisation="{asked}"`; leave '
            "that out"
        )
    return named or declared or asked or "unpolarised"


def _check(
    rows: Rows,
    columns: SpectrumColumns,
    signal: str,
    values: np.ndarray,
    sigma: np.ndarray | None,
    calibrated: bool,
    unit_stated: bool,
) -> None:
    """Check σ and the values of these rows, naming line and column. Raises DataError."""
    table = rows.table
    if sigma is not None and columns.sigma is not None:
        if not columns.sigma.name and np.median(sigma) > np.abs(values).max():
            raise DataError(
                f"{table.path}: has no header, and its third column, by custom the standard deviation, is "
                "larger than the signal; name the columns, or give n and k as `layer` or `substrate`"
            )
        where = rows.places(columns.sigma)
        refuse_first(sigma, sigma <= 0, where, "is not above zero; correct or delete that row")
    position = columns.signal.position
    if not calibrated:
        if values.max() <= 0:
            raise DataError(f"{table.path}: {table.label(position)} is nowhere positive; check what it holds")
        return
    remedy = "leave it out with `range`, or correct that row"
    too_high = (
        'if the file is in percent or an absorbance, say so with `signal_unit="percent"` or '
        '`signal_unit="absorbance"`, or in its header'
    )
    where = rows.places(columns.signal)
    kind = KINDS[signal]()
    assert isinstance(kind, OneColumn)
    kind.check_values(values, sigma, where, remedy if unit_stated else too_high, remedy)
