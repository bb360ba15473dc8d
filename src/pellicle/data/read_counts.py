"""Reflectance from raw counts, or from a ratio of reflectances, by a reference of known reflectance."""

import os
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pellicle.data.formats.detect import read_tables
from pellicle.data.noisy_edges import noisy_edges
from pellicle.data.read_power import beside_wavelength, by_position, read_signal
from pellicle.data.spectrum import Spectrum
from pellicle.data.tabular.column_selection import Selection, named_columns, only
from pellicle.data.tabular.columns import COUNTS, listed
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError
from pellicle.signals.limits import HIGHEST, check_noise, check_power


def read_counts(
    path: str | os.PathLike[str],
    *,
    columns: str | Sequence[str] | None = None,
    wavelength_unit: str | None = None,
    range: tuple[float | int, float | int] | None = None,
) -> Spectrum:
    """Read raw detector counts: those of the sample, or a wavelength column and one other of any name.

    **Arguments:** as in `read_spectrum`.

    **Returns:** a `Spectrum` with `signal` "counts", uncalibrated.

    **Raises:** DataError or UsageError as `read_spectrum` does; any finite count is accepted.
    """
    table = _only_table(path)
    named = named_columns(table, columns)
    if named is None:
        chosen = by_position(table, "counts")
    else:
        others = ("wavelength", "sigma", "angle", "azimuth")
        free = [c for c in named if c.role not in others and c.name not in ("_", "")]
        sample = [c for c in named if c.role == "sample counts"] or free
        if len(sample) != 1:
            raise UsageError(
                f"{table.path}: expected one column of counts beside the wavelength, found "
                f'{listed(sample) or "none"}; choose one, as in `columns=["wavelength", "counts"]`'
            )
        chosen = beside_wavelength(table, named, sample[0])
    counts = _read(table, chosen, wavelength_unit)
    return counts if range is None else counts.cut(*range)


def read_counts_beside(
    path: str | os.PathLike[str],
    part: str,
    *,
    columns: str | Sequence[str] | None = None,
    wavelength_unit: str | None = None,
) -> Spectrum | None:
    """Read the counts of a reference or without light that a file has beside those of the sample.

    **Arguments:** `part` is "reference counts" or "dark counts", the others as in `read_counts`.

    **Returns:** a `Spectrum` as `read_counts` does; None where the file has none.
    """
    table = _only_table(path)
    named = named_columns(table, columns) or ()
    counts = only(table, named, part)
    return _read(table, beside_wavelength(table, named, counts), wavelength_unit) if counts else None


def has_counts(path: str | os.PathLike[str], columns: str | Sequence[str] | None = None) -> bool:
    """True where a file names a column of counts, or of an intensity in arbitrary units."""
    named = (named_columns(table, columns) or () for table in read_tables(path))
    return any(column.role in (*COUNTS, "counts", "intensity") for table in named for column in table)


def _only_table(path: str | os.PathLike[str]) -> Table:
    table, *others = read_tables(path)
    if others:
        raise UsageError(f"{path}: has {len(others) + 1} spectra where raw counts of one are expected")
    return table


def _read(table: Table, chosen: Selection, wavelength_unit: str | None) -> Spectrum:
    rows = read_signal(table, chosen, wavelength_unit)
    counts = rows.spectrum((), {"values": rows.columns["values"]}, signal="counts", calibrated=False)
    return replace(counts, declared=table.declared.facts)


def reflectance_from_counts(
    sample: Spectrum,
    reference: Spectrum,
    reference_reflectance: np.ndarray,
    dark: Spectrum | None = None,
    *,
    noise: float | int | None = None,
) -> Spectrum:
    """Calibrate counts: the reflectance (S − D) / (Ref − D) R_ref at the wavelengths of `sample`.

    **Arguments:**

    - `sample`, `reference`, `dark`: raw counts with the same lamp, detector and integration time. Reference
      and dark are interpolated linearly where their wavelengths differ; cut only the sample to a range.
    - `reference_reflectance`: fraction, one number per wavelength of `sample`.
    - `noise`: standard deviation of the result of one sweep, a fraction; None leaves it unknown.

    **Returns:** a `Spectrum` of "R".

    **Raises:** DataError where the reference does not cover the sample or has no counts above the dark, or
    where the result is not a reflectance; UsageError for a noise that is not above zero.
    """
    known = _known(reference_reflectance, sample)
    check_noise(noise)
    sigma = None if noise is None else np.full(len(sample), noise / np.sqrt(max(len(sample.sweeps), 1)))
    sweeps = [reflectance_from_counts(sweep, reference, known, dark, noise=noise) for sweep in sample.sweeps]
    background = 0.0 if dark is None else _interpolated(sample, dark, "dark")
    full = _interpolated(sample, reference, "reference") - background
    if full.min() <= 0:
        first = sample.wavelength[np.argmax(full <= 0)]
        above = "" if dark is None else " above the dark"
        raise DataError(
            f"{reference.path}: the reference has no counts{above} at {first:g} nm; "
            "leave those wavelengths out with `range`"
        )
    values = (sample.values - background) / full * known
    note = f"counts divided by those of the reference {reference.path}"
    return _reflectance(sample, values, sigma, sweeps, "counts", note)


