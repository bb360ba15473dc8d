"""Spectra that were measured in several sweeps over the same wavelengths: their mean and their spread."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from pellicle.data.spectrum import FEWEST_POINTS, Spectrum
from pellicle.errors import DataError, UsageError

MOST_APART = 0.1
"""Share of the signal (for Ψ and Δ of the radius of the sphere of N, C, S) by which sweeps may differ, alike
at neighbouring points. A lamp drifts by less; other angles and samples differ by more."""
_ALIKE = 0.5
"""Share of the variance of sweeps that is alike at neighbouring points, above which they differ by more than
noise."""


def sweep_numbers(
    wavelength: Float[np.ndarray, " rows"], setting: Float[np.ndarray, " rows"] | None = None
) -> Int[np.ndarray, " rows"]:
    """Number of the sweep of each row: how many earlier rows have the same wavelength and setting.

    `setting` is that of `data.spectrum.setting_numbers`: an angle of incidence and an azimuth.
    """
    if setting is None and one_way(wavelength):
        return np.zeros(len(wavelength), dtype=np.int64)
    settings = np.zeros(len(wavelength)) if setting is None else setting
    order = np.lexsort((settings, wavelength))  # stable: equal points stay in the order of the rows
    points = np.stack([wavelength, settings], axis=1)[order]
    begins = np.flatnonzero(np.any(np.diff(points, axis=0, prepend=np.nan) != 0, axis=1))
    numbers = np.empty(len(wavelength), dtype=np.int64)
    numbers[order] = np.arange(len(order)) - np.repeat(begins, np.diff(begins, append=len(order)))
    return numbers


def are_sweeps(
    wavelength: Float[np.ndarray, " rows"],
    setting: Float[np.ndarray, " rows"] | None,
    number: Int[np.ndarray, " rows"],
) -> bool:
    """True for several complete sweeps: each has every point, and goes one way within each setting."""
    counts = np.bincount(number)
    if len(counts) < 2 or counts.min() != counts.max() or counts[0] < FEWEST_POINTS:
        return False
    groups = np.zeros(len(wavelength)) if setting is None else setting
    return all(
        one_way(wavelength[(number == k) & (groups == group)])
        for k in range(len(counts))
        for group in np.unique(groups)
    )


def one_way(wavelength: np.ndarray) -> bool:
    """True for values that rise or fall strictly."""
    steps = np.diff(wavelength)
    return bool((steps > 0).all() or (steps < 0).all())


_EQUAL = (
    *("signal", "transmission", "elements", "ratios", "polarisation", "folded"),
    *("wavelength", "angle", "azimuth"),
)
"""What sweeps that are averaged have in common."""


def mean_spectrum(sweeps: Sequence[Spectrum]) -> Spectrum:
    """Average repeated measurements of one spectrum, and keep them as its `sweeps`.

    With equal weights, a fit of the mean is the fit of all sweeps together. Ψ and Δ are averaged as N, C, S.

    **Arguments:** `sweeps`: two or more, of one signal at the same wavelengths, angles and azimuths.

    **Returns:** the mean, with the standard deviations of the mean where all sweeps have theirs. Copies of a
    sweep are left out, with a note.

    **Raises:** UsageError for spectra of different points or signals; DataError where they differ by more
    than repeats do: by over 10 % of the signal, alike at neighbouring points.

    ```python
    >>> from pellicle.data.repeated_sweeps import mean_spectrum
    >>> scene = pl.Scene(pl.Layer("SiO2", 500.0), "Si")
    >>> mean = mean_spectrum([pl.simulate(scene, noise=0.002, seed=seed) for seed in range(4)])
    >>> len(mean.sweeps), mean.sigma[0].item()
    (4, 0.001)

    ```
    """
    first, count = sweeps[0], len(sweeps)
    if count < 2:
        raise UsageError("a mean needs two sweeps or more")
    for name in _EQUAL:
        if any(not np.array_equal(getattr(first, name), getattr(sweep, name)) for sweep in sweeps):
            raise UsageError(f"sweeps that are averaged must have the same {name}")
    points = [sweep.kind.coordinates(sweep) for sweep in sweeps]
    copies = [i for i in range(1, count) if any(np.array_equal(points[i], one) for one in points[:i])]
    if copies:
        note = f"{len(copies)} of {count} sweeps hold the same numbers as an earlier one and are left out"
        kept = [sweep for i, sweep in enumerate(sweeps) if i not in copies]
        one = kept[0] if len(kept) == 1 else mean_spectrum(kept)
        return dataclasses.replace(one, notes=(*one.notes, note))
    mean: dict[str, Any] = dict(first.kind.averaged(np.mean(points, axis=0)))
    for name in ("sigma", "delta_sigma", "depolarisation_sigma"):
        errors = [error for sweep in sweeps if (error := getattr(sweep, name)) is not None]
        mean[name] = np.sqrt(np.sum(np.square(errors), axis=0)) / count if len(errors) == count else None
    shares = [sweep.depolarisation for sweep in sweeps if sweep.depolarisation is not None]
    if len(shares) < count:
        mean["depolarisation_sigma"] = None
    mean["depolarisation"] = np.mean(shares, axis=0) if len(shares) == count else None
    note = _note(sweeps, float(np.sqrt(np.mean(mean["values"] ** 2))))
    return dataclasses.replace(first, **mean, notes=(*first.notes, note), sweeps=tuple(sweeps))


def repeatability(sweeps: Sequence[Spectrum]) -> float:
    """Standard deviation of a point of one sweep, from the differences between sweeps, in any scene.

    It is pooled over all points, on (sweeps − 1) · points degrees of freedom, twice as many for Ψ and Δ and
    for each ratio of generalised ones, as many for each Mueller element. For Ψ and Δ it is in degrees of Ψ:
    half the distance on the sphere of N, C, S, in each of its two directions.
    """
    apart = deviations(sweeps)
    count, points, _ = apart.shape
    kind = sweeps[0].kind
    size = math.sqrt(float(np.sum(apart**2)) / ((count - 1) * points * kind.independent))
    return math.degrees(size) / 2 if kind.degrees else size


def deviations(sweeps: Sequence[Spectrum]) -> Float[np.ndarray, "sweeps points channels"]:
    """Each sweep less the mean of all."""
    points = np.stack([sweep.kind.coordinates(sweep) for sweep in sweeps])
    return points - points.mean(axis=0)


def _note(sweeps: Sequence[Spectrum], level: float) -> str:
    """A sentence on the repeatability of sweeps whose mean has the rms `level`. Raises DataError."""
    size, count, first, unit = repeatability(sweeps), len(sweeps), sweeps[0], ""
    if first.kind.degrees:
        level, unit = math.degrees(0.5), " degrees"
    apart = deviations(sweeps)
    # the covariance of neighbouring points
    alike = float(np.mean(apart[:, 1:] * apart[:, :-1])) > _ALIKE * float(np.mean(apart**2))
    if alike and size / level > MOST_APART:
        place = f"{first.path}: the" if first.path else "the"
        raise DataError(
            f"{place} {count} sweeps over the same wavelengths differ by {100 * size / level:.0f} % of the"
            " signal, alike at neighbouring points, too much for repeats of one measurement; keep the rows of"
            " one sweep, or add the column in which they differ, such as angle_deg"
        )
    note = f"{count} sweeps over the same wavelengths, averaged; a point scatters by {size:.2g}{unit}"
    drift = ", for the most part alike at neighbouring points: the sweeps drift"
    return note + drift if alike else note
