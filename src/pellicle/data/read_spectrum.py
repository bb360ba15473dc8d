"""Reading of spectra: reflectance, transmittance, or Ψ and Δ against wavelength."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import partial
from logging import getLogger

import numpy as np

from pellicle.data.formats.detect import find_export
from pellicle.data.read_ellipsometry import SIGNAL, is_ellipsometry, read_ellipsometry
from pellicle.data.repeated_sweeps import of_rows, sweep_numbers
from pellicle.data.signal_checks import check_noise, check_power, refuse_first
from pellicle.data.spectrum import POLARISATIONS, Spectrum, inside_range
from pellicle.data.tabular.column_selection import SIGNALS, SpectrumColumns, named_columns, spectrum_columns
from pellicle.data.tabular.signal_scale import Scale, signal_scale
from pellicle.data.tabular.table import Table, read_table
from pellicle.data.tabular.wavelength_axis import axis_note, axis_unit, read_columns
from pellicle.errors import DataError, UsageError

log = getLogger(__name__)


def read_spectrum(
    path: str | os.PathLike[str],
    *,
    signal: str | None = None,
    columns: str | Sequence[str] | None = None,
    wavelength_unit: str | None = None,
    signal_unit: str | None = None,
    range: tuple[float | int, float | int] | None = None,
    noise: float | int | None = None,
    polarisation: str | None = None,
    calibrated: bool | None = None,
    folded: bool = False,
    analyser: float | int | None = None,
    spot: int | None = None,
) -> Spectrum:
    """Read reflectance, transmittance or ellipsometry from a text file: CSV, or an instrument's export.

    **Arguments:**

    - `path` of the file.
    - `signal`: "R", "T" or "psi-delta"; needed without a header, for an `intensity` column, or where the file
      has several signals.
    - `columns`: names in the order of the file's columns, "_" to skip one; overrides the header.
    - `wavelength_unit`: "nm", "um", "A", "eV" or "cm-1", where the file does not state it (else nm).
    - `signal_unit`: "fraction" or "percent", where the file does not state it.
    - `range`: wavelengths to keep, (low, high) in nm. Values outside it are not checked.
    - `noise`: standard deviation of every point as a fraction, or of Ψ and Δ in degrees; replaces the file's.
    - `polarisation`: "s", "p" or "unpolarised", where the column's name does not state it.
    - `calibrated`: False lifts the limits on the values; by default for an `intensity` column only.
    - `folded`: Δ lies in 0 to 180, as from an instrument without a compensator; its sign is not fitted.
    - `analyser`: for columns α and β, the angle of the fixed polariser in degrees.
    - `spot`: number of the spot, from 1 in the order of the file, for an Accurion file of several spots.

    **Returns:** a `Spectrum`; of several complete sweeps over the same wavelengths, their mean.

    **Raises:** DataError (unreadable or impossible data) or UsageError (an argument missing or wrong): one
    sentence with file, line and remedy.
    """
    for name, value, known in (
        ("signal", signal, (*SIGNALS, SIGNAL)),
        ("polarisation", polarisation, POLARISATIONS),
    ):
        if value is not None and value not in known:
            raise UsageError(f"`{name}` must be one of {', '.join(known)}, not {value!r}")
    check_noise(noise)
    table = read_table(path, partial(find_export, spot=spot))
    if is_ellipsometry(table, named_columns(table, columns), signal):
        if signal_unit is not None:
            raise UsageError(f"{table.path}: psi and delta are in degrees; leave `signal_unit` out")
        if polarisation in ("s", "p"):
            raise UsageError(f"{table.path}: psi and delta compare p with s light; leave `polarisation` out")
        spectrum = read_ellipsometry(table, columns, wavelength_unit, noise, range, folded, analyser)
    else:
        if folded or analyser is not None:
            name = "folded" if folded else "analyser"
            raise UsageError(
                f"{table.path}: `{name}` is for ellipsometry, and the file has none; leave it out"
            )
        chosen = spectrum_columns(table, columns, signal, polarisation)
        axis = axis_unit(table, chosen.wavelength, wavelength_unit)
        scale = signal_scale(table, chosen, signal_unit)
        if calibrated is None:
            calibrated = chosen.signal.role != "intensity"
        spectrum = _power(table, chosen, axis, scale, signal, range, noise, polarisation, calibrated)
    log.info(
        "%s: %d rows used: %s from %g to %g nm, values from %.4g to %.4g",
        spectrum.path,
        len(spectrum),
        spectrum.signal,
        spectrum.wavelength.min(),
        spectrum.wavelength.max(),
        spectrum.values.min(),
        spectrum.values.max(),
    )
    return spectrum


def _power(
    table: Table,
    columns: SpectrumColumns,
    axis: str | None,
    scale: Scale,
    signal: str | None,
    range: tuple[float, float] | None,
    noise: float | None,
    polarisation: str | None,
    calibrated: bool,
) -> Spectrum:
    """Reflectance or transmittance of a table, cut to `range` before its values are checked."""
    wavelength, values, sigma, angle = read_columns(table, columns, axis)
    values, sigma = values / scale.signal, None if sigma is None else sigma / scale.sigma
    notes = [*table.notes, *columns.notes, axis_note(axis), scale.note(calibrated)]
    if noise is not None:
        notes += [] if sigma is None else ["the given noise replaces the column of standard deviations"]
        sigma = np.full(values.shape, float(noise))
    rows = np.arange(values.size)
    if range is not None:
        inside, note = inside_range(wavelength, range, table.path)
        rows, notes = rows[inside], [*notes, note]
    kind = signal or columns.signal.role
    values, sigma = values[rows], None if sigma is None else sigma[rows]
    _check_power(table, columns, kind, rows, values, sigma, calibrated, scale.stated)
    angle = None if angle is None else angle[rows]
    arrays = {"wavelength": wavelength[rows], "values": values, "sigma": sigma, "angle": angle}
    return of_rows(
        sweep_numbers(arrays["wavelength"], angle),
        arrays | {"lines": table.lines[rows]},
        signal=kind,
        polarisation=columns.signal.polarisation or polarisation or "unpolarised",
        calibrated=calibrated,
        path=table.path,
        sha256=table.sha256,
        notes=tuple(notes),
    )


def _check_power(
    table: Table,
    columns: SpectrumColumns,
    signal: str,
    rows: np.ndarray,
    values: np.ndarray,
    sigma: np.ndarray | None,
    calibrated: bool,
    unit_stated: bool,
) -> None:
    """Check σ and the values of these rows, naming line and column. Raises DataError."""
    if sigma is not None and columns.sigma is not None:
        at = table.places(columns.sigma.position, rows)
        refuse_first(sigma, sigma <= 0, at, "is not above zero; correct or delete that row")
    position = columns.signal.position
    if not calibrated:
        if values.max() <= 0:
            raise DataError(f"{table.path}: {table.label(position)} is nowhere positive; check what it holds")
        return
    remedy = "leave it out with `range`, or correct that row"
    too_high = 'if the file is in percent, say so with `signal_unit="percent"` or in its header'
    where = table.places(position, rows)
    check_power(signal, values, sigma, where, too_high=remedy if unit_stated else too_high, remedy=remedy)