def reflectance_from_ratio(ratio: Spectrum, reference_reflectance: np.ndarray) -> Spectrum:
    """Calibrate a reflectance relative to that of a reference: the reflectance (R / R_ref) R_ref.

    **Arguments:**

    - `ratio`: R / R_ref as "R", uncalibrated, with its standard deviation.
    - `reference_reflectance`: fraction, one number per wavelength of `ratio`.

    **Returns:** a `Spectrum` of "R".

    **Raises:** DataError where the result is not a reflectance.
    """
    known = _known(reference_reflectance, ratio)
    sigma = None if ratio.sigma is None else ratio.sigma * known
    sweeps = [reflectance_from_ratio(sweep, known) for sweep in ratio.sweeps]
    note = "relative to the reference, and multiplied by its reflectance"
    return _reflectance(ratio, ratio.values * known, sigma, sweeps, "ratio", note)


def without_dark_edges(sample: Spectrum, reference: Spectrum, dark: Spectrum | None = None) -> Spectrum:
    """Leave out the edges of the counts of a sample where the reference has no light, with a note.

    **Arguments:** as in `reflectance_from_counts`; a `sample` of several sweeps stays as it is.
    """
    other = [sample, reference] if dark is None else [sample, reference, dark]
    if sample.sweeps or any(not np.array_equal(sample.wavelength, one.wavelength) for one in other):
        return sample
    background = 0.0 if dark is None else dark.values
    full = reference.values - background
    with np.errstate(divide="ignore", invalid="ignore"):
        quotient = np.where(full > 0, (sample.values - background) / full, 2 * HIGHEST)
    good = noisy_edges(sample.wavelength, quotient, full)
    if good is None:
        return sample
    kept = sample.cut(*sample.wavelength[good.rows][[0, -1]].tolist())
    return replace(kept, left_out=good.left_out, notes=(*sample.notes, good.note))


def _known(reference_reflectance: np.ndarray, sample: Spectrum) -> np.ndarray:
    known = np.asarray(reference_reflectance, dtype=np.float64)
    if known.shape != sample.wavelength.shape:
        raise ValueError(
            f"`reference_reflectance`: expected one number per wavelength of the sample "
            f"{sample.wavelength.shape}, got {known.shape}"
        )
    return known


def _reflectance(
    sample: Spectrum,
    values: np.ndarray,
    sigma: np.ndarray | None,
    sweeps: list[Spectrum],
    source: str,
    note: str,
) -> Spectrum:
    """The calibrated spectrum of a sample. Raises DataError for values that are no reflectance."""
    place, remedy = sample.place(f"reflectance from {source}"), "leave it out with `range`, or measure again"
    check_power("reflectance", values, sigma, place, too_high=remedy, remedy=remedy)
    return replace(
        sample,
        values=values,
        signal="R",
        sigma=sigma,
        calibrated=True,
        notes=(*sample.notes, note),
        sweeps=tuple(sweeps),
    )


def _interpolated(sample: Spectrum, other: Spectrum, name: str) -> np.ndarray:
    if np.array_equal(sample.wavelength, other.wavelength):
        return other.values
    low, high = sample.wavelength[0], sample.wavelength[-1]
    if low < other.wavelength[0] or high > other.wavelength[-1]:
        raise DataError(
            f"{other.path}: the {name} covers {other.wavelength[0]:g} to {other.wavelength[-1]:g} nm but "
            f"{sample.path} runs from {low:g} to {high:g} nm; cut the sample with `range`"
        )
    return np.interp(sample.wavelength, other.wavelength, other.values)
