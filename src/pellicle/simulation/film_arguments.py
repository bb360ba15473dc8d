"""Arguments of functions of a film: numbers, arrays, materials and names, as numbers for the optics."""

from __future__ import annotations

import warnings
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from pellicle.dispersion.anisotropic import principal_media
from pellicle.dispersion.base import AbstractDispersion
from pellicle.errors import UsageError
from pellicle.optics import interface
from pellicle.optics.anisotropy import is_anisotropic
from pellicle.optics.pair import Number, is_real, to_pair
from pellicle.scene.film import check_polarisation
from pellicle.scene.layers import ambient_medium, medium

Medium = Any
"""A number (n + ik), an array of them, a material, or a material's name."""


class FilmArguments(NamedTuple):
    """A film as `pellicle.optics.coherent.responses` takes it."""

    wavelength: Any  # nm
    thicknesses: list[Any]  # nm
    ambient: Number
    layers: list[Number]
    substrate: Number
    angle: Any  # radians; None is normal incidence
    polarisations: str
    propagating: bool  # no wave is totally reflected in a real layer


def film_arguments(wavelength, thickness, layer, substrate, ambient, angle, polarisation) -> FilmArguments:
    """Evaluate and check the arguments of `pellicle.reflectance`.

    To be called by a helper of the public function: a warning names the line that calls the latter.
    """
    check_polarisation(polarisation)
    for name, value in {"wavelength": wavelength, "thickness": thickness, "angle": angle}.items():
        if isinstance(value, str):
            raise UsageError(f"`{name}` must be a number or an array, not {value!r}")
    if _loses_precision(wavelength, thickness, layer, substrate, ambient, angle):
        warnings.warn(
            "float64 input is computed in float32: jax.config.update('jax_enable_x64', True) keeps it",
            stacklevel=4,
        )
    wavelength = floating(wavelength)
    normal = isinstance(angle, int | float) and angle == 0
    several = isinstance(layer, list | tuple)
    propagating = normal or all(
        interface.propagates(n, ambient, angle) for n in (layer if several else [layer])
    )
    into_below = normal or interface.propagates(substrate, ambient, angle)
    named = isinstance(ambient, str | AbstractDispersion)
    ambient = index_at(ambient_medium(ambient) if named else ambient, wavelength)
    substrate = index_at(substrate, wavelength)
    if not is_real(ambient):
        raise ValueError("the ambient must not absorb: give it a real index")
    if not into_below and not is_anisotropic(substrate):
        substrate = interface.allow_tunnelling(substrate)
    theta = None if normal else jnp.deg2rad(floating(angle))
    letters = "sp" if polarisation == "unpolarised" else polarisation
    layers, thicknesses = [layer], [thickness]
    if several:
        layers = layer
        count = len(thickness) if isinstance(thickness, list | tuple) else np.shape(thickness)[:1]
        if count not in (len(layers), (len(layers),)):
            raise ValueError(f"thickness: expected one for each of {len(layers)} layers, got {count}")
        thicknesses = [thickness[i] for i in range(len(layers))]
    indices = [index_at(n, wavelength) for n in layers]
    return FilmArguments(wavelength, thicknesses, ambient, indices, substrate, theta, letters, propagating)


def floating(x: Any):
    """Convert to an array of real or complex floats, weakly typed where it is a Python number."""
    return jnp.asarray(x) * 1.0


def index_at(what: Medium, wavelength) -> Number:
    """Return the index at the wavelengths: arrays and numbers as they are, materials evaluated."""
    if isinstance(what, str | AbstractDispersion):
        material = medium(what)
        for own in [] if isinstance(wavelength, Tracer) else principal_media(material):
            if hasattr(own, "check_range"):
                own.check_range(np.asarray(wavelength))
        return material.index(wavelength)
    return to_pair(floating(what))


def _loses_precision(*arguments: Any) -> bool:
    if jax.config.jax_enable_x64:  # pyright: ignore[reportAttributeAccessIssue]
        return False
    double = (np.float64, np.complex128)
    return any(isinstance(a, np.ndarray | np.generic) and a.dtype in double for a in arguments)
