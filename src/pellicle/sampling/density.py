"""The logarithm of the posterior, for many points of the unit cube at once."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.fitting.evaluation import Looks, explained
from pellicle.fitting.measured import Measured
from pellicle.fitting.nuisance import Data
from pellicle.fitting.problem import Box, Problem
from pellicle.fitting.programs import kept
from pellicle.scene import Scene


class Density(NamedTuple):
    """ln posterior of each point, up to a constant; −∞ outside the bounds."""

    log: Any


@kept
def density(looks: Looks, scenes: tuple[Scene, ...], data: tuple[Data, ...], box: Box, units: Any) -> Density:
    """ln posterior at `units` (points, parameters): the evidence of every view, scale and offset integrated
    out, times the priors. A prior is one on the parameter in its own unit."""

    def one(unit):
        views, prior = explained(looks, scenes, data, box, unit)
        value = box.values(unit)
        logarithm = jnp.log(jnp.where(box.logarithmic > 0, value, 1.0))
        chi2 = sum(view.evidence for view in views) + jnp.sum(prior**2)
        log = -0.5 * chi2 - jnp.sum(box.logarithmic * logarithm)
        inside = jnp.all((unit >= 0) & (unit <= 1)) & jnp.isfinite(log)
        return jnp.where(inside, log, -jnp.inf)

    return Density(jax.vmap(one)(units))


class Target:
    """ln posterior of a weighed problem as a function of NumPy arrays (walkers, parameters).

    Batches are padded to `lanes` points, so that all of them share one program.
    """

    def __init__(self, problem: Problem, lanes: int):
        looks, *rest = problem.program
        self.looks, self.rest, self.lanes = looks, jax.device_put(tuple(rest)), lanes

    def __call__(self, units: np.ndarray) -> np.ndarray:
        inside = np.clip(units, 0.0, 1.0)  # nothing is simulated where it has no meaning
        found = [self._batch(inside[i : i + self.lanes]) for i in range(0, len(units), self.lanes)]
        within = np.all((units >= 0) & (units <= 1), axis=1)
        return np.where(within, np.concatenate(found), -np.inf)

    def _batch(self, units: np.ndarray) -> np.ndarray:
        padded = np.concatenate([units, np.repeat(units[-1:], self.lanes - len(units), axis=0)])
        return np.asarray(density(self.looks, *self.rest, padded).log)[: len(units)]


def fingerprint(spectra: Sequence[Measured], tolerance: float) -> str:
    """A hash of the data, the scenes with bounds and priors, and the tolerance: whose chain a chain is."""
    found = hashlib.sha256(repr(tolerance).encode())
    for spectrum in spectra:
        leaves, structure = jax.tree_util.tree_flatten(tuple(spectrum))
        found.update(str(structure).encode())
        for leaf in leaves:
            found.update(leaf.encode() if isinstance(leaf, str) else np.asarray(leaf).tobytes())
    return found.hexdigest()
