"""The layer of a scene whose n and k a fit reports."""

from __future__ import annotations

from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves
from pellicle.scene.layers import Interface


def reported_layer(scene: Scene) -> int | None:
    """Position of the layer whose n and k are reported: the first with free parameters of its own, else the
    uppermost; None, the substrate, where nothing but interfaces lies on it."""
    known = [(i, x.material) for i, x in enumerate(scene.layers) if not isinstance(x, Interface)]
    free = [i for i, material in known if free_leaves(material)]
    return next(iter([*free, *(i for i, _ in known)]), None)
