"""`.bsdf` files of the RGL material database and of Mitsuba 3's `measured`: a BRDF in adaptive coordinates.

For each direction to the light the half vectors are warped to a unit square by the visible normals of the
surface, so that a grid on the square is densest in the lobe. The file has this density (`vndf`), the values
on the grid (`rgb`, or `spectra` at `wavelengths`) and, where `jacobian` is 1, the density of normals (`ndf`)
and the projected area (`sigma`) by which they are to be multiplied.

The container is a tensor file, named arrays in one little-endian binary file: the bytes "tensor_file" and 0,
version 1.0 as two bytes, the number of fields as uint32, then for each field the length of its name (uint16),
the name, the number of axes (uint16), a code of its type (uint8), the position of its data (uint64) and its
shape (uint64 for each axis).

Source: J. Dupuy and W. Jakob, An adaptive parameterization for efficient material acquisition and rendering,
ACM TOG 37(6), 274 (2018); rgl.epfl.ch/materials; the plugin `measured` of Mitsuba 3, whose values it
reproduces; Mitsuba's writer of tensor files (`mitsuba.tensor_io`).
"""

import hashlib
import os
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.brdf_samples import BrdfSamples, angles, spread, vectors
from pellicle.data.formats.bilinear_warp import BilinearWarp, Corners, corners, interpolated
from pellicle.data.tabular.text import open_binary
from pellicle.errors import DataError
from pellicle.files import replacing

MAGIC = b"tensor_file\0"
VERSION = (1, 0)

_TYPES = ("u1", "i1", "<u2", "<i2", "<u4", "<i4", "<u8", "<i8", "<f2", "<f4", "<f8")  # codes 1 to 11
_ALIGNMENT = 8
_MOST_FIELDS, _MOST_AXES = 1000, 16
_AXES = {"theta_i": 1, "phi_i": 1, "ndf": 2, "sigma": 2, "vndf": 4, "luminance": 4, "jacobian": 1}
SAMPLES = 10_000
"""Samples kept by default, as of a MERL file."""
WAVELENGTHS = (645.0, 525.0, 445.0)
"""Wavelengths (nm) of R, G and B by default; those of BRDF models."""

Bands = tuple[np.ndarray, np.ndarray]
"""Wavelengths (N,) in nm and their weights (N, channels), 1 or 3: channels that are integrals."""
_UNSEEN = 0.01
"""Largest share of a band beyond the spectra, which keep their last value there."""


def theta_to_unit(theta: Any) -> Any:
    """Return the coordinate √(2θ/π) of an angle θ from the normal."""
    return np.sqrt(theta * (2 / np.pi))


def phi_to_unit(phi: Any) -> Any:
    """Return the coordinate (φ + π)/2π, from 0 to 1, of an azimuth."""
    return (phi + np.pi) / (2 * np.pi) % 1.0


def unit_to_theta(unit: Any) -> Any:
    """Return the angle from the normal of its coordinate."""
    return unit * unit * (np.pi / 2)


def unit_to_phi(unit: Any) -> Any:
    """Return the azimuth of its coordinate."""
    return (2 * unit - 1) * np.pi


