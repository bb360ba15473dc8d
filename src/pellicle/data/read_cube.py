"""Reading of cubes: spectra of many positions of a sample, from files or xarray objects."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from logging import getLogger
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.cube import Cube
from pellicle.data.cubes import (
    checks,
    envi,
    numpy_files,
    raw_cube,
    spectra_folder,
    tiff_stacks,
    time_series,
    traces,
    xarray_cubes,
)
from pellicle.data.cubes.frames import camera_frames, read_mask
from pellicle.data.fingerprint import WHOLE, file_fingerprint, fingerprint
from pellicle.data.movies import refuse_movie
from pellicle.data.photographs import image_format
from pellicle.data.spectrum import POLARISATIONS
from pellicle.errors import DataError, UsageError
from pellicle.signals.limits import noise_level

log = getLogger(__name__)
SIGNALS = ("R", "T", "psi-delta")
LARGEST_SPECTRUM = 2**27
"""Bytes of a larger HDF5 file are no spectrum's."""
READ = "zarr, NetCDF, ENVI (.hdr), TIFF stacks, .npy, .npz, and folders of spectra with a table of file, x, y"
READERS: dict[Callable[[Path], bool], Callable[[Path, raw_cube.Asked], raw_cube.RawCube]] = {
    xarray_cubes.is_zarr: xarray_cubes.read_zarr,
    Path.is_dir: spectra_folder.read_folder,
    xarray_cubes.is_netcdf: xarray_cubes.read_netcdf,
    numpy_files.is_numpy: numpy_files.read_numpy,
    tiff_stacks.is_tiff: tiff_stacks.read_tiff,
    envi.is_envi: envi.read_envi,
    traces.is_trace: traces.read_trace,
    spectra_folder.is_table: spectra_folder.read_folder,
}
"""Readers of cubes by the test of a file or folder that they read; the first that holds is taken."""
PathLike = str | os.PathLike[str]
_FRAME_AXES = {1: (raw_cube.WAVELENGTH,), 2: ("x", raw_cube.WAVELENGTH), 3: ("y", "x", raw_cube.WAVELENGTH)}


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
    time_from: str | None = None,
) -> Cube:
    """Read a cube: reflectance, transmittance, or Ψ and Δ against wavelength at every pixel.

    Only axes and a sample of the pixels are read; the values stay in the file and are read by blocks.

    **Arguments:**

    - `source`: a file or folder (zarr, NetCDF, ENVI, TIFF stack, `.npy`, `.npz`, or a folder of spectra
      with a table of their positions), a list of the files of a series, an xarray DataArray or Dataset, an
      array, or a `Cube`, which is returned as it is.
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
    - `time_from`: of a series of files "name" (the number in which their names differ, the default), "mtime",
      "header", or a table of file and time.

    **Returns:** a `Cube`, in nm, degrees and fractions, bands by increasing wavelength.

    **Raises:** DataError (unreadable or impossible data) or UsageError (an argument missing or wrong): one
    sentence with the file and the remedy.
    """
    if isinstance(source, Cube):
        return source
    camera = {"dark_frame": dark_frame, "white_reflectance": white_reflectance, "saturation": saturation}
    _check_arguments(polarisation, white_frame, camera)
    given, unit = (None, "") if wavelengths is None else checks.parse_wavelengths(wavelengths)
    known = signal if signal in SIGNALS else None
    raw = _raw(source, raw_cube.Asked(given, wavelength_unit or unit or None, variable, known), time_from)
    check_signal(signal)  # after a missing file, or one of a photograph, is told
    nm, notes = checks.in_nm(raw.wavelength, raw.unit, wavelength_unit, raw.path)
    bands, told = checks.chosen_bands(nm, range, without_bands, raw.good, raw.path)
    notes = [*raw.notes, *notes, *told]
    kind, told = _kind(raw, signal)
    notes += told
    frames = None
    if white_frame is not None:
        dark = None if dark_frame is None else _raw_frame(dark_frame, raw)
        white = _raw_frame(white_frame, raw)
        frames, told = camera_frames(raw, nm, white, dark, white_reflectance, saturation)
        notes += told
    calibrated = raw.calibrated if calibrated is None else calibrated
    scale, told = raw_cube.value_scale(
        raw, kind, signal_unit, calibrated=calibrated, framed=frames is not None
    )
    notes += [told] if told else []
    used = None if mask is None else read_mask(mask, raw)
    steps = (scale,) if frames is None else (scale, frames)
    measured = _lazy(raw, ("values", "delta"), bands, *steps)
    live, told = _live(raw, measured, kind, used, calibrated)
    bands = bands[live]
    measured = {name: replace(array, bands=bands) for name, array in measured.items()}
    cube = Cube(
        measured | _errors(raw, measured, noise, bands, scale, framed=frames is not None),
        nm[bands],
        kind,
        raw.dims,
        angle=raw.angle if angle is None else _stated_angle(raw, float(angle)),
        polarisation=polarisation or raw.polarisation or "unpolarised",
        coords=raw.coords,
        units=raw.units,
        mask=used,
        calibrated=calibrated,
        path=raw.path,
        notes=_once([*notes, *told]),
    )
    calibration = frames and (frames.reflectance, frames.saturation)
    facts = (noise, variable, polarisation, kind, scale, calibration, cube.angle, used, nm[bands], bands)
    cube = _with_fingerprint(cube, raw, [x for x in (white_frame, dark_frame) if x is not None], facts)
    log.info("%s", cube)
    return cube


