"""Sphere of a surface with a BRDF in an environment, and its BRDF in the plane of incidence."""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.brdf.directions import direction, dot, frame, half_vector, reflect
from pellicle.brdf.lobes import ggx
from pellicle.brdf.models import Model
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface
from pellicle.synthetic.environment import EDGE, Environment, studio
from pellicle.synthetic.relief import Relief, relief
from pellicle.synthetic.sphere import EYE, Rendering, sphere
from pellicle.synthetic.surface_colour import in_colour

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
        found = []
        for start in range(0, len(theta), _BATCH):
            rows = np.minimum(np.arange(start, start + _BATCH), len(theta) - 1)
            batch = {key: jnp.asarray(x[rows, None], jnp.float32) for key, x in maps.items()}
            lit = _radiance(shading.brdf, narrowest > NARROW, batch, jnp.asarray(axes[rows]), *shared)
            found.append(np.asarray(lit))
    return pixels.rendering(np.concatenate(found)[: len(theta)] @ shading.to_srgb)


def following(surface: Surface, noise: Relief) -> dict[str, np.ndarray]:
    """The thickness by the noise's height, and the deviation by its slope, where they are free."""
    depth, tilt = (surface.numbers.get(key) for key in ("thickness", "deviation"))
    found = {}
    if isinstance(depth, Free):
        found["thickness"] = depth.lower + noise.height * (depth.upper - depth.lower)
    if isinstance(tilt, Free):
        found |= {"deviation": tilt.upper * noise.slope, "azimuth": noise.azimuth}
    return found


def lobe_widths(surface: Surface) -> tuple[float, float]:
    """GGX roughness of the narrowest lobe, and one that spreads directions as widely as all lobes."""
    values = surface.start_numbers()
    rough = [float(value) for key, value in values.items() if key.endswith("roughness")]
    # cos^e around the mirror direction is nearly cos^4e around the normal, GGX of α² = 2/(4e + 2)
    phong = [
        np.sqrt(2 / (4 * float(value) + 2)) for key, value in values.items() if key.startswith("exponent")
    ]
    lobes = [*rough, *phong] or [1.0]
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
    numbers = {key: jnp.asarray(value) for key, value in surface.start_numbers().items()}
    return np.asarray(_evaluate(surface.brdf, numbers, jnp.broadcast_to(i, o.shape), o))


@partial(jax.jit, static_argnums=0)  # one program; compiled one by one its operations take seconds
def _evaluate(brdf: Model, parameters: dict[str, Any], i: Any, o: Any) -> Any:
    return brdf(parameters, i, o)
