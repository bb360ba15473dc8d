"""Binary files of the MERL BRDF database: one isotropic material on a grid of directions.

Matusik, Pfister, Brand and McMillan, A data-driven reflectance model, ACM Trans. Graph. 22 (2003).
Three int32 (90, 90, 180), then float64, little-endian: all of R, then G, then B, each over θ_h
(spaced as its square root), θ_d and φ_d, where φ_d stops at 180° because light and viewer may be
swapped. A cell is read at its middle. Values have a scale per channel; negative ones are invalid.
"""

import hashlib
import os
from pathlib import Path

import numpy as np

from pellicle.data.brdf_samples import BrdfSamples, angles, from_half_difference, spread
from pellicle.data.tabular.text import open_binary
from pellicle.errors import DataError

SHAPE = (90, 90, 180)
SCALE = (1.0 / 1500, 1.15 / 1500, 1.66 / 1500)
SAMPLES = 10_000
"""Samples kept by default: a fit gains nothing from all of about a million."""

_HEADER = 12  # bytes
_SIZE = _HEADER + 8 * 3 * SHAPE[0] * SHAPE[1] * SHAPE[2]
_LARGEST = 1 << 16  # text and most other binaries, read as int32, are far above

THETA_H = np.deg2rad((np.arange(SHAPE[0]) + 0.5) ** 2 / SHAPE[0])
THETA_D = np.deg2rad(np.arange(SHAPE[1]) + 0.5)
PHI_D = np.deg2rad(np.arange(SHAPE[2]) + 0.5)


def is_merl(path: str | os.PathLike[str]) -> bool:
    """Return True if a file begins with three plausible dimensions. Raises DataError if it cannot be read."""
    dimensions = _dimensions(path)
    return dimensions.size == 3 and bool(((dimensions > 0) & (dimensions < _LARGEST)).all())


def read_merl(
    path: str | os.PathLike[str], samples: int | None = None, max_theta: float = 90.0
) -> BrdfSamples:
    """Read at most `samples` (10 000 by default) valid cells of a MERL file, spread over its grid.

    The file is read piece by piece, not into memory. Cells with a direction below the surface or more than
    `max_theta` degrees from its normal, and invalid ones, are left out and counted in the notes. The surface
    is isotropic, so phi_i is 0.

    Raises DataError for other dimensions, a wrong size or no valid cell.
    """
    actual, expected = (" x ".join(map(str, shape)) for shape in (_dimensions(path), SHAPE))
    if actual != expected:
        raise DataError(
            f"{path}: looks like a MERL file of {actual} cells, where {expected} are expected; "
            "convert it to text (CSV) first"
        )
    if (size := Path(path).stat().st_size) != _SIZE:
        fault = "is cut short" if size < _SIZE else "is too long"
        raise DataError(f"{path}: {fault}, {size} bytes where a MERL file has {_SIZE}; download it again")
    with open_binary(path) as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    cells = np.memmap(path, dtype="<f8", mode="r", offset=_HEADER, shape=(3, *SHAPE))
    valid, below, invalid = _valid(cells, max_theta)
    if not valid.size:
        within = "" if max_theta == 90 else f" within {max_theta:g} degrees of the normal"
        raise DataError(f"{path}: has no valid cell of a BRDF{within}; download it again")
    beyond = "below the surface" if max_theta == 90 else f"more than {max_theta:g} degrees from the normal"
    kept = valid[spread(valid.size, SAMPLES if samples is None else samples)]
    h, d, p = np.unravel_index(kept, SHAPE)
    (theta_i, phi_i), (theta_o, phi_o) = map(
        angles, from_half_difference(THETA_H[h], 0.0, THETA_D[d], PHI_D[p])
    )
    return BrdfSamples(
        theta_i=np.rad2deg(theta_i),
        phi_i=np.zeros(kept.size),
        theta_o=np.rad2deg(theta_o),
        phi_o=np.rad2deg(phi_o - phi_i) % 360,
        values=cells[:, h, d, p].T * SCALE,
        channels=("R", "G", "B"),
        path=str(path),
        sha256=digest,
        notes=(
            "read as a MERL file of an isotropic surface, phi_i set to 0",
            f"{kept.size} of {valid.size} valid cells kept, spread over the grid",
            f"left out: {below} cells with a direction {beyond}, {invalid} invalid (negative) ones",
        ),
    )


def _dimensions(path: str | os.PathLike[str]) -> np.ndarray:
    with open_binary(path) as file:
        head = file.read(_HEADER)
    return np.frombuffer(head[: len(head) // 4 * 4], dtype="<i4")


def _valid(cells: np.ndarray, max_theta: float) -> tuple[np.ndarray, int, int]:
    """Flat indices of the valid cells; counts of cells beyond `max_theta` degrees and of invalid ones."""
    lowest = max(float(np.cos(np.deg2rad(max_theta))), 0.0) if max_theta < 90 else 0.0
    keep, below, invalid = np.empty(SHAPE, dtype=bool), 0, 0
    theta_d, phi_d = np.meshgrid(THETA_D, PHI_D, indexing="ij")
    for row, theta_h in enumerate(THETA_H):
        light, viewer = from_half_difference(theta_h, 0.0, theta_d, phi_d)
        above = (light[2] > lowest) & (viewer[2] > lowest)
        piece = cells[:, row]
        measured = ((piece >= 0) & (piece < np.inf)).all(axis=0)
        keep[row] = above & measured
        below += int(np.sum(~above))
        invalid += int(np.sum(above & ~measured))
    return np.flatnonzero(keep), below, invalid
