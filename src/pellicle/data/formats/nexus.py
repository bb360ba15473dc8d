"""NeXus files (HDF5): groups NXdata with units, the definition NXellipsometry, and NetCDF of xarray.

A group NXdata, or the root of a NetCDF file, has a wavelength, energy or wavenumber and datasets along it.
NXellipsometry of FAIRmat stores `measured_data[angle, observable, wavelength]` in `data_collection`, where
`data_type` names the observables. **Source**: https://manual.nexusformat.org and the NXDL of NXellipsometry.
"""

import io
from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec
from typing import Any

import numpy as np

from pellicle.data.formats import hdf5_reading as hdf5
from pellicle.data.formats import isolated
from pellicle.data.tabular.columns import recognise
from pellicle.data.tabular.table import Table, array_columns
from pellicle.errors import DataError, install_command
from pellicle.signals.registry import KINDS, ONE_COLUMN

_MEASURED = "measured_data"
_OBSERVABLES = {"psi/delta": ("psi", "delta"), "n/c/s": ("N", "C", "S")}
"""Columns of `measured_data` by its `data_type`."""
_QUANTITIES = [quantity for kind in KINDS.values() for quantity in kind().quantities]
_SIGNALS = {"N", "C", "S", "intensity", *(q.name for q in _QUANTITIES if q.array == "values")}
_ERRORS = {q: f"sigma_{q}" for q in ("depolarisation", *(q.name for q in _QUANTITIES))}
_ERRORS |= dict.fromkeys(ONE_COLUMN, "sigma")
_MOST_MEMBERS = 1000
_FACTS = (
    ("date", "start_time"),
    ("instrument", "instrument/device_information/model"),
    ("instrument", "instrument/model"),
    ("sample", "sample/sample_name"),
)
"""Date, instrument and sample in an entry."""


def read(content: bytes) -> list[Table] | None:
    """Return the spectra of a NeXus or NetCDF file, or None for another format.

    Raises DataError where h5py is absent, and for a file without spectra, damaged, or with parts elsewhere.
    """
    if not content.startswith(hdf5.SIGNATURE):
        return None
    if find_spec("h5py") is None:
        raise DataError(
            f"is an HDF5 (NeXus) file, which needs the package h5py: {install_command('formats')}; "
            "or export the spectrum as CSV"
        )
    return isolated.call(f"{__name__}:{read_hdf5.__name__}", content)


def read_hdf5(content: bytes) -> list[Table]:
    """Return the spectra of an HDF5 file, in this process. Raises DataError as `read` does."""
    import h5py

    try:
        with h5py.File(io.BytesIO(content), "r") as file:
            tables = list(_spectra(file))
    except DataError:
        raise
    except Exception as error:  # h5py raises OSError, KeyError, RuntimeError, ... on damaged files
        raise DataError(
            f"is an HDF5 (NeXus) file that cannot be read ({' '.join(str(error).split())[:200]}); "
            "export it as CSV"
        ) from None
    if not tables:
        raise DataError(
            "is an HDF5 (NeXus) file without a wavelength, energy or wavenumber beside a "
            "reflectance, a transmittance or psi and delta in a group NXdata; export the spectrum as CSV"
        )
    return tables if len(tables) > 1 else [replace(tables[0], name="")]


def _spectra(file: Any) -> Iterator[Table]:
    members = (hdf5.member(file, name) for name in list(file)[:_MOST_MEMBERS])
    entry = next((e for e in members if e is not None and hdf5.attribute(e, "NX_class") == "NXentry"), None)
    texts = [] if entry is None else [(f, hdf5.text(hdf5.member(entry, at))) for f, at in _FACTS]
    for name, group in hdf5.groups(file):
        if len(group) > _MOST_MEMBERS:
            continue
        if _MEASURED in group:
            columns, notes = _ellipsometry(group, name)
        elif name == "/" or hdf5.attribute(group, "NX_class") == "NXdata":
            columns, notes = _data(group, name)
        else:
            continue
        if columns:
            facts = [("format", "NeXus" if name != "/" else "NetCDF"), *(fact for fact in texts if fact[1])]
            said = [f"read as HDF5, group {name}", *notes]
            yield array_columns(list(columns), list(columns.values()), said, name=name, facts=facts)


def _named(name: str, units: str) -> str:
    """The column name of a dataset, with the unit that its attribute states."""
    plain = name.lower().removesuffix("_spectrum")
    if plain.endswith("_errors"):
        base = recognise(plain.removesuffix("_errors")).role
        plain = _ERRORS.get(base, plain)
    role = recognise(plain).role
    if role == "angle":
        plain = "angle"
    if role == "wavelength" and not units:
        units = recognise(plain).unit or "not stated"
    return f"{plain} ({units})" if units and units != "1" else plain


