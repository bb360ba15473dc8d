"""Reading of cubes: spectra of many positions of a sample, from files or xarray objects."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from logging import getLogger
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.cube import Cube
from pellicle.data.cubes import camera_frames as camera
from pellicle.data.cubes.bands import chosen_bands, in_nm, parse_wavelengths
from pellicle.data.cubes.fingerprint import fingerprint
from pellicle.data.cubes.frame_files import read_frame
from pellicle.data.cubes.masks import read_mask
from pellicle.data.cubes.pixel_array import Conversion, PixelArray, Scale, ShareOfSignal
from pellicle.data.cubes.raw_cube import COUNTS, Asked, RawCube
from pellicle.data.cubes.sampled_checks import (
    check_angles,
    check_level,
    check_type,
    live_bands,
    refuse_counts,
    sample,
)
from pellicle.data.cubes.stored_arrays import ANGLE, Stored
from pellicle.data.noise_level import noise_level
from pellicle.data.read_spectrum import read_spectrum
from pellicle.data.spectrum import POLARISATIONS
from pellicle.data.tabular.units import SIGNAL_UNITS, signal_unit
from pellicle.errors import DataError, UsageError

log = getLogger(__name__)
SIGNALS = ("R", "T", "psi-delta")
PathLike = str | os.PathLike[str]


def read_cube(
    source: Any,
    *,
    variable: str | None = None,
    wavelengths: PathLike | Sequence[float] | np.ndarray | None = None,
    wavelength_unit: str | None = None,
    signal: str | None = None,
    signal_unit: str | float | int | None = None,
    angle: float | int | None = None,
    polarisation: str | None = None,
    range: tuple[float | int, float | int] | None = None,
    without_bands: str | Sequence[tuple[float, float]] | None = None,
    noise: float | int | str | None = None,
    mask: PathLike | np.ndarray | None = None,
    white_frame: PathLike | np.ndarray | None = None,
    dark_frame: PathLike | np.ndarray | None = None,
    white_reflectance: float | int | str | os.PathLike[str] | Callable[[np.ndarray], Any] | None = None,
    saturation: float | int | None = None,
    calibrated: bool | None = None,
) -> Cube:
    """Read a cube: reflectance, transmittance, or Ψ and Δ against wavelength at every pixel.

    Only axes and a sample of the pixels are read; the values stay in the file and are read by blocks.

    **Arguments:**

    - `source`: a file or folder (zarr, NetCDF, ENVI, TIFF stack, `.npy`, `.npz`, or a folder of spectra
      with a table of their positions), an xarray DataArray or Dataset, an array, or a `Cube`,
      which is returned as it is.
    - `variable`: the name of the variable to read, where there are several.
    - `wavelengths` of the bands, where the file has none: numbers, "400:900:5", or a file of numbers.
    - `wavelength_unit`: "nm", "um", "A", "eV", "cm-1" or "THz"; overrides what the file states.
    - `signal`: "R", "T" or "psi-delta", where the file does not name it (else R).
    - `signal_unit`: "fraction", "percent", "absorbance", or the stored number that stands for 1.
    - `angle` of incidence in degrees, `polarisation`: where the file does not state them.
    - `range`: wavelengths to use, (low, high) in nm; `without_bands`: intervals of dead bands in nm,
      "755:775,820" or pairs.
    - `noise`: standard deviation of every point (degrees for Ψ and Δ), "2 %" of the signal, or the name of a
      variable; replaces that of the file.
    - `mask`: what is not zero is used: an array, a PNG, TIFF or `.npy` file, or the name of a variable.
    - `white_frame`, `dark_frame`: counts of a white reference and without light, as an image, a line, or one
      spectrum: a file or an array. The cube then is counts too.
    - `white_reflectance`: of the white reference: a number, a CSV, or a function of the wavelength in nm (1).
    - `saturation`: counts from which a pixel is saturated (the largest of a whole-number type).
    - `calibrated`: False lifts the limits on the values.

    **Returns:** a `Cube`, in nm, degrees and fractions, bands by increasing wavelength.

    **Raises:** DataError (unreadable or impossible data) or UsageError (an argument missing or wrong): one
    sentence with the file and the remedy.
    """
    if isinstance(source, Cube):
        return source
    if signal is not None and signal not in SIGNALS:
        raise UsageError(f"`signal` of a cube must be one of {', '.join(SIGNALS)}, not {signal!r}")
    if polarisation is not None and polarisation not in POLARISATIONS:
        raise UsageError(f"`polarisation` must be one of {', '.join(POLARISATIONS)}, not {polarisation!r}")
    of_frames = (dark_frame, white_reflectance, saturation)
    if white_frame is None and any(one is not None for one in of_frames):
        raise UsageError(
            "`dark_frame`, `white_reflectance` and `saturation` need `white_frame`: the counts of white"
        )
    given, unit = (None, "") if wavelengths is None else parse_wavelengths(wavelengths)
    raw = _raw(source, Asked(given, wavelength_unit or unit or None, variable, signal))
    path = raw.path
    for stored in raw.arrays.values():
        check_type(stored.data.dtype, path)
    nm, notes = in_nm(raw.wavelength, raw.unit, wavelength_unit, path)
    bands, told = chosen_bands(nm, range, without_bands, raw.good, path)
    notes = [*raw.notes, *notes, *told]
    kind = signal or raw.signal
    if kind is None:
        kind = "R"
        notes.append('signal: R, assumed; give `signal="T"` for transmittance')
    if (kind == "psi-delta") != ("delta" in raw.arrays):
        raise UsageError(f"{path}: psi-delta needs variables named psi and delta: name both in the file")
    frames: _Frames | None = None
    if white_frame is not None:
        frames, told = _frames(raw, white_frame, dark_frame, saturation)
        notes += told
    calibrated = raw.calibrated if calibrated is None else calibrated
    scale, told = _scale(raw, kind, signal_unit, calibrated, frames is not None)
    white = None if frames is None else _white(white_reflectance, nm, path)
    unlike = _Values(raw, scale, frames, white)
    values = {name: unlike.array(name, bands) for name in raw.arrays if name in ("values", "delta")}
    seen = sample(values, len(raw.dims))
    live, dead = live_bands(seen["values"], path)
    if not live.all():
        bands, seen = bands[live], {name: array[:, live] for name, array in seen.items()}
    notes += [*told, *dead]
    if kind == "psi-delta":
        check_angles(seen["values"], seen["delta"], path)
    elif calibrated:
        check_level(seen["values"], kind, path)
    arrays: dict[str, Any] = {name: unlike.array(name, bands) for name in values}
    arrays |= _errors(unlike, arrays, bands, noise)
    sizes = tuple(raw.arrays["values"].size(axis) for axis in raw.dims)
    used = None if mask is None else read_mask(mask, raw, sizes)
    angles = raw.angle if angle is None else _stated_angle(raw, float(angle))
    facts = {
        "scale": scale,
        "signal": kind,
        "noise": noise,
        "mask": used,
        "white": white,
        "saturation": None if frames is None else frames.saturation,
        "variable": variable,
        "polarisation": polarisation,
    }
    beside = [Path(f) for f in (white_frame, dark_frame) if isinstance(f, str | os.PathLike)]
    facts |= {f"frame {i}": f for i, f in enumerate((white_frame, dark_frame)) if isinstance(f, np.ndarray)}
    axes = [nm[bands], bands, np.zeros(0) if angles is None else angles]
    digest, told = fingerprint(raw, [*raw.files, *beside] if raw.files else [], facts, axes)
    cube = Cube(
        arrays,
        nm[bands],
        kind,
        raw.dims,
        angle=angles,
        polarisation=polarisation or raw.polarisation or "unpolarised",
        coords=raw.coords,
        units=raw.units,
        mask=used,
        calibrated=calibrated,
        path=path,
        fingerprint=digest,
        notes=(*notes, *([told] if told else [])),
    )
    log.info("%s", cube)
    return cube


@dataclass(frozen=True, eq=False)
class _Frames:
    """Frames of a camera and the counts of saturation."""

    white: camera.Frame
    dark: camera.Frame | None
    saturation: float | None


@dataclass(frozen=True, eq=False)
class _Values:
    """The arrays of a cube as they are converted."""

    raw: RawCube
    scale: Scale
    frames: _Frames | None
    white: np.ndarray | None

    def array(self, name: str, bands: np.ndarray) -> PixelArray:
        """Values of the bands, converted block by block."""
        return self.of(self.raw.arrays[name], bands, measured=not name.endswith("sigma"))

    def of(self, stored: Stored, bands: np.ndarray, *, measured: bool) -> PixelArray:
        """The same for any variable; errors are scaled only."""
        raw = self.raw
        sizes = tuple(raw.arrays["values"].size(axis) for axis in raw.dims)
        steps: list[Conversion] = [self.scale if measured else replace(self.scale, absorbance=False)]
        if self.frames is not None and self.white is not None:
            frames, white = self.frames, self.white[bands]
            steps.append(camera.Calibration(frames.white, frames.dark, white, bands, frames.saturation))
        angles = None
        if ANGLE in raw.arrays["values"].axes:
            angles = np.arange(raw.arrays["values"].size(ANGLE))
        return PixelArray(stored, raw.dims, sizes, bands, angles, steps)


def _raw(source: Any, asked: Asked) -> RawCube:
    from pellicle.data.cubes import detect, xarray_cubes

    if xarray_cubes.is_xarray(source):
        path = str(source.encoding.get("source", "")) or f"the {type(source).__name__}"
        return xarray_cubes.xarray_to_raw(source, path, asked)
    if isinstance(source, np.ndarray):
        from pellicle.data.cubes.numpy_files import arrays_to_raw

        return arrays_to_raw({"": source}, "the array", asked, ())
    if not isinstance(source, str | os.PathLike):
        raise UsageError(f"a cube must be a path, an xarray object or an array, not {type(source).__name__}")
    return detect.read_raw(Path(source), asked)


def _frames(raw: RawCube, white: Any, dark: Any, saturation: float | None) -> tuple[_Frames, list[str]]:
    if ANGLE in raw.arrays["values"].axes or "delta" in raw.arrays:
        raise UsageError(
            f"{raw.path}: `white_frame` is for a cube of counts against wavelength only: leave it out"
        )
    bright, note = camera.frame_of(read_frame(white, raw), raw, "white")
    notes, black = [note], None
    if dark is None:
        notes.append("no dark frame: the counts without light are taken as zero")
    else:
        black, note = camera.frame_of(read_frame(dark, raw), raw, "dark")
        notes.append(note)
    level, note = camera.saturation_level(raw, bright, saturation)
    return _Frames(bright, black, level), [*notes, *([note] if note else [])]


def _white(reflectance: Any, nm: np.ndarray, path: str) -> np.ndarray:
    """Reflectance of the white reference at all bands, as a fraction."""
    if callable(reflectance):
        values = np.asarray(reflectance(nm), dtype=float)
    else:
        reflectance = 1.0 if reflectance is None else reflectance
        try:
            values = np.full(nm.size, float(reflectance))
        except ValueError:
            known = read_spectrum(reflectance)
            values = np.interp(nm, known.wavelength, known.values, left=np.nan, right=np.nan)
    values = np.broadcast_to(values, nm.shape)
    if np.any(values <= 0) or np.any(values > 1.5) or not np.any(np.isfinite(values)):
        raise UsageError(
            f"{path}: `white_reflectance` must be above 0 and a fraction at the wavelengths of the bands, "
            "as in 0.99"
        )
    return values


def _scale(
    raw: RawCube, kind: str, asked: str | float | None, calibrated: bool, framed: bool
) -> tuple[Scale, list[str]]:
    """Conversion of the stored numbers, and notes. Raises DataError for counts without a scale."""
    unit, factor = raw.signal_unit, 1.0 / raw.divisor
    if framed or kind == "psi-delta":
        if asked is not None:
            reason = "frames of a camera give the scale" if framed else "psi and delta are in degrees"
            raise UsageError(f"{raw.path}: {reason}; leave `signal_unit` out")
        return Scale(factor, raw.missing), []
    if asked is not None:
        unit = signal_unit(str(asked))
        try:
            full = float(asked)
        except ValueError:
            full = 0.0
        if full > 0 and str(asked) != "1":
            return Scale(factor / full, raw.missing), [f"values divided by {full:g}, as given"]
        if unit is None:
            raise UsageError(
                f"`signal_unit` must be one of {', '.join(SIGNAL_UNITS)}, or the number that stands for 1, "
                f"not {asked!r}"
            )
    stored = raw.arrays["values"].data.dtype
    whole = np.dtype(stored).kind in "iu" and raw.divisor == 1.0 and unit is None
    if calibrated and (unit == COUNTS or whole):
        raise refuse_counts(raw.path, stored)
    if unit == "percent":
        return Scale(factor / 100, raw.missing), ["signal unit: percent"]
    if unit == "absorbance":
        return Scale(factor, raw.missing, True), [f"signal unit: absorbance A, converted to {kind} = 10^-A"]
    assumed = "" if unit == "fraction" else ", assumed"
    return Scale(factor, raw.missing), [
        f"signal unit: fraction{assumed}" if calibrated else "signal unit: arbitrary"
    ]


def _errors(
    unlike: _Values, arrays: Mapping[str, PixelArray], bands: np.ndarray, noise: float | str | None
) -> dict[str, Any]:
    """Standard deviations: those given, or those of the file."""
    raw = unlike.raw
    names = {"values": "sigma", "delta": "delta_sigma"}
    if isinstance(noise, str) and noise in raw.others:
        return {"sigma": unlike.of(raw.others[noise], bands, measured=False)}
    if noise is None:
        if unlike.frames is not None or unlike.scale.absorbance:
            return {}
        return {name: unlike.array(name, bands) for name in names.values() if name in raw.arrays}
    level = noise_level(noise)
    if level.relative:
        if "delta" in arrays:
            raise UsageError(
                f"`noise` {level} is a share of the signal: give that of psi and delta in degrees"
            )
        return {"sigma": ShareOfSignal(arrays["values"], level.value)}
    return {names[name]: np.full(bands.size, level.value) for name in arrays}


def _stated_angle(raw: RawCube, angle: float) -> np.ndarray:
    if raw.angle is not None and np.any(raw.angle != angle):
        raise UsageError(f"{raw.path}: states its own angles; leave `angle` out")
    if not 0 <= angle < 90:
        raise DataError(f"`angle` must be from 0 to below 90 degrees, not {angle:g}")
    return np.array([angle])
