"""Textures of a base: its numbers in a renderer's formula, where a map has free parameters of the base.

The texture of a number is an image from 0 to 1 between its least and its largest value over the object. A set
of numbers of a renderer has these two values in place of one: those of the base itself, shifted by as much as
the solver changes the number of the median base.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.colour import integration_bands
from pellicle.fitting.film.parameters import parameters
from pellicle.optics.pair import parts
from pellicle.rendering.appearance import CHANNELS, OPAQUE, Appearance, bare_colour, index_of
from pellicle.rendering.formula import Formula, Numbers
from pellicle.rendering.textures import share_of_range
from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves, insert
from pellicle.simulation.colours import BANDS

_LEVELS = 256
"""Values of a parameter between its least and its largest, as many as an image of 8 bits has."""
_CHUNK = 1 << 16
_QUANTILES = np.linspace(0.0, 1.0, 5)
"""Quantiles of the thickness and of each parameter of the base, at whose texels colours are compared."""


class Base(NamedTuple):
    """A base at every texel: n + ik at `CHANNELS` and linear sRGB without a film, (rows, columns, 3)."""

    indices: np.ndarray
    bare: np.ndarray

    @property
    def note(self) -> str:
        """A sentence on a base that absorbs in parts of the object only, else empty."""
        share = np.mean(np.max(np.imag(self.indices), axis=-1) > OPAQUE)
        if share in (0, 1):
            return ""
        return (
            f"the base absorbs on {100 * share:.2g} % of the object, and is one kind of material everywhere"
        )


class NumberTexture(NamedTuple):
    """A number of the base over the object, `share` (rows, columns, channels) of its range; `least` and
    `largest` (channels,) are what its ends add to the number of the median base, `bounds` limit both."""

    share: np.ndarray
    least: np.ndarray
    largest: np.ndarray
    bounds: tuple[float, float]

    def ends(self, number: Any) -> tuple[Any, Any]:
        """The least and the largest value (channels,), of the number of the median base."""
        low, high = ((number + end).clip(*self.bounds) for end in (self.least, self.largest))
        return low, high

    def at(self, number: Any, texels: np.ndarray) -> Any:
        """Values (texels, 1, channels) at some texels."""
        low, high = self.ends(number)
        return low + self.share.reshape(-1, 1, self.share.shape[-1])[texels] * (high - low)


class BaseTexture(NamedTuple):
    """Textures of the numbers of a base, by key, and the `texels` at which colours are compared."""

    numbers: dict[str, NumberTexture]
    texels: np.ndarray

    def image(self, key: str, chosen: Numbers) -> np.ndarray:
        """A number at every texel, (rows, columns, 3), or (rows, columns) of one channel."""
        texture = self.numbers[key]
        low, high = texture.ends(chosen[key])
        image = low + texture.share * (high - low)
        return image[..., 0] if image.shape[-1] == 1 else image

    def at_texels(self, chosen: Numbers) -> dict[str, Any]:
        """Numbers of which those of the base are (texels, 1, channels)."""
        return {**chosen, **{key: x.at(chosen[key], self.texels) for key, x in self.numbers.items()}}

    def over(self, formula: Formula) -> Formula:
        """The formula at the texels, of the numbers of the median base."""

        def colour(numbers: Numbers, thickness: Any, cosine: Any) -> Any:
            return formula.colour(self.at_texels(numbers), thickness, cosine)

        return replace(formula, colour=colour)


def base_parameters(scene: Scene, images: Mapping[str, np.ndarray]) -> list[str]:
    """Names of the free numbers of the base's material that vary over a map."""
    names = []
    for (path, _), parameter in zip(free_leaves(scene), parameters(scene), strict=True):
        if path[0].name == "substrate" and path[1].name == "material":
            names.append(parameter.name)
    return [name for name in names if name in images and np.ptp(images[name]) > 0]


def compared_texels(images: Sequence[np.ndarray]) -> np.ndarray:
    """Texels at the quantiles of each image, by rising values of the first, the thickness."""
    flat = [np.ravel(image) for image in images]
    ranks = np.unique(np.round(_QUANTILES * (flat[0].size - 1)).astype(int))
    chosen = np.unique(np.concatenate([np.argpartition(image, ranks)[ranks] for image in flat]))
    return chosen[np.argsort(flat[0][chosen], kind="stable")]


def base_at_texels(scene: Scene, images: Mapping[str, np.ndarray]) -> Base:
    """The base of a scene where some of its free parameters have images, in `_LEVELS` steps of their range.

    Other free parameters take their start values.
    """
    codes, coded = np.int64(0), {}
    for name, image in images.items():
        coded[name] = np.round((_LEVELS - 1) * share_of_range(image)).astype(np.int64)
        codes = codes * _LEVELS + coded[name]
    distinct, first, where = np.unique(codes, return_index=True, return_inverse=True)
    names = [p.name for p in parameters(scene)]
    values = np.tile([free.start for _, free in free_leaves(scene)], (len(distinct), 1))
    for name, image in images.items():
        share = np.ravel(coded[name])[first] / (_LEVELS - 1)
        values[:, names.index(name)] = image.min() + share * np.ptp(image)
    bands = integration_bands(BANDS).wavelength
    wavelength, above = np.concatenate([CHANNELS, bands]), index_of(scene.ambient, bands)

    @jax.jit
    @jax.vmap
    def index(row: Any) -> Any:
        re, im = parts(insert(scene, row).substrate.material.index(wavelength))
        return jnp.stack(jnp.broadcast_arrays(re, 0.0 if im is None else im, wavelength)[:2])

    found, bare = [], []
    with jax.enable_x64(True):
        for start in range(0, len(values), _CHUNK):
            re, im = np.moveaxis(np.asarray(index(values[start : start + _CHUNK])), 1, 0)
            found.append((re + 1j * im)[:, : len(CHANNELS)])
            bare.append(bare_colour(above, (re + 1j * im)[:, len(CHANNELS) :]))
    where = where.reshape(np.shape(codes))
    return Base(np.concatenate(found)[where], np.concatenate(bare)[where])


def base_texture(formula: Formula, look: Appearance, base: Base, texels: np.ndarray) -> BaseTexture:
    """Textures of the numbers of a formula that differ over a base; `look` is that of the median one."""
    own = formula.physical(look)
    over = formula.physical(replace(look, base=base.indices, bare=base.bare))
    numbers = {}
    for key in formula.keys:
        values = np.asarray(over[key.name])
        if values.ndim > 1 and np.any(np.ptp(values, axis=(0, 1)) > 0):
            shift = values.reshape(*base.bare.shape[:2], -1) - own[key.name]
            ends = shift.min(axis=(0, 1)), shift.max(axis=(0, 1))
            numbers[key.name] = NumberTexture(share_of_range(shift), *ends, (key.lower, key.upper))
    return BaseTexture(numbers, texels)
