"""The layer of a scene whose n and k a fit reports: its slopes beside those of the signal, and its errors."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.dispersion.anisotropic import Anisotropic, principal_media
from pellicle.dispersion.base import known_index
from pellicle.fitting.central_differences import around
from pellicle.fitting.curves import BIREFRINGENCE, Index
from pellicle.optics.hoisting import stack_rows
from pellicle.optics.pair import imag, real
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

    reported, push = jax.linearize(both, values)
    return Linearised(*reported, *jax.vmap(push, out_axes=-1)(jnp.eye(len(values))))


_STEP = 1e-7
"""Step of a difference, as a share of the number, or in its own unit below 1: that of 25 µm turns a phase by
1e-4 radians."""


def linearised_by_numpy(form: Any, scene: Scene, data: Any, values: np.ndarray) -> Linearised:
    """As `linearised`, with slopes by differences, of a plan that NumPy evaluates."""
    nm = np.asarray(scene.light.wavelength)

    def layer(numbers: np.ndarray) -> np.ndarray:
        media = principal_media(reported_medium(scene, insert(scene, [*numbers])))
        parts = [part(known_index(medium, nm)) for medium in media for part in (real, imag)]
        return np.stack([np.broadcast_to(x, nm.shape) for x in parts])

    def both(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return form.signals(scene, data, points), np.stack([*map(layer, points)])

    found = around(both, np.asarray(values, float), _STEP * np.maximum(np.abs(values), 1.0))
    return Linearised(*found.values, *found.slopes)


def index_of_layer(scene: Scene, at: Any, covariance: np.ndarray, wavelength: np.ndarray) -> dict[str, Any]:
    """n and k of the reported layer, standard errors by the covariance of the parameters, and its principal
    indices, as fields of a curve. `at` is the local model of a spectrum or of colours."""
    (n, k), slopes = (np.asarray(x)[:2, : wavelength.size] for x in (at.layer, at.layer_slope))
    index = Index(wavelength, n, k, *slope_errors(slopes, covariance))
    return vars(index) | {"principal": principal_indices(scene, at, covariance, wavelength)}


def principal_indices(
    scene: Scene, at: Any, covariance: np.ndarray, wavelength: np.ndarray
) -> dict[str, Index]:
    """Each principal index of the reported layer by its name, with standard errors; empty if it has only one.

    Of a uniaxial layer also its birefringence: n and k of the extraordinary medium less the ordinary ones.
    """
    medium = reported_medium(scene)
    if not isinstance(medium, Anisotropic):
        return {}
    points = wavelength.size
    values, slopes = np.asarray(at.layer)[:, :points], np.asarray(at.layer_slope)[:, :points]
    own = [(values[i : i + 2], slopes[i : i + 2]) for i in range(0, len(values), 2)]
    names = [medium.names[axis] for axis in (("x", "z") if medium.is_uniaxial else ("x", "y", "z"))]
    if medium.is_uniaxial:
        (ordinary, slope), (extraordinary, other) = own
        own.append((extraordinary - ordinary, other - slope))
        names.append(BIREFRINGENCE)
    return {
        name: Index(wavelength, *value, *slope_errors(slope, covariance))
        for name, (value, slope) in zip(names, own, strict=True)
    }


def slope_errors(slope: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Standard errors (..., rows, wavelengths) by slopes (..., rows, wavelengths, parameters)."""
    return np.sqrt(np.maximum(np.einsum("...cip,...pq,...ciq->...ci", slope, covariance, slope), 0.0))
