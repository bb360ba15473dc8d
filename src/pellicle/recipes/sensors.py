"""Sensors as recipes of surfaces name them: an observer or a camera, under an illuminant or a lamp."""

from __future__ import annotations

from pathlib import Path

from pellicle.colour.cameras import camera_sensor, illuminant_spectrum, observer_sensor, srgb_sensor
from pellicle.colour.observers import OBSERVERS, Sensor
from pellicle.data.sensitivities import read_lamp, read_sensitivities
from pellicle.errors import UsageError

SRGB = "srgb"


def band_sensor(name: str | None, illuminant: str | None, lamp: str | None, folder: Path) -> Sensor | None:
    """Return the sensor of a recipe, None without one; paths are relative to `folder`.

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
    light = read_lamp(folder / lamp) if lamp else illuminant_spectrum(illuminant or "D65")
    if name == SRGB:
        return srgb_sensor(observer_sensor("1931", *light))
    if name in OBSERVERS:
        return observer_sensor(name, *light)
    if not (folder / name).suffix and not (folder / name).exists():
        raise UsageError(
            f"sensor {name!r} is unknown: expected {', '.join(OBSERVERS)}, {SRGB} or a file of a camera's"
            " sensitivities"
        )
    return camera_sensor(*read_sensitivities(folder / name), *light)
