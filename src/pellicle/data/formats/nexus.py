"""NeXus files (HDF5): groups NXdata with units, the definition NXellipsometry, and NetCDF of xarray.

A group NXdata, or the root of a NetCDF file, has a wavelength, energy or wavenumber and datasets along it.
NXellipsometry of FAIRmat stores `measured_data[angle, observable, wavelength]` in `data_collection`, where
`data_type` names the observables.

HDF5 is read without leaving the file. External links, external storage and virtual datasets would open other
files; they are refused, as are datasets and chunks too large for a spectrum, before anything is allocated.
Soft links are followed part by part.

**Source**: https://manual.nexusformat.org and the NXDL of NXellipsometry.
"""

import io
from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec
from math import prod
from typing import Any

import numpy as np

from pellicle.data.formats import isolated
from pellicle.data.tabular.columns import recognise
from pellicle.data.tabular.table import Table, array_columns
from pellicle.errors import DataError, decoding, install_command
from pellicle.signals.registry import KINDS, ONE_COLUMN

SIGNATURE = b"\x89HDF\r\n\x1a\n"
MOST_NUMBERS = 5_000_000
"""Largest number of values of a dataset that is read, 40 MB."""
_MOST_CHUNK = 64 << 20  # bytes that HDF5 allocates for a chunk, whatever the dataset holds
_MOST_TEXT = 10_000  # bytes
_MOST_GROUPS = 1000
_MOST_LINKS = 20  # soft links that point to soft links
_MOST_DEPTH = 20
_MEASURED = "measured_data"
_NOT_PROVIDED = "NOT_PROVIDED"
_SPECTROMETER = "instrument/spectrometer"
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
    if not content.startswith(SIGNATURE):
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

    damaged = decoding("is an HDF5 (NeXus) file that cannot be read", "export it as CSV")
    with damaged, h5py.File(io.BytesIO(content), "r") as file:
        tables = list(_spectra(file))
    if not tables:
        raise DataError(
            "is an HDF5 (NeXus) file without a wavelength, energy or wavenumber beside a "
            "reflectance, a transmittance or psi and delta in a group NXdata; export the spectrum as CSV"
        )
    return tables if len(tables) > 1 else [replace(tables[0], name="")]


def _spectra(file: Any) -> Iterator[Table]:
    members = (member(file, name) for name in list(file)[:_MOST_MEMBERS])
    entry = next((e for e in members if e is not None and attribute(e, "NX_class") == "NXentry"), None)
    texts = [] if entry is None else [(f, text(member(entry, at))) for f, at in _FACTS]
    for name, group in groups(file):
        if len(group) > _MOST_MEMBERS:
            continue
        if _MEASURED in group:
            columns, notes = _ellipsometry(group, name)
        elif name == "/" or attribute(group, "NX_class") == "NXdata":
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
    stated = attribute(group, "axes")
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
    dataset = member(group, name)
    values = numbers(dataset, f"{group.name}/{name}")
    return values, "" if values is None else attribute(dataset, "units")


def _with_units(group: Any, name: str) -> tuple[np.ndarray | None, str]:
    """Numbers and unit of a dataset; without a unit, that of its attribute `target`, or of a dataset of equal
    values beside it or in the instrument."""
    values, units = _dataset(group, name)
    if values is None or units not in ("", _NOT_PROVIDED):
        return values, units
    target = attribute(member(group, name), "target")
    holders = [(group, target)] if target else []
    for holder in (group, member(group.parent, _SPECTROMETER)):
        holders += [(holder, child) for child in list(holder or ())[:_MOST_MEMBERS]]
    for holder, child in holders:
        other, stated = _dataset(holder, child)
        if other is not None and stated not in ("", _NOT_PROVIDED) and np.array_equal(other, values):
            return values, stated
    return values, ""


def _ellipsometry(group: Any, name: str) -> tuple[dict[str, np.ndarray], list[str]]:
    """The columns of `measured_data` of NXellipsometry, one row for each angle and wavelength."""
    stated = text(member(group, "data_type")).replace(_NOT_PROVIDED, "")
    slices = {child.lower().partition("_")[0] for child in group}
    kind = stated or ("Psi/Delta" if {"psi", "delta"} <= slices else "not stated")
    observables = _OBSERVABLES.get(kind.lower())
    if observables is None:
        raise DataError(f"{name} measures {kind!r}; export psi and delta in degrees, or N, C and S, as CSV")
    holder = group
    axis = next((child for child in group if recognise(_named(child, "")).role == "wavelength"), "")
    if not axis and member(group.parent, f"{_SPECTROMETER}/wavelength") is not None:
        holder, axis = member(group.parent, _SPECTROMETER), "wavelength"
    values, units = _with_units(holder, axis) if axis else (None, "")
    measured = _without_single_axes(_dataset(group, _MEASURED)[0])
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
        errors = _without_single_axes(_dataset(group, child)[0])
        if errors is not None and errors.shape == measured.shape and degrees:
            columns |= {f"{_ERRORS[o]} (deg)": errors[:, i].reshape(-1) for i, o in enumerate(observables)}
            break
    return columns, [f"{_MEASURED} read as {kind}" + ("" if stated else ", by the names beside it")]


