"""Reading of spectra: reflectance, transmittance, or Ψ and Δ against wavelength."""

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from logging import INFO, getLogger
from typing import Any

import numpy as np

from pellicle.data.file_spectra import ALL, Candidate, chosen, file_candidates
from pellicle.data.formats.detect import read_tables
from pellicle.data.read_ellipsometry import SIGNAL, EllipsometryColumns, read_ellipsometry
from pellicle.data.read_generalised import GeneralisedColumns, read_generalised
from pellicle.data.read_mueller import MuellerColumns, read_mueller
from pellicle.data.read_power import read_power
from pellicle.data.spectrum import Spectrum
from pellicle.data.spectrum_rows import Reading
from pellicle.data.tabular.column_selection import SpectrumColumns
from pellicle.data.tabular.table import Table
from pellicle.errors import UsageError
from pellicle.signals.generalised import Generalised
from pellicle.signals.mueller import Mueller

log = getLogger(__name__)


def read_spectrum(
    path: str | os.PathLike[str],
    *,
    spectrum: str | None = None,
    signal: str | None = None,
    columns: str | Sequence[str] | None = None,
    wavelength_unit: str | None = None,
    signal_unit: str | None = None,
    range: tuple[float | int, float | int] | None = None,
    noise: float | int | None = None,
    polarisation: str | None = None,
    calibrated: bool | None = None,
    folded: bool | None = None,
    analyser: float | int | None = None,
    spot: int | None = None,
    elements: Sequence[str] | None = None,
    transmission: bool | None = None,
) -> Spectrum:
    """Read reflectance, transmittance or ellipsometry from a file: CSV, or an instrument's export.

    **Arguments:**

    - `path` of the file.
    - `spectrum`: the name of one of several spectra in the file.
    - `signal`: "R", "T", "psi-delta", "mueller", "generalised-psi-delta" or "contrast"; needed where the
      file does not state it, or has several.
    - `columns`: names in the order of the file's columns, "_" to skip one; overrides the header.
    - `wavelength_unit`: "nm", "um", "A", "eV", "cm-1" or "THz", where the file does not state it (else nm).
    - `signal_unit`: "fraction", "percent" or "absorbance" (−log₁₀ of the signal), where the file does not
      state it.
    - `range`: wavelengths to keep, (low, high) in nm. Values outside it are not checked.
    - `noise`: standard deviation of every point as a fraction, or of Ψ and Δ in degrees; replaces the file's.
    - `polarisation`: "s", "p" or "unpolarised", where the column's name does not state it.
    - `calibrated`: False lifts the limits on the values; by default for an `intensity` column only.
    - `folded`: True where Δ lies in 0 to 180, as from an instrument without a compensator; its sign is not
      fitted. None takes it as folded where it turns back at 0 or 180 with a kink, with a note; False as it
      stands.
    - `analyser`: for columns α and β, the angle of the fixed polariser in degrees.
    - `spot`: number of the spot, from 1 in the order of the file, for an Accurion file of several spots.
    - `elements`: names of the elements of a Mueller matrix to read, such as ["m12", "m33"], or ratios of
      generalised Ψ and Δ, such as ["ane", "aps"]; None for all.
    - `transmission`: True where Ψ and Δ are those of transmitted light; None takes it from the file.

    **Returns:** a `Spectrum`; of several complete sweeps over the same wavelengths, their mean.

    **Raises:** DataError (unreadable or impossible data) or UsageError (an argument missing or wrong): one
    sentence with file, line and remedy.
    """
    reading = Reading(
        signal=signal,
        columns=columns,
        wavelength_unit=wavelength_unit,
        signal_unit=signal_unit,
        range=range,
        noise=noise,
        polarisation=polarisation,
        calibrated=calibrated,
        folded=folded,
        analyser=analyser,
        spot=spot,
        elements=elements,
        transmission=transmission,
    )
    if spectrum == ALL:
        raise UsageError(f"{path}: one spectrum is wanted; read all of a file with pl.read_spectra")
    candidates = _find(path, reading)
    [one] = candidates if len(candidates) == 1 else chosen(candidates, spectrum, together=False)
    return _read(one, reading, several=len(candidates) > 1)


def read_spectra(
    path: str | os.PathLike[str], *, spectrum: str | None = None, **reading: Any
) -> list[Spectrum]:
    """Read the spectra of a file that holds several, such as scans side by side or Ψ, Δ, R_p and R_s.

    **Arguments:** as in `read_spectrum`; `spectrum` is the name of one, or "all". None asks for the only one,
    or for those of one measurement: Ψ and Δ with reflectances or transmittances of the same film.

    **Returns:** the spectra in the order of the file, with their `name` where there are several. A joint fit
    takes those of one film.

    **Raises:** as `read_spectrum`.
    """
    options = Reading(**reading)
    candidates = _find(path, options)
    several = len(candidates) > 1
    return [_read(one, options, several) for one in chosen(candidates, spectrum, together=True)]


def _find(path: str | os.PathLike[str], asked: Reading) -> list[Candidate]:
    """The spectra of a file that the arguments may mean."""
    candidates = file_candidates(read_tables(path, asked.spot), asked)
    stated = ("folded", asked.folded), ("analyser", asked.analyser is not None)
    given = [name for name, given in (*stated, ("transmission", asked.transmission)) if given]
    if given and all(one.signal != SIGNAL for one in candidates):
        raise UsageError(f"{path}: `{given[0]}` is for ellipsometry, and the file has none; leave it out")
    kinds = {SIGNAL: "psi and delta are in degrees", Mueller.word: "Mueller elements have no unit"}
    kinds[Generalised.word] = kinds[SIGNAL]
    if all(one.signal in kinds for one in candidates):
        if asked.signal_unit is not None:
            raise UsageError(f"{path}: {kinds[candidates[0].signal]}; leave `signal_unit` out")
        if asked.polarisation in ("s", "p"):
            raise UsageError(f"{path}: ellipsometry compares p with s light; leave `polarisation` out")
    return candidates


_READERS: dict[type, Callable[[Table, Any, Reading], Spectrum]] = {
    SpectrumColumns: read_power,
    MuellerColumns: read_mueller,
    GeneralisedColumns: read_generalised,
    EllipsometryColumns: read_ellipsometry,
}


def _read(one: Candidate, asked: Reading, several: bool) -> Spectrum:
    """Read one of the spectra of a file; `several` keeps its name."""
    declared = one.table.layout.declared
    spectrum = _READERS[type(one.columns)](one.table, one.columns, asked)
    if declared.angle is not None and spectrum.angle is None:
        notes = (*spectrum.notes, f"angle of incidence {declared.angle:g} degrees, as the file declares")
        spectrum = replace(spectrum, angle=np.full(len(spectrum), declared.angle), notes=notes)
    name = one.name if several else ""
    if name or declared.facts:
        spectrum = replace(spectrum, name=name, declared=declared.facts)
    if log.isEnabledFor(INFO):
        low, high = spectrum.values.min(), spectrum.values.max()
        first, last = spectrum.wavelength[[0, -1]]
        text = "%s: %d rows used: %s from %g to %g nm, values from %.4g to %.4g"
        log.info(text, spectrum.path, len(spectrum), spectrum.signal, first, last, low, high)
    return spectrum
