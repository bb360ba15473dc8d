"""Simulated data sets whose truth is known, and the misfit that every solver minimises on them."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.accuracy.case import Case
from pellicle.accuracy.compiled import compiled
from pellicle.accuracy.methods import Way
from pellicle.effects.plan import Plan
from pellicle.fitting.levenberg_marquardt import least_squares
from pellicle.fitting.spectra import nuisance
from pellicle.fitting.spectra.problem import Problem, make
from pellicle.fitting.spectra.targets import Measured
from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves, insert
from pellicle.simulation.film import build


class Trial(NamedTuple):
    """A data set to fit, where its truth lies in the unit cube of the bounds, and where to start."""

    problem: Problem
    truth: np.ndarray
    start: np.ndarray

    @property
    def program(self) -> tuple[Any, ...]:
        """The arguments of the functions below, the plan first (static)."""
        (view,) = self.problem.views
        return view.program


def trials(case: Case, scene: Scene, noise: float, count: int, seed: int = 0) -> list[Trial]:
    """`count` data sets of a case, their truths uniform between the bounds, with normal noise.

    `scene` is the case's with the instrument's own scale and offset, which are fitted where they are
    free. `noise` is the standard deviation of every point in the signal's unit; for ellipsometry, in
    degrees of Ψ, that of N, C and S is twice as large on their sphere.
    """
    free = [leaf for _, leaf in free_leaves(case.scene)]
    low, high = np.array([f.lower for f in free]), np.array([f.upper for f in free])
    start = (np.array([f.start for f in free]) - low) / (high - low)
    random = np.random.default_rng(seed)
    units = random.uniform(size=(count, len(free)))
    clean = compiled(case._replace(draws=low + units * (high - low)), Way(case.plan, case.scene)).run()
    sigma = float(np.deg2rad(2 * noise)) if case.ellipsometric else noise
    noisy = clean + random.normal(0.0, sigma, clean.shape)
    if case.ellipsometric:
        noisy = noisy.reshape(count, -1, 3)
    nm, sigmas = case.wavelength, np.full(len(case.wavelength), sigma)
    return [
        Trial(make(Measured(scene, nm, values, sigmas)), unit, start)
        for values, unit in zip(noisy, units, strict=True)
    ]


def _solved(plan: Plan, scene: Scene, data: nuisance.Data, box: Any, unit: Any) -> nuisance.Solved:
    signal = build(plan)(insert(scene, list(box.values(unit))))
    return nuisance.solve(signal, data, scene.instrument)


def _prior(box: Any, unit: Any) -> Any:
    return (box.values(unit) - box.prior_mean) * box.prior_weight


def residual(plan: Plan, scene: Scene, data: nuisance.Data, box: Any, unit: Any) -> Any:
    """Weighted residuals at one point of the unit cube, with those of the priors."""
    return jnp.concatenate([_solved(plan, scene, data, box, unit).residual, _prior(box, unit)])


def misfit(plan: Plan, scene: Scene, data: nuisance.Data, box: Any, unit: Any) -> Any:
    """−2 log evidence at one point of the unit cube."""
    return _solved(plan, scene, data, box, unit).evidence + jnp.sum(_prior(box, unit) ** 2)


@partial(jax.jit, static_argnums=0)
def misfits(plan: Plan, scene: Scene, data: nuisance.Data, box: Any, units: Any) -> Any:
    """The misfit at points (points, parameters)."""
    return jax.vmap(lambda unit: misfit(plan, scene, data, box, unit))(units)


@partial(jax.jit, static_argnums=0)
def misfit_and_slope(plan: Plan, scene: Scene, data: nuisance.Data, box: Any, unit: Any) -> Any:
    """The misfit at one point, and its gradient by forward mode."""
    value, push = jax.linearize(lambda u: misfit(plan, scene, data, box, u), unit)
    return value, jax.vmap(push)(jnp.eye(len(unit)))


FEW_STEPS = 4


@partial(jax.jit, static_argnums=0)
def descend(plan: Plan, scene: Scene, data: nuisance.Data, box: Any, units: Any) -> tuple[Any, Any]:
    """A few steps of our bounded Levenberg-Marquardt from each start (starts, parameters): where they lead,
    and the misfit there."""

    def one(unit):
        there, _ = least_squares(lambda u: residual(plan, scene, data, box, u), unit, steps=FEW_STEPS)
        return there, misfit(plan, scene, data, box, there)

    return jax.vmap(one)(units)
