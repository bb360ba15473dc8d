"""Renderers' film formulas in transmission, and with single steps changed: for `renderers.py`.

`mended` is Airy's series with the steps in which published formulas differ as arguments: with glTF's steps it
is glTF's formula. `spectral` is a locally spectral film: Airy's formula at a few wavelengths, converted to
RGB where the surface is shaded, as OpenPBR describes it beside Belcour and Barla's since its pull request
262. Here the wavelengths have equal steps of 1/λ from 380 to 730 nm.

Its base is n + ik at 650, 550 and 450 nm: what a metal's F0 and F82 stand for. Between these it is linear in
λ, and constant beyond, as a renderer without spectra has to take it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.colour import delta_e2000, integration_bands, sensor
from pellicle.colour.bands import Bands, published_gaussians
from pellicle.colour.spaces import srgb_matrix
from pellicle.optics.orders import airy_series
from pellicle.optics.pair import Pair, abs2, real
from pellicle.rendering import gltf, materialx
from pellicle.rendering.appearance import ANGLES, CHANNELS, FILM, Appearance
from pellicle.rendering.formula import ColourError, lab_of
from pellicle.rendering.targets import target
from pellicle.scene.film import Light
from pellicle.simulation.colours import interference_colours

Colours = Callable[[Appearance, Any, Any], Any]
"""A film, thicknesses in nm and cosines, which broadcast, to linear sRGB (..., 3)."""

SRGB = srgb_matrix(sensor().white)
Transform = Callable[[Any], Pair]
"""Optical paths (...) in nm to the transforms (..., 3) of red, green and blue, which are 1 at path 0."""


class Steps(NamedTuple):
    """Steps of a formula: its `transform`, `orders` of interference, and what it takes of the base.

    `schlick`: Schlick's reflectance in place of Fresnel's of s and p, which has no phase but 0 or π.
    `complex_base`: the extinction of the base is used.
    """

    transform: Transform
    orders: int = 2
    schlick: bool = False
    complex_base: bool = True


def gaussian_transform(bands: Bands, to_rgb: np.ndarray) -> Transform:
    """Transform of Gaussian bands in 1/λ, whose XYZ weights become RGB by a matrix."""
    assert bands.width is not None
    weights, width = bands.weights @ to_rgb.T, bands.width

    def transform(path: Any) -> Pair:
        phase = 2 * jnp.pi * path[..., None]
        damping = jnp.exp(-0.5 * (phase * jnp.asarray(width, phase.dtype)) ** 2)
        turn = phase / jnp.asarray(bands.wavelength, phase.dtype)
        rgb = jnp.asarray(weights, phase.dtype)
        return Pair((jnp.cos(turn) * damping) @ rgb, (jnp.sin(turn) * damping) @ rgb)

    return transform


def exact_transform(illuminant: str = "D65", longest: float = 9549.0, count: int = 512) -> Transform:
    """Transform of the CIE 1931 observer under a lamp from a table, linear between entries as in Cycles."""
    eye = sensor("1931", illuminant)
    paths = np.linspace(0.0, longest, count)
    weights = eye.weights @ srgb_matrix(eye.white).T
    table = np.exp(2j * np.pi * paths[:, None] / eye.wavelength) @ (weights / weights.sum(axis=0))

    def transform(path: Any) -> Pair:
        at = jnp.clip(path * ((count - 1) / longest), 0.0, count - 1)
        row = jnp.minimum(at.astype(int), count - 2)
        step = (at - row)[..., None]
        parts = (jnp.asarray(x, step.dtype) for x in (np.real(table), np.imag(table)))
        return Pair(*(x[row] * (1 - step) + x[row + 1] * step for x in parts))

    return transform


def mended(steps: Steps, look: Appearance, thickness: Any, cosine: Any) -> Any:
    """Linear sRGB (..., 3) of the film of `look` at thicknesses in nm and cosines, which broadcast."""
    thickness, cosine = jnp.broadcast_arrays(jnp.asarray(thickness), jnp.asarray(cosine))
    index, k = look.index, np.imag(look.base) * steps.complex_base
    of_colour = look.metallic and not steps.complex_base
    n = gltf.base_index(look.bare) if of_colour else jnp.asarray(np.real(look.base))
    inside = jnp.sqrt(1 - (1 - cosine**2) / index**2)
    total: Any = 0.0
    for letter in "sp":
        if steps.schlick:
            first = -jnp.sqrt(gltf.schlick(((index - 1) / (index + 1)) ** 2, cosine))[..., None]
            size = jnp.sqrt(gltf.schlick(((n - index) / (n + index)) ** 2, inside[..., None]))
            lower = Pair(jnp.where(n < index, size, -size), jnp.zeros_like(size))
        else:
            media = jnp.asarray(index), Pair(n, jnp.asarray(k))
            waves = airy_series(1.0, *media, 0.0, jnp.arccos(cosine)[..., None], letter)
            first, lower = real(waves.upper), waves.lower
        total = total + 0.5 * _summed(first, lower, 2 * index * thickness * inside, steps)
    return jnp.maximum(total, 0.0)


def _summed(first: Any, lower: Any, path: Any, steps: Steps) -> Any:
    into = 1 - first**2
    returned = into**2 * abs2(lower) / (1 - first**2 * abs2(lower))
    total, term, step = first**2 + returned, lower * (first * (into - returned)), -(lower * first)
    for order in range(1, steps.orders + 1):
        total = total + 2 * real(term * steps.transform(order * path))
        term = term * step
    return total


def spectral(
    count: int,
    look: Appearance,
    thickness: Any,
    cosine: Any,
    absorbs: bool = False,
    through: bool = False,
) -> Any:
    """Linear sRGB (..., 3) of a locally spectral film at `count` wavelengths.

    `absorbs`: the film has the n + ik of red, green and blue, in place of one index. `through`: the light
    that enters the base, which is not 1 minus the reflected light where the film absorbs.
    """
    bands = integration_bands(f"frequency-{count}")
    cosine = jnp.broadcast_arrays(thickness, cosine)[1]
    angle, total = jnp.arccos(cosine), jnp.zeros(())
    along = (count, *[1] * jnp.ndim(cosine))
    wavelength, base, layer = (
        x.reshape(along)
        for x in (
            bands.wavelength,
            *(_between(x, bands.wavelength) for x in (look.base, look.layer)),
        )
    )
    film = _pair(layer) if absorbs else look.index
    for letter in "sp":
        waves = airy_series(1.0, film, _pair(base), 2 * jnp.pi / wavelength * thickness, angle, letter)
        turn = Pair(jnp.cos(waves.phase), jnp.sin(waves.phase))
        returned = waves.lower * waves.damping * turn
        below = abs2(1 + waves.upper * returned)
        power = waves.direct * waves.damping if through else abs2(waves.upper + returned)
        total = total + 0.5 * power / below
    weights = bands.weights @ SRGB.T
    rgb = jnp.moveaxis(total, 0, -1) @ jnp.asarray(weights, total.dtype)
    return jnp.maximum(rgb, 0.0)


def _pair(index: np.ndarray) -> Pair:
    return Pair(jnp.asarray(np.real(index)), jnp.asarray(np.imag(index)))


def _between(channels: np.ndarray, wavelength: np.ndarray) -> np.ndarray:
    """Indices n + ik at wavelengths, linear between those of red, green and blue."""
    nm, index = CHANNELS[::-1], channels[::-1]
    return np.interp(wavelength, nm, np.real(index)) + 1j * np.interp(wavelength, nm, np.imag(index))


def colour_error(rgb: Any, exact: np.ndarray) -> ColourError:
    """ΔE2000 of linear sRGB from XYZ (..., 3), exposed for the brightest."""
    xyz = np.asarray(rgb) @ np.linalg.inv(SRGB).T
    brightest = np.max(exact[..., 1])
    difference = delta_e2000(lab_of(xyz, brightest), lab_of(exact, brightest))
    return ColourError(float(np.mean(difference)), float(np.max(difference)))


def transmitted(look: Appearance) -> np.ndarray:
    """Exact XYZ (thicknesses, angles, 3) of the light that enters the substrate."""
    scene = eqx.tree_at(lambda s: s.light, look.scene, Light(signal="T"))
    return np.swapaxes(np.asarray(interference_colours(scene, look.thickness, ANGLES, FILM).xyz), 0, 1)


def bare(look: Appearance, cosine: Any) -> Any:
    """Reflectance (..., 1) of a transparent base without its film."""
    p, s = materialx.conductor_reflectances(cosine, np.real(look.base[1]), 0.0)
    return (0.5 * (p + s))[..., None]


GLTF_TRANSFORM = gaussian_transform(published_gaussians(), gltf.XYZ_TO_REC709)
ADAPTED = gaussian_transform(published_gaussians(), srgb_matrix(np.ones(3)))
FOUR = integration_bands("gaussians-4")
REFITTED = gaussian_transform(FOUR, SRGB)


def _own(name: str) -> Colours:
    """The formula of a target with the numbers of the film as they are."""
    of = target(name, package_check=False).formula
    assert of is not None

    def colours(look: Appearance, thickness: Any, cosine: Any) -> Any:
        formula = of(look)
        with jax.ensure_compile_time_eval():
            numbers = formula.physical(look)
        return formula.colour(numbers, thickness, cosine)

    return colours


GLTF, MATERIALX, OPENPBR, BLENDER = map(_own, ("gltf", "materialx", "openpbr", "blender"))
_FRESNEL = partial(mended, Steps(GLTF_TRANSFORM, complex_base=False))
_REAL = partial(mended, Steps(REFITTED, complex_base=False))
_ADAPTED = partial(mended, Steps(ADAPTED, complex_base=False))
_COMPLEX = partial(mended, Steps(ADAPTED))
_REFITTED = partial(mended, Steps(REFITTED))
_THIRD = partial(mended, Steps(REFITTED, orders=3))

CHANGES: tuple[tuple[str, Colours], ...] = (
    ("glTF (three.js, Babylon.js), as it is", GLTF),
    (
        "glTF: a third order",
        partial(mended, Steps(GLTF_TRANSFORM, orders=3, schlick=True, complex_base=False)),
    ),
    (
        "glTF: 4 refitted Gaussians",
        partial(mended, Steps(REFITTED, schlick=True, complex_base=False)),
    ),
    ("glTF: Fresnel's s and p", _FRESNEL),
    ("glTF: Fresnel's s and p, a matrix from E to D65", _ADAPTED),
    ("glTF: Fresnel's s and p, 4 refitted Gaussians", _REAL),
    ("glTF: the same, and n + ik of the base", _REFITTED),
    ("glTF: the same, and a third order", _THIRD),
    ("MaterialX, as it is", MATERIALX),
    ("MaterialX: a matrix from E to sRGB, before the base", _COMPLEX),
    ("MaterialX: the same, 4 refitted Gaussians", _REFITTED),
    ("MaterialX: the same, and a third order", _THIRD),
    ("OpenPBR in MaterialX, as it is", OPENPBR),
    ("OpenPBR: n + ik of F0 and F82", MATERIALX),
    ("OpenPBR: the same, and MaterialX's three changes", _THIRD),
    ("Blender 5, as it is", BLENDER),
    ("Blender: the table weighted by D65", partial(mended, Steps(exact_transform(), orders=3))),
    ("Blender: the same, and six orders", partial(mended, Steps(exact_transform(), orders=6))),
    *((f"locally spectral, {n} wavelengths", partial(spectral, n)) for n in (3, 4, 6, 8, 12, 16)),
    ("locally spectral, 12, n + ik of the film", partial(spectral, 12, absorbs=True)),
)
"""Formulas of reflected light as they are and changed, by what they are."""


def _through(colours: Colours, greatest: bool = False) -> Colours:
    """What a film transmits as 1 minus its reflectance, or minus the greatest of its three channels."""

    def transmittance(look: Appearance, thickness: Any, cosine: Any) -> Any:
        rgb = colours(look, thickness, cosine)
        return 1 - (jnp.max(rgb, axis=-1, keepdims=True) if greatest else rgb) * jnp.ones(3)

    return transmittance


def _without_film(look: Appearance, thickness: Any, cosine: Any) -> Any:
    return jnp.broadcast_to(1 - bare(look, cosine), (*jnp.broadcast_shapes(thickness.shape, cosine.shape), 3))


TRANSMITTED: tuple[tuple[str, Colours], ...] = (
    ("OpenPBR, Standard Surface in MaterialX 1.39.5: as without a film", _without_film),
    ("the same with the film (pull requests 3074, 3086): 1 − R", _through(MATERIALX)),
    ("the same, R with MaterialX's three changes", _through(_THIRD)),
    ("glTF's text: 1 − the greatest of R", _through(GLTF, greatest=True)),
    ("glTF: 1 − R", _through(GLTF)),
    ("glTF: 1 − R, Fresnel's s and p", _through(_FRESNEL)),
    ("glTF: 1 − R, Fresnel's s and p, a matrix from E to D65", _through(_ADAPTED)),
    ("glTF: 1 − R, Fresnel's s and p, 4 refitted Gaussians", _through(_REAL)),
    ("Blender 5: 1 − R", _through(BLENDER)),
    ("locally spectral, 12 wavelengths: 1 − R", _through(partial(spectral, 12))),
    (
        "locally spectral, 12, n + ik of the film: Airy's T",
        partial(spectral, 12, absorbs=True, through=True),
    ),
)
"""Formulas of transmitted light by what they are."""


def operations(colours: Colours, look: Appearance, count: int = 1000) -> tuple[float, float]:
    """Arithmetic operations, and roots and transcendental functions, per colour, as XLA counts them.

    In single precision, for one film and base at many thicknesses and angles.
    """
    with jax.enable_x64(False):
        cosine = jnp.linspace(1.0, 0.2, count)
        compiled = jax.jit(lambda d, c: colours(look, d, c)).lower(cosine * 100.0, cosine).compile()
    counts: Any = compiled.cost_analysis()
    return counts["flops"] / count, counts["transcendentals"] / count
