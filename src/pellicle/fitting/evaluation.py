"""Compiled evaluations of a problem: deviances, polished minima, model curves."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.fitting.coordinates import Box, Coordinates
from pellicle.fitting.problem import Explained, Form, Problem
from pellicle.fitting.program_cache import kept

Static = tuple[Coordinates, tuple[tuple[Form, tuple[int, ...]], ...]]
"""The static part of a program: coordinates, and of each view its form and the parameters that it takes."""


class Deviances(NamedTuple):
    """−2 ln likelihood of each candidate in one view, priors left out."""

    value: Any


@kept
def deviances(form: Form, arrays: Any, values: Any) -> Deviances:
    """Deviance of one view at candidates `values` (candidates, its parameters)."""
    return Deviances(jax.vmap(lambda each: form.explain(arrays, each).deviance)(values))


class Curves(NamedTuple):
    """The model of each candidate, nuisances at their best, (candidates, data values)."""

    model: Any


@kept
def curves(form: Form, arrays: Any, values: Any) -> Curves:
    """Model of one view at candidates `values` (candidates, its parameters)."""
    return Curves(jax.vmap(lambda each: form.explain(arrays, each).model)(values))


def explained(static: Static, arrays: tuple[Any, ...], box: Box, unit: Any) -> tuple[list[Explained], Any]:
    """Every view at one point of the unit cube, and the values of the parameters."""
    coordinates, looks = static
    values = coordinates.values(box, unit)
    views = zip(looks, arrays, strict=True)
    return [form.explain(own, [values[i] for i in takes]) for (form, takes), own in views], values


class Polished(NamedTuple):
    """Local minima in the unit cube, (starts, parameters), their deviance, and whether they settled."""

    units: Any
    deviance: Any
    converged: Any


@kept
def polish(static: tuple[Static, int], arrays: tuple[Any, ...], box: Box, units: Any) -> Polished:
    """The local minimum below each start (starts, parameters), in all views together.

    `static` ends with the most steps of the solver. The bounds of the box may be one for all starts, or
    (starts, parameters): where lower and upper meet, a parameter is fixed.
    """
    from pellicle.fitting.levenberg_marquardt import least_squares  # a kept program needs no solver

    looks, steps = static

    def one(unit, lower, upper):
        own = box._replace(lower=lower, upper=upper)

        def residual(unit):
            views, values = explained(looks, arrays, own, unit)
            return jnp.concatenate([*(view.residual for view in views), own.prior_rows(values)])

        best, converged = least_squares(residual, unit, steps=steps)
        views, values = explained(looks, arrays, own, best)
        prior = jnp.sum(own.prior_rows(values) ** 2)
        return Polished(best, sum(view.deviance for view in views) + prior, converged)

    sides = (jnp.broadcast_to(side, units.shape) for side in (box.lower, box.upper))
    return jax.vmap(one)(units, *sides)


def total_deviance(problem: Problem, units: np.ndarray) -> np.ndarray:
    """Deviance of all views and priors at points (points, parameters) of the unit cube."""
    values = np.asarray(problem.values(units))
    total = np.sum(problem.box.prior_rows(values) ** 2, axis=-1)
    for view in problem.views:
        total = total + np.asarray(deviances(view.form, view.arrays, problem.seen_by(view, values)).value)
    return total
