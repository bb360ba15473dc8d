"""Standard errors of a layer's n and k, of a birefringent one of each principal index."""

from __future__ import annotations

from typing import Any

import numpy as np

from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.fitting.curves import BIREFRINGENCE, Index
from pellicle.fitting.reported_layer import reported_medium
from pellicle.scene.film import Scene


def layer_errors(at: Any, covariance: np.ndarray, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Standard errors of the layer's n and k at each wavelength, from the covariance of the parameters.

    `at` is the local model of a spectrum or of colours.
    """
    n, k = _errors(np.asarray(at.layer_slope)[:2, :points], covariance)
    return n, k


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
        name: Index(wavelength, *value, *_errors(slope, covariance))
        for name, (value, slope) in zip(names, own, strict=True)
    }


def _errors(slope: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Standard errors (rows, wavelengths) by slopes (rows, wavelengths, parameters)."""
    return np.sqrt(np.maximum(np.einsum("cip,pq,ciq->ci", slope, covariance, slope), 0.0))
