"""Cubes of arrays without names of axes: in memory, `.npy`, and `.npz` with the wavelengths beside them.

Files are read block by block, but for compressed `.npz`, which are unpacked into memory. The names of several
arrays state which are the measured values, and which their errors; that holds for variables of xarray too.
"""

import re
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.cubes.raw_cube import ANGLE, COUNTS, WAVELENGTH, Asked, MappedFile, RawCube, Stored
from pellicle.data.tabular.columns import Column, recognise
from pellicle.data.tabular.text import open_binary
from pellicle.data.tabular.units import signal_unit
from pellicle.errors import DataError, UsageError, did_you_mean

_NPY, _ZIP = b"\x93NUMPY", b"PK\x03\x04"
_PIXELS = {1: ("site",), 2: ("y", "x"), 3: ("time", "y", "x")}
"""Axes of pixels of an array, by their number."""
_ERROR = r"(?:sigma|std|sd|stdev|stddev|stderr|uncertainty|unc|err|error|errors)"
_ERRORS = re.compile(rf"(?:{_ERROR}(?:_(?P<of>.+))?|(?P<name>.+)_{_ERROR})", re.IGNORECASE)
_MOST_UNPACKED = 2e9
"""Bytes of the arrays of a compressed `.npz`, which are held in memory: cubes of hyperspectral cameras take
0.1 to 1 GB, and a file of 4.7 MB can declare 4.7 GB of zeros."""
_COUNTS = ("counts", "count", "dn", "adu", "digital number", "raw")


def is_numpy(path: Path) -> bool:
    """True for a `.npy` or `.npz` file, by its content."""
    with open_binary(path) as file:
        head = file.read(8)
    return head.startswith(_NPY) or (head.startswith(_ZIP) and path.suffix.lower() == ".npz")


def read_numpy(path: Path, asked: Asked) -> RawCube:
    """Read a `.npy` or `.npz` file. Raises DataError for a damaged one, UsageError without wavelengths."""
    arrays = _members(path) if zipfile.is_zipfile(path) else {"": mapped_array(path)}
    return arrays_to_raw(arrays, str(path), asked, (path,))


def mapped_array(path: Path, start: int = 0) -> MappedFile:
    """The array whose header begins at a place of a file. Raises DataError for a damaged one."""
    try:
        with path.open("rb") as file:
            file.seek(start)
            version = np.lib.format.read_magic(file)
            v1, v2 = np.lib.format.read_array_header_1_0, np.lib.format.read_array_header_2_0
            shape, fortran, dtype = (v1 if version == (1, 0) else v2)(file)
            offset = file.tell()
        if dtype.hasobject:
            raise ValueError("it has Python objects in it, not numbers")
        if offset + int(np.prod(shape)) * dtype.itemsize > path.stat().st_size:
            raise ValueError("it ends before its last number")
    except (OSError, ValueError) as error:
        raise _damaged(path, error) from None
    return MappedFile(str(path), dtype, shape, offset, "F" if fortran else "C")


def _members(path: Path) -> dict[str, Any]:
    """Arrays of an `.npz`: maps of the file where they are stored without compression."""
    arrays: dict[str, Any] = {}
    try:
        with zipfile.ZipFile(path) as archive, path.open("rb") as whole:
            packed = [info for info in archive.infolist() if info.compress_type != zipfile.ZIP_STORED]
            if (size := sum(info.file_size for info in packed)) > _MOST_UNPACKED:
                raise DataError(
                    f"{path}: would take {size / 1e9:.1f} GB of memory unpacked, and at most"
                    f" {_MOST_UNPACKED / 1e9:g} are read: save it without compression (np.savez), which is"
                    " read in blocks"
                )
            for info in archive.infolist():
                name = info.filename.removesuffix(".npy")
                if info.compress_type != zipfile.ZIP_STORED:
                    with archive.open(info) as member:
                        arrays[name] = np.lib.format.read_array(member, allow_pickle=False)
                    continue
                whole.seek(info.header_offset + 26)  # lengths of the name and of the extra field
                lengths = np.frombuffer(whole.read(4), "<u2")
                arrays[name] = mapped_array(path, info.header_offset + 30 + int(lengths.sum()))
    except (OSError, ValueError, KeyError, RuntimeError, MemoryError, EOFError, *_OF_ZIP) as error:
        raise error if isinstance(error, DataError) else _damaged(path, error) from None
    return arrays


