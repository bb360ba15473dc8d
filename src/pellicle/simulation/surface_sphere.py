"""Sphere of a surface with a BRDF in an environment, and its BRDF in the plane of incidence."""

from __future__ import annotations

from functools import cache, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.brdf.directions import cosine_to_half, direction, dot, frame, half_vector, reflect
from pellicle.brdf.lobes import ggx
from pellicle.brdf.models import Model
from pellicle.colour import FilmColourTable, integration_bands, sensor
from pellicle.colour.observers import Sensor, srgb_sensor
from pellicle.dispersion.empirical import Table
from pellicle.scene.free import Free
from pellicle.scene.surface import INDICES, KEYS, HasDirections, Surface, index_numbers
from pellicle.simulation.colours import BANDS
from pellicle.simulation.environment import EDGE, EYE, Environment, Rendering, sphere, studio

DIRECTIONS = 192
"""Directions of the light at each pixel: half of them spread as a lobe, half as the light of a diffuser."""
LAMP, NARROW = 100, 0.04
"""Directions to the main lamp, and the roughness below which their spacing would show in its reflection:
there it is integrated with the rest of the environment."""
FOOTPRINT, WIDEST = 2.5, 60.0
"""Width over which edges of the environment fade: so many times the root of the solid angle that a direction
stands for, up to so many degrees. Narrower edges would show as a pattern (filtered importance sampling,
J. Křivánek and M. Colbert, EGSR 2008)."""
_BATCH = 128
"""Pixels in one call: with 192 directions and 64 wavelengths 6 MB in single precision."""


def render(
    surface: Surface,
    environment: Environment | None = None,
    size: int = 300,
    seed: int = 0,
    count: int = DIRECTIONS,
) -> Rendering:
    """Render a sphere in an environment (`studio()` if None), size × size pixels, in colours of the spectrum.

    The light is integrated by importance sampling with `count` directions, which are the same for all pixels
    relative to their normals: there is no grain. In white surroundings the default count is within 4 %.

    A free thickness follows smooth noise between its bounds; a free deviation of the normals follows the
    slope of that noise, up to its upper bound, in the direction of the slope. Other free parameters take
    their start values.
    """
    pixels, shading = sphere(size), in_colour(surface)
    theta = np.rad2deg(np.arccos(pixels.normal[:, 2]))
    phi = np.rad2deg(np.arctan2(pixels.normal[:, 1], pixels.normal[:, 0]))
    with jax.enable_x64(False):
        axes = np.asarray(frame(theta, phi))
        maps = following(surface, relief(pixels.normal, axes, np.random.default_rng(seed)))
        fixed = {key: x for key, x in shading.numbers.items() if key not in maps}
        narrowest, width = lobe_widths(surface)
        shared = (fixed, studio() if environment is None else environment, _squares(count), width)
        shared = jax.tree_util.tree_map(lambda x: jnp.asarray(x, jnp.float32), shared)
        radiance = []
        for start in range(0, len(theta), _BATCH):
            rows = np.minimum(np.arange(start, start + _BATCH), len(theta) - 1)
            batch = {key: jnp.asarray(x[rows, None], jnp.float32) for key, x in maps.items()}
            radiance.append(_radiance(shading.brdf, narrowest > NARROW, batch, axes[rows], *shared))
    return pixels.rendering(np.concatenate(radiance)[: len(theta)] @ shading.to_srgb)


def following(surface: Surface, noise: Relief) -> dict[str, np.ndarray]:
    """The thickness by the noise's height, and the deviation by its slope, where they are free."""
    depth, tilt = (surface.numbers.get(key) for key in ("thickness", "deviation"))
    arrays: dict[str, np.ndarray] = {}
    if isinstance(depth, Free):
        arrays["thickness"] = depth.lower + noise.height * (depth.upper - depth.lower)
    if isinstance(tilt, Free):
        arrays |= {"deviation": tilt.upper * noise.slope, "azimuth": noise.azimuth}
    return arrays


def lobe_widths(surface: Surface) -> tuple[float, float]:
    """GGX roughness of the narrowest lobe, and one that spreads directions as widely as all lobes."""
    values = surface.start_numbers()
    rough = [float(value) for key, value in values.items() if key.endswith("roughness")]
    phong = [float(value) for key, value in values.items() if key.startswith("exponent")]
    # cos^e around the mirror direction is nearly cos^4e around the normal, GGX of α² = 2/(4e + 2)
    lobes = [*rough, *(np.sqrt(2 / (4 * exponent + 2)) for exponent in phong)] or [1.0]
    tilt: Any = surface.numbers.get("deviation", 0.0)
    apart = np.tan(np.deg2rad(tilt.upper if isinstance(tilt, Free) else float(tilt)))
    return float(min(lobes)), float(np.clip(np.hypot(max(lobes), apart), 0.003, 1.0))


