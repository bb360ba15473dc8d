"""Reading of spectra: reflectance, transmittance, or Ψ and Δ against wavelength."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from logging import INFO, getLogger
from typing import Any

import numpy as np

from pellicle.data.file_spectra import ALL, Candidate, chosen, file_candidates
from pellicle.data.formats.detect import read_tables
from pellicle.data.options import SpectrumOptions
from pellicle.data.read_ellipsometry import SIGNAL, read_ellipsometry
from pellicle.data.read_generalised import GeneralisedColumns, read_generalised
from pellicle.data.read_mueller import MuellerColumns, read_mueller
from pellicle.data.read_power import read_power
from pellicle.data.spectrum import POLARISATIONS, Spectrum
from pellicle.data.tabular.column_selection import SpectrumColumns
from pellicle.data.tabular.table import Table
from pellicle.errors import UsageError
from pellicle.signals.generalised import Generalised
from pellicle.signals.limits import check_noise
from pellicle.signals.mueller import Mueller
from pellicle.signals.registry import SIMULATED

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
    reading = _Reading(
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
    candidates = reading.find(path)
    [one] = candidates if len(candidates) == 1 else chosen(candidates, spectrum, together=False)
    return reading.read(one, several=len(candidates) > 1)


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
    options = _Reading(**reading)
    candidates = options.find(path)
    several = len(candidates) > 1
    return [options.read(one, several) for one in chosen(candidates, spectrum, together=True)]


@dataclass(frozen=True, kw_only=True)
class _Reading(SpectrumOptions):
    """Arguments of `read_spectrum`, and reading with them. Raises UsageError for an unknown word."""

    noise: float | int | None = None
    calibrated: bool | None = None

    def __post_init__(self) -> None:
        for name, known in (
            ("signal", SIMULATED),
            ("polarisation", POLARISATIONS),
        ):
            value = getattr(self, name)
            if value is not None and value not in known:
                raise UsageError(f"`{name}` must be one of {', '.join(known)}, not {value!r}")
        check_noise(self.noise)

    def find(self, path: str | os.PathLike[str]) -> list[Candidate]:
        """Find the spectra of a file that these arguments may mean."""
        tables = read_tables(path, self.spot)
        candidates = file_candidates(tables, self.columns, self.signal, self.polarisation, self.elements)
        stated = ("folded", self.folded), ("analyser", self.analyser is not None)
        asked = [name for name, given in (*stated, ("transmission", self.transmission)) if given]
        if asked and all(one.signal != SIGNAL for one in candidates):
            name = asked[0]
            raise UsageError(f"{path}: `{name}` is for ellipsometry, and the file has none; leave it out")
        kinds = {SIGNAL: "psi and delta are in degrees", Mueller.word: "Mueller elements have no unit"}
        kinds[Generalised.word] = kinds[SIGNAL]
        if all(one.signal in kinds for one in candidates):
            if self.signal_unit is not None:
                raise UsageError(f"{path}: {kinds[candidates[0].signal]}; leave `signal_unit` out")
            if self.polarisation in ("s", "p"):
                raise UsageError(f"{path}: ellipsometry compares p with s light; leave `polarisation` out")
        return candidates

    def read(self, one: Candidate, several: bool) -> Spectrum:
        """Read one of them; `several` keeps its name."""
        table = one.table
        if isinstance(one.columns, SpectrumColumns):
            calibrated = self.calibrated
            if calibrated is None:
                calibrated = one.columns.signal.role != "intensity"
            spectrum = read_power(
                table,
                one.columns,
                self.wavelength_unit,
                self.signal_unit,
                self.signal,
                self.range,
                self.noise,
                _polarisation(table, one.columns, self.polarisation),
                calibrated,
            )
        elif isinstance(one.columns, MuellerColumns):
            spectrum = read_mueller(table, one.columns, self.wavelength_unit, self.noise, self.range)
        elif isinstance(one.columns, GeneralisedColumns):
            spectrum = read_generalised(table, one.columns, self.wavelength_unit, self.noise, self.range)
        else:
            spectrum = read_ellipsometry(
                table,
                one.columns,
                self.wavelength_unit,
                self.noise,
                self.range,
                _folded(table) if self.folded is None else self.folded,
                self.analyser,
            )
            declared = dict(table.layout.declared.facts).get("light", "").startswith("transmitted")
            if declared if self.transmission is None else self.transmission:
                sweeps = tuple(replace(sweep, transmission=True) for sweep in spectrum.sweeps)
                notes = (*spectrum.notes, "of transmitted light: conj(t_p/t_s)")
                spectrum = replace(spectrum, transmission=True, notes=notes, sweeps=sweeps)
        angle = table.layout.declared.angle
        if angle is not None and spectrum.angle is None:
            notes = (*spectrum.notes, f"angle of incidence {angle:g} degrees, as the file declares")
            spectrum = replace(spectrum, angle=np.full(len(spectrum), angle), notes=notes)
        name, declared = one.name if several else "", table.layout.declared.facts
        if name or declared:
            spectrum = replace(spectrum, name=name, declared=declared)
        if log.isEnabledFor(INFO):
            low, high = spectrum.values.min(), spectrum.values.max()
            first, last = spectrum.wavelength[[0, -1]]
            text = "%s: %d rows used: %s from %g to %g nm, values from %.4g to %.4g"
            log.info(text, spectrum.path, len(spectrum), spectrum.signal, first, last, low, high)
        return spectrum


def _folded(table: Table) -> bool | None:
    """True where the file says that its Δ is folded, None where it says nothing."""
    return True if dict(table.layout.declared.facts).get("delta", "").startswith("folded") else None


def _polarisation(table: Table, columns: SpectrumColumns, asked: str | None) -> str | None:
    """The polarisation that the caller or the file states. Raises UsageError where they differ."""
    declared = table.layout.declared.polarisation
    if declared is None or columns.signal.polarisation:
        return asked
    if asked not in (None, declared):
        raise UsageError(
            f'{table.path}: declares {declared} light, which contradicts `polarisation="{asked}"`; leave '
            "that out"
        )
    return declared