def _without_single_axes(values: np.ndarray | None) -> np.ndarray | None:
    """Values without leading axes of length 1, such as environment and time, before the last three."""
    while values is not None and values.ndim > 3 and values.shape[0] == 1:
        values = values[0]
    return values


def _angles(group: Any, count: int, points: int) -> dict[str, np.ndarray]:
    """A column of angles of incidence, empty where the entry states none for a single measurement."""
    entry = group.parent
    for place in ("angle_of_incidence", "instrument/angle_of_incidence"):
        for holder in (group, entry):
            dataset = member(holder, place)
            angles = numbers(dataset, place)
            if angles is not None and angles.size == count:
                units = attribute(dataset, "units").replace(_NOT_PROVIDED, "") or "not stated"
                return {f"angle ({units})": np.repeat(angles.reshape(-1), points)}
    if count > 1:
        raise DataError(
            f"has {count} measurements in {group.name}, but not an angle of incidence for each; "
            "export them as CSV"
        )
    return {}


def groups(file: Any) -> Iterator[tuple[str, Any]]:
    """Yield the root and every group below it once, with its name; links to elsewhere are not followed.

    Raises DataError for more than 1000 groups.
    """
    import h5py

    pending: list[tuple[str, Any]] = [("/", file)]
    seen: set[Any] = set()
    while pending:
        name, group = pending.pop(0)
        if len(seen) > _MOST_GROUPS:
            raise DataError(f"has more than {_MOST_GROUPS} groups; export one spectrum as CSV")
        if group in seen or name.count("/") > _MOST_DEPTH:  # equal groups are one under two names
            continue
        seen.add(group)
        yield name, group
        for child in group:
            if isinstance(group.get(child, getlink=True), h5py.HardLink):
                member = group[child]
                if isinstance(member, h5py.Group):
                    pending.append((f"{name.rstrip('/')}/{child}", member))


def member(group: Any, name: str, links: int = 0) -> Any:
    """Return a member by its name or path, None where it is missing.

    Raises DataError for a link to another file, and for links in a circle.
    """
    import h5py

    here: Any = group.file if name.startswith("/") else group
    for part in name.strip("/").split("/"):
        link = here.get(part, getlink=True) if isinstance(here, h5py.Group) else None
        if link is None:
            return None
        if isinstance(link, h5py.ExternalLink):
            raise DataError(f"{name} is a link to another file, {link.filename!r}; export the data into one")
        if isinstance(link, h5py.SoftLink):
            if links > _MOST_LINKS:
                raise DataError(f"{name} is a link to itself; export it again")
            here = member(here, link.path, links + 1)
        else:
            here = here[part]
    return here


def numbers(dataset: Any, name: str) -> np.ndarray | None:
    """Return the values of a dataset of numbers, None for anything else.

    Raises DataError for one that is stored in another file, or too large.
    """
    import h5py

    if not isinstance(dataset, h5py.Dataset) or dataset.dtype.kind not in "fiu" or dataset.shape is None:
        return None
    if dataset.is_virtual or dataset.external:
        raise DataError(f"{name} is stored in another dataset or file; export the data into one")
    chunk = prod(dataset.chunks or (1,)) * dataset.dtype.itemsize
    if dataset.size is None or dataset.size > MOST_NUMBERS or chunk > _MOST_CHUNK:
        raise DataError(f"{name} has {dataset.size} values, more than a spectrum; export one spectrum as CSV")
    return np.asarray(dataset[()], dtype=np.float64)


def text(dataset: Any) -> str:
    """Return the text of a dataset of one short string, else an empty text."""
    import h5py

    if not isinstance(dataset, h5py.Dataset) or dataset.size != 1 or dataset.is_virtual or dataset.external:
        return ""
    if h5py.check_string_dtype(dataset.dtype) is None or dataset.dtype.itemsize > _MOST_TEXT:
        return ""
    return _plain(dataset[()])


def attribute(thing: Any, name: str) -> str:
    """Return an attribute that is a short text, else an empty text."""
    if name not in thing.attrs or thing.attrs.get_id(name).get_storage_size() > _MOST_TEXT:
        return ""
    return _plain(thing.attrs[name])


def _plain(value: Any) -> str:
    if isinstance(value, np.ndarray):
        value = value.reshape(-1)[0] if value.size == 1 else ""
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    return value[:_MOST_TEXT].strip() if isinstance(value, str) else ""