_OF_ZIP = (zipfile.BadZipFile, zlib.error)


def _damaged(path: Path, error: Exception) -> DataError:
    return DataError(f"{path}: is a damaged NumPy file ({error}); save it again")


def arrays_to_raw(arrays: Mapping[str, Any], path: str, asked: Asked, files: tuple[Path, ...]) -> RawCube:
    """Return the cube of arrays by name, one of which may be the wavelengths.

    Raises DataError or UsageError.
    """
    roles = {name: recognise(name) for name in arrays if name}
    wavelength, unit, angle = asked.wavelength, asked.unit, None
    for name, column in roles.items():
        if column.role == "wavelength" and wavelength is None:
            wavelength, unit = np.asarray(arrays[name][...], dtype=float).reshape(-1), column.unit
        elif column.role == "angle":
            angle = np.asarray(arrays[name][...], dtype=float).reshape(-1)
    measured = {
        name: array
        for name, array in arrays.items()
        if len(array.shape) >= 2 and (not name or roles[name].role not in ("wavelength", "angle"))
    }
    if not measured:
        shapes = ", ".join(f"{name or 'one'} ({_text(array.shape)})" for name, array in arrays.items())
        raise DataError(f"{path}: has no array of pixels and bands, only {shapes or 'none'}")
    chosen, stated = choose_variables(dict.fromkeys(measured), asked.variable, asked.signal, path)
    shape = tuple(measured[chosen["values"]].shape)
    if wavelength is None:
        raise need_wavelengths(shape, path)
    axes, notes = array_axes(shape, wavelength.size, path, angle)
    dims = tuple(axis for axis in axes if axis not in (WAVELENGTH, ANGLE))
    by_rank = {len(axes): axes, len(dims): dims, 1: (WAVELENGTH,)}
    others = {name: a for name, a in arrays.items() if name not in chosen.values()}
    return RawCube(
        path,
        {role: Stored(measured[name], axes) for role, name in chosen.items()},
        dims,
        wavelength,
        unit,
        files=files,
        angle=angle,
        others={n: Stored(a, by_rank[len(a.shape)]) for n, a in others.items() if len(a.shape) in by_rank},
        notes=tuple(notes),
        **stated,
    )


def array_axes(
    shape: tuple[int, ...], bands: int, path: str, angle: np.ndarray | None = None
) -> tuple[tuple[str, ...], list[str]]:
    """Return the names of the axes of an array of pixels with `bands` bands, and notes.

    The last axis is that of the angles where there are several. The axis of the bands is the last before it,
    or else the only one of that length. Raises DataError where no axis has it.
    """
    if angle is not None and angle.size > 1:
        if shape[-1] != angle.size:
            raise DataError(
                f"{path}: has {angle.size} angles, and the last of its axes ({_text(shape)}) another length: "
                "store it as y, x, wavelength, angle"
            )
        axes, notes = array_axes(shape[:-1], bands, path)
        return (*axes, ANGLE), notes
    pixels = _PIXELS.get(len(shape) - 1)
    if pixels is None:
        raise DataError(
            f"{path}: has {len(shape)} axes ({_text(shape)}), and a cube has y, x and wavelength, perhaps "
            "after a time: give it as an xarray Dataset, which names its axes"
        )
    if bands not in shape:
        raise DataError(
            f"{path}: {bands} wavelengths are given, and none of its axes ({_text(shape)}) has that length: "
            "give one for each band with `wavelengths`"
        )
    place = len(pixels) if shape[-1] == bands else shape.index(bands)
    axes = (*pixels[:place], WAVELENGTH, *pixels[place:])
    return axes, [f"axes: {', '.join(axes)}, since that of the wavelengths has {bands} bands"]