def check_signal(signal: str | None) -> None:
    """Raise UsageError for a signal that a cube cannot have."""
    if signal is not None and signal not in SIGNALS:
        raise UsageError(f"`signal` of a cube must be one of {', '.join(SIGNALS)}, not {signal!r}")


def _check_arguments(polarisation: str | None, white_frame: Any, camera: Mapping[str, Any]) -> None:
    """Check the polarisation, and that counts of a camera have a white reference."""
    if polarisation is not None and polarisation not in POLARISATIONS:
        raise UsageError(f"`polarisation` must be one of {', '.join(POLARISATIONS)}, not {polarisation!r}")
    if white_frame is None and any(x is not None for x in camera.values()):
        raise UsageError(
            "`dark_frame`, `white_reflectance` and `saturation` need `white_frame`: the counts of white"
        )


def _kind(raw: raw_cube.RawCube, signal: str | None) -> tuple[str, list[str]]:
    """Return the signal of a cube and a note where it is assumed. Raises UsageError."""
    kind = signal or raw.signal or "R"
    if (kind == "psi-delta") != ("delta" in raw.arrays):
        raise UsageError(f"{raw.path}: psi-delta needs variables named psi and delta: name both in the file")
    assumed = 'signal: R, assumed; give `signal="T"` for transmittance'
    return kind, [assumed] if signal is raw.signal is None else []


def _raw(source: Any, asked: raw_cube.Asked, time_from: str | None = None) -> raw_cube.RawCube:
    """The content of a file, a series, an xarray object or an array. Raises DataError or UsageError."""
    if xarray_cubes.is_xarray(source):
        path = str(source.encoding.get("source", "")) or f"the {type(source).__name__}"
        raw = xarray_cubes.xarray_to_raw(source, path, asked)
    elif isinstance(source, np.ndarray):
        raw = numpy_files.arrays_to_raw({"": source}, "the array", asked, ())
    elif isinstance(source, list | tuple):
        raw = time_series.read_series([Path(path) for path in source], time_from, asked)
    elif isinstance(source, str | os.PathLike) and time_from is not None and Path(source).is_file():
        raw = time_series.read_series([Path(source)], time_from, asked)
    elif isinstance(source, str | os.PathLike):
        raw = read_raw(Path(source), asked)
    else:
        raise UsageError(f"a cube must be a path, an xarray object or an array, not {type(source).__name__}")
    for stored in raw.arrays.values():
        checks.check_type(stored.data.dtype, raw.path)
    if not np.prod(raw.arrays["values"].data.shape):
        sizes = ", ".join(f"{axis} {n}" for axis, n in raw.arrays["values"].sizes.items())
        raise DataError(f"{raw.path}: has no pixels or no bands ({sizes}): check how it was written")
    return raw


def _lazy(
    raw: raw_cube.RawCube, names: Sequence[str], bands: np.ndarray, *steps: raw_cube.Step
) -> dict[str, raw_cube.PixelArray]:
    """Arrays of the file by name, as far as it has them, at some bands, with conversions."""
    angles = raw.arrays["values"].sizes.get(raw_cube.ANGLE)
    stored = {name: raw.arrays[name] for name in names if name in raw.arrays}
    return {name: raw_cube.PixelArray(one, raw.pixels, bands, angles, steps) for name, one in stored.items()}


