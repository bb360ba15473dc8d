"""Measured spectra as arrays, and the settings of their points: angle of incidence and azimuth."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from pellicle.errors import DataError, UsageError
from pellicle.signals.base import Signal
from pellicle.signals.folded_delta import folding_at, folding_note
from pellicle.signals.limits import Where, refuse_first
from pellicle.signals.registry import KEYWORDS, KINDS, SIGNALS

POLARISATIONS = ("s", "p", "unpolarised")
FEWEST_POINTS = 5
"""A range that keeps fewer points is a mistake in the range."""

LEAST_SHARE = 0.5
"""Share of the points that must remain where a range is chosen for the user."""

_OF_PARTS = ("values", "sigma", "delta", "delta_sigma")
"""Arrays with a column for each part of a signal."""
_REMEDY = "correct or delete that point"


class LeftOut(NamedTuple):
    """Points that are not fitted: wavelengths in nm, values as fractions; and the reason."""

    wavelength: Float[np.ndarray, " points"]
    values: Float[np.ndarray, " points"]
    reason: str


@dataclass(frozen=True, eq=False, repr=False)
class Spectrum:
    """One measured signal against wavelength.

    **Arguments:** arrays of shape (points,), in any order; they are sorted by wavelength.

    - `wavelength` in nm.
    - `values`: reflectance or transmittance as fractions (on any scale if `calibrated` is False), or Ψ in
      degrees, or elements of the normalised Mueller matrix (points, elements), or Ψ of generalised
      ellipsometry (points, ratios).
    - `signal`: "R", "T", "psi-delta", "mueller", "generalised-psi-delta", or "counts" for raw detector
      counts.
    - `sigma`: standard deviations of `values`, in the same unit.
    - `polarisation`: "s", "p" or "unpolarised".
    - `angle` of incidence in degrees; None leaves it to the scene.
    - `azimuth` of the sample in degrees: its rotation about its normal (see `pellicle.Light`); None leaves it
      to the scene.
    - `calibrated`: False for values of unknown scale, which are not checked against 0 and 1.
    - `path`, `sha256`, `lines`: file, its digest and the source line of each point.
    - `notes`: sentences on how the file was read.
    - `delta`, `delta_sigma`: Δ and its standard deviations in degrees, for "psi-delta" and
      "generalised-psi-delta".
    - `folded`: the sign of sin Δ was not measured, and Δ lies in 0 to 180. With None it is taken as folded
      where it turns back at 0 or 180 with a kink.
    - `sweeps`: the repeated measurements of which this is the mean (`data.repeated_sweeps.mean_spectrum`).
    - `name` of the spectrum within its file, empty where the file has one spectrum.
    - `declared`: (key, value) pairs that the file states, such as its instrument and date.
    - `depolarisation`, `depolarisation_sigma`: 1 − N² − C² − S² and its standard deviations, as fractions,
      for "psi-delta".
    - `elements`: names of the columns of `values`, such as ("m12", "m33", "m34"), for "mueller".
    - `ratios`: names of the columns of `values`, `delta` and their errors, some of "ane", "aps" and "asp"
      (`pellicle.signals.generalised`), for "generalised-psi-delta".
    - `transmission`: Ψ and Δ are those of t_p/t_s, for "psi-delta".
    - `left_out`: points at noisy edges (`data.noisy_edges`) or beyond the data of media (`within`).

    **Raises:** DataError for values that no sample has, UsageError for unknown words, ValueError for shapes.

    >>> Spectrum(np.array([500.0, 600.0]), np.array([0.21, 0.19]), "R").values.tolist()
    [0.21, 0.19]
    """

    wavelength: np.ndarray
    values: np.ndarray
    signal: str
    sigma: np.ndarray | None = None
    polarisation: str = "unpolarised"
    angle: np.ndarray | None = None
    calibrated: bool = True
    path: str = ""
    sha256: str = ""
    notes: tuple[str, ...] = ()
    lines: np.ndarray | None = None
    delta: np.ndarray | None = None
    delta_sigma: np.ndarray | None = None
    folded: bool | None = None
    sweeps: tuple[Spectrum, ...] = ()
    name: str = ""
    declared: tuple[tuple[str, str], ...] = ()
    depolarisation: np.ndarray | None = None
    depolarisation_sigma: np.ndarray | None = None
    elements: tuple[str, ...] = ()
    azimuth: np.ndarray | None = None
    ratios: tuple[str, ...] = ()
    transmission: bool = False
    left_out: LeftOut | None = None

    def __post_init__(self) -> None:
        for name in _ARRAYS:
            if isinstance(value := getattr(self, name), str):
                raise UsageError(f"`{name}` must be an array, not {value!r}: pl.read_spectrum reads files")
        for name, known in (("signal", SIGNALS), ("polarisation", POLARISATIONS)):
            if getattr(self, name) not in known:
                raise UsageError(f"`{name}` must be one of {', '.join(known)}, not {getattr(self, name)!r}")
        stated = KINDS[self.signal]
        for name in KEYWORDS:
            value = getattr(self, name)
            given = value is not None and value is not False and not (isinstance(value, tuple) and not value)
            if (given and name not in stated.keywords) or (not given and name in stated.required):
                kinds = [word for word, kind in KINDS.items() if name in kind.keywords] or [""]
                go = "go" if name.endswith("s") else "goes"
                raise UsageError(f'`{name}` {go} with `signal="{kinds[0]}"`: give both, or neither')
        if self.depolarisation_sigma is not None and self.depolarisation is None:
            raise UsageError("`depolarisation_sigma` goes with `depolarisation`: give both, or neither")
        size, parts = np.size(self.wavelength), self.kind.parts
        given, order = [x for x in (self.azimuth, self.angle) if x is not None], None
        if given or not size or not np.all(np.diff(self.wavelength) > 0):
            order = np.lexsort((*given, self.wavelength))
        for name in _ARRAYS:
            value = getattr(self, name)
            if value is None:
                continue
            columns = len(parts) if name in _OF_PARTS else 0
            if np.shape(value) != ((size, columns) if columns else (size,)):
                expected = f"{columns} numbers" if columns else "one number"
                raise ValueError(
                    f"`{name}`: expected {expected} per wavelength ({size}), got {np.shape(value)}"
                )
            array = np.array(value, dtype=np.int64 if name == "lines" else np.float64)  # a copy
            array = array if order is None else array[order]
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        self._check_arrays()
        if self.folded is None:
            kink = None
            if self.delta is not None and not parts:
                group = np.zeros(size) if self.setting is None else self.setting
                kink = folding_at(self.wavelength, self.values, self.delta, group)
            object.__setattr__(self, "folded", kink is not None)
            if kink is not None:
                object.__setattr__(self, "notes", (*self.notes, folding_note(kink)))

    @property
    def kind(self) -> Signal:
        """Kind of the signal: quantities, units, and their comparison in a fit."""
        return KINDS[self.signal].of(self)

    def _check_arrays(self) -> None:
        """Refuse what a file may not contain either. Raises DataError."""
        present = {name: array for name in _ARRAYS if (array := getattr(self, name)) is not None}
        for name in tuple(present):
            if present[name].ndim > 1:
                pairs = zip(self.kind.parts, present.pop(name).T, strict=True)
                present |= {f"{column} {name}": own for column, own in pairs}
        for name, array in present.items():
            refuse_first(array, ~np.isfinite(array), self.place(f"`{name}`"), f"is not finite; {_REMEDY}")
            if name == "wavelength" or name.endswith("sigma"):
                refuse_first(array, array <= 0, self.place(f"`{name}`"), f"is not above zero; {_REMEDY}")
        angle = present.get("angle", np.zeros(len(self)))
        reason = f"is not from 0 to 90 degrees; {_REMEDY}"
        refuse_first(angle, (angle < 0) | (angle > 90), self.place("`angle`"), reason)
        same = angle if self.azimuth is None else np.stack([angle, self.azimuth])
        repeated = (np.diff(self.wavelength) == 0) & np.all(np.atleast_2d(np.diff(same)) == 0, axis=0)
        reason = "comes twice at one angle; keep one of the points, or their mean"
        refuse_first(self.wavelength[1:], repeated, lambda row: self.place("`wavelength`")(row + 1), reason)
        self.kind.check(self, self.place, _REMEDY)

    @property
    def ellipsometric(self) -> bool:
        """True for Ψ and Δ and for Mueller elements, which have no scale and no offset."""
        return self.kind.ellipsometric

    @property
    def setting(self) -> np.ndarray | None:
        """A number for each point that is the same at one angle of incidence and azimuth, None without."""
        return setting_numbers(self.angle, self.azimuth)

    @property
    def settings(self) -> list[Setting]:
        """The points of each angle of incidence and azimuth."""
        return settings(self.angle, self.azimuth, len(self))

    @property
    def source(self) -> str:
        """Path of the file, and the name of the spectrum within it: `film.dat [Rp]`."""
        return " ".join(part for part in (self.path, f"[{self.name}]" if self.name else "") if part)

    def place(self, name: str) -> Where:
        """Return the place of a point, as a function of its row, for a message about `name`."""
        path = f"{self.source}: " if self.source else ""

        def place(row: int) -> str:
            line = "" if self.lines is None else f"line {self.lines[row]}, "
            return f"{path}{line}{name} at {self.wavelength[row]:g} nm"

        return place

    def __len__(self) -> int:
        return self.wavelength.size

    def __str__(self) -> str:
        span = "empty"
        if len(self):
            low, high = self.wavelength[0], self.wavelength[-1]
            span = f"{low:g} to {high:g} nm" if low < high else f"{low:g} nm"
        return f"{self.source or 'spectrum'}: {len(self)} points of {self.signal}, {span}"

    __repr__ = __str__

    def cut(self, low: float | int, high: float | int) -> Spectrum:
        """Return the points with low ≤ wavelength ≤ high (nm).

        Raises UsageError for an empty range, DataError if fewer than 5 points remain.
        """
        inside, note = inside_range(self.wavelength, (low, high), self.source)
        kept = {
            name: None if getattr(self, name) is None else getattr(self, name)[inside] for name in _ARRAYS
        }
        sweeps = tuple(sweep.cut(low, high) for sweep in self.sweeps)
        return dataclasses.replace(self, **kept, notes=(*self.notes, note), sweeps=sweeps)


_ARRAYS = tuple(field.name for field in dataclasses.fields(Spectrum) if "ndarray" in str(field.type))


def within(spectrum: Spectrum, limits: tuple[float, float], reason: str) -> Spectrum:
    """Leave out the points beyond `limits` (nm), for a `reason`; all stay if less than half remain.

    Points left out of Ψ and Δ and of matrices have no value.
    """
    low, high = limits
    nm = spectrum.wavelength
    out = (nm < low) | (nm > high)
    kept = len(spectrum) - int(out.sum())
    if not out.any() or kept < max(FEWEST_POINTS, LEAST_SHARE * len(spectrum)):
        return spectrum
    before = spectrum.left_out or LeftOut(np.empty(0), np.empty(0), "")
    values = spectrum.values[out] if spectrum.kind.has_scale else np.full(int(out.sum()), np.nan)
    points = np.r_[before.wavelength, nm[out]], np.r_[before.values, values]
    short = "beyond the data of a medium"
    left_out = LeftOut(*points, f"{before.reason}; {short}" if before.reason else short)
    cut = spectrum.cut(nm[~out].min(), nm[~out].max())
    note = f"{cut.notes[-1]}: {reason}"
    return dataclasses.replace(cut, notes=(*spectrum.notes, note), left_out=left_out)


def inside_range(
    wavelength: np.ndarray, limits: tuple[float, float], path: str
) -> tuple[Bool[np.ndarray, " points"], str]:
    """Return which wavelengths (nm) are within the limits, and a note. Raises as `Spectrum.cut` does."""
    low, high = limits
    if not (0 <= low < high):
        raise UsageError(f"`range=({low:g}, {high:g})` is empty: give the lower wavelength in nm first")
    inside = (wavelength >= low) & (wavelength <= high)
    if inside.sum() < FEWEST_POINTS:
        raise DataError(
            f"{path or 'spectrum'}: only {inside.sum()} of {wavelength.size} points, which cover "
            f"{wavelength.min():g} to {wavelength.max():g} nm, lie in `range=({low:g}, {high:g})`; widen it "
            f"to keep at least {FEWEST_POINTS}"
        )
    return inside, f"{inside.sum()} of {wavelength.size} points kept, {low:g} to {high:g} nm"


class Setting(NamedTuple):
    """The points measured at one angle of incidence and one azimuth in degrees; None where none is stated."""

    rows: Int[np.ndarray, " points"]
    angle: float | None
    azimuth: float | None


def setting_numbers(
    angle: Float[np.ndarray, " points"] | None, azimuth: Float[np.ndarray, " points"] | None
) -> Float[np.ndarray, " points"] | None:
    """Return a number for each point that is the same at one angle and azimuth; None where neither is known.

    Without azimuths it is the angle itself.
    """
    if azimuth is None:
        return angle
    if angle is None:
        return azimuth
    pairs = np.stack([angle, azimuth])
    return np.unique(pairs, axis=1, return_inverse=True)[1].ravel().astype(float)


def settings(
    angle: Float[np.ndarray, " points"] | None,
    azimuth: Float[np.ndarray, " points"] | None,
    points: int,
) -> list[Setting]:
    """Return the points of each angle and azimuth, in rising order of both."""
    numbers = setting_numbers(angle, azimuth)
    if numbers is None:
        return [Setting(np.arange(points), None, None)]
    levels = []
    for number in np.unique(numbers):
        rows = np.flatnonzero(numbers == number)
        own = (None if x is None else float(x[rows[0]]) for x in (angle, azimuth))
        levels.append(Setting(rows, *own))
    return levels


def named(setting: Setting, every: list[Setting]) -> str | None:
    """Return the name of a setting among several, such as `65°` or `azimuth 45°`; None for a single one."""
    if len(every) == 1:
        return None
    parts = []
    if setting.angle is not None and len({each.angle for each in every}) > 1:
        parts.append(f"{setting.angle:g}°")
    if setting.azimuth is not None and len({each.azimuth for each in every}) > 1:
        parts.append(f"azimuth {setting.azimuth:g}°")
    return ", ".join(parts)
