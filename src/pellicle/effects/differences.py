"""Largest difference of two plans over the bounds of a film or surface, and the time that one saves."""

from __future__ import annotations

import itertools
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.forward_model.plan import Plan
from pellicle.scene.free import free_leaves, insert, is_free, start_values

Build = Callable[[Plan], Callable[[Any], Any]]
"""A plan → its forward model: `build` of `forward_model.film_signal` or `forward_model.surface_signal`."""

POINTS = 256
CORNERS = 64
_BATCH = 16
TIMING_SECONDS, FEWEST_ROUNDS = 0.3, 5
"""Seconds for which plans are timed in turns, and the least number of rounds."""


def design(scene: Any) -> np.ndarray:
    """Points within the bounds at which plans are compared, (points, parameters).

    They are the corners of the bounds (at most 64), the start values, and 256 points of a Sobol sequence;
    without free parameters one point, the scene itself.
    """
    free = [leaf for _, leaf in free_leaves(scene)]
    if not free:
        return np.zeros((1, 0))
    from scipy.stats import qmc  # slow to import

    lower, upper = (np.array([getattr(f, side) for f in free]) for side in ("lower", "upper"))
    corners = [*itertools.islice(itertools.product(*zip(lower, upper, strict=True)), CORNERS)]
    between = qmc.Sobol(len(free), rng=np.random.default_rng(0)).random(POINTS)
    start = np.tile(start_values(scene), (_BATCH - len(corners) % _BATCH, 1))  # whole batches compile faster
    return np.concatenate([corners, start, lower + between * (upper - lower)])


class Evaluation(NamedTuple):
    """Simulations of one scene at the points of a design, by any plan.

    `scene` has its media evaluated where possible. Signals are divided by `scale`, which broadcasts to
    (points, values).
    """

    build: Build
    scene: Any
    points: np.ndarray
    scale: Any = 1.0

    def signals(self, plan: Plan) -> np.ndarray:
        """Signal of a plan at each point, (points, values)."""
        return signals(plan, self.scene, self.points, self.build) / self.scale

    def seconds(self, plans: Sequence[Plan]) -> list[float]:
        """Median time of an evaluation by each plan, all points in one call, as in a fit's scan.

        The plans take turns, so that other processes affect all of them.
        """
        structure, free, *numbers = _split(self.scene, self.points)
        numbers = jax.device_put(numbers)
        runs = [partial(_signals, self.build, plan.static_key, structure, free, *numbers) for plan in plans]
        times: list[list[float]] = [[] for _ in runs]
        jax.block_until_ready([run() for run in runs])  # compiles
        end = time.perf_counter() + TIMING_SECONDS
        while len(times[0]) < FEWEST_ROUNDS or time.perf_counter() < end:
            for run, some in zip(runs, times, strict=True):
                began = time.perf_counter()
                run().block_until_ready()
                some.append((time.perf_counter() - began) / len(self.points))
        return [statistics.median(some) for some in times]

    def slope_change(self, one: Plan, other: Plan, count: int) -> float:
        """`largest_slope_change` between two plans at the last `count` points; 0 if nothing is free."""
        if not self.points.shape[1]:
            return 0.0
        last = self.points[-count:]
        return largest_slope_change(*(gradients(plan, self.scene, last, self.build) for plan in (one, other)))


def signals(plan: Plan, scene: Any, points: np.ndarray, build: Build) -> np.ndarray:
    """Signal at each point, (points, values): for a film its wavelengths, for ellipsometry N, C and S of
    each wavelength (and ratio), for a surface the channels of each pair of directions."""
    return np.asarray(_signals(build, plan.static_key, *_split(scene, points)), dtype=float)


def gradients(plan: Plan, scene: Any, points: np.ndarray, build: Build) -> np.ndarray:
    """Derivatives of the signal in the free parameters at each point, (points, values, parameters)."""
    return np.asarray(_gradients(build, plan.static_key, *_split(scene, points)), dtype=float)


