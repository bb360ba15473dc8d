"""Fitted profiles of graded layers: fraction, n and k against depth, with standard errors."""

from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.effects.presence import name
from pellicle.fitting.film.parameters import parameters
from pellicle.fitting.result import Fit
from pellicle.optics.pair import imag, real
from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves, insert
from pellicle.scene.graded import Graded
from pellicle.scene.layers import Layer

POINTS = 101
"""Depths of a profile, with both faces."""


@dataclass(frozen=True)
class FittedProfile:
    """Profile of one layer at one wavelength (nm), each array (depths,).

    `depth` in nm from the upper face, for the fitted thickness. `fraction` is that of the second medium.
    """

    layer: str
    wavelength: float
    depth: np.ndarray
    fraction: np.ndarray
    n: np.ndarray
    k: np.ndarray
    fraction_stderr: np.ndarray
    n_stderr: np.ndarray
    k_stderr: np.ndarray


def fitted_profiles(fit: Fit) -> tuple[FittedProfile, ...]:
    """Return the profile of every graded layer of a fit, at the middle of its wavelengths.

    Errors are those of the parameters of the layer's material, with their correlations.
    """
    scenes = fit.scene if isinstance(fit.scene, tuple) else (fit.scene,)
    scene = next((x for x in scenes if isinstance(x, Scene)), None)
    if scene is None:
        return ()
    graded = [
        i for i, x in enumerate(scene.layers) if isinstance(x, Layer) and isinstance(x.material, Graded)
    ]
    wavelength = float(np.median(fit.index.wavelength)) if graded else 0.0
    with jax.enable_x64(True):
        return tuple(_profile(fit, scene, i, wavelength) for i in graded)


def _profile(fit: Fit, scene: Scene, position: int, wavelength: float) -> FittedProfile:
    names = [p.name for p in parameters(scene)]
    values = np.array([fit.parameters[each].value for each in names])
    layer: Any = insert(scene, values.tolist()).layers[position]
    z = np.linspace(0.0, 1.0, POINTS)

    def curves(numbers: Any) -> Any:
        changed: Any = insert(scene, list(numbers)).layers[position]
        material = changed.material
        index = material.at(z, np.array([wavelength]))
        n, k = real(index), imag(index) + jnp.zeros_like(real(index))
        rows = material.profile.fraction(z), n[..., 0], k[..., 0]
        return jnp.stack([jnp.broadcast_to(row, z.shape) for row in rows])

    indices = np.asarray(curves(jnp.asarray(values)))
    stderr = np.zeros_like(indices)
    if free_leaves(scene.layers[position].material):  # pyright: ignore[reportAttributeAccessIssue]
        slope = np.asarray(jax.jacfwd(curves)(jnp.asarray(values)))
        variance = np.einsum("cip,pq,ciq->ci", slope, _covariance(fit, names), slope)
        stderr = np.sqrt(np.maximum(variance, 0.0))
    depth = z * float(np.asarray(layer.thickness))
    return FittedProfile(name(scene, position), wavelength, depth, *indices, *stderr)


def _covariance(fit: Fit, names: list[str]) -> np.ndarray:
    """Covariance of some parameters; an infinite error makes that of whatever depends on it infinite."""
    listed = list(fit.correlation_names)
    rows = [listed.index(each) for each in names]
    error = np.array([fit.parameters[each].stderr for each in names])
    error = np.where(np.isfinite(error), error, 1e150)
    return np.asarray(fit.correlation)[np.ix_(rows, rows)] * np.outer(error, error)
