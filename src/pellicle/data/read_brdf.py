"""Reading samples of a BRDF, whatever the format."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence

import numpy as np

from pellicle.data.brdf_samples import CHANNELS, BrdfSamples, sigma_names
from pellicle.data.formats import alta
from pellicle.data.formats.merl import is_merl, read_merl
from pellicle.data.tabular.column_selection import listed, named_columns, only
from pellicle.data.tabular.columns import DIRECTIONS, Column
from pellicle.data.tabular.table import Table, read_table
from pellicle.data.tabular.units import brdf_unit
from pellicle.errors import DataError, UsageError

ROUNDING = 1e-3  # degrees: π/2 with four decimals is no direction below the horizon
_EXAMPLE = "--columns theta_i,phi_i,theta_o,phi_o,R,G,B"


def read_brdf_samples(
    path: str | os.PathLike[str],
    *,
    columns: str | Sequence[str] | None = None,
    samples: int | None = None,
) -> BrdfSamples:
    """Reads samples of a BRDF: CSV, ALTA text or MERL binary, told by the content of the file.

    A CSV has the columns theta_i, phi_i, theta_o, phi_o in degrees, then value or R, G, B in 1/sr, and
    may have their standard deviations: sigma for all, or sigma_R, sigma_G, sigma_B.

    - `columns`: names in the order of a CSV's columns, `_` to skip one; overrides the header.
    - `samples`: the most to keep, spread over the file, the same at every call. By default all of a
      text file and 10 000 of a MERL file.

    Returns `BrdfSamples`. Raises DataError (unreadable or impossible data) or UsageError (an argument
    missing or wrong), one sentence with file, line and remedy.
    """
    if is_merl(path):
        return read_merl(path, samples)
    table = read_table(path, alta.layout)
    header = alta.find_header(table.comments, table.path)
    found = _checked(alta.from_table(table, header) if header else _from_csv(table, columns))
    return found if samples is None else found.thinned(samples)


def _from_csv(table: Table, spec: str | Sequence[str] | None) -> BrdfSamples:
    columns = named_columns(table, spec)
    if columns is None:
        raise UsageError(f"{table.path}: has no header, so say what its columns are with {_EXAMPLE}")
    directions = _required(table, columns, DIRECTIONS)
    channels = _channels(table, columns)
    values = _required(table, columns, channels)
    errors = _errors(table, columns, channels)
    read = [*directions, *values, *errors]
    _check_units(table, directions, [*values, *errors])
    numbers = table.numbers([column.position for column in read])
    start, end = len(directions), len(directions) + len(values)
    if not any(column.unit for column in directions):
        _refuse_radians(table, numbers[:start])
    sigma = np.stack((numbers[end:] * len(values))[: len(values)], axis=1) if errors else None
    ignored = [column for column in columns if column not in read and column.name not in ("_", "")]
    said = [f"{listed(directions)} read as directions in degrees, {listed(values)} as the BRDF in 1/sr"]
    said += [f"{listed(errors)} read as the standard deviation of the BRDF"] if errors else []
    said += [f"ignored: {listed(ignored)}"] if ignored else []
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
        notes=(*table.notes, *said),
        lines=table.lines,
    )


def _required(table: Table, columns: Sequence[Column], roles: Sequence[str]) -> list[Column]:
    found = [only(table, columns, role) for role in roles]
    missing = [role for role, column in zip(roles, found, strict=True) if column is None]
    if missing:
        raise DataError(
            f"{table.path}: no column is {', '.join(missing)} among {listed(columns)}; add it, or name the "
            f"columns in order, e.g. {_EXAMPLE}"
        )
    return [column for column in found if column is not None]


def _channels(table: Table, columns: Sequence[Column]) -> tuple[str, ...]:
    """R, G, B or value, whichever the file has; value where it has none, for the message."""
    single, triple = CHANNELS
    roles = {column.role for column in columns}
    if roles.isdisjoint(triple):
        return single
    if "value" in roles:
        raise UsageError(
            f"{table.path}: holds value as well as R, G, B; say which to read with _ for the others, "
            f"e.g. {_EXAMPLE},_"
        )
    return triple


def _errors(table: Table, columns: Sequence[Column], channels: tuple[str, ...]) -> list[Column]:
    """A standard deviation for each channel, or one for all; none if the file has none."""
    each = [name for name in sigma_names(channels) if only(table, columns, name)]
    if each:
        return _required(table, columns, sigma_names(channels))
    one = only(table, columns, "sigma")
    return [one] if one else []


def _check_units(table: Table, directions: Sequence[Column], others: Sequence[Column]) -> None:
    for column in directions:
        if column.unknown_unit:
            raise DataError(
                f"{table.path}: {table.label(column.position)} is in {column.unknown_unit!r}; "
                "write directions in degrees"
            )
    for column in others:
        unit = "percent" if column.unit == "percent" else column.unknown_unit
        if unit and not brdf_unit(unit):
            raise DataError(
                f"{table.path}: {table.label(column.position)} is in {unit!r}; write the BRDF in 1/sr"
            )


def _checked(samples: BrdfSamples) -> BrdfSamples:
    """Refuses directions below the horizon, a negative BRDF, a standard deviation that is none. DataError."""
    thetas = {name: getattr(samples, name) for name in ("theta_i", "theta_o")}
    for name, theta in thetas.items():
        why = "is below the horizon; write theta from 0 to 90 degrees, the far side with phi + 180"
        _refuse(samples, name, theta, (theta < -ROUNDING) | (theta > 90 + ROUNDING), f"degrees {why}")
    for at, name in enumerate(samples.channels):
        values = samples.values[:, at]
        _refuse(samples, name, values, values < 0, "is a BRDF below zero; correct or delete that row")
        if samples.sigma is not None:
            sigma, why = samples.sigma[:, at], "is not above zero; correct or delete that row"
            _refuse(samples, f"the standard deviation of {name}", sigma, sigma <= 0, why)
    return dataclasses.replace(samples, **{name: np.clip(theta, 0, 90) for name, theta in thetas.items()})


def _refuse(samples: BrdfSamples, what: str, values: np.ndarray, wrong: np.ndarray, why: str) -> None:
    if wrong.any():
        row = int(np.argmax(wrong))
        line = "" if samples.lines is None else f"line {samples.lines[row]}: "
        raise DataError(f"{samples.path}: {line}{what} = {values[row]:g} {why}")


def _refuse_radians(table: Table, angles: Sequence[np.ndarray]) -> None:
    theta, phi = (max(np.abs(values).max() for values in angles[at::2]) for at in (0, 1))
    if 0 < theta <= np.pi / 2 + ROUNDING and phi <= 2 * np.pi + ROUNDING:
        raise DataError(
            f"{table.path}: theta is at most {theta:g} and phi {phi:g}, which look like radians; write "
            "directions in degrees, or name the columns theta_i_deg and so on if they are"
        )
