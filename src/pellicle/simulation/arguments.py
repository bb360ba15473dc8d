"""Arguments of the simulating functions: media evaluated at wavelengths, and numbers checked."""

import warnings
from collections.abc import Callable
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
from pellicle.scene.layers import ambient_medium, medium, why_no_index

Medium = Any
"""A number (n + ik), an array of them, a material, or a material's name."""


class FilmArguments(NamedTuple):
    """A film as `pellicle.optics.coherent.responses` takes it."""

    wavelength: Any  # nm
    thicknesses: list[Any]  # nm
    media: tuple[Number, list[Any], Any]  # ambient, layers and substrate, each of them any medium of optics
    angle: Any  # radians; None is normal incidence
    polarisations: str
    propagating: bool  # no wave is totally reflected in a real layer

    @property
    def phases(self) -> list[Any]:
        """k₀d of each layer."""
        return [2 * jnp.pi / self.wavelength * d for d in self.thicknesses]


def film_arguments(wavelength, thickness, layer, substrate, ambient, angle, polarisation) -> FilmArguments:
    """Evaluate and check the arguments of `pellicle.reflectance`.

    To be called by a helper of the public function: a warning names the line that calls the latter.
    """
    check_polarisation(polarisation)
    for name, value in {"wavelength": wavelength, "thickness": thickness, "angle": angle}.items():
        if isinstance(value, str):
            raise UsageError(f"`{name}` must be a number or an array, not {value!r}")
    check_numbers(wavelength, thickness, angle)
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
    media = ambient, [index_at(n, wavelength) for n in layers], substrate
    return FilmArguments(wavelength, thicknesses, media, theta, letters, propagating)


MICROMETRES = 10.0
"""Wavelengths in nm below it are of X-rays, which no catalogue covers; in µm they are of light."""


def check_numbers(wavelength: Any, thickness: Any, angle: Any) -> None:
    """Raise UsageError for impossible numbers; traced ones are not known, and pass."""
    for x in thickness if isinstance(thickness, list | tuple) else [thickness]:
        if (value := _wrong(x, lambda d: d < 0)) is not None:
            raise UsageError(f"`thickness` must not be negative, got {value:g} nm")
    if (value := _wrong(wavelength, lambda nm: ~(nm > 0))) is not None:
        raise UsageError(f"`wavelength` must be above zero, in nm, got {value:g}")
    # not JAX's own array, of which a program would trace the maximum
    known = np.asarray([] if isinstance(wavelength, Tracer) else wavelength)
    if known.size and (most := np.max(known)) < MICROMETRES:
        unit, scale = ("µm", 1e3) if most > 1e-3 else ("m", 1e9)
        raise UsageError(f"`wavelength` is in nm, and {most:g} is like one in {unit}: write {scale * most:g}")
    if (value := _wrong(angle, lambda degrees: ~(np.abs(degrees) <= 90))) is not None:
        raise UsageError(f"`angle` must be 0 to 90 degrees, got {value:g}")


def _wrong(values: Any, test: Callable[[np.ndarray], np.ndarray]) -> Any:
    """The first of some known numbers that fails a test; None where none does, or they are traced."""
    if isinstance(values, Tracer):
        return None
    array = np.asarray(values)
    failing = array[test(array)] if array.dtype.kind in "fiu" else array[:0]
    return failing.flat[0] if failing.size else None


def floating(x: Any):
    """Convert to an array of real or complex floats, weakly typed where it is a Python number."""
    return jnp.asarray(x) * 1.0


def index_at(what: Medium, wavelength) -> Any:
    """Return the index at the wavelengths: arrays and numbers as they are, materials evaluated."""
    if isinstance(what, str | AbstractDispersion):
        return material_at(what, wavelength).index(wavelength)
    check_index(what)
    return to_pair(floating(what))


def check_index(what: Any) -> None:
    """Raise UsageError for an index that no medium has; traced ones are not known, and pass."""
    if isinstance(what, Tracer):
        return
    known = np.asarray(what)  # JAX's copy would be traced in a program
    if known.dtype.kind in "fciu" and (reason := why_no_index(known)):
        raise UsageError(reason)


def material_at(what: str | AbstractDispersion, wavelength: Any) -> AbstractDispersion:
    """A material, with data at the wavelengths where these are known."""
    material = medium(what)
    for principal in [] if isinstance(wavelength, Tracer) else principal_media(material):
        if hasattr(principal, "check_range"):
            principal.check_range(np.asarray(wavelength))
    return material


def _loses_precision(*arguments: Any) -> bool:
    if jax.config.jax_enable_x64:  # pyright: ignore[reportAttributeAccessIssue]
        return False
    double = (np.float64, np.complex128)
    return any(isinstance(a, np.ndarray | np.generic) and a.dtype in double for a in arguments)
