"""From a plan to a function that gives a surface's BRDF: it composes what the plan names, nothing else."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import jax.numpy as jnp

from pellicle.brdf import film_colour
from pellicle.brdf.models import Evaluate, model
from pellicle.effects.plan import Plan
from pellicle.scene.surface import SurfaceView


@lru_cache(maxsize=64)
def build(plan: Plan) -> Callable[[SurfaceView], Any]:
    """simulate(view) → the BRDF (samples, channels) in 1/sr, of a `SurfaceView` that holds numbers only.

    The function is pure and can be traced.
    """

    def simulate(view: SurfaceView) -> Any:
        shape = (*view.i.shape[:-1], view.channels)
        for leave_out in plan.left_out:
            view = leave_out(view)
        numbers = {key: jnp.stack(x) if isinstance(x, list) else x for key, x in view.numbers.items()}
        return jnp.broadcast_to(composed(plan, view.model)(numbers, view.i, view.o), shape)

    return simulate


@lru_cache(maxsize=64)
def composed(plan: Plan, name: str) -> Evaluate:
    """The evaluation of the model of that name, as far as a static_key plan calls for it.

    It takes numbers as `scene.surface.nonzero_numbers` gives them: an effect that has one is absent with it.
    """
    brdf = model(name)
    if not plan.on("coherence"):
        return brdf.incoherent
    return brdf.evaluate if brdf.from_film_colour is None else brdf.from_film_colour(_colour(plan))


def _colour(plan: Plan) -> film_colour.Colour:
    """The film's colour: at nodes of the angle, at each sample, or at none."""
    reflectance = _reflectance(plan)
    if not plan.on("oblique"):
        return film_colour.at_normal_incidence(reflectance)
    count = plan.row("oblique").count
    return film_colour.interpolated(count, reflectance) if count else film_colour.per_sample(reflectance)


def _reflectance(plan: Plan) -> film_colour.Reflectance:
    polarisations = "sp" if plan.on("polarisation") else "s"
    if plan.on("tunnelling"):
        return film_colour.airy(polarisations)
    return film_colour.airy(polarisations, tunnelling=False)
