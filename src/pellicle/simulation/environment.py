"""Surroundings of a rendered object, and the sphere that they light.

Surroundings are soft boxes, a horizon, and a sky and a ground that fade from it.

Directions are unit vectors away from the object: x to the right, y up, z towards the eye. The light is of one
spectrum, that of the illuminant, so radiances are numbers: a white diffuser in surroundings of radiance 1 has
radiance 1.

The sphere has radius 1, the eye is at infinite z: all lines of sight are parallel.
"""

from typing import Any, NamedTuple

import numpy as np

from pellicle.optics.pair import namespace

EDGE = 3.0
"""Width (degrees) over which the edges of a soft box and the horizon fade: a step would be a staircase."""


class SoftBox(NamedTuple):
    """Rectangular lamp far away: its centre by polar angle from the line of sight and azimuth from the right,
    its width and height, all in degrees, and its radiance."""

    polar: float
    azimuth: float
    width: float
    height: float
    radiance: float

    def axes(self, xp: Any = np) -> tuple[Any, Any, Any]:
        """Directions (3,) to the right of the box, up, and towards its centre."""
        polar, azimuth = xp.deg2rad(self.polar), xp.deg2rad(self.azimuth)
        sine = xp.sin(polar)
        centre = xp.stack([sine * xp.cos(azimuth), sine * xp.sin(azimuth), xp.cos(polar)])
        right = xp.stack([centre[2], 0 * sine, -centre[0]]) / xp.hypot(centre[0], centre[2])
        return right, xp.cross(centre, right), centre

    def coverage(self, direction: Any, edge: Any = EDGE) -> Any:
        """Share (...) of the box's radiance in directions (..., 3): 1 inside, 0 outside."""
        xp = namespace(direction)
        right, above, centre = self.axes(xp)
        forward = direction @ centre
        across = xp.rad2deg(xp.arctan2(direction @ right, forward))
        up = xp.rad2deg(xp.arctan2(direction @ above, forward))
        inside = _fade(self.width / 2 - xp.abs(across), edge, xp) * _fade(
            self.height / 2 - xp.abs(up), edge, xp
        )
        return xp.where(forward > 0, inside, 0.0)

    def sample(self, u: Any, v: Any) -> tuple[Any, Any]:
        """Directions (..., 3) to points of the unit square, spread over the plane of the box with its fading
        edges, and the solid angle (...) that each would stand for alone."""
        xp = namespace(u, v)
        right, above, centre = self.axes(xp)
        wide, high = (xp.tan(xp.deg2rad(side + EDGE) / 2) for side in (self.width, self.height))
        x, y = wide * (2 * u - 1), high * (2 * v - 1)
        distance = xp.sqrt(1 + x * x + y * y)
        towards = centre + x[..., None] * right + y[..., None] * above
        return towards / distance[..., None], 4 * wide * high / distance**3


class Environment(NamedTuple):
    """Soft boxes, the main lamp last and in front, before a sky and a ground.

    The four numbers are the radiances of the nadir, of both sides of the horizon and of the zenith.
    """

    boxes: tuple[SoftBox, ...]
    nadir: float
    below_horizon: float
    above_horizon: float
    zenith: float

    def radiance(self, direction: Any, edge: Any = EDGE) -> Any:
        """Radiance (...) from directions (..., 3), in NumPy or JAX as they are.

        Edges fade over `edge` degrees, one number or one for each direction.
        """
        xp = namespace(direction)
        elevation = xp.rad2deg(xp.arcsin(xp.clip(direction[..., 1], -1.0, 1.0)))
        height = xp.abs(elevation) / 90
        sky = self.above_horizon + (self.zenith - self.above_horizon) * height
        ground = self.below_horizon + (self.nadir - self.below_horizon) * height
        total = ground + (sky - ground) * _fade(elevation, edge, xp)
        for box in self.boxes:
            total = total + (box.radiance - total) * box.coverage(direction, edge)
        return total


def _fade(degrees: Any, edge: Any, xp: Any) -> Any:
    """0 below −edge/2, 1 above edge/2, smooth between."""
    t = xp.clip(degrees / edge + 0.5, 0.0, 1.0)
    return t * t * (3 - 2 * t)


