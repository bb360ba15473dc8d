"""Weights of lobes solved for each candidate of a search: a BRDF is linear in them."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from pellicle.fitting.brdf.residuals import RESIDUALS, slope
from pellicle.fitting.brdf.view import Samples, SamplesForm
from pellicle.fitting.coordinates import Box, Coordinates
from pellicle.fitting.positive_definite import solve_positive
from pellicle.fitting.program_cache import kept


class Candidates(NamedTuple):
    """χ² of each candidate, and its weights in the unit cube (candidates, weights)."""

    chi2: Any
    weights: Any


@kept
def scan(
    static: tuple[Coordinates, SamplesForm], samples: Samples, fixed: dict[str, Any], box: Box, units: Any
) -> Candidates:
    """χ² and weights of candidates `units` (candidates, nonlinear parameters) in the unit cube."""
    coordinates, form = static

    def one(unit):
        weights = solve_weights(static, samples, fixed, box, unit)
        values = coordinates.values(box, jnp.concatenate([unit, weights]))
        return Candidates(form.explain((samples, fixed), values).deviance, weights)

    return jax.vmap(one)(units)


def solve_weights(
    static: tuple[Coordinates, SamplesForm], samples: Samples, fixed: dict[str, Any], box: Box, unit: Any
) -> Any:
    """The best weights, in the unit cube, for nonlinear parameters at `unit`.

    They are exact where residuals are linear in them; else residuals are linearised at the data.
    """
    coordinates, form = static
    first = len(unit)
    lower, upper = box.lower[first:], box.upper[first:]
    size = len(form.keys) - first
    if not size:
        return jnp.zeros(0)
    by_channel = form.channels[first] is not None
    groups = samples.values.shape[1] if by_channel else 1
    count = size // groups

    def at(weights):
        values = coordinates.values(box, jnp.concatenate([unit, jnp.zeros(size)]))
        values = values.at[first:].set(jnp.repeat(weights, groups))
        return form.evaluate(form.numbers(values, fixed), samples.i, samples.o)

    nothing = at(jnp.zeros(count))
    columns = jnp.stack([at(one) - nothing for one in jnp.eye(count)])
    change = samples.weight * slope(
        RESIDUALS[form.residual], samples.values, samples.i[:, 2:3], samples.floor
    )
    weighted = columns * change
    normal = jnp.einsum("knc,lnc->ckl", weighted, weighted)
    right = jnp.einsum("knc,nc->ck", weighted, (samples.values - nothing) * change)
    if not by_channel:
        normal, right = normal.sum(0, keepdims=True), right.sum(0, keepdims=True)
    weights = jax.vmap(_nonnegative)(normal, right).T.reshape(-1)
    return jnp.clip((weights - lower) / (upper - lower), 0.0, 1.0)


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
