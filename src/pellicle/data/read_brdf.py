"""Reading of BRDF samples: CSV, ALTA text, MERL and RGL binary files."""

import os
from collections.abc import Sequence

import numpy as np

from pellicle.data.brdf_samples import CHANNELS, ROUNDING, BrdfSamples, sigma_names
from pellicle.data.formats import alta
from pellicle.data.formats.merl import is_merl, read_merl
from pellicle.data.formats.rgl import is_tensor_file, read_rgl
from pellicle.data.tabular.column_selection import named_columns, only
from pellicle.data.tabular.columns import DIRECTIONS, Column, listed
from pellicle.data.tabular.layout import find_layout
from pellicle.data.tabular.table import Table
from pellicle.data.tabular.text import read_bytes, text_file
from pellicle.data.tabular.units import brdf_unit
from pellicle.errors import DataError, UsageError

_EXAMPLE = '`columns=["theta_i", "phi_i", "theta_o", "phi_o", "R", "G", "B"]`'


def read_brdf_samples(
    path: str | os.PathLike[str],
    *,
    columns: str | Sequence[str] | None = None,
    samples: int | None = None,
    max_theta: float | None = None,
    wavelengths: Sequence[float] | None = None,
    bands: tuple[np.ndarray, np.ndarray] | None = None,
) -> BrdfSamples:
    """Read samples of a BRDF from CSV, ALTA text, MERL or RGL (`.bsdf`) files, recognised by their content.

    A CSV has the columns theta_i, phi_i, theta_o, phi_o in degrees, then value or R, G, B in 1/sr, and
    may have their standard deviations: sigma for all, or sigma_R, sigma_G, sigma_B.

    **Arguments:**

    - `path` of the file.
    - `columns`: names in the order of a CSV's columns, "_" to skip one; overrides the header.
    - `samples`: how many to keep, spread over the file, the same at every call. By default all of a text
      file and 10 000 of a MERL or RGL file.
    - `max_theta`: samples with light or viewer further than this from the normal (degrees) are left out:
      near grazing many instruments, MERL's among them, measure badly.
    - `wavelengths` (nm) at which spectra of an RGL file are taken, one or three: 645, 525, 445 by default.
    - `bands`: in place of `wavelengths`, those over which they are integrated, in nm (N,), with their weights
      in each channel (N, channels), as of `pellicle.colour.sensor`.

    **Returns:** `BrdfSamples`.

    **Raises:** DataError (unreadable or impossible data) or UsageError (an argument missing or wrong): one
    sentence with file, line and remedy.
    """
    if max_theta is not None and not 0 < max_theta <= 90:
        raise UsageError(f"`max_theta` must lie above 0 and at most at 90 degrees, got {max_theta:g}")
    widest = 90.0 if max_theta is None else max_theta
    if is_tensor_file(path):
        return read_rgl(path, samples, widest, wavelengths, bands)
    if is_merl(path):
        return read_merl(path, samples, widest)
    file = text_file(*read_bytes(path), path)
    header = alta.find_header(file.comments, file.path)
    table = alta.table_of(file, header) if header else find_layout(file)
    every = alta.from_table(table, header) if header else _from_csv(table, columns)
    every = every if max_theta is None else every.within(max_theta)
    return every if samples is None else every.thinned(samples)


def _from_csv(table: Table, requested: str | Sequence[str] | None) -> BrdfSamples:
    columns = named_columns(table, requested)
    if columns is None:
        raise UsageError(f"{table.path}: has no header, so name its columns, as in {_EXAMPLE}")
    directions = _required(table, columns, DIRECTIONS)
    single, triple = CHANNELS
    roles = {column.role for column in columns}
    # value where the file has neither, for the message
    channels = single if roles.isdisjoint(triple) else triple
    if channels == triple and "value" in roles:
        raise UsageError(
            f"{table.path}: has value as well as R, G, B; choose with `columns`, _ for the others"
        )
    values = _required(table, columns, channels)
    # a standard deviation for each channel, or one for all
    single = any(only(table, columns, name) for name in sigma_names(channels))
    common = None if single else only(table, columns, "sigma")
    errors = _required(table, columns, sigma_names(channels)) if single else [common] if common else []
    read = [*directions, *values, *errors]
    for column in read:
        unit = "percent" if column.unit == "percent" else column.unknown_unit
        wanted = "directions in degrees" if column in directions else "the BRDF in 1/sr"
        if unit and (column in directions or not brdf_unit(unit)):
            label = table.label(column.position)
            raise DataError(f"{table.path}: {label} is in {unit!r}; write {wanted}")
    numbers = table.numbers([column.position for column in read])
    start, end = len(directions), len(directions) + len(values)
    if not any(column.unit for column in directions):
        _refuse_radians(table, numbers[:start])
    sigma = np.stack((numbers[end:] * len(values))[: len(values)], axis=1) if errors else None
    ignored = [column for column in columns if column not in read and column.name not in ("_", "")]
    notes = [f"{listed(directions)} read as directions in degrees, {listed(values)} as the BRDF in 1/sr"]
    notes += [f"{listed(errors)} read as the standard deviation of the BRDF"] if errors else []
    notes += [f"ignored: {listed(ignored)}"] if ignored else []
    theta_i, phi_i, theta_o, phi_o = numbers[:start]
    return BrdfSamples(
        theta_i,
        phi_i,
        theta_o,
        phi_o,
        np.stack(numbers[start:end], axis=1),
        channels,
        sigma=sigma,
        path=table.path,
        sha256=table.sha256,
        notes=(*table.notes, *notes),
        lines=table.lines,
    )


def _required(table: Table, columns: Sequence[Column], roles: Sequence[str]) -> list[Column]:
    matching = {role: only(table, columns, role) for role in roles}
    missing = [role for role, column in matching.items() if column is None]
    if missing:
        raise DataError(
            f"{table.path}: no column is {', '.join(missing)} among {listed(columns)}; add it, or name the "
            f"columns in order, as in {_EXAMPLE}"
        )
    return [column for column in matching.values() if column is not None]


def _refuse_radians(table: Table, angles: Sequence[np.ndarray]) -> None:
    theta, phi = (max(np.abs(values).max() for values in angles[first::2]) for first in (0, 1))
    if 0 < theta <= np.pi / 2 + ROUNDING and phi <= 2 * np.pi + ROUNDING:
        raise DataError(
            f"{table.path}: theta is at most {theta:g} and phi {phi:g}, which look like radians; write "
            "directions in degrees, or name the columns theta_i_deg and so on if they are"
        )