def _live(
    raw: raw_cube.RawCube,
    measured: Mapping[str, raw_cube.PixelArray],
    signal: str,
    used: np.ndarray | None,
    calibrated: bool,
) -> tuple[np.ndarray, list[str]]:
    """Check a sample of the values; returns which bands have some, and a note. Raises DataError."""
    seen = checks.sample(measured, len(raw.dims), used)
    live, notes = checks.live_bands(seen["values"], int(np.prod(raw.shape)), raw.path)
    seen = {name: array[:, live] for name, array in seen.items()}
    if signal == "psi-delta":
        checks.check_angles(seen["values"], seen["delta"], raw.path)
    elif calibrated:
        checks.check_level(seen["values"], signal, raw.path)
    return live, notes


def _errors(
    raw: raw_cube.RawCube,
    measured: Mapping[str, raw_cube.PixelArray],
    noise: float | str | None,
    bands: np.ndarray,
    scale: raw_cube.Scale,
    *,
    framed: bool,
) -> dict[str, Any]:
    """Standard deviations by name: those that `noise` states or names, or those of the file.

    Raises UsageError.
    """
    step, names = replace(scale, absorbance=False), {"values": "sigma", "delta": "delta_sigma"}
    if isinstance(noise, str) and noise in raw.others:
        return {"sigma": replace(measured["values"], stored=raw.others[noise], steps=(step,))}
    if noise is None:
        # errors of counts or absorbances are not converted
        return {} if framed or scale.absorbance else _lazy(raw, [*names.values()], bands, step)
    level = noise_level(noise)
    if not level.relative:
        return {names[name]: np.full(bands.size, level.value) for name in measured}
    if "delta" in measured:
        raise UsageError(f"`noise` {level} is a share of the signal: give that of psi and delta in degrees")
    return {"sigma": measured["values"].then(partial(raw_cube.share_of, share=level.value))}


def _with_fingerprint(
    cube: Cube, raw: raw_cube.RawCube, frames: Sequence[Any], facts: tuple[Any, ...]
) -> Cube:
    """The cube with a digest of its content and of how it was read, and a note where that is of a sample.

    Of files, and of arrays in memory, of more than 64 MB some samples are read.
    """
    beside = [Path(frame) for frame in frames if not isinstance(frame, np.ndarray)]
    parts: list[Any] = [frame for frame in frames if isinstance(frame, np.ndarray)]
    arrays = [array for _, array in sorted(raw.arrays.items())]
    form = [(n, s.axes, s.data.shape, str(s.data.dtype)) for n, s in sorted(raw.arrays.items())]
    content, total = file_fingerprint((*raw.files, *beside))
    how = "size, date and samples of its files"
    if not raw.files:
        how = "some blocks of pixels"
        total = sum(int(np.prod(s.data.shape)) * np.dtype(s.data.dtype).itemsize for s in arrays)
        for stored in arrays:
            graph = ""  # the name of a dask array is a digest of its graph
            if getattr(stored.data, "chunks", None) is not None:
                graph = str(getattr(getattr(stored.data, "data", stored.data), "name", ""))
            dims = [axis for axis in stored.axes if axis in raw.dims]
            blocks = checks.sample_blocks(tuple(stored.sizes[axis] for axis in dims), 10**9)
            places = [dict(zip(dims, w, strict=True)) for w in blocks] if total > WHOLE or graph else [None]
            parts += [graph, *(stored.read(place) for place in places)]
    digest = fingerprint(facts, form, content, parts)
    note = f"{total / 1e9:.2g} GB: a change of the content is recognised by {how}"
    return replace(cube, fingerprint=digest, notes=(*cube.notes, *([note] if total > WHOLE else [])))


def _once(notes: Sequence[str]) -> tuple[str, ...]:
    """Notes without later ones on a unit: those of a folder's spectra are already in nm and fractions."""
    units = ("wavelength unit: ", "signal unit: ")
    first = [next((i for i, n in enumerate(notes) if n.startswith(unit)), -1) for unit in units]
    return tuple(n for i, n in enumerate(notes) if i in first or not n.startswith(units))