def _squares(count: int) -> np.ndarray:
    """Points (count, 2) that fill the unit square evenly: R. Roberts's R₂ sequence (2018)."""
    plastic = 1.324717957244746
    return (0.5 + np.arange(count)[:, None] * np.array([1 / plastic, 1 / plastic**2])) % 1.0


@partial(jax.jit, static_argnums=(0, 1))
def _radiance(
    brdf: Model,
    by_lamp: bool,
    maps: dict[str, Any],
    axes: Any,
    fixed: dict[str, Any],
    environment: Environment,
    squares: Any,
    width: Any,
) -> Any:
    """Radiance (pixels, channels) to the eye; with `by_lamp` the main lamp is integrated over itself."""
    eye = (axes @ jnp.asarray(EYE, axes.dtype))[:, None]
    rest, lamp = environment._replace(boxes=environment.boxes[:-1]), environment.boxes[-1]
    total = 0.0
    groups = [_by_lobe(rest if by_lamp else environment, axes, eye, squares, width)]
    if by_lamp:
        outside, solid_angle = lamp.sample(*jnp.asarray(_squares(LAMP), axes.dtype).T)
        added = lamp.coverage(outside) * (lamp.radiance - rest.radiance(outside)) * solid_angle / LAMP
        i = jnp.einsum("mk,plk->pml", outside, axes)
        groups.append((i, added * jnp.maximum(i[..., 2], 0.0)))
    for i, weight in groups:
        values = brdf(fixed | maps, i, jnp.broadcast_to(eye, i.shape))
        total = total + jnp.einsum("pmn,pm->pn", values, weight)
    return total


def _by_lobe(environment: Environment, axes: Any, eye: Any, squares: Any, width: Any) -> tuple[Any, Any]:
    """Directions (pixels, count, 3) of the light and radiance × cosine over their density.

    Half of them are mirrored by facets of a GGX lobe (B. Walter et al., EGSR 2007, eq. 35), half are spread
    as the cosine; all are weighted by the density of their mixture (the balance heuristic, E. Veach and
    L. Guibas, SIGGRAPH 1995).
    """
    count = len(squares)
    o = jnp.broadcast_to(eye, (len(axes), count, 3))
    u, v = squares.T
    is_facet = jnp.arange(count) % 2 == 0
    tilt = jnp.where(is_facet, jnp.arctan(width * jnp.sqrt(u / (1 - u))), jnp.arcsin(jnp.sqrt(u)))
    spread = direction(jnp.rad2deg(tilt), 360 * v)
    i = jnp.where(is_facet[:, None], reflect(o, spread), spread)
    h = half_vector(i, o)
    facets = ggx(h, width) * h[..., 2] / (4 * dot(o, h))
    density = 0.5 * facets + 0.5 * jnp.maximum(i[..., 2], 0.0) / jnp.pi
    edge = jnp.rad2deg(FOOTPRINT / jnp.sqrt(count * density))
    seen = environment.radiance(jnp.einsum("pmk,pkl->pml", i, axes), jnp.clip(edge, EDGE, WIDEST))
    return i, jnp.where(i[..., 2] > 0, seen * i[..., 2] / density, 0.0) / count


def in_plane(surface: Surface, incidence: float, leaving: np.ndarray) -> np.ndarray:
    """The BRDF (angles, channels) in the plane of incidence, at angles `leaving` in degrees.

    Positive angles are on the side of the mirror direction. Free parameters take their start values.
    """
    i = direction(incidence, 0.0)
    o = direction(np.abs(leaving), np.where(leaving >= 0, 180.0, 0.0))
    return _values(surface, jnp.broadcast_to(i, o.shape), o)


def along(surface: Surface, seen: HasDirections) -> np.ndarray:
    """The BRDF (samples, channels) along pairs of directions. Free parameters take their start values."""
    return _values(surface, direction(seen.theta_i, seen.phi_i), direction(seen.theta_o, seen.phi_o))


def _values(surface: Surface, i: Any, o: Any) -> np.ndarray:
    numbers = {key: jnp.asarray(value) for key, value in surface.start_numbers().items()}
    return np.asarray(_evaluate(surface.brdf, numbers, i, o))


# one program; compiled one by one its operations take seconds
_evaluate = jax.jit(lambda brdf, *arguments: brdf(*arguments), static_argnums=0)


THIN = 1000.0
"""Optical thickness (nm) up to which 32 wavelengths suffice: ΔE2000 0.016 in the mean, 0.08 at most."""
_EVERYWHERE = sensor().wavelength
"""Wavelengths (nm) of the table of a film, in steps of 1 nm."""
STEEPEST = 85.0
"""Largest angle of incidence on a facet (degrees) in the table of a film; beyond it colours stay the same."""


