"""Cubes in xarray objects: their axes, coordinates and variables; nothing else is loaded."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.cubes.raw_cube import Asked, RawCube
from pellicle.data.cubes.stored_arrays import ANGLE, WAVELENGTH, Stored, XarrayVariable
from pellicle.data.cubes.variable_names import choose_variables
from pellicle.data.spectrum import POLARISATIONS
from pellicle.data.tabular.columns import recognise
from pellicle.data.tabular.units import wavelength_unit
from pellicle.errors import DataError, UsageError

_PIXELS = {
    "time": ("time", "t", "frame", "frames"),
    "y": ("y", "row", "rows", "line", "lines"),
    "x": ("x", "col", "cols", "column", "columns", "sample", "samples"),
    "site": ("site", "sites", "spot", "spots", "point", "points", "position", "positions"),
}
_BANDS = ("band", "bands", "channel", "channels", "spectral", "wvl", "wave")
_SIGNALS = ("signal", "signals", "quantity")


def is_xarray(source: Any) -> bool:
    """True for a DataArray or Dataset, without importing xarray."""
    kind = type(source)
    return kind.__module__.split(".")[0] == "xarray" and kind.__name__ in ("DataArray", "Dataset")


def xarray_to_raw(source: Any, path: str, asked: Asked, files: tuple[Path, ...] = ()) -> RawCube:
    """Return the cube of a DataArray or Dataset. Raises DataError or UsageError, one sentence."""
    if type(source).__name__ == "DataArray":
        source = source.to_dataset(name=source.name or "values")
    dataset, notes = _without_signal_axis(source, asked.signal), []
    roles = _roles(dataset)
    band = next((dim for dim, role in roles.items() if role == WAVELENGTH), None)
    measured = {str(name): v for name, v in dataset.data_vars.items() if band is not None and band in v.dims}
    if band is None or not measured:
        raise _no_axis(dataset, "wavelength", path)
    written = {name: v.attrs.get("units") for name, v in measured.items()}
    chosen = choose_variables(_pixels_only(measured, written), asked.variable, asked.signal, path)
    main = measured[chosen.arrays["values"]]
    lengths = {str(dim): int(n) for dim, n in main.sizes.items()}
    for dim in [dim for dim, role in roles.items() if role is None and lengths.get(dim) == 1]:
        dataset, lengths = dataset.isel({dim: 0}), {d: n for d, n in lengths.items() if d != dim}
        notes.append(f"axis {dim!r} of length one left out")
    unknown = [dim for dim in lengths if roles[dim] is None]
    if unknown:
        raise DataError(
            f"{path}: the axis {unknown[0]!r} of {chosen.arrays['values']!r} ({_listed(lengths)}) is none "
            "of y, x, wavelength, angle, time and site: rename or select it in xarray"
        )
    dims = tuple(axis for axis in _PIXELS if axis in {roles[dim] for dim in lengths})
    if not dims:
        raise _no_axis(dataset, "pixels (y and x, or site)", path)
    renamed = {dim: role for dim, role in roles.items() if role is not None}
    stored = {
        str(name): Stored(
            XarrayVariable(variable.variable), tuple(renamed.get(str(d), str(d)) for d in variable.dims)
        )
        for name, variable in dataset.data_vars.items()
    }
    wavelength, unit = _band_axis(dataset, band, asked, path)
    angle, polarisation = _light(dataset, main, roles, path)
    coords, units, told = _coordinates(dataset, renamed, dims)
    return RawCube(
        path,
        {role: stored[name] for role, name in chosen.arrays.items()},
        dims,
        wavelength,
        unit,
        files=files,
        signal=chosen.signal,
        polarisation=chosen.polarisation or polarisation,
        signal_unit=chosen.unit,
        calibrated=chosen.calibrated,
        angle=angle,
        coords=coords,
        units=units,
        others={name: one for name, one in stored.items() if name not in chosen.arrays.values()},
        notes=(
            f"variable {chosen.arrays['values']!r} ({_listed(lengths)})"
            + "".join(f", {name!r}" for role, name in chosen.arrays.items() if role == "delta"),
            *(
                f"standard deviations: {name!r}"
                for role, name in chosen.arrays.items()
                if role in ("sigma", "delta_sigma")
            ),
            *notes,
            *told,
        ),
    )


def _pixels_only(measured: Mapping[str, Any], written: dict[str, str | None]) -> dict[str, str | None]:
    """Variables with pixels; a curve along the wavelength is no cube, but may be its errors."""
    return {
        name: unit
        for name, unit in written.items()
        if measured[name].ndim > 1 or name.lower() != "wavelength"
    }


def _without_signal_axis(dataset: Any, signal: str | None) -> Any:
    """The dataset with one variable for each entry of an axis `signal`, whose coordinate names them."""
    for dim in dataset.dims:
        if str(dim).lower() in _SIGNALS and dim in dataset.coords:
            names = [str(name) for name in dataset[dim].values]
            parts = {}
            for name, variable in dataset.data_vars.items():
                if dim not in variable.dims:
                    parts[name] = variable
                    continue
                many = sum(dim in v.dims for v in dataset.data_vars.values()) > 1
                for i, entry in enumerate(names):
                    one = variable.isel({dim: i}, drop=True)
                    parts[f"{entry}_{name}" if many and name not in ("values", "R", "T") else entry] = one
            del signal
            return type(dataset)(parts, attrs=dataset.attrs)
    return dataset


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


def _light(
    dataset: Any, main: Any, roles: Mapping[str, str | None], path: str
) -> tuple[np.ndarray | None, str | None]:
    """Angles of incidence in degrees, along an axis or one for all, and the polarisation.

    The polarisation is an attribute of the `main` variable or of the dataset.
    """
    angle = None
    for name, coordinate in dataset.coords.items():
        if recognise(str(name)).role == "angle" and coordinate.ndim <= 1 and coordinate.dtype.kind in "iuf":
            angle = np.atleast_1d(np.asarray(coordinate.values, dtype=float))
            if _units(coordinate).lower().startswith("rad"):
                angle = np.degrees(angle)
    if angle is None and ANGLE in roles.values():
        dim = next(dim for dim, role in roles.items() if role == ANGLE)
        raise DataError(
            f"{path}: its axis {dim!r} has no angles as a coordinate: assign them in degrees in xarray"
        )
    stated = dataset.attrs | main.attrs
    stated = str(stated.get("polarisation", stated.get("polarization", ""))).lower().replace("zed", "sed")
    return angle, stated if stated in POLARISATIONS else None


def _coordinates(
    dataset: Any, renamed: Mapping[str, str], dims: tuple[str, ...]
) -> tuple[dict[str, np.ndarray], dict[str, str], list[str]]:
    """Coordinates along one axis of pixels, with their units; dates become seconds since the first."""
    coords, units, notes = {}, {}, []
    for name, coordinate in dataset.coords.items():
        axes = [renamed.get(str(dim)) for dim in coordinate.dims]
        if len(axes) != 1 or axes[0] not in dims:
            continue
        key = renamed.get(str(name), str(name))
        values, unit = np.asarray(coordinate.values), _units(coordinate)
        if values.dtype.kind == "M":
            values, unit = (values - values[0]) / np.timedelta64(1, "s"), "s"
            notes.append(f"{key!r} in seconds since {str(coordinate.values[0])[:19]}")
        elif values.dtype.kind == "m":
            values, unit = values / np.timedelta64(1, "s"), "s"
        coords[key] = values
        if unit:
            units[key] = unit
    return coords, units, notes


def _listed(lengths: Mapping[str, int]) -> str:
    return ", ".join(f"{dim} {n}" for dim, n in lengths.items())


def _no_axis(dataset: Any, wanted: str, path: str) -> DataError:
    found = _listed({str(dim): n for dim, n in dataset.sizes.items()}) or "none"
    return DataError(
        f"{path}: has no axis of {wanted}, only {found}: rename the axes to y, x and wavelength in xarray"
    )