def _stated_angle(raw: raw_cube.RawCube, angle: float) -> np.ndarray:
    if raw.angle is not None and np.any(raw.angle != angle):
        raise UsageError(f"{raw.path}: states its own angles; leave `angle` out")
    if not 0 <= angle < 90:
        raise UsageError(f"`angle` must be from 0 to below 90 degrees, not {angle:g}")
    return np.array([angle])


def _raw_frame(frame: str | os.PathLike[str] | np.ndarray, cube: raw_cube.RawCube) -> raw_cube.RawCube:
    """The content of a frame for a cube. Raises DataError, or UsageError of a reader.

    An array has the axes (bands), (x, bands) or (y, x, bands).
    """
    path = Path("the frame" if isinstance(frame, np.ndarray) else frame)
    stored = path.is_file() and numpy_files.is_numpy(path) and path.suffix.lower() != ".npz"
    if isinstance(frame, np.ndarray) or stored:
        values: Any = frame if isinstance(frame, np.ndarray) else numpy_files.mapped_array(path)
        rank, bands = len(values.shape), cube.wavelength.size
        if rank not in _FRAME_AXES:
            raise DataError(
                f"{path}: a frame has the axes bands, x and bands, or y, x and bands, not {rank} axes"
            )
        axes = _FRAME_AXES[rank]
        if rank == 3 and values.shape[0] == bands != values.shape[-1]:
            axes = (raw_cube.WAVELENGTH, "y", "x")
        dims = tuple(axis for axis in axes if axis != raw_cube.WAVELENGTH)
        return raw_cube.RawCube(str(path), {"values": raw_cube.Stored(values, axes)}, dims, cube.wavelength)
    try:
        raw = read_raw(path, raw_cube.Asked())
    except UsageError:  # it has no wavelengths of its own, or several variables
        raw = read_raw(path, raw_cube.Asked(cube.wavelength, cube.unit))
    comparable = raw.unit == cube.unit and raw.wavelength.shape == cube.wavelength.shape
    if comparable and not np.allclose(raw.wavelength, cube.wavelength, 1e-4):
        raise DataError(
            f"{path}: the wavelengths of the frame differ from those of {cube.path}: record both with the "
            "same settings of the camera"
        )
    return raw


def read_raw(path: Path, asked: raw_cube.Asked) -> raw_cube.RawCube:
    """Read the cube of a file or folder. Raises DataError or UsageError, one sentence."""
    if not path.exists():
        raise DataError(f"{path}: no such file or folder; check its name")
    refuse_movie(path)
    for recognises, read in READERS.items():
        if recognises(path):
            return read(path, asked)
    raise DataError(
        f"{path}: is no cube that pellicle reads ({READ}) and no photograph (PNG, JPEG, TIFF):"
        " convert it to one of these"
    )


def series_files(source: Any) -> Any:
    """The source of a series as `read_cube` takes it: a folder that is no cube as a list of its files, and a
    file that no reader of cubes recognises as a list of one."""
    if not isinstance(source, str | os.PathLike):
        return source
    path = Path(source)
    if path.is_dir() and not xarray_cubes.is_zarr(path) and spectra_folder.table_of(path) is None:
        return sorted(file for file in path.iterdir() if file.is_file() and not file.name.startswith("."))
    known = any(recognises(path) for recognises in READERS) if path.exists() else True
    return source if known else [path]


def is_cube(path: Path) -> bool:
    """True for a file or folder that only a reader of cubes understands; HDF5 may also be a spectrum."""
    read = next((read for recognises, read in READERS.items() if path.exists() and recognises(path)), None)
    if read is spectra_folder.read_folder:
        return spectra_folder.table_of(path) is not None
    if read is tiff_stacks.read_tiff:
        return not tiff_stacks.is_colour_image(path)
    if read is xarray_cubes.read_netcdf:
        return xarray_cubes.is_classic(path) or path.stat().st_size > LARGEST_SPECTRUM
    return read is not None


def is_photograph(path: Path) -> bool:
    """True for a photograph in colours: PNG, JPEG, or a TIFF of one page in R, G, B or with a palette."""
    kind = image_format(path) if path.is_file() else None
    return tiff_stacks.is_colour_image(path) if kind == "TIFF" else kind is not None
