"""Reading of spectra: what a file has to choose from, the choice, and the spectra themselves."""

import os
from collections.abc import Sequence
from dataclasses import replace
from logging import INFO, getLogger
from typing import Any, NamedTuple

import numpy as np

from pellicle.data.formats.detect import read_tables
from pellicle.data.read_ellipsometry import COLUMNS, FORMS, PSI_DELTA, READERS, SIGNAL
from pellicle.data.read_power import power_columns, read_power
from pellicle.data.spectrum import Spectrum
from pellicle.data.spectrum_rows import Reading
from pellicle.data.tabular.column_selection import Selection, named_columns
from pellicle.data.tabular.columns import DIRECTIONS, RATIO_COLUMNS, SIGNALS, Column, listed
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError
from pellicle.signals.generalised import Generalised
from pellicle.signals.mueller import ELEMENTS, Mueller
from pellicle.signals.registry import KINDS

log = getLogger(__name__)

ALL = "all"
_MOST_LISTED = 40


class Candidate(NamedTuple):
    """A spectrum of a file: its table, columns and name."""

    table: Table
    columns: Selection
    name: str

    @property
    def signal(self) -> str:
        """The word of its signal."""
        return self.columns.signal

    @property
    def polarisation(self) -> str | None:
        """The polarisation that the name of its column states."""
        return self.columns.values[0].polarisation


