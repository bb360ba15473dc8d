"""Observers and cameras of a film's colours, with their lamp and coding, from names and files.

A camera is known by the sensitivities of its channels, or by a matrix that a photographed chart gives.
"""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pellicle.colour import delta_e76, delta_e2000, lab, observers
from pellicle.colour.spaces import Encoding, camera_encoding, encoding
from pellicle.data.colour_rows import bare_name, colour_cells, scaled
from pellicle.data.colours import CameraMatrix
from pellicle.data.spectrum_rows import axis_unit, read_axis
from pellicle.data.tabular.column_selection import AxisColumns, first_column
from pellicle.data.tabular.columns import Column, listed, recognise_all
from pellicle.data.tabular.layout import read_table
from pellicle.errors import DataError, UsageError
from pellicle.signals.limits import refuse_first

SRGB = "srgb"
_CHANNELS = {"r": 0, "red": 0, "x": 0, "g": 1, "green": 1, "y": 1, "b": 2, "blue": 2, "z": 2}
_NEGATIVE = 0.02
"""Share of its largest value by which a measured sensitivity or lamp may fall below zero."""
FEWEST = 6
"""Patches of a chart: three numbers of the matrix in each channel and as many for its errors."""


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

    sensor: observers.Sensor
    matrix: CameraMatrix | None
    coding: Encoding
    notes: tuple[str, ...]


def sight(camera: Camera, space: str) -> Sight:
    """Return what `camera` sees, in a colour space.

    **Raises:** UsageError for parts that exclude each other or do not go with the space, DataError for files.
    """
    if camera.sensitivities is not None and camera.chart is not None:
        raise UsageError("`sensitivities` and `chart` exclude each other: a camera needs one of them")
    if camera.lamp is not None and camera.illuminant != "D65":
        raise UsageError("`illuminant` and `lamp` exclude each other: leave one out")
    stray = next((name for name in ("sensitivities", "chart") if getattr(camera, name) is not None), "")
    if space != "rgb" and stray:
        raise UsageError(f'`{stray}` goes with `signal="rgb"`, the channels of a camera, not with {space}')
    if space == "rgb" and not 0.1 <= camera.gamma <= 10:
        raise UsageError(f"`gamma` must be a number from 0.1 to 10, such as 2.2, got {camera.gamma:g}")
    eye, light = _sensor(camera), camera.lamp or camera.illuminant
    if camera.sensitivities is not None:
        reach = f"{eye.wavelength[0]:g} to {eye.wavelength[-1]:g} nm"
        notes = (f"camera {camera.sensitivities} under {light}, {reach}",)
        return Sight(eye, None, camera_encoding(camera.gamma), notes)
    notes = (f"observer {camera.observer} under {light}",)
    if space != "rgb":
        return Sight(eye, None, encoding(space, eye.white), notes)
    coding = camera_encoding(camera.gamma)
    if camera.chart is None:
        return Sight(observers.srgb_sensor(eye), None, coding, (*notes, "R, G, B: channels of linear sRGB"))
    chart = read_chart(camera.chart)
    linear = coding.decoded(chart.rgb)
    slope = np.diagonal(coding.rise(linear), axis1=-2, axis2=-1)  # ∂ coded / ∂ linear of each channel
    sigma = None if chart.sigma is None else chart.sigma / slope
    fitted = fit_matrix(linear, chart.xyz, sigma, camera.chart)
    recorded = linear @ np.linalg.inv(fitted.matrix).T
    one, other = (np.asarray(lab(x, eye.white)) for x in (recorded, chart.xyz))
    try:
        name, difference = "ΔE2000", delta_e2000(one, other)
    except ImportError:  # without the extra `colour`
        name, difference = "ΔE*ab", np.asarray(delta_e76(one, other))
    misfit = (
        f"chart {camera.chart}: {len(linear)} patches, misfit {name} {difference.mean():.2g} on average and"
        f" {difference.max():.2g} at most"
    )
    return Sight(eye, fitted, coding, (*notes, misfit, *chart.notes))


def _sensor(camera: Camera) -> observers.Sensor:
    """The sensor of an observer of the CIE, or of a camera of known sensitivities, under its light.

    Raises UsageError for an unknown observer or illuminant, DataError for a file.
    """
    if camera.lamp is camera.sensitivities is None:
        with _as_error(UsageError, ""):
            return observers.sensor(camera.observer, camera.illuminant)
    seen = None if camera.sensitivities is None else read_sensitivities(camera.sensitivities)
    if camera.lamp is None:
        with _as_error(UsageError, "`illuminant`: "):
            light = observers.illuminant_spectrum(camera.illuminant)
    else:
        light = read_lamp(camera.lamp)
    with _as_error(DataError, f"{camera.sensitivities or camera.lamp}: "):
        return (
            observers.observer_sensor(camera.observer, *light)
            if seen is None
            else observers.camera_sensor(*seen, *light)
        )


@contextmanager
def _as_error(kind: type[DataError | UsageError], where: str) -> Iterator[None]:
    """Turn a ValueError of a function of arrays into an error of its file or argument."""
    try:
        yield
    except ValueError as error:
        raise kind(f"{where}{error}") from None


