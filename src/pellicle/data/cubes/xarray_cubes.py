"""Cubes in xarray objects, zarr stores and NetCDF files: only axes, coordinates and names are read."""

import json
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.cubes.numpy_files import arrays_to_raw, choose_variables
from pellicle.data.cubes.raw_cube import ANGLE, WAVELENGTH, Asked, RawCube, Stored
from pellicle.data.formats.nexus import SIGNATURE
from pellicle.data.spectrum import POLARISATIONS
from pellicle.data.tabular.columns import recognise
from pellicle.data.tabular.text import open_binary
from pellicle.data.tabular.units import wavelength_unit
from pellicle.errors import DataError, UsageError, decoding, needs

_PIXELS = {
    "time": ("time", "t", "frame", "frames"),
    "y": ("y", "row", "rows", "line", "lines"),
    "x": ("x", "col", "cols", "column", "columns", "sample", "samples"),
    "site": ("site", "sites", "spot", "spots", "point", "points", "position", "positions"),
}
_BANDS = ("band", "bands", "channel", "channels", "spectral", "wvl", "wave")
_SIGNALS = ("signal", "signals", "quantity")
_CLASSIC = b"CDF"
_STORES = ("zarr.json", ".zgroup", ".zarray", ".zmetadata")


def is_xarray(source: Any) -> bool:
    """True for a DataArray or Dataset, without importing xarray."""
    kind = type(source)
    return kind.__module__.split(".")[0] == "xarray" and kind.__name__ in ("DataArray", "Dataset")


def xarray_to_raw(source: Any, path: str, asked: Asked, files: tuple[Path, ...] = ()) -> RawCube:
    """Return the cube of a DataArray or Dataset. Raises DataError or UsageError, one sentence."""
    if type(source).__name__ == "DataArray":
        source = source.to_dataset(name=source.name or "values")
    dataset = _without_signal_axis(source)
    roles = _roles(dataset)
    band, measured = _measured(dataset, roles, path)
    # a curve along the wavelength is no cube, but may be its errors
    written = {
        n: v.attrs.get("units") for n, v in measured.items() if v.ndim > 1 or n.lower() != "wavelength"
    }
    chosen, stated = choose_variables(written, asked.variable, asked.signal, path)
    name, main = chosen["values"], measured[chosen["values"]]
    single = [str(dim) for dim, n in main.sizes.items() if roles[str(dim)] is None and n == 1]
    dataset = dataset.isel(dict.fromkeys(single, 0))
    lengths = {str(dim): int(n) for dim, n in main.sizes.items() if str(dim) not in single}
    if unknown := [dim for dim in lengths if roles[dim] is None]:
        raise DataError(
            f"{path}: the axis {unknown[0]!r} of {name!r} ({_listed(lengths)}) is none of y, x, wavelength, "
            "angle, time and site: rename or select it in xarray"
        )
    dims = tuple(axis for axis in _PIXELS if axis in {roles[dim] for dim in lengths})
    if not dims:
        raise _no_axis(dataset, "pixels (y and x, or site)", path)
    stored = {
        str(name): Stored(variable.variable, tuple(roles[str(dim)] or str(dim) for dim in variable.dims))
        for name, variable in dataset.data_vars.items()
    }
    wavelength, unit = _band_axis(dataset, band, asked, path)
    coords, units, dates = _coordinates(dataset, roles, dims)
    stated["polarisation"] = stated.get("polarisation") or _polarisation(dataset.attrs | main.attrs)
    delta = f", {chosen['delta']!r}" if "delta" in chosen else ""
    return RawCube(
        path,
        {role: stored[name] for role, name in chosen.items()},
        dims,
        wavelength,
        unit,
        files=files,
        angle=_angles(dataset, roles, path),
        coords=coords,
        units=units,
        others={name: one for name, one in stored.items() if name not in chosen.values()},
        notes=(
            f"variable {name!r} ({_listed(lengths)}){delta}",
            *(f"standard deviations: {chosen[role]!r}" for role in chosen if role.endswith("sigma")),
            *(f"axis {dim!r} of length one left out" for dim in single),
            *dates,
        ),
        **stated,
    )


