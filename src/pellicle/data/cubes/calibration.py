"""Frames of a camera for a cube: white, dark, reflectance of the white, and saturation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pellicle.data.cubes.camera_frames import Calibration, Frame, frame_of, saturation_level
from pellicle.data.cubes.frame_files import read_frame
from pellicle.data.cubes.raw_cube import RawCube
from pellicle.data.cubes.stored_arrays import ANGLE
from pellicle.data.read_spectrum import read_spectrum
from pellicle.data.signal_checks import HIGHEST
from pellicle.errors import UsageError


@dataclass(frozen=True, eq=False)
class Frames:
    """Frames of a camera, the reflectance of the white at all bands, and the counts of saturation."""

    white: Frame
    dark: Frame | None
    reflectance: np.ndarray
    saturation: float | None

    def at(self, bands: np.ndarray) -> Calibration:
        """The calibration of some bands."""
        return Calibration(self.white, self.dark, self.reflectance[bands], bands, self.saturation)


def camera_frames(
    raw: RawCube, nm: np.ndarray, white: Any, dark: Any, reflectance: Any, saturation: float | None
) -> tuple[Frames, list[str]]:
    """Return the frames of a cube whose bands are at `nm`, and notes on them.

    `white` and `dark` are files or arrays, `reflectance` of the white a number, a CSV or a function of the
    wavelength. Raises DataError or UsageError.
    """
    if ANGLE in raw.arrays["values"].axes or "delta" in raw.arrays:
        raise UsageError(
            f"{raw.path}: `white_frame` is for a cube of counts against wavelength only: leave it out"
        )
    bright, note = frame_of(read_frame(white, raw), raw, "white")
    notes, black = [note], None
    if dark is None:
        notes.append("no dark frame: the counts without light are taken as zero")
    else:
        black, note = frame_of(read_frame(dark, raw), raw, "dark")
        notes.append(note)
    level, note = saturation_level(raw, bright, saturation)
    known = _white(reflectance, nm, raw.path)
    return Frames(bright, black, known, level), [*notes, *([note] if note else [])]


def _white(reflectance: Any, nm: np.ndarray, path: str) -> np.ndarray:
    """Reflectance of the white reference at all bands, NaN beyond its table. Raises UsageError."""
    if callable(reflectance):
        values = np.asarray(reflectance(nm), dtype=float)
    else:
        reflectance = 1.0 if reflectance is None else reflectance
        try:
            values = np.full(nm.size, float(reflectance))
        except (TypeError, ValueError):
            known = read_spectrum(reflectance)
            values = np.interp(nm, known.wavelength, known.values, left=np.nan, right=np.nan)
    values = np.broadcast_to(values, nm.shape)
    if np.any(values <= 0) or np.any(values > HIGHEST) or not np.any(np.isfinite(values)):
        raise UsageError(
            f"{path}: `white_reflectance` must be above 0 and a fraction at the wavelengths of the bands, "
            "as in 0.99"
        )
    return values
