"""Reading of reflectance and transmittance from a table: their units and checks."""

from __future__ import annotations

import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.data.spectrum_rows import Rows
from pellicle.data.tabular.axis_and_signal import axis_note, axis_unit, read_columns, signal_scale
from pellicle.data.tabular.column_selection import SpectrumColumns
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError
from pellicle.signals.limits import refuse_first
from pellicle.signals.one_column import OneColumn
from pellicle.signals.registry import KINDS


def read_power(
    table: Table,
    columns: SpectrumColumns,
    wavelength_unit: str | None,
    signal_unit: str | None,
    signal: str | None,
    range: tuple[float, float] | None,
    noise: float | None,
    polarisation: str | None,
    calibrated: bool,
) -> Spectrum:
    """Read a reflectance or transmittance, cut to `range` before its values are checked.

    Arguments as in `read_spectrum`. Raises DataError or UsageError.
    """
    kind = signal or columns.signal.role
    unit = axis_unit(table, columns.axis.wavelength, wavelength_unit)
    scale = signal_scale(table, columns, signal_unit)
    axis, values, sigma = read_columns(table, columns, unit)
    values, sigma = scale.fractions(values, sigma)
    notes = [axis_note(unit), scale.note(kind, calibrated)]
    if noise is not None:
        notes += [] if sigma is None else ["the given noise replaces the column of standard deviations"]
        sigma = np.full(values.shape, float(noise))
    read = (values,) if sigma is None else (values, sigma)
    rows = Rows(table, np.arange(values.size), axis, read, (*table.notes, *columns.notes, *notes)).cut(range)
    values, sigma = rows.columns[0], rows.columns[1] if len(rows.columns) > 1 else None
    _check(rows, columns, kind, values, sigma, calibrated, scale.stated)
    return rows.spectrum(
        (),
        {"values": values, "sigma": sigma},
        signal=kind,
        polarisation=columns.signal.polarisation or polarisation or "unpolarised",
        calibrated=calibrated,
    )


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
