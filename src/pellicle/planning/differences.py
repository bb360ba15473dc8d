"""How much two plans differ over the bounds of a scene, a film's or a surface's, measured."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.effects.plan import Plan
from pellicle.scene.free import free_leaves, insert, is_free, start_values
from pellicle.simulation.film import build

Builder = Callable[[Plan], Callable[[Any], Any]]
"""A plan → what simulates a scene by it: `model.build`, or that of a surface."""

POINTS = 256
CORNERS = 64
_BATCH = 16


def design(scene: Any) -> np.ndarray:
    """Where plans are compared: the corners of the bounds (at most 64), the start, and 256 points of a
    Sobol sequence between, (points, parameters). Without free parameters it is the scene itself."""
    free = [leaf for _, leaf in free_leaves(scene)]
    if not free:
        return np.zeros((1, 0))
    from scipy.stats import qmc

    lower, upper = (np.array([getattr(f, side) for f in free]) for side in ("lower", "upper"))
    corners = [*itertools.islice(itertools.product(*zip(lower, upper, strict=True)), CORNERS)]
    between = qmc.Sobol(len(free), rng=np.random.default_rng(0)).random(POINTS)
    start = np.tile(start_values(scene), (_BATCH - len(corners) % _BATCH, 1))  # whole batches compile faster
    return np.concatenate([corners, start, lower + between * (upper - lower)])


def signals(plan: Plan, scene: Any, points: np.ndarray, builder: Builder = build) -> np.ndarray:
    """The signal at each of the points, (points, wavelengths), N, C and S of each for ellipsometry."""
    return np.asarray(_signals(builder, plan.static_key, *_split(scene, points)), dtype=float)


def gradients(plan: Plan, scene: Any, points: np.ndarray, builder: Builder = build) -> np.ndarray:
    """Its derivatives in the free parameters, (points, wavelengths, parameters)."""
    return np.asarray(_gradients(builder, plan.static_key, *_split(scene, points)), dtype=float)


def largest_difference(one: np.ndarray, other: np.ndarray, signal: str) -> float:
    """Of two sets of signals, in the signal's unit: for ellipsometry the arc, in degrees, between two
    points (N, C, S). Infinite where one of them is no number."""
    apart = np.abs(one - other)
    if signal == "psi-delta":
        apart = np.rad2deg(np.linalg.norm(apart.reshape(-1, 3), axis=1))
    return float(np.max(np.where(np.isfinite(apart), apart, np.inf), initial=0.0))


def largest_slope_change(one: np.ndarray, other: np.ndarray) -> float:
    """Of two sets of gradients, as a share of each parameter's largest derivative in the first."""
    apart, size = (np.max(np.abs(x), axis=(0, 1), initial=0.0) for x in (one - other, one))
    return float(np.max(apart / np.where(size > 0, size, 1.0), initial=0.0))


def _split(scene: Any, points: np.ndarray) -> tuple[Any, tuple[bool, ...], list[Any], np.ndarray]:
    """What a program is compiled for (structure, and which leaves are free), and its numbers."""
    marked = jax.tree_util.tree_leaves(scene, is_leaf=is_free)
    fixed, structure = jax.tree_util.tree_flatten(insert(scene, points[0]))
    free = tuple(is_free(leaf) for leaf in marked)
    return structure, free, [x for x, f in zip(fixed, free, strict=True) if not f], points


def _filled(structure: Any, free: tuple[bool, ...], fixed: list[Any], values: Any) -> Any:
    moving, standing = iter(values), iter(fixed)
    leaves = [next(moving) if f else next(standing) for f in free]
    return jax.tree_util.tree_unflatten(structure, leaves)


@partial(jax.jit, static_argnums=(0, 1, 2, 3))
def _signals(
    builder: Builder, plan: Plan, structure: Any, free: tuple[bool, ...], fixed: list[Any], points: Any
) -> Any:
    simulate = builder(plan)
    return _at_each(lambda v: jnp.ravel(simulate(_filled(structure, free, fixed, v))), points)


@partial(jax.jit, static_argnums=(0, 1, 2, 3))
def _gradients(
    builder: Builder, plan: Plan, structure: Any, free: tuple[bool, ...], fixed: list[Any], points: Any
) -> Any:
    simulate = builder(plan)
    return _at_each(jax.jacfwd(lambda v: jnp.ravel(simulate(_filled(structure, free, fixed, v)))), points)


def _at_each(function: Callable[[Any], Any], points: Any) -> Any:
    """A few points at a time: a cone of light over a long spectrum would not fit into memory at once."""
    return jax.lax.map(function, points, batch_size=min(_BATCH, len(points)))