def _measured(dataset: Any, roles: Mapping[str, str | None], path: str) -> tuple[str, dict[str, Any]]:
    """The axis of the bands, and the variables along it. Raises DataError where there are none."""
    for band in (dim for dim, role in roles.items() if role == WAVELENGTH):
        if measured := {str(name): v for name, v in dataset.data_vars.items() if band in v.dims}:
            return band, measured
    raise _no_axis(dataset, "wavelength", path)


def _polarisation(facts: Mapping[str, Any]) -> str | None:
    word = str(facts.get("polarisation", facts.get("polarization", ""))).lower().replace("zed", "sed")
    return word if word in POLARISATIONS else None


def _without_signal_axis(dataset: Any) -> Any:
    """The dataset with one variable for each entry of an axis `signal`, whose coordinate names them."""
    dim = next((d for d in dataset.dims if str(d).lower() in _SIGNALS and d in dataset.coords), None)
    if dim is None:
        return dataset
    parts = {}
    several = sum(dim in variable.dims for variable in dataset.data_vars.values()) > 1
    for name, variable in dataset.data_vars.items():
        if dim not in variable.dims:
            parts[name] = variable
            continue
        for i, entry in enumerate(map(str, dataset[dim].values)):
            prefixed = several and name not in ("values", "R", "T")
            parts[f"{entry}_{name}" if prefixed else entry] = variable.isel({dim: i}, drop=True)
    return type(dataset)(parts, attrs=dataset.attrs)


def _roles(dataset: Any) -> dict[str, str | None]:
    """The role of each axis by its name, by that of a coordinate along it, or by its unit."""
    roles: dict[str, str | None] = {}
    for dim in map(str, dataset.dims):
        plain = dim.lower()
        column = recognise(dim)
        role = next((axis for axis, names in _PIXELS.items() if plain in names), None)
        if column.role in ("wavelength", "angle") or plain in _BANDS:
            role = ANGLE if column.role == "angle" else WAVELENGTH
        if role is None and dim in dataset.coords and wavelength_unit(_units(dataset[dim])):
            role = WAVELENGTH
        roles[dim] = role if role not in roles.values() else None
    return roles


def _units(array: Any) -> str:
    return str(array.attrs.get("units", array.attrs.get("unit", "")))


def _band_axis(dataset: Any, band: str, asked: Asked, path: str) -> tuple[np.ndarray, str | None]:
    """Wavelengths along the axis of the bands, and their unit as written."""
    if asked.wavelength is not None:
        if asked.wavelength.size != dataset.sizes[band]:
            raise DataError(
                f"{path}: {asked.wavelength.size} wavelengths are given for {dataset.sizes[band]} bands: "
                "give one for each with `wavelengths`"
            )
        return asked.wavelength, asked.unit
    along = {str(name): c for name, c in {**dataset.coords, **dataset.data_vars}.items() if c.dims == (band,)}
    named = [name for name in along if recognise(name).role == "wavelength"]
    for name in (*named, *([band] if band in along else [])):
        column = recognise(name)
        values = np.asarray(along[name].values)
        if values.dtype.kind in "iuf" and (name in named or _units(along[name]) or band not in _BANDS):
            return values.astype(float), _units(along[name]) or column.unit
    raise UsageError(
        f"{path}: its axis {band!r} has no wavelengths as a coordinate: assign them in xarray, or give "
        "`wavelengths`"
    )


def _angles(dataset: Any, roles: Mapping[str, str | None], path: str) -> np.ndarray | None:
    """Angles of incidence in degrees, along an axis or one for all. Raises DataError for an axis without."""
    angle = None
    for name, coordinate in dataset.coords.items():
        if recognise(str(name)).role == "angle" and coordinate.ndim <= 1 and coordinate.dtype.kind in "iuf":
            angle = np.atleast_1d(np.asarray(coordinate.values, dtype=float))
            angle = np.degrees(angle) if _units(coordinate).lower().startswith("rad") else angle
    if angle is None and ANGLE in roles.values():
        dim = next(dim for dim, role in roles.items() if role == ANGLE)
        raise DataError(
            f"{path}: its axis {dim!r} has no angles as a coordinate: assign them in degrees in xarray"
        )
    return angle


