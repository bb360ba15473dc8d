"""Writing of spectra as CSV, NetCDF or NeXus."""

import os
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.errors import UsageError, needs
from pellicle.files import replacing

_POLARISED = {"s": "s", "p": "p", "unpolarised": ""}


class _Column(NamedTuple):
    """A column of a CSV, its unit, and its name in NetCDF and NeXus."""

    header: str
    values: np.ndarray
    unit: str
    name: str


def write_spectrum(path: str | os.PathLike[str], spectrum: Spectrum, *, overwrite: bool = False) -> Path:
    """Write a spectrum as CSV, NetCDF or NeXus, by the suffix of the path: .csv, .nc or .nxs.

    A CSV is read back unchanged by `read_spectrum`, repeated sweeps included. NetCDF is for xarray
    (`xarray.open_dataset(path, engine="h5netcdf")`). NeXus has an NXdata group under the definition
    NXellipsometry for ellipsometry, NXoptical_spectroscopy for reflectance and
    transmittance. NetCDF and NeXus hold the mean of repeated sweeps and need the extra `formats`.

    **Arguments:** `path` of the file; `spectrum`; `overwrite` an existing file.

    **Returns:** the path.

    **Raises:** UsageError for another suffix, a missing package, or a file that exists without `overwrite` or
    cannot be written.
    """
    target = Path(path)
    write = _WRITERS.get(target.suffix.lower())
    if write is None:
        raise UsageError(f"`path` {target}: expected a name ending in {', '.join(_WRITERS)}")
    with replacing(target, overwrite=overwrite) as draft:
        write(draft, spectrum)
    return target


def _columns(spectrum: Spectrum) -> list[_Column]:
    """Axis, angle, values and errors of a spectrum, as far as it has them."""
    columns = [_Column("wavelength_nm", spectrum.wavelength, "nm", "wavelength")]
    if spectrum.angle is not None:
        columns.append(_Column("angle_deg", spectrum.angle, "degree", "angle_of_incidence"))
    if spectrum.azimuth is not None:
        columns.append(_Column("azimuth_deg", spectrum.azimuth, "degree", "sample_azimuth"))
    kind, name = spectrum.kind, ""
    if not (kind.degrees or kind.parts):  # the only column of the signal
        name = f"{kind.word}{_POLARISED[spectrum.polarisation] if kind.has_scale else ''}"
        if kind.of_counts or not spectrum.calibrated:
            name = "counts" if kind.of_counts else "intensity"
    shares = [q for q in kind.quantities if q.array == "depolarisation"]
    for group in ([q for q in kind.quantities if q not in shares], shares):
        for q in group:
            unit, stored = "degree" if q.unit else "", kind.noun if name else q.name
            columns.append(_Column(name or q.header, q.measured(spectrum), unit, stored))
        for q in group:
            if (error := q.error(spectrum)) is not None:
                header, stored = ("sigma", kind.noun) if name else (f"sigma_{q.header}", q.name)
                unit = "degree" if q.unit else ""
                columns.append(_Column(header, error, unit, f"{stored}_errors"))
    return columns


def _facts(spectrum: Spectrum) -> list[tuple[str, str]]:
    """Origin of a spectrum, as pairs of a key and a value without line breaks."""
    pairs = [
        ("source", Path(spectrum.path).name),
        ("sha256", spectrum.sha256),
        ("name", spectrum.name),
        *spectrum.declared,
        ("signal" if spectrum.calibrated else "uncalibrated", spectrum.signal),
        ("polarisation", "" if spectrum.ellipsometric else spectrum.polarisation),
        ("delta", "folded into 0 to 180 degrees" if spectrum.folded else ""),
        ("light", "transmitted" if spectrum.transmission else ""),
        ("written_by", f"pellicle {version('pellicle')}"),
    ]
    return [(key, " ".join(value.split())) for key, value in pairs if value.strip()]


def _write_csv(path: Path, spectrum: Spectrum) -> None:
    columns = [_columns(sweep) for sweep in spectrum.sweeps or (spectrum,)]
    headers = ",".join(column.header for column in columns[0])
    rows = [
        ",".join(repr(float(x)) for x in row)
        for sweep in columns
        for row in zip(*(column.values for column in sweep), strict=True)
    ]
    comments = [f"# {key} = {value}" for key, value in _facts(spectrum)]
    path.write_text("\n".join([*comments, headers, *rows, ""]), encoding="utf-8", newline="\n")


def _write_netcdf(path: Path, spectrum: Spectrum) -> None:
    xarray = _imported("xarray")
    _imported("h5netcdf")
    columns = _columns(spectrum)
    arrays = {c.name: ("point", c.values, {"units": c.unit or "1"}) for c in columns}
    # several angles repeat the wavelengths, so that these are no index
    xarray.Dataset(arrays, attrs=dict(_facts(spectrum))).to_netcdf(path, engine="h5netcdf")


def _write_nexus(path: Path, spectrum: Spectrum) -> None:
    h5py = _imported("h5py")
    of_angles = spectrum.ellipsometric
    with h5py.File(path, "w") as file:
        entry = _group(file, "entry", "NXentry", default="data")
        entry["definition"] = "NXellipsometry" if of_angles else "NXoptical_spectroscopy"
        entry["title"] = spectrum.name or Path(spectrum.path).stem or "spectrum"
        process = _group(entry, "origin", "NXprocess")
        for key, value in _facts(spectrum):
            process[key] = value
        columns, kind = _columns(spectrum), spectrum.kind
        names = [q.name for q in kind.quantities] if kind.degrees or kind.parts else [kind.noun]
        first, *others = [c.name for c in columns if c.name in names]
        data = _group(entry, "data", "NXdata", signal=first, axes=["wavelength"])
        if others:
            data.attrs["auxiliary_signals"] = others
        for column in columns:
            data.create_dataset(column.name, data=column.values).attrs["units"] = column.unit


def _group(parent: Any, name: str, kind: str, **attributes: Any) -> Any:
    group = parent.create_group(name)
    group.attrs.update({"NX_class": kind, **attributes})
    return group


def _imported(package: str) -> Any:
    import importlib

    with needs("formats", "NetCDF and NeXus need"):
        return importlib.import_module(package)


_WRITERS: dict[str, Callable[[Path, Spectrum], None]] = {
    ".csv": _write_csv,
    ".nc": _write_netcdf,
    ".nxs": _write_nexus,
}
