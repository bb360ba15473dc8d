"""Sensors as recipes name them: an observer or a camera, under an illuminant or a lamp."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pellicle.colour.cameras import camera_sensor, illuminant_spectrum, observer_sensor, srgb_sensor
from pellicle.colour.observers import OBSERVERS, Sensor, sensor
from pellicle.data.sensitivities import read_lamp, read_sensitivities
from pellicle.errors import DataError, UsageError

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