@dataclass(frozen=True)
class RglBrdf:
    """A BRDF of a `.bsdf` file. Angles are in radians; arrays are indexed [azimuth, theta, ..., y, x].

    **Arguments:**

    - `phi_i`, `theta_i`: rising directions to the light; at most two azimuths mean an isotropic surface.
    - `values`: (azimuths, thetas, channels, rows, columns), the BRDF times cos θ_o over `scale`.
    - `wavelengths` of the channels in nm, or None for linear sRGB.
    - `ndf`, `sigma`: (rows, columns), over the half vector and over the direction to the light, or None.
    - `warp`: of the half vectors.
    """

    phi_i: np.ndarray
    theta_i: np.ndarray
    values: np.ndarray
    wavelengths: np.ndarray | None
    ndf: np.ndarray | None
    sigma: np.ndarray | None
    warp: BilinearWarp

    @property
    def isotropic(self) -> bool:
        """True where the azimuth of the light does not matter."""
        return self.phi_i.size <= 2

    @property
    def symmetry(self) -> int:
        """1, or 2 or 4 where the file has a half or a quarter of all azimuths and the rest by symmetry."""
        return 1 if self.isotropic else int(np.rint(2 * np.pi / np.ptp(self.phi_i)))

    def evaluate(self, i: np.ndarray, o: np.ndarray) -> np.ndarray:
        """Return the BRDF (N, channels) in 1/sr for light from `i` to `o`, unit vectors (3, N).

        It is what Mitsuba computes, without its factor cos θ_o; 0 below the horizon. `i` is the direction
        that Mitsuba calls `wi`.
        """
        i, o = (np.asarray(v, dtype=float).reshape(3, -1) for v in (i, o))
        above = (i[2] > 0) & (o[2] > 0)
        if self.symmetry >= 2:
            turn_y = np.where(np.signbit(i[1]), 1.0, -1.0)
            turn_x = np.where(np.signbit(i[0]), 1.0, -1.0) if self.symmetry == 4 else turn_y
            i, o = (np.stack([v[0] * turn_x, v[1] * turn_y, v[2]]) for v in (i, o))
        theta, phi = angles(i)
        phi = np.where(phi > np.pi, phi - 2 * np.pi, phi)
        theta_m, phi_m = angles(i + o)
        x, y = theta_to_unit(theta_m), phi_to_unit(phi_m - phi if self.isotropic else phi_m)
        around = corners((self.phi_i, self.theta_i), (phi, theta))
        u, v = self.warp.invert(around, x, y)
        slices = self.values.reshape(-1, *self.values.shape[2:])
        values = interpolated(np.moveaxis(slices, 1, -1), around, u, v)
        scale = self._scale(x, y, theta, phi) / np.where(above, o[2], 1.0)
        return np.where(above[:, None], values * scale[:, None], 0.0)

    def directions(
        self, azimuth: int, theta: int, x: np.ndarray, y: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return `i` (3,), `o` (3, N) and the factor (N,) of values to the BRDF for half vectors (x, y)."""
        theta_i, phi_i = self.theta_i[theta], self.phi_i[azimuth]
        i = vectors(theta_i, phi_i)
        m = vectors(unit_to_theta(x), unit_to_phi(y) + (phi_i if self.isotropic else 0.0))
        o = 2 * (i @ m) * m - i[:, None]
        light = np.full((2, x.size), [[theta_i], [phi_i]])
        return i, o, self._scale(x, y, *light) / np.where(o[2] > 0, o[2], 1.0)

    def _scale(self, x: np.ndarray, y: np.ndarray, theta: np.ndarray, phi: np.ndarray) -> np.ndarray:
        """D/4σ, by which values are to be multiplied."""
        if self.ndf is None or self.sigma is None:
            return np.ones(x.size)
        once = Corners(np.zeros((1, x.size), dtype=np.int64), np.ones((1, x.size)))
        ndf = interpolated(self.ndf[None], once, x, y)
        return ndf / (4 * interpolated(self.sigma[None], once, theta_to_unit(theta), phi_to_unit(phi)))


def load_rgl(path: str | os.PathLike[str]) -> RglBrdf:
    """Return the BRDF of a `.bsdf` file. Raises DataError for tensor files of something else or damaged."""
    fields = read_tensors(path)
    colour = "rgb" if "rgb" in fields else "spectra"
    axes = _AXES | {colour: 5} | ({"wavelengths": 1} if colour == "spectra" else {})
    missing = [name for name, count in axes.items() if name not in fields or fields[name].ndim != count]
    if missing:
        raise DataError(
            f"{path}: is a tensor file of no BRDF: it has {', '.join(fields) or 'no field'}, where"
            f" {', '.join(missing)} is expected; choose a .bsdf file of RGL or of Mitsuba"
        )
    phi, theta = (np.array(fields[name], dtype=float) for name in ("phi_i", "theta_i"))
    values, density = fields[colour], fields["vndf"]
    wavelengths = np.array(fields["wavelengths"], dtype=float) if colour == "spectra" else None
    channels = 3 if wavelengths is None else wavelengths.size
    fits = density.shape[:2] == values.shape[:2] == (phi.size, theta.size) and values.shape[2] == channels
    ranges = [phi, theta] + ([] if wavelengths is None else [wavelengths])
    grids = [values.shape[3:], density.shape[2:], fields["ndf"].shape, fields["sigma"].shape]
    if not fits or min(map(min, grids)) < 2 or any((~(np.diff(x) > 0)).any() for x in ranges):
        raise DataError(f"{path}: its fields do not match in shape or order; download or export it again")
    scaled = bool(fields["jacobian"][0])
    used = {"vndf": density} | ({name: fields[name] for name in ("ndf", "sigma")} if scaled else {})
    for name, field in used.items():
        if not (np.isfinite(field).all() and (field >= 0).all()):
            raise DataError(f"{path}: {name} has values that are no densities; download or export it again")
    flat = density.reshape(-1, *density.shape[2:])
    if not np.all(np.any(flat[:, :, :] > 0, axis=(1, 2))):
        raise DataError(f"{path}: vndf is zero everywhere for a direction; download or export it again")
    ndf, sigma = (np.array(fields[n], dtype=float) if scaled else None for n in ("ndf", "sigma"))
    return RglBrdf(phi, theta, values, wavelengths, ndf, sigma, BilinearWarp(flat))


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
    channels, described = _channels(path, brdf, wavelengths, bands)
    lowest = np.cos(np.deg2rad(max_theta)) if max_theta < 90 else 0.0
    every, beyond, invalid = _valid_nodes(brdf, channels, lowest)
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
            f"read as an RGL tensor file of an {nature}, {described}",
            f"{kept.size} of {every.shape[1]} valid nodes kept, spread over the grid",
            f"left out: {beyond} nodes with a direction {where}, {invalid} invalid (negative) ones",
        ),
    )


def _valid_nodes(brdf: RglBrdf, channels: np.ndarray, lowest: float) -> tuple[np.ndarray, int, int]:
    """Directions and values of the valid nodes, (6 + channels, nodes), with cosines above `lowest`; and the
    number of nodes beyond it and of other invalid ones."""
    pieces, beyond, invalid = [], 0, 0
    rows, columns = brdf.values.shape[3:]
    # nodes inside the unit square: those on its edge repeat directions
    y, x = (part.ravel() for part in np.mgrid[1 : rows - 1, 1 : columns - 1])
    nodes = y * columns + x
    for azimuth, theta in np.ndindex(brdf.values.shape[:2]):
        here = np.full((1, x.size), azimuth * brdf.theta_i.size + theta)
        around = Corners(here, np.ones(here.shape))
        half_vectors = brdf.warp.sample(around, x / (columns - 1), y / (rows - 1))
        i, o, factor = brdf.directions(azimuth, theta, *half_vectors)
        stored = brdf.values[azimuth, theta].reshape(brdf.values.shape[2], -1)[:, nodes]
        values = channels @ stored.astype(float) * factor
        above = (o[2] > lowest) & (i[2] > lowest)
        valid = above & np.all((values >= 0) & np.isfinite(values), axis=0)
        beyond += int(np.sum(~above))
        invalid += int(np.sum(above & ~valid))
        pieces.append(np.concatenate([np.tile(i[:, None], o.shape[1]), o, values])[:, valid])
    return np.concatenate(pieces, axis=1), beyond, invalid


def _channels(
    path: str | os.PathLike[str], brdf: RglBrdf, wavelengths: Sequence[float] | None, bands: Bands | None
) -> tuple[np.ndarray, str]:
    """Weights (channels, stored) of the stored channels in those that are read, and a description."""
    if brdf.wavelengths is None:
        told = "R, G, B of linear sRGB"
        return np.eye(3), told + ("" if bands else ', which are bands: give the surface sensor = "srgb"')
    wanted = np.array(bands[0] if bands else WAVELENGTHS if wavelengths is None else wavelengths, dtype=float)
    first, last = brdf.wavelengths[[0, -1]]
    stored = [np.interp(wanted, brdf.wavelengths, row) for row in np.eye(brdf.wavelengths.size)]
    if bands:
        weights, beyond = np.asarray(bands[1], dtype=float), (wanted < first) | (wanted > last)
        if np.any(np.abs(weights[beyond]).sum(axis=0) > _UNSEEN * np.abs(weights).sum(axis=0)):
            raise DataError(
                f"{path}: its spectra go from {first:g} to {last:g} nm, beyond which the sensor sees more"
                " than 1 % of the light; give the surface wavelengths in place of a sensor"
            )
        return weights.T @ np.stack(stored, axis=1), "spectra integrated over the bands of the sensor"
    names = ", ".join(f"{nm:g}" for nm in wanted)
    if wanted.size not in (1, 3) or wanted.min() < first or wanted.max() > last:
        raise DataError(
            f"{path}: its spectra go from {first:g} to {last:g} nm; choose one or three `wavelengths` there,"
            f" not {names}"
        )
    return np.stack(stored, axis=1), f"spectra taken at {names} nm"


def is_tensor_file(path: str | os.PathLike[str]) -> bool:
    """Return True if a file begins as a tensor file. Raises DataError if it cannot be read."""
    with open_binary(path) as file:
        return file.read(len(MAGIC)) == MAGIC


def read_tensors(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """Return the fields of a tensor file by name, mapped from the file and read where they are used.

    Raises DataError for another version and for a damaged file.
    """
    size = Path(path).stat().st_size
    damaged = DataError(f"{path}: is a damaged tensor file; download or export it again")
    fields: dict[str, np.ndarray] = {}
    with open_binary(path) as file:

        def unpack(layout: str) -> tuple[int, ...]:
            length = struct.calcsize("<" + layout)
            piece = file.read(length)
            if len(piece) < length:
                raise damaged
            return struct.unpack("<" + layout, piece)

        file.read(len(MAGIC))
        version = unpack("BB")
        if version != VERSION:
            raise DataError(f"{path}: is a tensor file of version {version[0]}.{version[1]}, 1.0 is expected")
        (count,) = unpack("I")
        if count > _MOST_FIELDS:
            raise damaged
        for _ in range(count):
            (length,) = unpack("H")
            name = file.read(length).decode("utf-8", errors="replace")
            axes, code, offset = unpack("HBQ")
            if axes > _MOST_AXES or not 1 <= code <= len(_TYPES):
                raise damaged
            shape, dtype = unpack("Q" * axes), np.dtype(_TYPES[code - 1])
            items = 1
            for axis in shape:
                items *= axis  # Python's integers do not overflow
            if not items or offset + items * dtype.itemsize > size:
                raise damaged
            fields[name] = np.memmap(path, dtype=dtype, mode="r", offset=offset, shape=shape)
    return fields


def write_tensors(
    path: str | os.PathLike[str], fields: Mapping[str, np.ndarray], *, overwrite: bool = False
) -> None:
    """Write named arrays, of any shape, as a tensor file.

    Raises UsageError where `path` exists without `overwrite`, or cannot be written; ValueError for an array
    of a type that the format does not have.
    """
    arrays = {name: np.ascontiguousarray(array) for name, array in fields.items()}
    codes = {np.dtype(kind): code for code, kind in enumerate(_TYPES, 1)}
    size = len(MAGIC) + 2 + 4 + sum(2 + len(name.encode()) + 11 + 8 * a.ndim for name, a in arrays.items())
    head, data = [MAGIC, struct.pack("<BBI", *VERSION, len(arrays))], []
    for name, array in arrays.items():
        code, label = codes.get(array.dtype), name.encode()
        if code is None:
            raise ValueError(f"`{name}`: tensor files have no numbers of type {array.dtype}")
        padding = -size % _ALIGNMENT
        head += [struct.pack("<H", len(label)), label, struct.pack("<HBQ", array.ndim, code, size + padding)]
        head.append(struct.pack(f"<{array.ndim}Q", *array.shape))
        data += [b"\0" * padding, array.tobytes()]
        size += padding + array.nbytes
    with replacing(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(b"".join(head + data))
