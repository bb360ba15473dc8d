"""Samples and a surface as numbers: what the search and the solver evaluate."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.brdf.directions import direction
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.fitting.brdf.coordinates import Box, Coordinates, named, values
from pellicle.fitting.brdf.residuals import RESIDUALS, slope
from pellicle.fitting.levenberg_marquardt import least_squares, solve_positive

_ROUND = 128
"""Samples are padded to a multiple of this, so that files of nearly one length share a program."""
_FLOOR = 1e-3
"""Of the median value: below it all values are alike to the cube root."""


class Form(NamedTuple):
    """What a compiled program depends on: the BRDF and which of its numbers are free."""

    evaluate: Callable[..., Any]  # (parameters, i, o) → (samples, channels)
    coordinates: Coordinates  # the nonlinear ones
    weights: tuple[str, ...]  # the linear ones, after them in the unit cube
    each: bool  # whether a weight is one number for each channel
    residual: str


class Data(NamedTuple):
    """Samples, padded: `weight` is 0 on the padding."""

    i: Any
    o: Any
    values: Any  # (samples, channels), 1/sr
    weight: Any  # of the transformed residual
    floor: Any


class Problem(NamedTuple):
    """Everything about one fit. `most` are the upper bounds of the weights, whose lower bound is 0."""

    form: Form
    data: Data
    fixed: dict[str, Any]
    box: Box
    most: Any
    samples: int

    @property
    def program(self) -> tuple[Any, ...]:
        """The arguments that the compiled functions take, the form first (static)."""
        return self.form, self.data, self.fixed, self.box, self.most

    @property
    def thickness(self) -> int | None:
        """The position of the thickness among the coordinates, None where it is fixed."""
        names = self.form.coordinates.names
        return names.index("thickness") if "thickness" in names else None


def seeing(problem: Problem, rows: np.ndarray) -> Problem:
    """The same problem, and program, with weight on the samples of these rows alone."""
    seen = np.zeros((len(problem.data.weight), 1))
    seen[rows] = 1.0
    return problem._replace(data=problem.data._replace(weight=problem.data.weight * seen))


def data(samples: BrdfSamples, residual: str) -> Data:
    """Directions and values; weights 1/σ where σ is known, else 1 for every transformed value."""
    size = len(samples)
    extra = -size % _ROUND

    def pad(x, edge):
        return np.concatenate([x, np.broadcast_to(edge, (extra, *np.shape(x)[1:]))])

    i = np.asarray(direction(samples.theta_i, samples.phi_i))
    o = np.asarray(direction(samples.theta_o, samples.phi_o))
    known = samples.values
    floor = np.float64(_FLOOR * max(float(np.median(known)), 1e-9))
    weight = np.ones_like(known)
    if samples.sigma is not None:
        change = slope(RESIDUALS[residual], jnp.asarray(known), jnp.asarray(i[:, 2:3]), floor)
        weight = 1 / (np.asarray(change) * samples.sigma)
    up = np.array([0.0, 0.0, 1.0])
    return Data(pad(i, up), pad(o, up), pad(known, np.median(known)), pad(weight, 0.0), floor)


def parameters(form: Form, fixed: dict[str, Any], box: Box, most: Any, unit: Any) -> dict[str, Any]:
    """What the BRDF takes, from a point of the unit cube."""
    count = len(form.coordinates.names)
    free = named(form.coordinates, values(form.coordinates, box, unit[:count]))
    weights = unit[count:] * most  # none, or one of each kind, or one of each kind for each channel
    weights = weights.reshape(len(form.weights), -1) if form.each else weights
    return {**fixed, **free, **dict(zip(form.weights, weights, strict=True))}


def compared(form: Form, data: Data, rho: Any) -> Any:
    """Residuals (samples, channels) of a BRDF's values."""
    transform, cosine = RESIDUALS[form.residual], data.i[:, 2:3]
    difference = transform(rho, cosine, data.floor) - transform(data.values, cosine, data.floor)
    return jnp.where(data.weight > 0, difference, 0.0) * data.weight


def residual(form: Form, data: Data, fixed: dict[str, Any], box: Box, most: Any, unit: Any) -> Any:
    """All residuals (samples · channels,) at one point of the unit cube."""
    return compared(
        form, data, form.evaluate(parameters(form, fixed, box, most, unit), data.i, data.o)
    ).reshape(-1)


