"""Matrix of a camera from a photographed colour chart."""

from __future__ import annotations

import os
from typing import NamedTuple

import numpy as np

from pellicle.data.colour_columns import bare_name, channel_sets, colour_table, named_cells
from pellicle.data.colour_scale import scaled
from pellicle.data.colours import CameraMatrix
from pellicle.data.tabular.text import read_bytes, text_file
from pellicle.errors import DataError

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
    comma = delimiter != "," and any("," in row[i] for row in cells for i in wanted)
    table = colour_table(file, names, rows, cells, comma)
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
