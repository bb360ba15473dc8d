"""Spectra of a stack of smooth films for s and p, over thickness and angle, and their colours."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.colour import integration_bands
from pellicle.colour.observers import Sensor
from pellicle.colour.spaces import SRGB_WHITE, TO_SRGB, adaptation
from pellicle.dispersion.base import AbstractDispersion, known_index
from pellicle.errors import UsageError
from pellicle.optics import coherent, response
from pellicle.optics.interface import allow_tunnelling
from pellicle.optics.pair import Number
from pellicle.scene.film import Scene
from pellicle.scene.free import insert, start_values
from pellicle.scene.layers import Layer
from pellicle.synthetic.colours import BANDS, varied_layer

_BATCH = 4096
"""Films in one call: 4096 × 64 wavelengths are 2 MB in double precision."""


class Stack(NamedTuple):
    """Indices of smooth layers between two media at the wavelengths of `eye`, and their thicknesses in nm.

    The thickness of the layer `varied` is given to `spectra` instead.
    """

    eye: Sensor
    ambient: Number
    layers: tuple[Number, ...]
    substrate: Number
    thickness: tuple[float, ...]
    varied: int


class Spectra(NamedTuple):
    """Reflectance from above, transmittance and reflectance from below, each (2, ..., wavelengths), s and p.

    The light from below is that which the layers transmit at the angle above.
    """

    reflected: np.ndarray
    transmitted: np.ndarray
    below: np.ndarray


def stack(
    scene: Scene, layer: str | None = None, *, observer: str = "1931", illuminant: str = "D65"
) -> Stack:
    """Return the media of a scene at the wavelengths of `BANDS`; free parameters take their start values.

    A back face of the substrate is left out: the substrate is the inside of the sphere.

    **Arguments:** `layer`, `observer` and `illuminant` as for `interference_colours`.

    **Raises:** UsageError for a plate or a mixed interface among the layers, and where a material has no data
    between 380 and 730 nm.
    """
    varied, bands = varied_layer(scene, layer), integration_bands(BANDS, observer, illuminant)
    eye = Sensor(bands.wavelength, bands.weights)
    fixed: Any = insert(scene, start_values(scene))
    if not all(isinstance(each, Layer) for each in fixed.layers):
        raise UsageError("a sphere has coherent layers only: leave out plates and mixed interfaces")
    media = [fixed.ambient, *(each.material for each in fixed.layers), fixed.substrate.material]
    ambient, *layers, substrate = (_index(medium, eye.wavelength) for medium in media)
    thickness = tuple(float(each.thickness) for each in fixed.layers)
    return Stack(eye, ambient, tuple(layers), substrate, thickness, varied)


def _index(medium: AbstractDispersion, wavelength: np.ndarray) -> Number:
    index = known_index(medium, wavelength)
    if not all(np.all(np.isfinite(part)) for part in jax.tree_util.tree_leaves(index)):
        raise UsageError("a material has no data between 380 and 730 nm, which a colour needs")
    return jax.tree_util.tree_map(lambda part: part * np.ones(len(wavelength)), index)


def spectra(films: Stack, thickness: float | np.ndarray, cosine: np.ndarray) -> Spectra:
    """Compute spectra at thicknesses (nm) of the varied layer and cosines of incidence, which broadcast."""
    at = np.broadcast_arrays(np.asarray(thickness, float), np.asarray(cosine, float))
    rows = np.stack([one.ravel() for one in at])
    count = rows.shape[1]
    size = min(_BATCH, 1 << (count - 1).bit_length())  # powers of two: few programs
    rows = np.pad(rows, ((0, 0), (0, -count % size)), "edge").reshape(2, -1, size)
    media = (films.ambient, films.layers, films.substrate, films.eye.wavelength)
    with jax.enable_x64(True):
        found = [
            np.asarray(_spectra(media, films.thickness, films.varied, *each)) for each in rows.swapaxes(0, 1)
        ]
    whole = np.concatenate(found, axis=2)[:, :, :count]
    return Spectra(*whole.reshape(3, 2, *at[0].shape, -1))


@jax.jit
def _spectra(media: Any, fixed: tuple[Any, ...], varied: Any, thickness: Any, cosine: Any) -> Any:
    """Spectra (3, 2, films, wavelengths)."""
    ambient, layers, substrate, wavelength = media
    turns = 2 * jnp.pi / wavelength
    phases = [turns * jnp.where(varied == i, thickness, nm)[:, None] for i, nm in enumerate(fixed)]
    angle = jnp.arccos(cosine)[:, None]
    inner = [allow_tunnelling(index) for index in layers]
    each = coherent.responses(ambient, inner, allow_tunnelling(substrate), phases, angle)
    quantities = (response.reflectance, response.transmittance, response.reflectance_below)
    return jnp.stack([jnp.stack([quantity(one) for one in each]) for quantity in quantities])


def linear_srgb(films: Stack, spectrum: np.ndarray) -> np.ndarray:
    """Linear sRGB (..., 3) of spectra (2, ..., wavelengths) in unpolarised light, the mean of s and p.

    The white of the illuminant is (1, 1, 1).
    """
    return spectrum.mean(axis=0) @ to_srgb(films.eye)


def to_srgb(eye: Sensor) -> np.ndarray:
    """Matrix (wavelengths, 3) from a spectrum to linear sRGB, with the white of the sensor at (1, 1, 1)."""
    return eye.weights @ (TO_SRGB @ adaptation(eye.white, SRGB_WHITE)).T
