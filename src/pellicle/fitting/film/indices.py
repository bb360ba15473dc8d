"""Indices of the media of a fitted scene, computed once for each set of their numbers."""

from typing import Any, NamedTuple

import numpy as np

from pellicle.dispersion.anisotropic import ordinary_index
from pellicle.dispersion.base import known_index
from pellicle.optics.pair import imag, real
from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves, insert, remembered
from pellicle.scene.layers import Layer


class Indices(NamedTuple):
    """n and k of each layer (wavelengths,), None of one without a medium of its own, n of the ambient, and
    n + ik of the substrate."""

    n: list[np.ndarray | None]
    k: list[np.ndarray | None]
    ambient: np.ndarray
    substrate: np.ndarray


@remembered
def free_media(scene: Scene) -> bool:
    """Test if a medium of the scene has free numbers."""
    media = [getattr(layer, "material", None) for layer in scene.layers], scene.substrate, scene.ambient
    return bool(free_leaves(media))


def indices(scene: Scene, values: np.ndarray) -> Indices:
    """The indices of a scene with its free numbers at `values` (parameters,).

    Those of birefringent media are the ordinary ones.
    """
    return _indices(scene, tuple(map(float, values)) if free_media(scene) else None)


@remembered
def _indices(scene: Scene, values: tuple[float, ...] | None) -> Indices:
    fitted: Scene = insert(scene, [0.5] * len(free_leaves(scene)) if values is None else values)
    nm = np.asarray(fitted.light.wavelength)
    each = [ordinary_index(x.material, nm) if isinstance(x, Layer) else None for x in fitted.layers]

    def along(x: Any) -> np.ndarray | None:
        return None if x is None else np.broadcast_to(x, nm.shape)

    n = [along(None if x is None else real(x)) for x in each]
    k = [along(None if x is None else imag(x)) for x in each]
    below = ordinary_index(fitted.substrate.material, nm)
    substrate = np.broadcast_to(real(below) + 1j * np.asarray(imag(below)), nm.shape)
    return Indices(n, k, np.broadcast_to(real(known_index(fitted.ambient, nm)), nm.shape), substrate)
