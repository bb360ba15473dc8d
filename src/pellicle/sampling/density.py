"""Log posterior of a problem at many points of the unit cube at once, and the fingerprint of a problem."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.fitting.coordinates import Box
from pellicle.fitting.evaluation import Static, explained
from pellicle.fitting.problem import Problem
from pellicle.fitting.program_cache import kept
from pellicle.sampling.systematics import Systematics, without_effects

LogDensity = Callable[[np.ndarray], np.ndarray]
"""ln posterior (points,), up to a constant, at points (points, parameters) of the unit cube."""


class Density(NamedTuple):
    """ln posterior of each point, up to a constant; −∞ outside the bounds."""

    log: jax.Array


@kept
def density(static: Static, arrays: tuple[Any, ...], box: Box, effects: Systematics, units: Any) -> Density:
    """ln posterior at `units` (points, parameters): the likelihood of every view, nuisances and systematic
    effects integrated out, times the priors. A prior is one on the parameter in its own unit."""
    coordinates, _ = static

    def one(unit):
        views, values = explained(static, arrays, box, unit)
        prior = box.log_prior(values) + coordinates.log_area(box, unit)
        log = -0.5 * effects.deviance(views) + prior
        return jnp.where(jnp.all((unit >= 0) & (unit <= 1)) & jnp.isfinite(log), log, -jnp.inf)

    return Density(jax.vmap(one)(units))


def log_density(problem: Problem, effects: Systematics | None = None) -> LogDensity:
    """ln posterior of a ranked, affine problem; without `effects` that of the noise alone."""
    static = problem.static
    arrays, box, known = jax.device_put((problem.arrays, problem.box, effects or without_effects(problem)))
    return lambda units: np.asarray(density(static, arrays, box, known, units).log)


def fingerprint(parts: Sequence[tuple[Any, ...]], *settings: Any) -> str:
    """SHA-256 hash of everything that a posterior depends on, to match a chain with its problem.

    `parts` are data and scenes with bounds and priors, as pytrees of numbers and strings.
    """
    digest = hashlib.sha256(",".join(map(repr, settings)).encode())
    for part in parts:
        leaves, structure = jax.tree_util.tree_flatten(tuple(part))
        digest.update(str(structure).encode())
        for leaf in leaves:
            digest.update(leaf.encode() if isinstance(leaf, str) else np.asarray(leaf).tobytes())
    return digest.hexdigest()