def largest_difference(one: np.ndarray, other: np.ndarray, degrees: bool) -> float:
    """Largest difference of two arrays of signals, in the unit of the signal.

    In `degrees` it is the arc between two points (N, C, S). Infinite where one of the
    signals is not a number.
    """
    apart = np.abs(one - other)
    if degrees:
        apart = np.rad2deg(np.linalg.norm(apart.reshape(-1, 3), axis=1))
    return float(np.max(np.where(np.isfinite(apart), apart, np.inf), initial=0.0))


def largest_slope_change(one: np.ndarray, other: np.ndarray) -> float:
    """Largest difference of two arrays of gradients, relative to the largest derivative of each parameter in
    the first."""
    apart, size = (np.max(np.abs(x), axis=(0, 1), initial=0.0) for x in (one - other, one))
    return float(np.max(apart / np.where(size > 0, size, 1.0), initial=0.0))


def _split(scene: Any, points: np.ndarray) -> tuple[Any, tuple[bool, ...], list[Any], np.ndarray]:
    """The static arguments of a program (structure, and which leaves are free) and its numbers."""
    leaves = jax.tree_util.tree_leaves(scene, is_leaf=is_free)
    fixed, structure = jax.tree_util.tree_flatten(insert(scene, points[0]))
    free = tuple(is_free(leaf) for leaf in leaves)
    return structure, free, [x for x, f in zip(fixed, free, strict=True) if not f], points


def _join(structure: Any, free: tuple[bool, ...], fixed: list[Any], values: Any) -> Any:
    free_values, fixed_values = iter(values), iter(fixed)
    leaves = [next(free_values) if f else next(fixed_values) for f in free]
    return jax.tree_util.tree_unflatten(structure, leaves)


@partial(jax.jit, static_argnums=(0, 1, 2, 3))
def _signals(
    build: Build, plan: Plan, structure: Any, free: tuple[bool, ...], fixed: list[Any], points: Any
) -> Any:
    simulate = build(plan)
    return _in_batches(lambda v: jnp.ravel(simulate(_join(structure, free, fixed, v))), points)


@partial(jax.jit, static_argnums=(0, 1, 2, 3))
def _gradients(
    build: Build, plan: Plan, structure: Any, free: tuple[bool, ...], fixed: list[Any], points: Any
) -> Any:
    simulate = build(plan)
    return _in_batches(jax.jacfwd(lambda v: jnp.ravel(simulate(_join(structure, free, fixed, v)))), points)


def _in_batches(function: Callable[[Any], Any], points: Any) -> Any:
    """`function` at each point, a few at a time: a cone of light over a long spectrum would not fit into
    memory at once."""
    return jax.lax.map(function, points, batch_size=min(_BATCH, len(points)))


class Saving(NamedTuple):
    """Effect of leaving something out: its error in the unit of the signal, and the seconds it saves."""

    error: float
    seconds: float


class Savings(NamedTuple):
    """The saving of each effect, and the seconds of one evaluation of the exact plan and of the planned one.

    A saving below a few per cent of `exact` is noise, and may be negative.
    """

    effects: dict[str, Saving]
    exact: float
    planned: float


def measured(full: Plan, chosen: Plan, cheaper: Mapping[str, list[Plan]], evaluation: Evaluation) -> Savings:
    """Savings compared with the `full` plan; `cheaper` has at most one plan for each effect."""
    others = {effect: plan for effect, plans in cheaper.items() for plan in plans}
    exact = evaluation.signals(full)
    errors = [largest_difference(evaluation.signals(plan), exact, full.degrees) for plan in others.values()]
    whole, planned, *times = evaluation.seconds([full, chosen, *others.values()])
    each = zip(others, errors, times, strict=True)
    return Savings({effect: Saving(error, whole - time) for effect, error, time in each}, whole, planned)
