"""Simulated data sets with known true values, and the deviance that every solver minimises on them."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.accuracy.case import Case, Variant, compiled
from pellicle.fitting.film.problem import make
from pellicle.fitting.film.targets import Measured
from pellicle.fitting.problem import Explained, Form, Problem
from pellicle.scene.film import Scene, with_wavelength
from pellicle.scene.free import free_leaves


class DataSet(NamedTuple):
    """A data set to fit, with its true values and start values in the unit cube of the bounds."""

    problem: Problem
    truth: np.ndarray
    start: np.ndarray

    @property
    def program(self) -> tuple[Any, ...]:
        """Arguments of the functions below, the form of the spectrum first (static)."""
        (view,) = self.problem.views
        return view.form, view.arrays, self.problem.box


def data_sets(case: Case, scene: Scene, noise: float, count: int, seed: int = 0) -> list[DataSet]:
    """`count` data sets of a case, with true values uniform between the bounds and normal noise.

    `scene` is that of the case with the scale and offset of its instrument, which are fitted where they are
    free. `noise` is the standard deviation of every point in the unit of the signal; for ellipsometry it is
    in degrees of Ψ, and that of N, C and S twice as large on their sphere.
    """
    scene = with_wavelength(scene, case.wavelength)
    free = [leaf for _, leaf in free_leaves(case.scene)]
    low, high = np.array([f.lower for f in free]), np.array([f.upper for f in free])
    start = (np.array([f.start for f in free]) - low) / (high - low)
    random = np.random.default_rng(seed)
    units = random.uniform(size=(count, len(free)))
    clean = compiled(case._replace(draws=low + units * (high - low)), Variant(case.plan, case.scene)).run()
    sigma = float(np.deg2rad(2 * noise)) if case.in_degrees else noise
    noisy = clean + random.normal(0.0, sigma, clean.shape)
    channels = clean.shape[1] // len(case.wavelength)
    noisy = noisy.reshape(count, -1, channels) if channels > 1 else noisy
    kind = scene.light.kind.seen_in(scene, False)
    nm, sigmas = case.wavelength, np.full(len(case.wavelength), sigma)
    return [
        DataSet(make(Measured(scene, nm, values, sigmas, kind)), unit, start)
        for values, unit in zip(noisy, units, strict=True)
    ]


def _explained(form: Form, arrays: Any, box: Any, unit: Any) -> tuple[Explained, Any]:
    values = box.lower + unit * (box.upper - box.lower)
    return form.explain(arrays, list(values)), box.prior_rows(values)


def residual(form: Form, arrays: Any, box: Any, unit: Any) -> Any:
    """Weighted residuals at one point of the unit cube, with those of the priors."""
    spectrum, prior = _explained(form, arrays, box, unit)
    return jnp.concatenate([spectrum.residual, prior])


def deviance(form: Form, arrays: Any, box: Any, unit: Any) -> Any:
    """Deviance (−2 ln evidence) at one point of the unit cube."""
    spectrum, prior = _explained(form, arrays, box, unit)
    return spectrum.deviance + jnp.sum(prior**2)


@partial(jax.jit, static_argnums=0)
def deviances(form: Form, arrays: Any, box: Any, units: Any) -> Any:
    """Deviance at points (points, parameters)."""
    return jax.vmap(lambda unit: deviance(form, arrays, box, unit))(units)


@partial(jax.jit, static_argnums=0)
def deviance_and_slope(form: Form, arrays: Any, box: Any, unit: Any) -> Any:
    """Deviance at one point, and its gradient by forward mode."""
    value, push = jax.linearize(lambda u: deviance(form, arrays, box, u), unit)
    return value, jax.vmap(push)(jnp.eye(len(unit)))
