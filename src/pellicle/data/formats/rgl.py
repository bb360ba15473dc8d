"""`.bsdf` files of the RGL material database and of Mitsuba 3's `measured`: a BRDF in adaptive coordinates.

For each direction to the light the half vectors are warped to a unit square by the visible normals of the
surface, so that a grid on the square is densest in the lobe. The file has this density (`vndf`), the values
on the grid (`rgb`, or `spectra` at `wavelengths`) and, where `jacobian` is 1, the density of normals (`ndf`)
and the projected area (`sigma`) by which they are to be multiplied.

Source: J. Dupuy and W. Jakob, An adaptive parameterization for efficient material acquisition and rendering,
ACM TOG 37(6), 274 (2018); rgl.epfl.ch/materials; the plugin `measured` of Mitsuba 3, whose values it
reproduces.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from pellicle.data.formats.bilinear_warp import BilinearWarp, Corners, corners, interpolated
from pellicle.data.formats.tensor_file import read_tensors
from pellicle.data.half_angles import angles, vectors
from pellicle.errors import DataError

_AXES = {"theta_i": 1, "phi_i": 1, "ndf": 2, "sigma": 2, "vndf": 4, "luminance": 4, "jacobian": 1}


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
        found = interpolated(np.moveaxis(self._flat(), 1, -1), around, u, v)
        scale = self._scale(x, y, theta, phi) / np.where(above, o[2], 1.0)
        return np.where(above[:, None], found * scale[:, None], 0.0)

    def at_nodes(self, azimuth: int, theta: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return `i` (3,), `o` (3, N), the factor (N,) of `values` to the BRDF, and the nodes (N,).

        The nodes are those inside the unit square: those on its edge repeat directions.
        """
        rows, columns = self.values.shape[3:]
        y, x = (part.ravel() for part in np.mgrid[1 : rows - 1, 1 : columns - 1])
        here = np.full((1, x.size), azimuth * self.theta_i.size + theta)
        at = self.warp.sample(Corners(here, np.ones(here.shape)), x / (columns - 1), y / (rows - 1))
        return *self.directions(azimuth, theta, *at), y * columns + x

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

    def _flat(self) -> np.ndarray:
        return self.values.reshape(-1, *self.values.shape[2:])

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
