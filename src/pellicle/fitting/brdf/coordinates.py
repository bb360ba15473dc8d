"""Free numbers as a point of the unit cube: logarithms of what spans decades, a tilt as a plane vector.

A deviation of the normal is searched as (x, y) in a disc, for at zero its azimuth means nothing.
Samples in one plane see y² alone, the tilt out of it: y itself has no slope at 0, where a solver would
rest on the saddle between its two signs and call what trades with y² better known than it is.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from pellicle.scene.surface import FreeNumber

_TILT = ("deviation", "azimuth")
_LEAST = 1e-6
"""Of y² in the disc: a fiftieth of a degree off the plane, where y² → y still has a slope."""


class Coordinates(NamedTuple):
    """What a compiled program depends on: static and hashable."""

    names: tuple[str, ...]
    keys: tuple[str, ...]
    channels: tuple[int | None, ...]
    log: tuple[bool, ...]
    tilt: tuple[int, int] | None  # positions of deviation and azimuth where they are x and y of a disc
    folded: bool = False  # y² in the place of y


class Box(NamedTuple):
    """Bounds of the coordinates; `reach` is the largest deviation in degrees."""

    lower: Any
    upper: Any
    reach: Any


def coordinates(leaves: tuple[FreeNumber, ...], in_plane: bool) -> tuple[Coordinates, Box]:
    """Coordinates and box of the nonlinear free numbers.

    Samples in one plane cannot tell a tilt to one side of it from one to the other: its square is
    searched.
    """
    names = tuple(leaf.name for leaf in leaves)
    where = {leaf.name: at for at, leaf in enumerate(leaves)}
    tilt = (where[_TILT[0]], where[_TILT[1]]) if all(name in where for name in _TILT) else None
    if tilt is not None:
        deviation, azimuth = (leaves[at].free for at in tilt)
        if deviation.lower > 0 or azimuth.upper - azimuth.lower < 360:
            tilt = None
    log = tuple(leaf.log for leaf in leaves)
    take = [np.log if each else float for each in log]
    lower = np.array([f(leaf.free.lower) for f, leaf in zip(take, leaves, strict=True)])
    upper = np.array([f(leaf.free.upper) for f, leaf in zip(take, leaves, strict=True)])
    reach = upper[tilt[0]] if tilt else 0.0
    if tilt is not None:
        lower[list(tilt)], upper[list(tilt)] = (-1.0, _LEAST if in_plane else -1.0), 1.0
    keys = tuple(leaf.key for leaf in leaves)
    channels = tuple(leaf.channel for leaf in leaves)
    folded = in_plane and tilt is not None
    return Coordinates(names, keys, channels, log, tilt, folded), Box(lower, upper, np.float64(reach))


def values(c: Coordinates, box: Box, unit: Any) -> Any:
    """The free numbers in their own units, in the order of `c.names`."""
    x = box.lower + unit * (box.upper - box.lower)
    log = np.array(c.log, bool)
    x = jnp.where(log, jnp.exp(jnp.where(log, x, 0.0)), x)
    if c.tilt is None:
        return x
    a, b = c.tilt
    y = jnp.sqrt(x[b]) if c.folded else x[b]
    # the square onto the disc, smoothly and edge to edge: see `log_area`
    u, v = x[a] * jnp.sqrt(1 - 0.5 * y**2), y * jnp.sqrt(1 - 0.5 * x[a] ** 2)
    u = jnp.where(u * u + v * v < 1e-20, 1e-10, u)  # its azimuth has a slope everywhere but at the centre
    return x.at[a].set(box.reach * jnp.sqrt(u * u + v * v)).at[b].set(jnp.rad2deg(jnp.arctan2(v, u)))


def log_area(c: Coordinates, box: Box, unit: Any) -> Any:
    """ln of how much of the disc of tilts a step in the unit cube sweeps, up to a constant; not folded."""
    if c.tilt is None:
        return 0.0
    x, y = (box.lower[at] + unit[at] * (box.upper[at] - box.lower[at]) for at in c.tilt)
    sides = jnp.sqrt((1 - 0.5 * y**2) * (1 - 0.5 * x**2))
    return jnp.log(sides - (0.5 * x * y) ** 2 / sides)


def named(c: Coordinates, numbers: Any) -> dict[str, Any]:
    """Free numbers by key, those of channels gathered into one array."""
    found: dict[str, Any] = {}
    for at, (key, channel) in enumerate(zip(c.keys, c.channels, strict=True)):
        found[key] = numbers[at] if channel is None else [*found.get(key, []), numbers[at]]
    return {key: jnp.stack(x) if isinstance(x, list) else x for key, x in found.items()}