def need_wavelengths(shape: tuple[int, ...], path: str) -> UsageError:
    """The error for an array whose wavelengths nobody states."""
    if 3 in (shape[0], shape[-1]) and len(shape) == 3:
        return UsageError(
            f"{path}: has three channels ({_text(shape)}) and no wavelengths: the map of colours reads a "
            'photograph as PNG or TIFF in R, G, B (`signal="srgb"`); give `wavelengths` if it has three bands'
        )
    return UsageError(
        f"{path}: has no wavelengths for its bands ({_text(shape)}): give them with "
        '`wavelengths="400:900:5"`, numbers or a file'
    )


def _text(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape))


def choose_variables(
    written: Mapping[str, str | None], variable: str | None, signal: str | None, path: str
) -> tuple[dict[str, str], dict[str, Any]]:
    """Choose the variables to read among those with an axis of wavelengths.

    `written` gives the unit of each as its file states it; `variable` is the name of the one to read, and
    `signal` may settle which one is meant. Raises UsageError where several remain.

    **Returns:** names by role ("values", "delta", "sigma", "delta_sigma"), and what they state, as arguments
    of a `RawCube`.
    """
    if variable is not None and [*written] == [""]:
        raise UsageError(f"{path}: is one array without a name: leave out `variable`, {variable!r}")
    if variable is not None and variable not in written:
        raise UsageError(
            f"{path}: has no variable {variable!r}{did_you_mean(variable, written)} of pixels and bands, but "
            f"{', '.join(map(repr, written))}"
        )
    roles = {name: recognise(name) for name in written}
    errors = {name: match for name in written if (match := _ERRORS.fullmatch(name)) and name != variable}
    values = {name: column for name, column in roles.items() if name not in errors}
    if variable is None and signal in (None, "psi-delta"):
        pair = {c.role: name for name, c in values.items() if c.role in ("psi", "delta")}
        if len(pair) == 2 and (signal or not any(c.role in ("R", "T") for c in values.values())):
            if radians := [x for x in pair.values() if (written[x] or "").strip().lower()[:3] == "rad"]:
                raise DataError(f"{path}: {radians[0]!r} is in radians: convert it to degrees")
            keys = {"sigma": "psi", "delta_sigma": "delta"}
            sigma = {key: _errors_of(pair[x], x, errors, alone=False) for key, x in keys.items()}
            sigma = {key: name for key, name in sigma.items() if name}
            return {"values": pair["psi"], "delta": pair["delta"], **sigma}, {"signal": "psi-delta"}
    names = [variable] if variable else _measured(values, signal)
    if not names and (half := [name for name, column in roles.items() if column.role in ("psi", "delta")]):
        raise DataError(
            f"{path}: has {half[0]!r} alone, and ellipsometry needs psi and delta: write both into the file"
        )
    if len(names) != 1:
        raise UsageError(
            f"{path}: has several variables of pixels and bands, {', '.join(map(repr, names or written))}: "
            "choose one with `variable`"
        )
    [name] = names
    column = roles[name]
    sigma = _errors_of(name, column.role, errors, alone=len(values) == 1)
    unit = None if (stated := written[name]) is None else stated.strip().lower()
    counted = unit in _COUNTS or column.role in ("counts", "sample counts")
    return {"values": name} | ({"sigma": sigma} if sigma else {}), {
        "signal": column.role if column.role in ("R", "T") else None,
        "polarisation": column.polarisation,
        "signal_unit": COUNTS if counted else (unit is not None and signal_unit(unit)) or column.unit,
        "calibrated": column.role != "intensity",
    }


def _measured(values: Mapping[str, Column], signal: str | None) -> list[str]:
    """Names of the variables that may be meant: those of known quantities first."""
    for wanted in ((signal,), ("R", "T"), ("intensity", "counts", "sample counts")):
        if named := [name for name, column in values.items() if column.role in wanted]:
            return named
    return [name for name, column in values.items() if column.role not in ("psi", "delta", "foreign")]


def _errors_of(name: str, role: str, errors: Mapping[str, re.Match[str]], *, alone: bool) -> str | None:
    """The variable of the standard deviations of another one."""
    for error, match in errors.items():
        of = match["of"] or match["name"]
        if (of is None and alone) or (of is not None and of in (name, role)):
            return error
    return None
