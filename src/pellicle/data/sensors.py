"""Sensors by name or files: an observer, or a camera of known sensitivities, under any lamp."""

import os
from pathlib import Path

import numpy as np

from pellicle.colour.observers import (
    OBSERVERS,
    Sensor,
    camera_sensor,
    illuminant_spectrum,
    observer_sensor,
    sensor,
    srgb_sensor,
)
from pellicle.data.tabular.axis import axis_unit, read_axis
from pellicle.data.tabular.column_selection import AxisColumns, first_column
from pellicle.data.tabular.columns import Column, listed, recognise_all
from pellicle.data.tabular.layout import read_table
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError, UsageError
from pellicle.signals.limits import refuse_first

SRGB = "srgb"
_DAYLIGHT = "D65"


def of_observer(observer: str, illuminant: str, lamp: str | None = None) -> Sensor:
    """Return the sensor of an observer of the CIE under an illuminant, or under the `lamp` of a file.

    **Raises:** UsageError for an unknown observer or illuminant, DataError for a file.
    """
    if lamp is None:
        try:
            return sensor(observer, illuminant)
        except ValueError as error:
            raise UsageError(str(error)) from None
    spectrum = read_lamp(lamp)
    try:
        return observer_sensor(observer, *spectrum)
    except ValueError as error:
        raise DataError(f"{lamp}: {error}") from None


def of_camera(sensitivities: str, illuminant: str, lamp: str | None = None) -> Sensor:
    """Return the sensor of a camera, by the file of its sensitivities, under an illuminant or a lamp.

    **Raises:** UsageError for an unknown illuminant, DataError for a file.
    """
    nm, seen = read_sensitivities(sensitivities)
    light = _light(illuminant) if lamp is None else read_lamp(lamp)
    try:
        return camera_sensor(nm, seen, *light)
    except ValueError as error:
        raise DataError(f"{sensitivities}: {error}") from None


def _light(illuminant: str) -> tuple[np.ndarray, np.ndarray]:
    try:
        return illuminant_spectrum(illuminant)
    except ValueError as error:
        raise UsageError(f"`illuminant`: {error}") from None


def band_sensor(name: str | None, illuminant: str | None, lamp: str | None, folder: Path) -> Sensor | None:
    """Return the sensor of a surface's recipe, None without one; paths are relative to `folder`.

    **Arguments:** `name` "1931" or "1964", whose channels are X, Y and Z; "srgb", the linear R, G and B of
    sRGB; or a file of a camera's sensitivities. `illuminant` of the CIE, D65 by default, or `lamp`, the file
    of a spectrum.

    **Raises:** UsageError or DataError.
    """
    if name is None:
        if stray := [key for key, value in (("illuminant", illuminant), ("lamp", lamp)) if value]:
            raise UsageError(f'{stray[0]} needs a sensor: give sensor = "1931", "srgb" or a file of a camera')
        return None
    if illuminant and lamp:
        raise UsageError("illuminant and lamp exclude each other: both are the light")
    light = illuminant or _DAYLIGHT, str(folder / lamp) if lamp else None
    if name == SRGB:
        return srgb_sensor(of_observer("1931", *light))
    if name in OBSERVERS:
        return of_observer(name, *light)
    if not (folder / name).suffix and not (folder / name).exists():
        raise UsageError(
            f"sensor {name!r} is unknown: expected {', '.join(OBSERVERS)}, {SRGB} or a file of a camera's"
            " sensitivities"
        )
    return of_camera(str(folder / name), *light)


_CHANNELS = {"r": 0, "red": 0, "x": 0, "g": 1, "green": 1, "y": 1, "b": 2, "blue": 2, "z": 2}
_NEGATIVE = 0.02
"""Share of its largest value by which a measured sensitivity or lamp may fall below zero."""
_REMEDY = "correct or delete that row"


def read_sensitivities(path: str | os.PathLike[str]) -> tuple[np.ndarray, np.ndarray]:
    """Read the spectral sensitivities of a camera's three channels.

    The file has a wavelength, whose unit its name gives (nm without one), and three columns: R, G, B, or red,
    green, blue, in any order, or three of any other name in the order of the channels. The level of a
    channel has no meaning. Other columns are refused.

    **Returns:** wavelengths in nm, rising, (N,), and sensitivities (N, 3).

    **Raises:** DataError: one sentence with file, line and remedy.
    """
    table = read_table(path)
    wavelength, others = _columns(table)
    if len(others) != 3:
        raise DataError(
            f"{table.path}: has {len(others)} columns beside the wavelength where the sensitivities of three "
            f"channels are expected ({listed(others)}); keep those of R, G and B"
        )
    order = [_CHANNELS.get(_bare(column.name), -1) for column in others]
    if sorted(order) == [0, 1, 2]:
        others = [others[order.index(channel)] for channel in range(3)]
    return _read(table, wavelength, others)


def read_lamp(path: str | os.PathLike[str]) -> tuple[np.ndarray, np.ndarray]:
    """Read the spectrum of a lamp: power per wavelength in any unit, against the wavelength.

    **Returns:** wavelengths in nm, rising, (N,), and the power (N,).

    **Raises:** DataError: one sentence with file, line and remedy.
    """
    table = read_table(path)
    wavelength, others = _columns(table)
    if len(others) != 1:
        raise DataError(
            f"{table.path}: has {len(others)} columns beside the wavelength where the power of one lamp is "
            f"expected ({listed(others)}); keep one"
        )
    nm, power = _read(table, wavelength, others)
    return nm, power[:, 0]


def _columns(table: Table) -> tuple[Column, list[Column]]:
    """The wavelength and the other columns that are not empty, in file order. Raises DataError."""
    if table.names is None:
        return first_column(table), [Column(i, f"column {i + 1}", "other") for i in range(1, table.width)]
    named = [column for column in recognise_all(table.names) if column.name.strip()]
    axes = [column for column in named if column.role == "wavelength"]
    if len(axes) != 1:
        raise DataError(
            f"{table.path}: has {len(axes)} wavelength columns among {listed(named)} where one is expected; "
            "name it wavelength_nm"
        )
    return axes[0], [column for column in named if column is not axes[0]]


def _bare(name: str) -> str:
    """A channel's name without a unit or brackets: `R (a.u.)` and `red_sensitivity` are R and red."""
    return name.strip().lower().replace("_", " ").replace("(", " ").split(" ")[0]


def _read(table: Table, wavelength: Column, others: list[Column]) -> tuple[np.ndarray, np.ndarray]:
    try:
        axis, read = read_axis(table, AxisColumns(wavelength), others, axis_unit(table, wavelength, None))
    except DataError as error:
        told, unclear, _ = str(error).partition("; state its unit")
        if not unclear:
            raise
        raise DataError(f"{told}; name the unit in the header, as in wavelength_um") from None
    nm = axis.wavelength
    order = np.argsort(nm)
    if len(nm) < 2 or not np.all(np.diff(nm[order]) > 0):
        raise DataError(f"{table.path}: needs two or more wavelengths, each of them once")
    for column, values in zip(others, read, strict=True):
        largest = np.max(values)
        if not largest > 0:
            raise DataError(f"{table.path}: {table.label(column.position)} is nowhere above zero; correct it")
        reason = f"is below zero; {_REMEDY}"
        refuse_first(values, values < -_NEGATIVE * largest, table.places(column.position), reason)
    return nm[order], np.stack(read, axis=1)[order]
