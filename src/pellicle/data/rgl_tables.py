"""Tables of a BRDF as RGL's `.bsdf` files have them, for Mitsuba's `measured` and other readers.

The density of half vectors that shapes the grid is the BRDF's own: its mean over directions to the light,
against the angle from the normal, so that a table serves any lobe, with or without a diffuse part.
"""

from collections.abc import Callable
from importlib.metadata import version
from typing import NamedTuple

import numpy as np

from pellicle.data.brdf_samples import vectors
from pellicle.data.formats.bilinear_warp import BilinearWarp, Corners
from pellicle.data.formats.rgl import RglBrdf, unit_to_phi, unit_to_theta

Brdf = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""BRDF (N, channels) in 1/sr of directions to the light and to the viewer, unit vectors (3, N)."""

_GRAZING = np.deg2rad(89.0)
_PROFILE = 1024  # angles of the density of half vectors
_FLOOR = 1e-9  # of its maximum: it divides the values
_DARKEST = 1e-3  # share of the brightest node: the least chance of a direction to be drawn


class TableSize(NamedTuple):
    """Nodes of a table: azimuths of the light (1 where the surface is isotropic), its angles, each side of
    the square of directions, and the density of half vectors over azimuth and angle."""

    azimuths: int = 1
    thetas: int = 46
    side: int = 48
    density: tuple[int, int] = (64, 192)


ISOTROPIC = TableSize()
"""4 MB for three channels; see `docs/howto/mitsuba.md` for its error."""


def tabulate(
    brdf: Brdf,
    size: TableSize = ISOTROPIC,
    *,
    wavelengths: np.ndarray | None = None,
    description: str = "",
) -> dict[str, np.ndarray]:
    """Return the fields of a `.bsdf` file of a BRDF, exact at its nodes.

    **Arguments:**

    - `brdf`: function of unit vectors to light and viewer, (3, N) each, that returns (N, channels) in 1/sr.
    - `size`: how many nodes; `azimuths` above 1 for a surface that is not isotropic.
    - `wavelengths` of the channels in nm, or None for the three of linear sRGB.
    - `description`: a line of text in the file.

    **Returns:** arrays by name, for `write_tensors` of `pellicle.data.formats.rgl`.
    """
    table, density = _empty_table(brdf, size, wavelengths)
    values = _values(brdf, table, size.side)
    luminance = np.abs(values).mean(axis=2)
    floor = _DARKEST * luminance.max(axis=(2, 3), keepdims=True)
    text = f"{description or 'BRDF'}, written by pellicle {version('pellicle')}".encode()
    fields = {
        **{name: getattr(table, name) for name in ("phi_i", "theta_i", "ndf", "sigma")},
        "vndf": density,
        "luminance": np.maximum(luminance, np.maximum(floor, 1e-30)),
        "rgb" if wavelengths is None else "spectra": values,
        **({} if wavelengths is None else {"wavelengths": np.asarray(wavelengths)}),
    }
    return {
        "description": np.frombuffer(text, np.uint8),
        "jacobian": np.array([1], np.uint8),
        **{name: np.asarray(array, np.float32) for name, array in fields.items()},
    }


def _empty_table(brdf: Brdf, size: TableSize, wavelengths: np.ndarray | None) -> tuple[RglBrdf, np.ndarray]:
    """The table without values, and the density of half vectors, (azimuths, thetas, rows, columns)."""
    x = np.linspace(0, 1, _PROFILE)
    profile = _profile(brdf, x)
    theta = np.linspace(0, _GRAZING, size.thetas)
    phi = np.zeros(1) if size.azimuths == 1 else np.linspace(-np.pi, np.pi, size.azimuths)
    sigma = _projected_area(profile, x, unit_to_theta(np.linspace(0, 1, 256)))
    rows, columns = size.density
    grid_x, grid_y = np.linspace(0, 1, columns), np.linspace(0, 1, rows)
    # half vectors around a light at azimuth 0; without symmetry the grid keeps its own azimuth
    m = vectors(unit_to_theta(grid_x), unit_to_phi(grid_y)[:, None]).reshape(3, -1)
    jacobian = np.tile(grid_x * np.sin(unit_to_theta(grid_x)), rows)
    weight = np.tile(np.interp(grid_x, x, profile), rows) * jacobian
    lights = vectors(theta[None, :], phi[:, None]).reshape(3, -1)
    density = np.maximum(lights.T @ m, 0.0) * weight
    density = np.maximum(density, 1e-6 * density.max(axis=1, keepdims=True)).astype(np.float32)
    shape = (phi.size, theta.size)
    table = RglBrdf(
        phi_i=phi.astype(np.float32).astype(float),
        theta_i=theta.astype(np.float32).astype(float),
        values=np.zeros((*shape, 0, size.side, size.side)),
        wavelengths=wavelengths,
        ndf=np.stack([profile, profile]).astype(np.float32).astype(float),
        sigma=np.stack([sigma, sigma]).astype(np.float32).astype(float),
        warp=BilinearWarp(density.reshape(-1, rows, columns)),
    )
    return table, density.reshape(*shape, rows, columns)


def _profile(brdf: Brdf, x: np.ndarray) -> np.ndarray:
    """Density of half vectors over their coordinate: 4 cos θ_i f cos θ_o, its mean over the lights."""
    theta = unit_to_theta(x)
    total, weight = np.zeros(x.size), np.zeros(x.size)
    for light in np.deg2rad([0.0, 20.0, 40.0, 60.0]):
        for azimuth in np.deg2rad([0.0, 90.0, 180.0]):
            i, m = vectors(light, 0.0)[:, None], vectors(theta, azimuth)
            o = 2 * (i * m).sum(axis=0) * m - i
            seen = np.where(o[2] > 1e-3, o[2], 0.0)  # a light leaves the mean where its mirror light sets
            viewer = np.where(seen > 0, o, np.array([[0.0], [0.0], [1.0]]))
            strength = np.abs(brdf(np.broadcast_to(i, o.shape), viewer)).mean(axis=1)
            total += strength * 4 * i[2] * seen * seen
            weight += seen
    known = weight > 0
    mean = np.interp(x, x[known], total[known] / weight[known])
    return np.maximum(mean, _FLOOR * mean.max())


def _projected_area(profile: np.ndarray, x: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Area of facets of this density seen from angles θ, ∫ D max(⟨i, m⟩, 0) dω, 1 for a flat surface."""
    angle = unit_to_theta(x)
    upright = np.cos(theta)[:, None] * np.cos(angle)
    tilted = np.maximum(np.sin(theta)[:, None] * np.sin(angle), 1e-30)
    edge = np.arccos(np.clip(-upright / tilted, -1.0, 1.0))  # azimuth from which a facet is not seen
    seen = (upright * edge + tilted * np.sin(edge)) / np.pi  # mean over the azimuth
    return np.trapezoid(seen * profile * np.sin(angle) * 2 * np.pi, angle, axis=1)


def _values(brdf: Brdf, table: RglBrdf, side: int) -> np.ndarray:
    """Values of the nodes, (azimuths, thetas, channels, side, side)."""
    y, x = (part.ravel() / (side - 1) for part in np.mgrid[:side, :side])
    slices = []
    for slice_, (azimuth, theta) in enumerate(np.ndindex(table.values.shape[:2])):
        around = Corners(np.full((1, x.size), slice_), np.ones((1, x.size)))
        i, o, factor = table.directions(azimuth, theta, *table.warp.sample(around, x, y))
        above = o[2] > 0
        viewer = np.where(above, o, np.array([[0.0], [0.0], [1.0]]))
        seen = brdf(np.broadcast_to(i[:, None], o.shape), viewer) / factor[:, None]
        slices.append(np.where(above[:, None], seen, 0.0).T.reshape(-1, side, side))
    return np.reshape(slices, (*table.values.shape[:2], -1, side, side))
