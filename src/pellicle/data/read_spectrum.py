"""Reading a measured spectrum: reflectance, transmittance or Ψ and Δ against wavelength."""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Sequence
from functools import partial
from logging import getLogger

import numpy as np

from pellicle.data.formats.detect import find_export
from pellicle.data.read_ellipsometry import SIGNAL, is_ellipsometry, read_ellipsometry
from pellicle.data.signal_checks import check_signal, scale_note, signal_scale
from pellicle.data.spectrum import Spectrum
from pellicle.data.tabular.column_selection import POLARISATIONS, SIGNALS, choose_spectrum, named_columns
from pellicle.data.tabular.table import read_table
from pellicle.data.tabular.wavelength_axis import axis_note, axis_unit, read_columns
from pellicle.errors import UsageError

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
    """Reads a text file of reflectance, transmittance or ellipsometry: CSV, or an instrument's export.

    - `signal`: "R", "T" or "psi-delta"; needed without a header, for an `intensity` column, or if
      several are there.
    - `columns`: names in the order of the file's columns, `_` to skip one; overrides the header.
    - `wavelength_unit`: nm, um, A, eV or cm-1, where the file does not say (nm if nobody does).
    - `signal_unit`: "fraction" or "percent", where the file does not say.
    - `range`: wavelengths in nm to keep. It cuts before values are judged, so noisy ends may go.
    - `noise`: standard deviation of every point as a fraction, or of Ψ and Δ in degrees; replaces the file's.
    - `polarisation`: "s", "p" or "unpolarised", where the column's name does not say.
    - `folded`: Δ is in 0 to 180, as an instrument without a compensator sees it, and its sign is not fitted.
    - `analyser`: of columns α and β the angle of the polariser that stands, in degrees.
    - `spot`: of an Accurion file of several spots, which: counted from 1 as they come in the file.
    - `calibrated`: false lifts the limits on the values; by default only for an `intensity` column.

    Returns a `Spectrum`. Raises DataError (unreadable or impossible data) or UsageError (an
    argument missing or wrong), one sentence with file, line and remedy.
    """
    _check_choice("--signal", signal, (*SIGNALS, SIGNAL))
    _check_choice("--polarisation", polarisation, POLARISATIONS)
    if noise is not None and not (0 < noise < math.inf):
        raise UsageError(f"--noise {noise:g} must be a standard deviation above zero, e.g. --noise 0.005")
    table = read_table(path, partial(find_export, spot=spot))
    if is_ellipsometry(table, named_columns(table, columns), signal):
        _refuse_flags(table.path, signal_unit, polarisation)
        return _told(read_ellipsometry(table, columns, wavelength_unit, noise, range, folded, analyser))
    _refuse_ellipsometry(table.path, folded, analyser)
    chosen = choose_spectrum(table, columns, signal, polarisation)
    axis = axis_unit(table, chosen.wavelength, wavelength_unit)
    scale = signal_scale(table, chosen, signal_unit)
    wavelength, values, sigma, angle = read_columns(table, chosen, axis)
    if calibrated is None:
        calibrated = chosen.signal.role != "intensity"
    spectrum = Spectrum(
        wavelength=wavelength,
        values=values / scale.signal,
        signal=signal or chosen.signal.role,
        sigma=None if sigma is None else sigma / scale.sigma,
        polarisation=chosen.signal.polarisation or polarisation or "unpolarised",
        angle=angle,
        calibrated=calibrated,
        path=table.path,
        sha256=table.sha256,
        notes=(*table.notes, *chosen.notes, axis_note(axis), scale_note(scale, calibrated)),
        lines=table.lines,
    )
    if noise is not None:
        replaced = ("the noise that was given goes before the sigma column",) if sigma is not None else ()
        spectrum = dataclasses.replace(
            spectrum, sigma=np.full(len(spectrum), noise), notes=(*spectrum.notes, *replaced)
        )
    if range is not None:
        spectrum = spectrum.cut(*range)
    check_signal(spectrum, table.label(chosen.signal.position), stated=scale.stated)
    return _told(spectrum)


def _told(spectrum: Spectrum) -> Spectrum:
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


def _check_choice(flag: str, given: str | None, known: Sequence[str]) -> None:
    if given is not None and given not in known:
        raise UsageError(f"{flag} {given!r} is not known; use one of {', '.join(known)}")


def _refuse_ellipsometry(path: str, folded: bool, analyser: float | None) -> None:
    """What has a meaning for Ψ and Δ only."""
    if folded or analyser is not None:
        flag = "--folded" if folded else "--analyser"
        raise UsageError(f"{path}: {flag} is for ellipsometry, and the file holds none; leave it out")


def _refuse_flags(path: str, signal_unit: str | None, polarisation: str | None) -> None:
    """What has no meaning for Ψ and Δ."""
    if signal_unit is not None:
        raise UsageError(f"{path}: psi and delta are in degrees; leave --signal-unit out")
    if polarisation in ("s", "p"):
        raise UsageError(f"{path}: psi and delta compare p with s light; leave --polarisation out")
