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
from pellicle.data.cubes.bands import chosen_bands, in_nm, parse_wavelengths
from pellicle.data.cubes.calibration import Frames, camera_frames
from pellicle.data.cubes.fingerprint import fingerprint
from pellicle.data.cubes.masks import read_mask
from pellicle.data.cubes.pixel_array import Conversion, PixelArray, Scale, ShareOfSignal
from pellicle.data.cubes.raw_cube import Asked, RawCube
from pellicle.data.cubes.sampled_checks import check_angles, check_level, check_type, live_bands, sample
from pellicle.data.cubes.stored_arrays import ANGLE, Stored
from pellicle.data.cubes.value_scale import value_scale
from pellicle.data.noise_level import noise_level
from pellicle.data.spectrum import POLARISATIONS
from pellicle.errors import UsageError

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
    frames = None
    if white_frame is not None:
        given_frames = (white_frame, dark_frame, white_reflectance, saturation)
        frames, told = camera_frames(raw, nm, *given_frames)
        notes += told
    calibrated = raw.calibrated if calibrated is None else calibrated
    scale, told = value_scale(raw, kind, signal_unit, calibrated=calibrated, framed=frames is not None)
    notes += [told] if told else []
    used = None if mask is None else read_mask(mask, raw, raw.sizes)
    converted = _Converted(raw, scale, frames)
    names = [name for name in ("values", "delta") if name in raw.arrays]
    seen = sample({name: converted.array(name, bands) for name in names}, len(raw.dims), used)
    live, told = live_bands(seen["values"], int(np.prod(raw.sizes)), path)
    notes += told
    bands, seen = bands[live], {name: values[:, live] for name, values in seen.items()}
    if kind == "psi-delta":
        check_angles(seen["values"], seen["delta"], path)
    elif calibrated:
        check_level(seen["values"], kind, path)
    arrays: dict[str, Any] = {name: converted.array(name, bands) for name in names}
    arrays |= converted.errors(arrays, bands, noise)
    angles = raw.angle if angle is None else _stated_angle(raw, float(angle))
    facts = {
        "scale": scale,
        "signal": kind,
        "noise": noise,
        "mask": used,
        "white": None if frames is None else frames.reflectance,
        "saturation": None if frames is None else frames.saturation,
        "variable": variable,
        "polarisation": polarisation,
    }
    beside = [Path(f) for f in (white_frame, dark_frame) if isinstance(f, str | os.PathLike)]
    facts |= {f"frame {i}": f for i, f in enumerate((white_frame, dark_frame)) if isinstance(f, np.ndarray)}
    axes = [nm[bands], bands, np.zeros(0) if angles is None else angles]
    digest, told = fingerprint(raw, beside, facts, axes)
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
        notes=_once([*notes, *([told] if told else [])]),
    )
    log.info("%s", cube)
    return cube


@dataclass(frozen=True, eq=False)
class _Converted:
    """The arrays of a cube as they are converted when a block is read."""

    raw: RawCube
    scale: Scale
    frames: Frames | None

    def array(self, name: str, bands: np.ndarray) -> PixelArray:
        """Measured values at some bands."""
        steps: list[Conversion] = [self.scale]
        if self.frames is not None:
            steps.append(self.frames.at(bands))
        return self._pixels(self.raw.arrays[name], bands, steps)

    def errors(
        self, arrays: Mapping[str, PixelArray], bands: np.ndarray, noise: float | str | None
    ) -> dict[str, Any]:
        """Standard deviations by name: those given, or those of the file. Raises UsageError."""
        raw, names = self.raw, {"values": "sigma", "delta": "delta_sigma"}
        named = isinstance(noise, str) and noise in raw.others
        if named or noise is None:
            stored = {n: raw.arrays[n] for n in names.values() if n in raw.arrays}
            if named:
                stored = {"sigma": raw.others[str(noise)]}
            elif self.frames is not None or self.scale.absorbance:
                return {}  # of counts or absorbances, which are not converted
            scale = replace(self.scale, absorbance=False)
            return {name: self._pixels(one, bands, [scale]) for name, one in stored.items()}
        level = noise_level(noise)
        if level.relative and "delta" in arrays:
            raise UsageError(
                f"`noise` {level} is a share of the signal: give that of psi and delta in degrees"
            )
        if level.relative:
            return {"sigma": ShareOfSignal(arrays["values"], level.value)}
        return {names[name]: np.full(bands.size, level.value) for name in arrays}

    def _pixels(self, stored: Stored, bands: np.ndarray, steps: list[Conversion]) -> PixelArray:
        values = self.raw.arrays["values"]
        angles = np.arange(values.size(ANGLE)) if ANGLE in values.axes else None
        return PixelArray(stored, self.raw.dims, self.raw.sizes, bands, angles, steps)


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


def _once(notes: Sequence[str]) -> tuple[str, ...]:
    """Notes without later ones on a unit: those of a folder's spectra are already in nm and fractions."""
    units = ("wavelength unit: ", "signal unit: ")
    first = [next((i for i, n in enumerate(notes) if n.startswith(unit)), -1) for unit in units]
    return tuple(n for i, n in enumerate(notes) if i in first or not n.startswith(units))


def _stated_angle(raw: RawCube, angle: float) -> np.ndarray:
    if raw.angle is not None and np.any(raw.angle != angle):
        raise UsageError(f"{raw.path}: states its own angles; leave `angle` out")
    if not 0 <= angle < 90:
        raise UsageError(f"`angle` must be from 0 to below 90 degrees, not {angle:g}")
    return np.array([angle])
