"""Spectra in one file: what there is to choose from, and the choice."""

from collections.abc import Sequence
from typing import NamedTuple

from pellicle.data.ellipsometry_angles import FORMS, PSI_DELTA
from pellicle.data.read_ellipsometry import SIGNAL, EllipsometryColumns, ellipsometry_columns
from pellicle.data.read_generalised import GeneralisedColumns, generalised_columns
from pellicle.data.read_mueller import MuellerColumns, mueller_columns
from pellicle.data.spectrum_rows import Reading
from pellicle.data.tabular.column_names import RATIO_COLUMNS
from pellicle.data.tabular.column_selection import SpectrumColumns, named_columns, signal_columns
from pellicle.data.tabular.columns import DIRECTIONS, SIGNALS, Column, listed
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError
from pellicle.signals.generalised import Generalised
from pellicle.signals.mueller import ELEMENTS, Mueller

ALL = "all"
_MOST_LISTED = 40
_ELLIPSOMETRY = {
    SIGNAL: "psi and delta",
    Mueller.word: "Mueller elements",
    Generalised.word: "generalised psi and delta",
}
_OF_ANISOTROPIC = (Mueller.word, Generalised.word)
"""Signals of anisotropic samples, which yield to psi and delta where none is asked for."""


class Candidate(NamedTuple):
    """A spectrum of a file: its table and columns, and its name, signal and polarisation."""

    table: Table
    columns: SpectrumColumns | EllipsometryColumns | MuellerColumns | GeneralisedColumns
    name: str
    signal: str
    polarisation: str | None


def _candidates(table: Table, asked: Reading) -> list[Candidate]:
    """The spectra of a table. Raises UsageError or DataError where there is none."""
    named = named_columns(table, asked.columns)
    if {column.role for column in named or ()}.issuperset(DIRECTIONS):
        raise UsageError(
            f"{table.path}: holds samples of a BRDF, not a spectrum; fit them with a `recipe` of the surface "
            "(Python: pl.read_brdf_samples)"
        )
    own, spectra = table.layout.name, []
    word, wanted = _ellipsometric(named, asked)
    if word is not None:
        if word == SIGNAL:
            chosen = ellipsometry_columns(table, named)
        else:
            select = generalised_columns if word == Generalised.word else mueller_columns
            chosen = select(table, named, asked.elements)
        spectra.append(Candidate(table, chosen, own or word, word, None))
        if wanted or not any(column.role in SIGNALS for column in named or ()):
            return spectra
    powers = signal_columns(table, asked.columns, asked.signal, asked.polarisation)
    for power in powers:
        column = power.signal
        alone = len(powers) + len(spectra) == 1
        label = own if alone else " ".join(part for part in (own, column.name) if part)
        spectra.append(Candidate(table, power, label or column.name, column.role, column.polarisation))
    return spectra


def _ellipsometric(named: Sequence[Column] | None, asked: Reading) -> tuple[str | None, bool]:
    """The signal of ellipsometry that a table has, None without one, and whether it was asked for."""
    if asked.signal is not None:
        return (asked.signal, True) if asked.signal in _ELLIPSOMETRY else (None, False)
    if asked.elements is not None:
        ratios = not set(asked.elements).isdisjoint(Generalised().parts)
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
        return [one for one in spectra if one.signal not in _OF_ANISOTROPIC]
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
    kinds = [one.signal for one in spectra if one.signal in _ELLIPSOMETRY]
    if len(kinds) == 1:
        if together:
            return list(spectra)
        powers = sorted(signals - set(kinds))
        raise UsageError(
            f"{path}: has {_ELLIPSOMETRY[kinds[0]]} as well as {', '.join(powers)}; choose one with `signal`,"
            " or read all with pl.read_spectra"
        )
    every = '`spectrum="all"`'
    if signals == {"R", "T"}:
        raise UsageError(
            f'{path}: has both R and T; choose one with `signal="R"` or `signal="T"`, or take {every}'
        )
    if len({one.polarisation for one in spectra}) == len(spectra) > 1:
        names = listed([one.columns.signal for one in spectra if isinstance(one.columns, SpectrumColumns)])
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