def solve_weights(form: Form, data: Data, fixed: dict[str, Any], box: Box, most: Any, unit: Any) -> Any:
    """The best weights, as a part of the unit cube, for nonlinear coordinates `unit`.

    They are exact where residuals are linear in them; else residuals are linearised at the data.
    """
    count, groups = len(form.weights), data.values.shape[1] if form.each else 1
    size = np.size(most)
    if not size:
        return jnp.zeros(0)

    def at(weights):
        full = jnp.concatenate([unit, jnp.repeat(weights, groups) / most])
        return form.evaluate(parameters(form, fixed, box, most, full), data.i, data.o)

    nothing = at(jnp.zeros(count))
    columns = jnp.stack([at(one) - nothing for one in jnp.eye(count)])
    change = data.weight * slope(RESIDUALS[form.residual], data.values, data.i[:, 2:3], data.floor)
    left = columns * change
    normal = jnp.einsum("knc,lnc->ckl", left, left)
    right = jnp.einsum("knc,nc->ck", left, (data.values - nothing) * change)
    if not form.each:
        normal, right = normal.sum(0, keepdims=True), right.sum(0, keepdims=True)
    weights = jax.vmap(_nonnegative)(normal, right)
    return jnp.clip(weights.T.reshape(-1) / most, 0.0, 1.0)


def _nonnegative(normal: Any, right: Any) -> Any:
    """min wᵀNw − 2 wᵀr over w ≥ 0, exactly: the best of all sets of weights that are not 0."""
    scale = jnp.sqrt(jnp.maximum(jnp.diag(normal), 1e-300))
    matrix, vector = normal / jnp.outer(scale, scale), right / scale
    best, least = jnp.zeros_like(vector), jnp.zeros(())
    for chosen in itertools.product((False, True), repeat=len(vector)):
        mask = jnp.array(chosen)
        part = jnp.where(mask[:, None] & mask[None, :], matrix, 0) + jnp.diag(jnp.where(mask, 1e-12, 1.0))
        w = solve_positive(part, jnp.where(mask, vector, 0))
        cost = jnp.where(jnp.all(w >= 0), w @ matrix @ w - 2 * w @ vector, jnp.inf)
        best, least = jnp.where(cost < least, w, best), jnp.minimum(cost, least)
    return best / scale


@partial(jax.jit, static_argnums=0)
def scanned(form: Form, data: Data, fixed: dict[str, Any], box: Box, most: Any, units: Any) -> Any:
    """(χ², weights in the unit cube) of candidates `units` (candidates, coordinates)."""

    def one(unit):
        weights = solve_weights(form, data, fixed, box, most, unit)
        left = residual(form, data, fixed, box, most, jnp.concatenate([unit, weights]))
        return left @ left, weights

    return jax.vmap(one)(units)


@partial(jax.jit, static_argnums=(0, 6))
def polished(
    form: Form, data: Data, fixed: dict[str, Any], box: Box, most: Any, units: Any, steps: int = 100
) -> Any:
    """(points, χ², converged) of the local minimum below each start (starts, coordinates and weights).

    The box may be one for all, or (starts, coordinates): where its bounds meet a coordinate is held.
    """

    def one(unit, lower, upper):
        left = partial(residual, form, data, fixed, box._replace(lower=lower, upper=upper), most)
        best, converged = least_squares(left, unit, steps=steps)
        return best, jnp.sum(left(best) ** 2), converged

    shape = units.shape[0], len(form.coordinates.names)
    return jax.vmap(one)(units, *(jnp.broadcast_to(side, shape) for side in (box.lower, box.upper)))


@partial(jax.jit, static_argnums=0)
def chi_squares(form: Form, data: Data, fixed: dict[str, Any], box: Box, most: Any, units: Any) -> Any:
    """χ² at each point (points, coordinates and weights)."""
    return jax.vmap(lambda unit: jnp.sum(residual(form, data, fixed, box, most, unit) ** 2))(units)


@partial(jax.jit, static_argnums=0)
def around(form: Form, data: Data, fixed: dict[str, Any], box: Box, most: Any, unit: Any) -> Any:
    """(residuals, their Jacobian in the unit cube, free numbers, their Jacobian, the BRDF) at one point."""
    count = len(form.coordinates.names)

    def numbers(unit):
        return jnp.concatenate([values(form.coordinates, box, unit[:count]), unit[count:] * most])

    left = partial(residual, form, data, fixed, box, most)
    rho = form.evaluate(parameters(form, fixed, box, most, unit), data.i, data.o)
    return left(unit), jax.jacfwd(left)(unit), numbers(unit), jax.jacfwd(numbers)(unit), rho
