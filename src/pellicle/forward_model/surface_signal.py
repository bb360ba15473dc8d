"""Forward model of a surface: composes the effects of a plan into a BRDF."""

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import jax.numpy as jnp

from pellicle.brdf import film_colour
from pellicle.brdf.lobes import Evaluate
from pellicle.brdf.models import model
from pellicle.forward_model.plan import Plan
from pellicle.scene.surface import SurfaceView


@lru_cache(maxsize=64)
def build(plan: Plan) -> Callable[[SurfaceView], Any]:
    """The forward model of a plan: simulate(view) → BRDF (samples, channels) in 1/sr.

    The `SurfaceView` contains numbers only. The function is pure and can be traced.
    """

    def simulate(view: SurfaceView) -> Any:
        shape = (*view.i.shape[:-1], view.channels)
        for remove in plan.left_out:
            view = remove(view)
        numbers = {key: jnp.stack(x) if isinstance(x, list) else x for key, x in view.numbers.items()}
        return jnp.broadcast_to(_evaluate(plan, view.model)(numbers, view.i, view.o), shape)

    return simulate


def _evaluate(plan: Plan, name: str) -> Evaluate:
    """The BRDF model of that name with the effects of a plan.

    Its numbers are those of `scene.surface.nonzero_numbers`: where a number is absent, so is its effect.
    """
    brdf = model(name)
    if not plan.on("coherence"):
        return brdf.incoherent
    if brdf.from_film_colour is None:
        return brdf.evaluate
    polarisations = "sp" if plan.on("polarisation") else "s"
    reflectance = film_colour.airy(polarisations, tunnelling=plan.on("tunnelling"))
    if not plan.on("oblique"):
        return brdf.from_film_colour(film_colour.at_normal_incidence(reflectance))
    count = plan.row("oblique").count
    colour = film_colour.interpolated(count, reflectance) if count else film_colour.per_sample(reflectance)
    return brdf.from_film_colour(colour)
