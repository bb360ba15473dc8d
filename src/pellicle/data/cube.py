"""Cubes: spectra of one kind at many positions of a sample, as arrays that may stay on disk."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from pellicle.data.cubes.raw_cube import divided, lazy
from pellicle.data.fingerprint import fingerprint


@dataclass(frozen=True, eq=False, repr=False)
class Cube:
    """One signal against wavelength, and perhaps angle, at every pixel.

    **Arguments:**

    - `arrays`: the measured values by name: "values" (R or T as fractions, or Ψ in degrees), and as far as
      measured "delta", "sigma", "delta_sigma" (standard deviations in the same unit). Each is
      (*pixels, bands) or (*pixels, bands, angles), and anything that has `shape` and `dtype` and is read by
      slicing: a NumPy array or memory map, a zarr or dask array. "sigma" may also be (bands,). NaN marks what
      was not measured.
    - `wavelength` (bands,) in nm, increasing; `angle` (angles,) of incidence in degrees, None where the cube
      has no such axis.
    - `signal`: "R", "T" or "psi-delta"; `polarisation` as of a `Spectrum`.
    - `dims`: names of the axes of pixels, such as ("y", "x"), ("time", "y", "x") or ("site",).
    - `coords`: coordinates of pixels by name, each along one of the `dims` or (sites,), and their `units`.
    - `mask` (*pixels): False where a pixel is left out; None where all are used.
    - `calibrated`: False for values of unknown scale.
    - `path`, `fingerprint`: where the cube comes from, and a digest that changes with its content.
    - `notes`: sentences on how it was read.
    """

    arrays: Mapping[str, Any]
    wavelength: np.ndarray
    signal: str = "R"
    dims: tuple[str, ...] = ("y", "x")
    angle: np.ndarray | None = None
    polarisation: str = "unpolarised"
    coords: Mapping[str, np.ndarray] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    mask: np.ndarray | None = None
    calibrated: bool = True
    path: str = ""
    fingerprint: str = ""
    notes: tuple[str, ...] = ()

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of pixels along each of the `dims`."""
        return tuple(self.arrays["values"].shape[: len(self.dims)])

    @property
    def points(self) -> int:
        """Data points of a pixel: bands, times angles where there are several."""
        return self.wavelength.size * (1 if self.angle is None else self.angle.size)

    def __str__(self) -> str:
        pixels = " x ".join(map(str, self.shape))
        low, high = self.wavelength[0], self.wavelength[-1]
        return (
            f"{self.path or 'cube'}: {pixels} pixels of {self.signal}, {self.wavelength.size} bands from"
            f" {low:g} to {high:g} nm"
        )

    __repr__ = __str__

    def pixels(self, where: tuple[slice, ...]) -> dict[str, np.ndarray]:
        """Read a block of pixels: arrays (pixels, points) by name, wavelength before angle.

        "sigma" is left out where the cube has none. Pixels outside the mask are NaN.
        """
        count = math.prod(len(range(n)[part]) for part, n in zip(where, self.shape, strict=True))
        block: dict[str, np.ndarray] = {}
        for name, array in self.arrays.items():
            if len(array.shape) > 1:
                block[name] = np.asarray(array[where], dtype=float).reshape(count, self.points)
            else:
                bands = np.asarray(array, dtype=float)
                block[name] = np.broadcast_to(bands.repeat(self.points // bands.size), (count, self.points))
        if self.mask is not None:
            block["values"] = np.where(self.mask[where].reshape(-1, 1), block["values"], np.nan)
        return block

    def part(self, where: tuple[slice, ...]) -> Cube:
        """The cube of some of the pixels, a slice along each of the `dims`; values stay in their file."""
        arrays = {
            name: array if len(array.shape) == 1 else lazy(array, self.dims).part(where)
            for name, array in self.arrays.items()
        }
        along = dict(zip(self.dims, where, strict=True))
        if len(self.dims) == 1:  # coordinates of sites have names of their own
            along = dict.fromkeys(self.coords, where[0])
        coords = {name: values[along[name]] for name, values in self.coords.items() if name in along}
        mask = None if self.mask is None else self.mask[where]
        digest = fingerprint(self.fingerprint, str(where)) if self.fingerprint else ""
        return replace(self, arrays=arrays, coords=coords, mask=mask, fingerprint=digest)

    def coarse(self, factor: int) -> Cube:
        """The cube of every `factor`-th pixel along each axis but that of time."""
        steps = [1 if dim == "time" else min(factor, n) for dim, n in zip(self.dims, self.shape, strict=True)]
        return self.part(tuple(slice(step // 2, None, step) for step in steps))

    def divided(self, gain: np.ndarray, note: str) -> Cube:
        """The cube divided by a gain (bands,), block by block as it is read, with a note on it."""
        step = partial(divided, gain=gain if self.angle is None else gain[:, None])
        arrays = {
            name: array / gain if len(array.shape) == 1 else lazy(array, self.dims).then(step)
            for name, array in self.arrays.items()
        }
        digest = fingerprint(self.fingerprint, "divided", gain) if self.fingerprint else ""
        return replace(self, arrays=arrays, notes=(*self.notes, note), fingerprint=digest)