def studio(light: float = 35.0) -> Environment:
    """Bright studio over a grey ground and before a pale sky, with four soft boxes.

    The brightest is at the upper right, `light` degrees from the line of sight; a large one is at the left,
    one overhead and a narrow one behind at the right.
    """
    boxes = (
        SoftBox(75.0, 170.0, 40.0, 80.0, 1.6),
        SoftBox(85.0, 91.0, 90.0, 28.0, 1.6),
        SoftBox(112.0, 5.0, 16.0, 90.0, 1.6),
        SoftBox(light, 60.0, 34.0, 34.0, 3.0),
    )
    return Environment(boxes, 0.12, 0.35, 0.5, 0.9)


def light_tent() -> Environment:
    """Light tent with two windows, before a dark background: for what reflects little."""
    boxes = (
        SoftBox(180.0, 0.0, 100.0, 100.0, 0.02),
        SoftBox(70.0, 15.0, 18.0, 60.0, 1.4),
        SoftBox(48.0, 150.0, 30.0, 44.0, 2.0),
    )
    return Environment(boxes, 0.25, 0.4, 0.5, 0.8)


def one_lamp(light: float = 35.0, width: float = 20.0) -> Environment:
    """One square soft box at the upper right in the dark, `light` degrees from the line of sight.

    A surface that faces it has the irradiance of surroundings of radiance 1 all round.
    """
    half = np.deg2rad(width / 2)
    solid_angle = 4 * np.arcsin(np.sin(half) ** 2)
    return Environment((SoftBox(light, 60.0, width, width, np.pi / solid_angle),), 0.0, 0.0, 0.0, 0.0)


EYE = np.array([0.0, 0.0, 1.0])
FILLS = 0.95
"""Diameter of the sphere, relative to the width of its rendering."""
LIMB = 0.9995
"""Largest sine of the angle of incidence: pixels that lie across the limb take the colour beside it."""


class Rendering(NamedTuple):
    """Rendering of a sphere: linear sRGB (size, size, 3), and the share of each pixel in it (size, size)."""

    linear: np.ndarray
    coverage: np.ndarray


class Sphere(NamedTuple):
    """Pixels that a sphere covers at least in part: a mask (size, size), their share inside, and normals."""

    mask: np.ndarray
    share: np.ndarray  # (pixels,)
    normal: np.ndarray  # (pixels, 3)

    @property
    def cosine(self) -> np.ndarray:
        """Cosines (pixels,) of the angle of incidence along the line of sight."""
        return self.normal[:, 2]

    @property
    def outward(self) -> np.ndarray:
        """Directions (pixels, 3) from the centre of the rendering to each pixel."""
        flat = self.normal * [1.0, 1.0, 0.0]
        return flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-12)

    def interpolated(self, cosine: np.ndarray, table: np.ndarray) -> np.ndarray:
        """Colours (pixels, 3) from a table (cosines, 3) over rising cosines of the angle of incidence."""
        return np.stack([np.interp(self.cosine, cosine, channel) for channel in table.T], axis=-1)

    def rendering(self, linear: np.ndarray) -> Rendering:
        """Make a rendering of the linear sRGB (pixels, 3) of each pixel."""
        image, coverage = np.zeros((*self.mask.shape, 3)), np.zeros(self.mask.shape)
        image[self.mask], coverage[self.mask] = linear, self.share
        return Rendering(image, coverage)

    def deflected(self, angle: np.ndarray) -> np.ndarray:
        """The line of sight (pixels, 3), away from the eye, turned outward by angles (pixels,) in radians."""
        return np.cos(angle)[:, None] * -EYE + np.sin(angle)[:, None] * self.outward

    def mirrored(self) -> np.ndarray:
        """Directions (pixels, 3) that the sphere mirrors to the eye."""
        return self.deflected(np.pi - 2 * np.arccos(self.cosine))


def sphere(size: int) -> Sphere:
    """Return the pixels of a sphere in a rendering of `size` × `size`."""
    across = ((np.arange(size) + 0.5) * 2 / size - 1) / FILLS
    x, y = np.meshgrid(across, -across)
    radius = np.hypot(x, y)
    share = np.clip((1 - radius) * FILLS * size / 2 + 0.5, 0.0, 1.0)
    mask = share > 0
    shrunk = np.minimum(1.0, LIMB / np.maximum(radius[mask], 1e-12))
    x, y = x[mask] * shrunk, y[mask] * shrunk
    return Sphere(mask, share[mask], np.stack([x, y, np.sqrt(1 - x * x - y * y)], axis=-1))
