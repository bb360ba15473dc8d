"""A measured spectrum as arrays, wherever it came from."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from pellicle.errors import DataError, UsageError

FEWEST_POINTS = 5  # a cut that leaves less is a mistake in the range
_ARRAYS = ("wavelength", "values", "sigma", "angle", "lines", "delta", "delta_sigma")


@dataclass(frozen=True, eq=False)
class Spectrum:
    """One measured signal against wavelength, points in rising order of wavelength (nm).

    `values` are fractions (any scale where `calibrated` is false) and `sigma` their standard
    deviations in the same unit, or None. `angle` is the angle of incidence of each point in
    degrees, or None where the file does not say: then it is for the scene to say. `lines` are the
    source line numbers of the points, `notes` sentences on what was detected. `signal` is "R",
    "T", "counts" for raw detector counts, or "psi-delta": then `values` is Ψ and `delta` Δ, both in
    degrees, and `sigma` and `delta_sigma` their standard deviations; `folded` says that the sign of
    sin Δ was not measured, and Δ is in 0 to 180. Given in any order, points are sorted here.
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
    folded: bool = False

    def __post_init__(self) -> None:
        size = np.size(self.wavelength)
        order = np.lexsort((np.zeros(size) if self.angle is None else self.angle, self.wavelength))
        for name in _ARRAYS:
            given = getattr(self, name)
            if given is None:
                continue
            if np.shape(given) != (size,):
                raise ValueError(
                    f"{name}: expected one number per wavelength ({size}), got {np.shape(given)}"
                )
            array = np.asarray(given, dtype=np.int64 if name == "lines" else np.float64)[order]
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return self.wavelength.size

    def __str__(self) -> str:
        span = "empty"
        if len(self):
            lo, hi = self.wavelength[0], self.wavelength[-1]
            span = f"{lo:g} to {hi:g} nm" if lo < hi else f"{lo:g} nm"
        return f"{self.path or 'spectrum'}: {len(self)} points of {self.signal}, {span}"

    def cut(self, lo: float | int, hi: float | int) -> Spectrum:
        """The points with lo ≤ wavelength ≤ hi (nm).

        Raises UsageError for a range that is no range, DataError if fewer than 5 points remain.
        """
        if not (0 <= lo < hi):
            raise UsageError(f"--range {lo:g}:{hi:g} is no range; give the lower wavelength in nm first")
        inside = (self.wavelength >= lo) & (self.wavelength <= hi)
        if inside.sum() < FEWEST_POINTS:
            raise DataError(
                f"{self.path or 'spectrum'}: only {inside.sum()} of {len(self)} points, which cover "
                f"{self.wavelength[0]:g} to {self.wavelength[-1]:g} nm, lie in --range {lo:g}:{hi:g}; "
                f"widen it to keep at least {FEWEST_POINTS}"
            )
        kept = {
            name: None if getattr(self, name) is None else getattr(self, name)[inside] for name in _ARRAYS
        }
        note = f"{inside.sum()} of {len(self)} points kept, {lo:g} to {hi:g} nm"
        return dataclasses.replace(self, **kept, notes=(*self.notes, note))