def read_spectrum(
    path: str | os.PathLike[str],
    *,
    spectrum: str | None = None,
    signal: str | None = None,
    columns: str | Sequence[str] | None = None,
    wavelength_unit: str | None = None,
    signal_unit: str | None = None,
    range: tuple[float | int, float | int] | None = None,
    noise: float | int | str | None = None,
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

    - `path` of the file; `spectrum`: the name of one of several spectra in it.
    - `signal`: "R", "T", "psi-delta", "mueller", "generalised-psi-delta" or "contrast"; needed where the
      file does not state it, or has several.
    - `columns`: names in the order of the file's columns, "_" to skip one; overrides the header.
    - `wavelength_unit`: "nm", "um", "A", "eV", "cm-1" or "THz" (else nm), `signal_unit`: "fraction",
      "percent" or "absorbance" (−log₁₀ of the signal); where the file does not state them.
    - `range`: wavelengths to keep, (low, high) in nm. Values outside it are not checked.
    - `noise`: σ of every point as a fraction, or of Ψ and Δ in degrees; replaces the file's. As a text it is
      in the unit of the file, "0.4", or a share of the signal, "0.4 %".
    - `polarisation`: "s", "p" or "unpolarised", where the column's name does not state it.
    - `calibrated`: False lifts the limits on the values; by default for an `intensity` column only.
    - `folded`: True where Δ lies in 0 to 180 and its sign is unknown; None finds it by kinks, with a note.
    - `analyser`: for columns α and β, the angle of the fixed polariser in degrees.
    - `spot`: number, from 1 in the order of the file, of one of several spots of an Accurion file.
    - `elements` of a Mueller matrix, as ["m12", "m33"], or ratios, as ["ane", "aps"]; None for all.
    - `transmission`: True where Ψ and Δ are those of transmitted light; None takes it from the file.

    **Returns:** a `Spectrum`; of several complete sweeps over the same wavelengths, their mean.

    **Raises:** DataError (unreadable or impossible data) or UsageError (an argument missing or wrong).
    """
    asked = Reading(**{name: value for name, value in locals().items() if name != "path"})
    if spectrum == ALL:
        raise UsageError(f"{path}: one spectrum is wanted; read all of a file with pl.read_spectra")
    return _read(path, asked, together=False)[0]


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
    return _read(path, Reading(spectrum=spectrum, **reading), together=True)


def _read(path: str | os.PathLike[str], asked: Reading, *, together: bool) -> list[Spectrum]:
    """Read the spectra of a file that the arguments mean; `together` as in `chosen`."""
    candidates = file_candidates(read_tables(path, asked.spot), asked)
    stated = ("folded", asked.folded), ("analyser", asked.analyser is not None)
    given = [name for name, given in (*stated, ("transmission", asked.transmission)) if given]
    if given and all(one.signal != SIGNAL for one in candidates):
        raise UsageError(f"{path}: `{given[0]}` is for ellipsometry, and the file has none; leave it out")
    if all(one.signal in READERS for one in candidates):
        kind = KINDS[candidates[0].signal]
        if asked.signal_unit is not None:
            unit = "psi and delta are in degrees" if kind.degrees else f"{kind.noun} have no unit"
            raise UsageError(f"{path}: {unit}; leave `signal_unit` out")
        if asked.polarisation in ("s", "p"):
            raise UsageError(f"{path}: ellipsometry compares p with s light; leave `polarisation` out")
    several = len(candidates) > 1
    return [_spectrum(one, asked, several) for one in chosen(candidates, asked.spectrum, together=together)]


def _spectrum(one: Candidate, asked: Reading, several: bool) -> Spectrum:
    """Read one of the spectra of a file; `several` keeps its name."""
    declared = one.table.declared
    spectrum = READERS.get(one.signal, read_power)(one.table, one.columns, asked)
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


def _candidates(table: Table, asked: Reading) -> list[Candidate]:
    """The spectra of a table. Raises UsageError or DataError where there is none."""
    named = named_columns(table, asked.columns)
    if {column.role for column in named or ()}.issuperset(DIRECTIONS):
        raise UsageError(
            f"{table.path}: holds samples of a BRDF, not a spectrum; fit them with a `recipe` of the surface "
            "(Python: pl.read_brdf_samples)"
        )
    spectra = []
    word, wanted = _ellipsometric(named, asked)
    if word is not None:
        spectra.append(Candidate(table, COLUMNS[word](table, named, asked.elements), table.name or word))
        if wanted or not any(column.role in SIGNALS for column in named or ()):
            return spectra
    powers = power_columns(table, asked.columns, asked.signal, asked.polarisation)
    for power in powers:
        [column] = power.values
        alone = len(powers) + len(spectra) == 1
        name = table.name if alone else " ".join(part for part in (table.name, column.name) if part)
        spectra.append(Candidate(table, power, name or column.name))
    return spectra


def _ellipsometric(named: Sequence[Column] | None, asked: Reading) -> tuple[str | None, bool]:
    """The signal of ellipsometry that a table has, None without one, and whether it was asked for."""
    if asked.signal is not None:
        return (asked.signal, True) if asked.signal in READERS else (None, False)
    if asked.elements is not None:
        ratios = not set(asked.elements).isdisjoint(Generalised.every)
        return (Generalised.word if ratios else Mueller.word), True
    roles = {column.role for column in named or ()}
    # psi and delta go before what only anisotropic samples need
    if roles & set(PSI_DELTA) or any(roles.issuperset(form) for form in FORMS):
        return SIGNAL, False
    present = ((Generalised.word, RATIO_COLUMNS), (Mueller.word, ELEMENTS))
    return next((word for word, known in present if roles & set(known)), None), False


def file_candidates(tables: Sequence[Table], asked: Reading) -> list[Candidate]:
    """Find the spectra of all tables of a file that have the wanted signal and polarisation; of Ψ and Δ and
    a Mueller matrix or generalised Ψ and Δ beside them Ψ and Δ, where none is wanted.

    Raises UsageError or DataError where no table has them.
    """
    spectra: list[Candidate] = []
    refusals: list[DataError | UsageError] = []
    for table in tables:
        try:
            spectra += _candidates(table, asked)
        except (DataError, UsageError) as refusal:
            if len(tables) == 1 or asked.signal is asked.polarisation is asked.elements is None:
                raise
            refusals.append(refusal)
    if not spectra:
        raise refusals[0]
    if asked.signal is None and asked.elements is None and any(one.signal == SIGNAL for one in spectra):
        return [one for one in spectra if one.signal == SIGNAL or one.signal not in READERS]
    return spectra


def chosen(spectra: Sequence[Candidate], spectrum: str | None, *, together: bool) -> list[Candidate]:
    """Return the spectrum of this name, or all; without a name the only one.

    `together` also returns Ψ and Δ with the reflectances and transmittances beside them, which are of one
    film. Raises UsageError where the choice is open, with the arguments that settle it.
    """
    path = spectra[0].table.path
    if spectrum == ALL:
        return list(spectra)
    if spectrum is not None:
        wanted = spectrum.strip().lower()
        named = [one for one in spectra if one.name.lower() == wanted]
        if len(named) == 1:
            return named
        reason = f"has no spectrum {spectrum!r}" if not named else f"has {len(named)} spectra {spectrum!r}"
        raise UsageError(f"{path}: {reason}; it has {_listed(spectra)}")
    if len(spectra) == 1:
        return list(spectra)
    signals = {one.signal for one in spectra}
    kinds = [one.signal for one in spectra if one.signal in READERS]
    if len(kinds) == 1:
        if together:
            return list(spectra)
        powers = sorted(signals - set(kinds))
        raise UsageError(
            f"{path}: has {KINDS[kinds[0]].noun} as well as {', '.join(powers)}; choose one with `signal`,"
            " or read all with pl.read_spectra"
        )
    every = '`spectrum="all"`'
    if signals == {"R", "T"}:
        raise UsageError(
            f'{path}: has both R and T; choose one with `signal="R"` or `signal="T"`, or take {every}'
        )
    if len({one.polarisation for one in spectra}) == len(spectra) > 1:
        names = listed([column for one in spectra for column in one.columns.values])
        raise UsageError(
            f'{path}: has {names}; choose one with `polarisation="s"`, `polarisation="p"` or '
            f'`polarisation="unpolarised"`, or take {every}'
        )
    raise UsageError(
        f"{path}: has {len(spectra)} spectra: {_listed(spectra)}; choose one, as in "
        f'`spectrum="{spectra[0].name}"`, or take {every}'
    )


def _listed(spectra: Sequence[Candidate]) -> str:
    more = f" and {len(spectra) - _MOST_LISTED} more" if len(spectra) > _MOST_LISTED else ""
    return ", ".join(repr(one.name) for one in spectra[:_MOST_LISTED]) + more