def band_sensor(
    name: str | None, illuminant: str | None, lamp: str | None, folder: Path
) -> observers.Sensor | None:
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
    observer = "1931" if name == SRGB else name
    known = observer in observers.OBSERVERS
    if not known and not (folder / name).suffix and not (folder / name).exists():
        raise UsageError(
            f"sensor {name!r} is unknown: expected {', '.join(observers.OBSERVERS)}, {SRGB} or a file of a"
            " camera's sensitivities"
        )
    lamp = str(folder / lamp) if lamp else None
    sensitivities = None if known else str(folder / name)
    eye = _sensor(Camera(observer, illuminant or "D65", lamp, sensitivities))
    return observers.srgb_sensor(eye) if name == SRGB else eye


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
    cells = colour_cells(path)
    names, sets = cells.names, cells.sets
    if not {"rgb", "xyz"} <= sets.keys():
        raise DataError(
            f"{path}: a chart needs the columns R, G, B as measured and X, Y, Z of the reference, not "
            f"{', '.join(map(repr, names))}"
        )
    plain = [bare_name(name)[0].lower().replace("_", " ") for name in names]
    single = [plain.index(name) for name in ("sigma r", "sigma g", "sigma b") if name in plain]
    errors = single if len(single) == 3 else [plain.index("sigma")] if "sigma" in plain else []
    wanted = [*sets["rgb"], *sets["xyz"], *errors]
    table = cells.table(wanted)
    numbers = table.numbers(wanted)
    if len(table) < FEWEST:
        raise DataError(f"{path}: has {len(table)} patches; a matrix with its errors needs {FEWEST} or more")
    rgb, xyz = np.stack(numbers[:3], axis=1), np.stack(numbers[3:6], axis=1)
    sigma = np.stack((numbers[6:] * 3)[:3], axis=1) if errors else None
    places = [table.places(position) for position in wanted]
    unit = bare_name(names[sets["rgb"][0]])[1]
    rgb, sigma, scale = scaled(rgb, sigma, "rgb", unit, places[:3], table.path)
    xyz, _, percent = scaled(xyz, None, "xyz", None, places[3:6], table.path)
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


def read_sensitivities(path: str | os.PathLike[str]) -> tuple[np.ndarray, np.ndarray]:
    """Read the spectral sensitivities of a camera's three channels.

    The file has a wavelength, whose unit its name gives (nm without one), and three columns: R, G, B, or red,
    green, blue, in any order, or three of any other name in the order of the channels. The level of a
    channel has no meaning. Other columns are refused.

    **Returns:** wavelengths in nm, rising, (N,), and sensitivities (N, 3).

    **Raises:** DataError: one sentence with file, line and remedy.
    """
    return _spectra(path, 3, "the sensitivities of three channels are", "those of R, G and B")


def read_lamp(path: str | os.PathLike[str]) -> tuple[np.ndarray, np.ndarray]:
    """Read the spectrum of a lamp: power per wavelength in any unit, against the wavelength.

    **Returns:** wavelengths in nm, rising, (N,), and the power (N,).

    **Raises:** DataError: one sentence with file, line and remedy.
    """
    nm, power = _spectra(path, 1, "the power of one lamp is", "one")
    return nm, power[:, 0]


def _spectra(
    path: str | os.PathLike[str], count: int, expected: str, kept: str
) -> tuple[np.ndarray, np.ndarray]:
    """Rising wavelengths (N,) in nm and the `count` other columns of a file (N, count). Raises DataError."""
    table = read_table(path)
    if table.names is None:
        wavelength = first_column(table)
        others = [Column(i, f"column {i + 1}", "other") for i in range(1, table.width)]
    else:
        named = [column for column in recognise_all(table.names) if column.name.strip()]
        axes = [column for column in named if column.role == "wavelength"]
        if len(axes) != 1:
            raise DataError(
                f"{table.path}: has {len(axes)} wavelength columns among {listed(named)} where one is"
                " expected; name it wavelength_nm"
            )
        wavelength, others = axes[0], [column for column in named if column is not axes[0]]
    if len(others) != count:
        raise DataError(
            f"{table.path}: has {len(others)} columns beside the wavelength where {expected} expected"
            f" ({listed(others)}); keep {kept}"
        )
    # `R (a.u.)` and `red_sensitivity` are R and red
    bare = [re.split(r"[ _(]", column.name.strip().lower())[0] for column in others]
    order = [_CHANNELS.get(name, -1) for name in bare]
    if sorted(order) == [0, 1, 2]:
        others = [others[order.index(channel)] for channel in range(3)]
    try:
        axis, columns = read_axis(table, AxisColumns(wavelength), others, axis_unit(table, wavelength, None))
    except DataError as error:
        told, unclear, _ = str(error).partition("; state its unit")
        if not unclear:
            raise
        raise DataError(f"{told}; name the unit in the header, as in wavelength_um") from None
    order = np.argsort(axis.wavelength)
    nm = axis.wavelength[order]
    if len(nm) < 2 or not np.all(np.diff(nm) > 0):
        raise DataError(f"{table.path}: needs two or more wavelengths, each of them once")
    for column, values in zip(others, columns, strict=True):
        largest = np.max(values)
        if not largest > 0:
            raise DataError(f"{table.path}: {table.label(column.position)} is nowhere above zero; correct it")
        reason = "is below zero; correct or delete that row"
        refuse_first(values, values < -_NEGATIVE * largest, table.places(column.position), reason)
    return nm, np.stack(columns, axis=1)[order]
