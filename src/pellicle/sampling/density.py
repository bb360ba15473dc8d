"""The logarithm of the posterior, for many points of the unit cube at once."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.fitting.program_cache import kept
from pellicle.fitting.spectra.evaluation import Looks, explained
from pellicle.fitting.spectra.nuisance import Data
from pellicle.fitting.spectra.problem import Box, Problem
from pellicle.sampling.target import LogDensity
from pellicle.scene.film import Scene


class Density(NamedTuple):
    """ln posterior of each point, up to a constant; −∞ outside the bounds."""

    log: Any


@kept
def density(looks: Looks, scenes: tuple[Scene, ...], data: tuple[Data, ...], box: Box, units: Any) -> Density:
    """ln posterior at `units` (points, parameters): the evidence of every view, scale and offset integrated
    out, times the priors. A prior is one on the parameter in its own unit."""

    def one(unit):
        views, _ = explained(looks, scenes, data, box, unit)
        return bounded(unit, -0.5 * sum(view.evidence for view in views) + log_prior(box, box.values(unit)))

    return Density(jax.vmap(one)(units))


def log_prior(box: Box, value: Any) -> Any:
    """ln of the priors at values of the parameters, in their own units."""
    normal = (value - box.prior_mean) * box.prior_weight
    logarithm = jnp.log(jnp.where(box.logarithmic > 0, value, 1.0))
    return -0.5 * jnp.sum(normal**2) - jnp.sum(box.logarithmic * logarithm)


def bounded(unit: Any, log: Any) -> Any:
    """`log` inside the unit cube and where it is a number, else −∞."""
    return jnp.where(jnp.all((unit >= 0) & (unit <= 1)) & jnp.isfinite(log), log, -jnp.inf)


def log_density(problem: Problem) -> LogDensity:
    """ln posterior of a weighed problem of spectra."""
    looks, *rest = problem.program
    held = jax.device_put(tuple(rest))
    return lambda units: np.asarray(density(looks, *held, units).log)


def fingerprint(parts: Sequence[tuple[Any, ...]], *settings: Any) -> str:
    """A hash of what a posterior depends on, which says whose chain a chain is: data and scenes with bounds
    and priors, as pytrees of numbers and strings, and settings."""
    found = hashlib.sha256(",".join(map(repr, settings)).encode())
    for part in parts:
        leaves, structure = jax.tree_util.tree_flatten(tuple(part))
        found.update(str(structure).encode())
        for leaf in leaves:
            found.update(leaf.encode() if isinstance(leaf, str) else np.asarray(leaf).tobytes())
    return found.hexdigest()
