"""A cube as its file has it, before units, bands and frames of a camera are applied."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pellicle.data.cubes.stored_arrays import Stored

COUNTS = "counts"
"""The signal unit of raw counts of a camera."""


@dataclass(frozen=True, eq=False)
class RawCube:
    """Content of a file of spectra of many pixels, as a reader finds it.

    **Arguments:**

    - `path` for messages; `files` on disk, whose content the fingerprint covers.
    - `arrays`: "values", and as far as present "delta", "sigma", "delta_sigma".
    - `dims`: axes of pixels in the order of the result.
    - `wavelength` of the bands as written, None where the file has none, and its `unit` as written.
    - `signal`, `polarisation`: as the file states them, else None.
    - `signal_unit`: "fraction", "percent", "absorbance" or "counts" where the file states it.
    - `calibrated`: False for an intensity on an arbitrary scale.
    - `divisor`: number by which stored values are divided, as `reflectance scale factor` of ENVI.
    - `missing`: stored value that marks what was not measured.
    - `good`: False for a band that the file marks as bad.
    - `angle` of incidence in degrees, along the axis "angle" or a single one.
    - `coords`, `units`: coordinates of pixels and their units.
    - `others`: further variables by name, which `noise` or `mask` may name.
    - `notes`: sentences on how the file was read.
    """

    path: str
    arrays: Mapping[str, Stored]
    dims: tuple[str, ...]
    wavelength: np.ndarray
    unit: str | None = None
    files: tuple[Path, ...] = ()
    signal: str | None = None
    polarisation: str | None = None
    signal_unit: str | None = None
    calibrated: bool = True
    divisor: float = 1.0
    missing: float | None = None
    good: np.ndarray | None = None
    angle: np.ndarray | None = None
    coords: Mapping[str, np.ndarray] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    others: Mapping[str, Stored] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def sizes(self) -> tuple[int, ...]:
        """Number of pixels along each of the `dims`."""
        return tuple(self.arrays["values"].size(axis) for axis in self.dims)


@dataclass(frozen=True)
class Asked:
    """The caller's statements about the content of a file, as far as readers need them.

    `wavelength` and its `unit` of the bands, None where the file has them; `variable` to read; `signal`.
    """

    wavelength: np.ndarray | None = None
    unit: str | None = None
    variable: str | None = None
    signal: str | None = None
