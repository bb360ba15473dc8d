"""Observers and cameras of a film's colours, with their lamp and coding, from words and files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pellicle.colour import delta_e76, delta_e2000, lab
from pellicle.colour.cameras import srgb_sensor
from pellicle.colour.encoding import Encoding, camera_encoding, encoding
from pellicle.colour.observers import Sensor
from pellicle.data.colour_chart import fit_matrix, read_chart
from pellicle.data.colours import CameraMatrix
from pellicle.errors import UsageError
from pellicle.recipes.sensors import of_camera, of_observer


@dataclass(frozen=True)
class Camera:
    """Observer or camera and lamp; files are paths.

    - `observer`: "1931" (2°) or "1964" (10°); `illuminant`: E, A, D50, D55, D65 or D75, or `lamp`, a CSV of
      its spectrum.
    - `sensitivities`: CSV of a camera's three channels, or `chart`, CSV of a photographed chart. Without
      either the channels of "rgb" are linear sRGB.
    - `gamma` of "rgb": values are linear ones to the power 1/gamma.
    - `white_balance`: "fixed", or "free" for an unknown factor of each channel.
    - `transmitted`: the light has passed the film.
    """

    observer: str = "1931"
    illuminant: str = "D65"
    lamp: str | None = None
    sensitivities: str | None = None
    chart: str | None = None
    gamma: float = 1.0
    white_balance: str = "fixed"
    transmitted: bool = False


class Sight(NamedTuple):
    """Sensor of a camera, its matrix by a chart, the coding of its values, and sentences on them."""

    sensor: Sensor
    matrix: CameraMatrix | None
    coding: Encoding
    notes: tuple[str, ...]


def sight(camera: Camera, space: str) -> Sight:
    """Return what `camera` sees, in a colour space.

    **Raises:** UsageError for parts that exclude each other or do not go with the space, DataError for files.
    """
    _check(camera, space)
    if camera.sensitivities is not None:
        made = of_camera(camera.sensitivities, camera.illuminant, camera.lamp)
        reach = f"{made.wavelength[0]:g} to {made.wavelength[-1]:g} nm"
        notes = (f"camera {camera.sensitivities} under {_light(camera)}, {reach}",)
        return Sight(made, None, camera_encoding(camera.gamma), notes)
    eye = of_observer(camera.observer, camera.illuminant, camera.lamp)
    notes = (f"observer {camera.observer} under {_light(camera)}",)
    if space != "rgb":
        return Sight(eye, None, encoding(space, eye.white), notes)
    coding = camera_encoding(camera.gamma)
    if camera.chart is None:
        return Sight(srgb_sensor(eye), None, coding, (*notes, "R, G, B: channels of linear sRGB"))
    matrix, told = _by_chart(camera.chart, coding, eye.white)
    return Sight(eye, matrix, coding, (*notes, *told))


def _check(camera: Camera, space: str) -> None:
    if camera.sensitivities is not None and camera.chart is not None:
        raise UsageError("`sensitivities` and `chart` exclude each other: a camera needs one of them")
    if camera.lamp is not None and camera.illuminant != "D65":
        raise UsageError("`illuminant` and `lamp` exclude each other: leave one out")
    if space == "rgb":
        if not 0.1 <= camera.gamma <= 10:
            raise UsageError(f"`gamma` must be a number from 0.1 to 10, such as 2.2, got {camera.gamma:g}")
        return
    for name in ("sensitivities", "chart"):
        if getattr(camera, name) is not None:
            raise UsageError(f'`{name}` goes with `signal="rgb"`, the channels of a camera, not with {space}')


def _light(camera: Camera) -> str:
    return camera.illuminant if camera.lamp is None else camera.lamp


def _by_chart(path: str, coding: Encoding, white: np.ndarray) -> tuple[CameraMatrix, tuple[str, ...]]:
    """Matrix of a camera by a chart, with a sentence on the misfit of its patches."""
    chart = read_chart(path)
    linear = coding.decoded(chart.rgb)
    sigma = None if chart.sigma is None else chart.sigma / _slope(coding, linear)
    fitted = fit_matrix(linear, chart.xyz, sigma, path)
    one, other = (np.asarray(lab(x, white)) for x in (linear @ np.linalg.inv(fitted.matrix).T, chart.xyz))
    try:
        name, difference = "ΔE2000", delta_e2000(one, other)
    except ImportError:  # without the extra `colour`
        name, difference = "ΔE*ab", np.asarray(delta_e76(one, other))
    misfit = (
        f"chart {path}: {len(linear)} patches, misfit {name} {difference.mean():.2g} on average and"
        f" {difference.max():.2g} at most"
    )
    return fitted, (misfit, *chart.notes)


def _slope(coding: Encoding, linear: np.ndarray) -> np.ndarray:
    """∂ coded / ∂ linear of each channel by itself, (..., 3)."""
    return np.diagonal(coding.rise(linear), axis1=-2, axis2=-1)
