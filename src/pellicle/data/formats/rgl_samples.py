"""BRDF samples of `.bsdf` files: their stored values, in the channels of a surface."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence

import numpy as np

from pellicle.data.brdf_samples import BrdfSamples, spread
from pellicle.data.formats.rgl import RglBrdf, load_rgl
from pellicle.data.half_angles import angles
from pellicle.data.tabular.text import open_binary
from pellicle.errors import DataError

SAMPLES = 10_000
"""Samples kept by default, as of a MERL file."""
WAVELENGTHS = (645.0, 525.0, 445.0)
"""Wavelengths (nm) of R, G and B by default; those of BRDF models."""

Bands = tuple[np.ndarray, np.ndarray]
"""Wavelengths (N,) in nm and their weights (N, channels), 1 or 3: channels that are integrals."""
_UNSEEN = 0.01
"""Largest share of a band beyond the spectra, which keep their last value there."""


def read_rgl(
    path: str | os.PathLike[str],
    samples: int | None = None,
    max_theta: float = 90.0,
    wavelengths: Sequence[float] | None = None,
    bands: Bands | None = None,
) -> BrdfSamples:
    """Read at most `samples` (10 000 by default) nodes of a `.bsdf` file, spread over its grid.

    Each is a stored value at its own direction, not interpolated. Nodes with a direction below the surface
    or more than `max_theta` degrees from its normal, and negative ones, are left out and counted.
    Spectra are interpolated linearly at `wavelengths` (nm), one or three, by default 645, 525 and 445, or
    integrated over `bands`.

    Raises DataError for another tensor file, a damaged one, one without a valid node, and wavelengths or
    bands outside the spectra.
    """
    brdf = load_rgl(path)
    channels = _channels(path, brdf, wavelengths) if bands is None else _band_channels(path, brdf, bands)
    lowest = np.cos(np.deg2rad(max_theta)) if max_theta < 90 else 0.0
    pieces, beyond, invalid = [], 0, 0
    for azimuth, theta in np.ndindex(brdf.values.shape[:2]):
        i, o, factor, nodes = brdf.at_nodes(azimuth, theta)
        stored = brdf.values[azimuth, theta].reshape(brdf.values.shape[2], -1)[:, nodes]
        values = channels @ stored.astype(float) * factor
        above = (o[2] > lowest) & (i[2] > lowest)
        valid = above & np.all((values >= 0) & np.isfinite(values), axis=0)
        beyond += int(np.sum(~above))
        invalid += int(np.sum(above & ~valid))
        pieces.append(np.concatenate([np.tile(i[:, None], o.shape[1]), o, values])[:, valid])
    every = np.concatenate(pieces, axis=1)
    if not every.size:
        within = "" if max_theta == 90 else f" within {max_theta:g} degrees of the normal"
        raise DataError(f"{path}: has no valid value of a BRDF{within}; download it again")
    kept = spread(every.shape[1], SAMPLES if samples is None else samples)
    (theta_i, phi_i), (theta_o, phi_o) = angles(every[:3, kept]), angles(every[3:6, kept])
    if brdf.isotropic:
        phi_i, phi_o = np.zeros(kept.size), (phi_o - phi_i) % (2 * np.pi)
    where = "below the surface" if max_theta == 90 else f"more than {max_theta:g} degrees from the normal"
    nature = "isotropic surface, phi_i set to 0" if brdf.isotropic else "anisotropic surface"
    with open_binary(path) as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return BrdfSamples(
        *(np.rad2deg(x) for x in (theta_i, phi_i, theta_o, phi_o)),
        values=every[6:, kept].T,
        channels=("R", "G", "B") if len(channels) == 3 else ("value",),
        path=str(path),
        sha256=digest,
        notes=(
            f"read as an RGL tensor file of an {nature}, {_described(brdf, wavelengths, bands)}",
            f"{kept.size} of {every.shape[1]} valid nodes kept, spread over the grid",
            f"left out: {beyond} nodes with a direction {where}, {invalid} invalid (negative) ones",
        ),
    )


def _channels(path: str | os.PathLike[str], brdf: RglBrdf, wavelengths: Sequence[float] | None) -> np.ndarray:
    """Weights (channels, stored) of the stored channels in those that are read."""
    if brdf.wavelengths is None:
        return np.eye(3)
    wanted = np.array(WAVELENGTHS if wavelengths is None else wavelengths, dtype=float)
    first, last = brdf.wavelengths[[0, -1]]
    if wanted.size not in (1, 3) or wanted.min() < first or wanted.max() > last:
        raise DataError(
            f"{path}: its spectra go from {first:g} to {last:g} nm; choose one or three `wavelengths` there,"
            f" not {', '.join(f'{each:g}' for each in wanted)}"
        )
    unit = np.eye(brdf.wavelengths.size)
    return np.stack([np.interp(wanted, brdf.wavelengths, row) for row in unit], axis=1)


def _band_channels(path: str | os.PathLike[str], brdf: RglBrdf, bands: Bands) -> np.ndarray:
    """Weights (channels, stored) of the stored wavelengths in channels that are integrals."""
    if brdf.wavelengths is None:
        return np.eye(3)
    wavelength, weights = (np.asarray(each, dtype=float) for each in bands)
    first, last = brdf.wavelengths[[0, -1]]
    beyond = (wavelength < first) | (wavelength > last)
    if np.any(np.abs(weights[beyond]).sum(axis=0) > _UNSEEN * np.abs(weights).sum(axis=0)):
        raise DataError(
            f"{path}: its spectra go from {first:g} to {last:g} nm, beyond which the sensor sees more than"
            " 1 % of the light; give the surface wavelengths in place of a sensor"
        )
    unit = np.eye(brdf.wavelengths.size)
    return weights.T @ np.stack([np.interp(wavelength, brdf.wavelengths, row) for row in unit], axis=1)


def _described(brdf: RglBrdf, wavelengths: Sequence[float] | None, bands: Bands | None) -> str:
    if brdf.wavelengths is None:
        told = "R, G, B of linear sRGB"
        return told if bands is not None else f'{told}, at wavelengths: give the surface sensor = "srgb"'
    if bands is not None:
        return "spectra integrated over the bands of the sensor"
    names = ", ".join(f"{each:g}" for each in (WAVELENGTHS if wavelengths is None else wavelengths))
    return f"spectra taken at {names} nm"
