"""Observers and cameras of a film's colours, with their lamp and coding, and a camera's matrix by a chart."""

import os
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pellicle.colour import delta_e76, delta_e2000, lab
from pellicle.colour.encoding import Encoding, camera_encoding, encoding
from pellicle.colour.observers import Sensor, srgb_sensor
from pellicle.data.colour_rows import bare_name, channel_sets, colour_table, named_cells, scaled
from pellicle.data.colours import CameraMatrix
from pellicle.data.sensors import of_camera, of_observer
from pellicle.data.tabular.text import read_bytes, text_file
from pellicle.errors import DataError, UsageError


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
    slope = np.diagonal(coding.rise(linear), axis1=-2, axis2=-1)  # ∂ coded / ∂ linear of each channel
    sigma = None if chart.sigma is None else chart.sigma / slope
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


FEWEST = 6
"""Patches of a chart: three numbers of the matrix in each channel and as many for its errors."""


class Chart(NamedTuple):
    """Patches of a chart: R, G, B as the camera coded them (patches, 3), 0 to 1, and reference X, Y, Z with
    Y = 1 for a perfect reflector; `sigma` of R, G, B."""

    rgb: np.ndarray
    xyz: np.ndarray
    sigma: np.ndarray | None
    notes: tuple[str, ...]


def read_chart(path: str | os.PathLike[str]) -> Chart:
    """Read a chart: a CSV with R, G, B as measured and X, Y, Z of the reference, one patch a row.

    A column sigma, or sigma_R and so on, has the standard deviations of R, G, B. Other columns, as names of
    patches, are not used.

    **Raises:** DataError or UsageError: one sentence with file, line and remedy.
    """
    file = text_file(*read_bytes(path), path)
    names, rows, cells, delimiter = named_cells(file)
    sets = channel_sets(names)
    if not {"rgb", "xyz"} <= sets.keys():
        raise DataError(
            f"{file.path}: a chart needs the columns R, G, B as measured and X, Y, Z of the reference, not "
            f"{', '.join(map(repr, names))}"
        )
    plain = [bare_name(name)[0].lower().replace("_", " ") for name in names]
    each = [plain.index(name) for name in ("sigma r", "sigma g", "sigma b") if name in plain]
    errors = each if len(each) == 3 else [plain.index("sigma")] if "sigma" in plain else []
    wanted = [*sets["rgb"], *sets["xyz"], *errors]
    table = colour_table(file, names, rows, cells, delimiter, wanted)
    numbers = table.numbers(wanted)
    if len(rows) < FEWEST:
        raise DataError(
            f"{file.path}: has {len(rows)} patches; a matrix with its errors needs {FEWEST} or more"
        )
    rgb, xyz = np.stack(numbers[:3], axis=1), np.stack(numbers[3:6], axis=1)
    sigma = np.stack((numbers[6:] * 3)[:3], axis=1) if errors else None
    places = [table.places(position) for position in wanted]
    unit = bare_name(names[sets["rgb"][0]])[1]
    rgb, sigma, scale = scaled(rgb, sigma, "rgb", unit, places[:3], file.path)
    xyz, _, percent = scaled(xyz, None, "xyz", None, places[3:6], file.path)
    return Chart(rgb, xyz, sigma, (f"R, G, B of the chart: {scale}", f"X, Y, Z of the chart: {percent}"))


def fit_matrix(linear: np.ndarray, xyz: np.ndarray, sigma: np.ndarray | None, path: str = "") -> CameraMatrix:
    """Fit linear R, G, B = matrix · XYZ to the patches of a chart by weighted least squares.

    Without `sigma` (patches, 3) all patches weigh the same. The covariance is scaled to the residuals where
    they exceed σ.

    **Raises:** DataError for patches of fewer than three independent colours, in the reference or the
    photograph.
    """
    rows, covariance = np.zeros((3, 3)), np.zeros((9, 9))
    for channel in range(3):
        error = np.ones(len(xyz)) if sigma is None else sigma[:, channel]
        design, target = xyz / error[:, None], linear[:, channel] / error
        values = np.linalg.svd(design, compute_uv=False)
        if values[-1] < 1e-6 * values[0]:
            raise DataError(f"{path}: the patches are all of one hue; a matrix needs coloured and grey ones")
        rows[channel] = np.linalg.lstsq(design, target, rcond=None)[0]
        variance = np.sum((target - design @ rows[channel]) ** 2) / (len(xyz) - 3)
        block = slice(3 * channel, 3 * channel + 3)
        scale = variance if sigma is None else max(variance, 1.0)
        covariance[block, block] = scale * np.linalg.inv(design.T @ design)
    if np.linalg.cond(rows) > 1e6:
        raise DataError(f"{path}: R, G, B of its patches are of one hue; give them as photographed")
    return CameraMatrix(rows, covariance)