def _data(group: Any, name: str) -> tuple[dict[str, np.ndarray], list[str]]:
    """The columns of a group along its wavelength, empty without a wavelength and a signal."""
    names = {child: recognise(_named(child, "")).role for child in group}
    axes = [child for child, role in names.items() if role == "wavelength"]
    if not axes or not _SIGNALS & set(names.values()):
        return {}, []
    stated = hdf5.attribute(group, "axes")
    axis = stated if stated in axes else axes[0]
    if len(axes) > 1 and stated not in axes:
        raise DataError(f"{name} has the axes {', '.join(axes)} and names none of them; export it as CSV")
    values, units = _dataset(group, axis)
    if values is None or values.ndim != 1 or not values.size:
        raise DataError(f"{name}/{axis} is no list of numbers; export the spectrum as CSV")
    angle = next((child for child, role in names.items() if role == "angle"), None)
    angles = _dataset(group, angle)[0] if angle else None
    sweeps = angles.size if angles is not None and angles.shape != values.shape else 1
    columns = {_named(axis, units): np.tile(values, sweeps)}
    left_out = [other for other in axes if other != axis]
    for child, role in names.items():
        if child in axes:
            continue
        column, units = _dataset(group, child)
        if column is not None and role == "angle" and column.size == sweeps and column.shape != values.shape:
            column = np.repeat(column.reshape(-1), values.size)
        if column is not None and column.size == sweeps * values.size and column.shape[-1:] == values.shape:
            columns[_named(child, units)] = column.reshape(-1)
        elif role in _SIGNALS or role in ("angle", "azimuth"):
            raise DataError(
                f"{name}/{child} has the shape {None if column is None else column.shape}, which "
                f"does not match {values.size} points of {axis}; export the spectrum as CSV"
            )
        else:
            left_out.append(child)
    return columns, [f"left out: {', '.join(left_out)}"] if left_out else []


def _dataset(group: Any, name: str) -> tuple[np.ndarray | None, str]:
    """Numbers and unit of a dataset."""
    dataset = hdf5.member(group, name)
    values = hdf5.numbers(dataset, f"{group.name}/{name}")
    return values, "" if values is None else hdf5.attribute(dataset, "units")


def _ellipsometry(group: Any, name: str) -> tuple[dict[str, np.ndarray], list[str]]:
    """The columns of `measured_data` of NXellipsometry, one row for each angle and wavelength."""
    stated = hdf5.text(hdf5.member(group, "data_type"))
    slices = {child.lower().partition("_")[0] for child in group}
    kind = stated or ("Psi/Delta" if {"psi", "delta"} <= slices else "not stated")
    observables = _OBSERVABLES.get(kind.lower())
    if observables is None:
        raise DataError(f"{name} measures {kind!r}; export psi and delta in degrees, or N, C and S, as CSV")
    axis = next((child for child in group if recognise(_named(child, "")).role == "wavelength"), "")
    values, units = _dataset(group, axis) if axis else (None, "")
    measured, _ = _dataset(group, _MEASURED)
    if values is None or measured is None or measured.shape[1:] != (len(observables), values.size):
        raise DataError(
            f"{name}/{_MEASURED} has the shape {None if measured is None else measured.shape}, where "
            f"(angles, {len(observables)}, {'wavelengths' if values is None else values.size}) is expected "
            f"for {kind}; export it as CSV"
        )
    count = measured.shape[0]
    columns = {_named(axis, units): np.tile(values, count)}
    columns |= _angles(group, count, values.size)
    degrees = " (deg)" if "psi" in observables else ""
    columns |= {f"{o}{degrees}": measured[:, i].reshape(-1) for i, o in enumerate(observables)}
    for child in (f"{_MEASURED}_errors", "data_error"):
        errors = _dataset(group, child)[0]
        if errors is not None and errors.shape == measured.shape and degrees:
            columns |= {f"{_ERRORS[o]} (deg)": errors[:, i].reshape(-1) for i, o in enumerate(observables)}
            break
    return columns, [f"{_MEASURED} read as {kind}" + ("" if stated else ", by the names beside it")]


def _angles(group: Any, count: int, points: int) -> dict[str, np.ndarray]:
    """A column of angles of incidence, empty where the entry states none for a single measurement."""
    entry = group.parent
    for place in ("angle_of_incidence", "instrument/angle_of_incidence"):
        for holder in (group, entry):
            dataset = hdf5.member(holder, place)
            angles = hdf5.numbers(dataset, place)
            if angles is not None and angles.size == count:
                units = hdf5.attribute(dataset, "units") or "not stated"
                return {f"angle ({units})": np.repeat(angles.reshape(-1), points)}
    if count > 1:
        raise DataError(
            f"has {count} measurements in {group.name}, but not an angle of incidence for each; "
            "export them as CSV"
        )
    return {}