class Shading(NamedTuple):
    """Model of a surface, its numbers, and the matrix (channels, 3) from its channels to linear sRGB."""

    brdf: Model
    numbers: dict[str, Any]
    to_srgb: np.ndarray


def in_colour(surface: Surface) -> Shading:
    """Return a surface's model for colours under D65, with the CIE 1931 observer.

    A model with the colour of a film takes it from a `FilmColourTable`, which is made in steps of 1 nm. The
    lobes of other models differ between wavelengths: they are evaluated at 32 wavelengths, or at 64 where
    the layer is thick. Media have their own index at each wavelength; an index given for each channel is
    interpolated linearly between the wavelengths of the channels, and constant beyond them. Free parameters
    take their start values.
    """
    numbers: dict[str, Any] = dict(surface.start_numbers())
    thickness: Any = surface.numbers.get("thickness", numbers["thickness"])
    free = isinstance(thickness, Free)
    low, high = (thickness.lower, thickness.upper) if free else (float(thickness), float(thickness))
    brdf = surface.brdf
    numbers.pop("weights", None)  # of a sensor that is not the eye
    if not numbers.get("multiple_scattering"):
        numbers.pop("multiple_scattering", None)
    if brdf.from_film_colour is not None:
        indices, media = _indices(surface, numbers, _EVERYWHERE), []
        for n, k in KEYS.values():
            absorbs = np.any(indices.get(k, 0.0))
            media.append(Table(_EVERYWHERE, indices[n], indices[k] if absorbs else None))
        film, base = media
        above = indices.get("ambient_n")
        ambient = numbers.get("coat_n", 1.0) if above is None else Table(_EVERYWHERE, above)
        heights = (0.99 * low, 1.01 * high + 1.0)
        table = FilmColourTable.build(film, base, heights, ambient=ambient, angle=(0.0, STEEPEST))
        matrix = srgb_sensor(sensor()).weights
        numbers |= {"table": table, "xyz_to_srgb": np.linalg.lstsq(sensor().weights, matrix, rcond=None)[0]}
        return Shading(_by_table(brdf), numbers, np.eye(3))
    thick = high * float(np.max(numbers["n"])) > THIN
    bands = integration_bands(BANDS if thick else "uniform-32")
    numbers |= _indices(surface, numbers, bands.wavelength) | {"wavelengths": bands.wavelength}
    return Shading(brdf, numbers, srgb_sensor(Sensor(bands.wavelength, bands.weights)).weights)


@cache  # one object for each model, for which programs are compiled once
def _by_table(brdf: Model) -> Model:
    """Return the model with the film's linear sRGB (..., 3) from a table."""
    assert brdf.from_film_colour is not None

    def colour(parameters: Any, i: Any, o: Any) -> Any:
        xyz = parameters["table"].xyz(parameters["thickness"], cosine_to_half(i, o))
        return xyz @ parameters["xyz_to_srgb"]

    return brdf._replace(evaluate=brdf.from_film_colour(colour))


def _indices(surface: Surface, numbers: dict[str, Any], nm: np.ndarray) -> dict[str, np.ndarray]:
    """Indices (wavelengths,) of the surface: those of its media, and those of its channels interpolated."""
    channels = surface.bands.wavelength
    order = np.argsort(channels)
    given = {
        key: np.interp(nm, channels[order], np.broadcast_to(numbers[key], channels.shape)[order])
        for key in INDICES
        if key in numbers
    }
    for part, medium in (("film", surface.film), ("base", surface.base)):
        given |= index_numbers(part, medium, nm, surface.numbers, surface.brdf)
    return given


WAVES = 24
"""Number of plane waves in the noise."""


class Relief(NamedTuple):
    """Height and slope of the noise, both 0 to 1, and direction of the slope (degrees), each (...)."""

    height: np.ndarray
    slope: np.ndarray
    azimuth: np.ndarray


def relief(normal: np.ndarray, axes: np.ndarray, rng: np.random.Generator) -> Relief:
    """Return noise of a few bumps over the sphere, at normals (..., 3) with frames (..., 3, 3).

    All heights have the same share of the normals, so that no thickness is rare in a rendering.
    """
    waves = rng.normal(0.0, 3.0, (WAVES, 3))
    phase = normal @ waves.T + rng.uniform(0, 2 * np.pi, WAVES)
    height, gradient = np.cos(phase).sum(-1), -np.sin(phase) @ waves
    along, beside = ((axes[:, row] * gradient).sum(-1) for row in (0, 1))
    slope = np.hypot(along, beside)
    even = np.argsort(np.argsort(height, axis=None)).reshape(height.shape) / max(height.size - 1, 1)
    return Relief(even, slope / slope.max(), np.rad2deg(np.arctan2(beside, along)))