def _coordinates(
    dataset: Any, roles: Mapping[str, str | None], dims: tuple[str, ...]
) -> tuple[dict[str, np.ndarray], dict[str, str], list[str]]:
    """Coordinates along one axis of pixels, with their units; dates become seconds since the first."""
    coords, units, notes = {}, {}, []
    for name, coordinate in dataset.coords.items():
        axes = [roles[str(dim)] for dim in coordinate.dims]
        if len(axes) != 1 or axes[0] not in dims:
            continue
        key = roles.get(str(name)) or str(name)
        values, unit = np.asarray(coordinate.values), _units(coordinate)
        if values.dtype.kind == "M":
            values = (values - values[0]) / np.timedelta64(1, "s")
            unit = f"seconds since {str(coordinate.values[0])[:23]}"
            notes.append(f"{key!r} in {unit[:33]}")
        elif values.dtype.kind == "m":
            values, unit = values / np.timedelta64(1, "s"), "s"
        coords[key] = values
        if unit:
            units[key] = unit
    return coords, units, notes


def _listed(lengths: Mapping[str, int]) -> str:
    return ", ".join(f"{dim} {n}" for dim, n in lengths.items())


def _no_axis(dataset: Any, wanted: str, path: str) -> DataError:
    axes = _listed({str(dim): n for dim, n in dataset.sizes.items()}) or "none"
    return DataError(
        f"{path}: has no axis of {wanted}, only {axes}: rename the axes to y, x and wavelength in xarray"
    )


def is_netcdf(path: Path) -> bool:
    """True for a NetCDF or HDF5 file, by its first bytes."""
    return is_classic(path) or _head(path) == SIGNATURE


def is_classic(path: Path) -> bool:
    """True for NetCDF 3, which has its own format."""
    return _head(path).startswith(_CLASSIC)


def _head(path: Path) -> bytes:
    with open_binary(path) as file:
        return file.read(len(SIGNATURE))


def is_zarr(path: Path) -> bool:
    """True for the folder of a zarr store."""
    return any((path / name).exists() for name in _STORES)


def read_netcdf(path: Path, asked: Asked) -> RawCube:
    """Read a NetCDF file. Raises DataError for a damaged one, UsageError without the packages."""
    engine = "scipy" if is_classic(path) else "h5netcdf"
    dataset = _opened(path, lambda xarray: xarray.open_dataset(path, engine=engine, chunks=None, cache=False))
    return xarray_to_raw(dataset, str(path), asked, (path,))


def read_zarr(path: Path, asked: Asked) -> RawCube:
    """Read a zarr store: a group as xarray writes it, or one array, whose axes may have names (zarr 3).

    Raises DataError or UsageError.
    """

    def group(xarray: Any) -> Any:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # metadata that are not consolidated take longer to read
            return xarray.open_zarr(path, chunks=None, decode_timedelta=True)

    def alone(xarray: Any) -> Any:
        import zarr

        array = zarr.open_array(path, mode="r")
        names = getattr(array.metadata, "dimension_names", None)
        return xarray.DataArray(xarray.Variable(tuple(names), array)) if names and all(names) else array

    kind = "array" if (path / ".zarray").exists() else "group"
    if (path / "zarr.json").is_file():
        # its text may also contain the types of its arrays
        try:
            kind = json.loads((path / "zarr.json").read_bytes())["node_type"]
        except (ValueError, KeyError, TypeError):
            raise DataError(f"{path}: is damaged: it states no node_type; write the store again") from None
    content = _opened(path, alone if kind == "array" else group)
    if not is_xarray(content):
        return arrays_to_raw({"": content}, str(path), asked, (path,))
    return xarray_to_raw(content, str(path), asked, (path,))


def _opened(path: Path, opening: Any) -> Any:
    damaged = decoding(f"{path}: cannot be opened as a cube", "write it again")
    with needs("maps", f"{path}: cubes in zarr and NetCDF need"), damaged:
        import xarray

        return opening(xarray)
