"""What the back face of a plate is worth: the same fit without it."""

from __future__ import annotations

import equinox as eqx
import jax
import numpy as np

from pellicle.fitting.problem import Problem, local, make
from pellicle.fitting.search import polished, quiet
from pellicle.fitting.weigh import Weighed
from pellicle.scene import Scene, free_leaves


def rms_without(scene: Scene, weighed: Weighed) -> float | None:
    """rms of the best fit with the substrate as a half space, from the same minima.

    None where the back face itself has free parameters: without it they would have no meaning.
    """
    if free_leaves((scene.substrate.back, scene.substrate.plate_mm)):
        return None
    bare = eqx.tree_at(
        lambda s: s.substrate.back, scene, None, is_leaf=lambda x: x is None or x is scene.substrate.back
    )
    problem = weighed.problem
    keep = slice(problem.points)
    wavelength = np.asarray(problem.scene.light.wavelength)[keep]
    without = make(
        bare,
        wavelength,
        problem.data.values[keep],
        1 / problem.data.weight[keep],
        float(problem.data.temper),
    )
    best = polished(without, weighed.minima.units, quiet).units[0]
    at = jax.device_get(local(*without.program, best))
    return _rms(without, at)


def _rms(problem: Problem, at) -> float:
    residual = (problem.data.values - np.asarray(at.model))[: problem.points]
    return float(np.sqrt(np.mean(residual**2)))


def told(rms: float, without: float | None) -> str:
    """A sentence for the verdict."""
    if without is None:
        return ""
    if without > 1.05 * rms:
        return f" The back face matters: rms {rms:.4f} with it, {without:.4f} without."
    if rms > 1.05 * without:
        return f" The back face does harm: rms {rms:.4f} with it, {without:.4f} without."
    return f" The back face makes no difference here: rms {rms:.4f} with it, {without:.4f} without."
