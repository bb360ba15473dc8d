"""The layer of a scene whose n and k a fit reports, and its slopes beside those of the signal."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from pellicle.dispersion.anisotropic import principal_media
from pellicle.optics.hoisting import stack_rows
from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves, insert
from pellicle.scene.layers import Interface


def reported_layer(scene: Scene) -> int | None:
    """Position of the layer whose n and k are reported: the first with free parameters of its own, else the
    uppermost; None, the substrate, where nothing but interfaces lies on it."""
    known = [(i, x.material) for i, x in enumerate(scene.layers) if not isinstance(x, Interface)]
    free = [i for i, material in known if free_leaves(material)]
    return next(iter([*free, *(i for i, _ in known)]), None)


def reported_medium(scene: Scene, numbers: Scene | None = None) -> Any:
    """Medium of the reported layer of a scene; of the same scene in `numbers` if given."""
    shown, own = reported_layer(scene), scene if numbers is None else numbers
    layer: Any = own.substrate if shown is None else own.layers[shown]
    return layer.material


class Linearised(NamedTuple):
    """A simulated signal and the n and k of the reported layer, with their derivatives."""

    signal: Any  # as the form simulates it
    layer: Any  # n and k, (2, wavelengths); of a birefringent one n and k of each principal medium in turn
    slope: Any  # ∂ signal / ∂ parameter in its own unit, (..., parameters)
    layer_slope: Any  # (2 or more, wavelengths, parameters)


def linearised(form: Any, scene: Scene, data: Any, values: Any) -> Linearised:
    """The signal that a form simulates of a scene, and the layer, around `values` (parameters,); traced."""

    def both(values):
        numbers = insert(scene, list(values))
        media = principal_media(reported_medium(scene, numbers))
        indices = [medium(numbers.light.wavelength) for medium in media]
        return form.simulate(numbers, data), stack_rows([x for n in indices for x in (n.real, n.imag)])

    found, push = jax.linearize(both, values)
    return Linearised(*found, *jax.vmap(push, out_axes=-1)(jnp.eye(len(values))))
