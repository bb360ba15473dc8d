"""Colour of one film: its reflectance in each band, weighted and summed."""

from functools import partial
from inspect import unwrap
from typing import Any, NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from pellicle.colour import spaces
from pellicle.colour.bands import Bands, integration_bands
from pellicle.colour.observers import sensor
from pellicle.dispersion.base import AbstractDispersion
from pellicle.optics import coherent, interface, orders, response
from pellicle.optics.pair import Number, is_real, real, to_pair

FEW = 12
"""Layers up to which a colour multiplies out the product: ten take 0.9 µs a pixel and channel in float32, and
9 to 13 µs in a loop; the program compiles in 2 s. The Jacobians of a fit would take longer."""


# one program each: in single operations the first colour takes 8 s of processor time, not 1.5
_lab = jax.jit(spaces.lab, static_argnums=1)
_linear_srgb = jax.jit(spaces.linear_srgb, static_argnums=1)
_srgb = jax.jit(spaces.srgb)


@final
class Colour(eqx.Module):
    """Colours relative to a white; `xyz` has Y = 1 for a perfect reflector."""

    xyz: Float[Array, "... 3"]
    white: tuple[float, float, float] = eqx.field(static=True)

    @property
    def lab(self) -> Float[Array, "... 3"]:
        """CIE 1976 L*, a*, b*."""
        return _lab(self.xyz, self.white)

    @property
    def linear_srgb(self) -> Float[Array, "... 3"]:
        """Linear sRGB, not clipped: interference colours exceed its gamut."""
        return _linear_srgb(self.xyz, self.white)

    @property
    def srgb(self) -> Float[Array, "... 3"]:
        """Display values, 0 to 1."""
        return _srgb(self.linear_srgb)


def film_colour(
    thickness: Any,
    layer: Any,
    substrate: Any,
    *,
    ambient: Any = 1.0,
    angle: Any = 0.0,
    method: str = "gaussians-8",
    illuminant: str = "D65",
    observer: str = "1931",
) -> Colour:
    """Return the colour of a layer on a half space in unpolarised light.

    **Arguments:** all broadcast.

    - `thickness` in nm, `angle` of incidence in degrees.
    - `layer`, `substrate`: numbers n + ik, arrays, or materials (`pl.material("Fe2O3")`); `ambient` is real.
      `pl.film_colour` also takes names. For several coherent layers `layer` and `thickness` are lists, from
      the ambient down, with a method of single wavelengths such as `uniform-64`.
    - `method`: see `pellicle.colour.integration_bands`.
    - `illuminant`, `observer`: see `pellicle.colour.sensor`.

    **Accuracy:** against steps of 1 nm, the mean ΔE2000 of `gaussians-8` over the sweep of
    `benchmarks/colour.py` is 0.06 to 0.09 under E, D50, D65, D75 and A (0.7 at most). Gaussians take the
    index of a material at their centres and its slope there, which is too coarse for media that change
    much within 30 nm: 140 nm of Fe2O3 on glass are off by 3.6, and by `uniform-64` by 0.005.

    **Raises:** ValueError for an unknown method, observer or illuminant, for an absorbing ambient, and for
    an absorbing layer with `belcour-barla`, which does not model absorption.

    ```python
    >>> film_colour(300.0, 1.33, 1.0).srgb.round(2).tolist()
    [0.23, 0.31, 0.2]

    ```
    """
    bands, white = integration_bands(method, observer, illuminant), sensor(observer, illuminant).white
    spectrum = jnp.asarray(reflectance(thickness, layer, substrate, bands, ambient=ambient, angle=angle))
    xyz = spectrum @ jnp.asarray(bands.weights, spectrum.dtype)
    return Colour(xyz, (float(white[0]), float(white[1]), float(white[2])))


def reflectance(
    thickness: Any, layer: Any, substrate: Any, bands: Bands, *, ambient: Any = 1.0, angle: Any = 0.0
) -> Float[Array, "... bands"]:
    """Return the reflectance in each band, (..., N); arguments as for `film_colour`."""
    several = isinstance(layer, list | tuple)
    layers, thicknesses = (layer, thickness) if several else ([layer], [thickness])
    if len(thicknesses) != len(layers):
        raise ValueError(f"`thickness` needs one for each of {len(layers)} layers, not {len(thicknesses)}")
    above, *media, below = (_medium(x) for x in (ambient, *layers, substrate))
    depths, theta = [jnp.asarray(x) for x in thicknesses], jnp.asarray(angle)
    wavelength = jnp.asarray(bands.wavelength, jnp.result_type(*depths, theta, 1.0))
    films = _Films(above, media, below, depths, theta, wavelength)
    # a medium of the user's own may hold what is no argument of a program, such as a function
    compiled = all(isinstance(x, _NUMBERS) for x in jax.tree.leaves(films))
    if bands.width is None:
        run = _of_samples if compiled else unwrap(_of_samples)
        return run(films, absorbs=bands.absorbs)
    if several:
        raise ValueError('several layers need single wavelengths: give `method="uniform-64"`')
    # of a known material by NumPy: JAX's numbers are unknown within a program
    known, traced = layer, any(isinstance(x, Tracer) for x in jax.tree.leaves(layer))
    if isinstance(layer, AbstractDispersion) and not traced:
        known = layer.index(np.asarray(bands.wavelength))
    propagating = interface.propagates(known, ambient, 90.0)  # and so at any angle
    width = jnp.asarray(bands.width, wavelength.dtype)
    how = {"count": bands.orders, "propagating": propagating, "absorbs": bands.absorbs}
    return (_of_bands if compiled else unwrap(_of_bands))(films, width, **how)


_NUMBERS = (int, float, complex, np.ndarray, np.generic, jax.Array)


class _Films(NamedTuple):
    """Films as numbers, arrays and materials, which a compiled function takes."""

    ambient: Any
    layers: list[Any]
    substrate: Any
    thicknesses: list[Any]  # nm
    angle: Any  # degrees
    wavelength: Any  # nm: of each band


@partial(jax.jit, static_argnames="absorbs")
def _of_samples(films: _Films, *, absorbs: bool) -> Any:
    """Reflectance at single wavelengths."""
    n0, media, n2, k0d, theta = _waves(films, absorbs)
    return response.reflectance(*coherent.responses(n0, media, n2, k0d, theta, few=FEW))


@partial(jax.jit, static_argnames=("count", "propagating", "absorbs"))
def _of_bands(films: _Films, width: Any, *, count: int, propagating: bool, absorbs: bool) -> Any:
    """Reflectance of one layer in bands of a `width` in 1/λ, by `count` orders of the film's series."""
    n0, [n1], n2, [k0d], theta = _waves(films, absorbs)
    if not propagating:
        n1 = interface.allow_tunnelling(n1)
    index_slope = _phase_index(films.layers[0], n0, n1, theta, films.wavelength, propagating)
    spread = 2 * jnp.pi * width * 2 * (films.thicknesses[0][..., None] * 1.0) * index_slope
    damping = jnp.exp(-0.5 * spread * spread)
    both = [
        orders.reflectance(
            orders.airy_series(n0, n1, n2, k0d, theta, letter), lambda m: damping ** (m * m), count
        )
        for letter in "sp"
    ]
    return 0.5 * (both[0] + both[1])


def _waves(films: _Films, absorbs: bool) -> tuple[Number, list[Number], Number, list[Any], Any]:
    """Indices of ambient, layers and substrate in each band, k₀d of each layer, and the angle in radians."""
    above, layers, below, thicknesses, angle, wavelength = films
    n0, *media, n2 = (_index(x, wavelength) for x in (above, *layers, below))
    if not is_real(n0):
        raise ValueError("the ambient must not absorb: give it a real index")
    if not absorbs and not is_real(media[0]):
        raise ValueError(
            "the layer absorbs, which belcour-barla does not model: use method gaussians-8 or uniform-64"
        )
    k0d = [2 * jnp.pi / wavelength * (d[..., None] * 1.0) for d in thicknesses]
    return n0, media, interface.allow_tunnelling(n2), k0d, jnp.deg2rad(angle)[..., None] * 1.0


def _medium(medium: Any) -> Any:
    """A material as it is, or numbers as an array."""
    if isinstance(medium, str):
        raise ValueError(f"{medium!r} is a name, for pl.film_colour: here give pl.material({medium!r})")
    return medium if isinstance(medium, AbstractDispersion) else jnp.asarray(medium)


def _index(medium: Any, wavelength: Any) -> Number:
    """Return the index in each band; an array of numbers gets an axis for the bands."""
    if isinstance(medium, AbstractDispersion):
        return medium.index(wavelength)
    return to_pair(medium[..., None] * 1.0)


def _phase_index(
    layer: Any, ambient: Any, index: Number, theta: Any, wavelength: Any, propagating: bool
) -> Any:
    """Return d(Re q₁/λ)/d(1/λ): Re q₁ without dispersion, else the analogue of the group index n_g.

    Where the wave propagates that is q₁ + n₁(n_g − n₁)/q₁, with one n_g for each band.
    """
    if not isinstance(layer, AbstractDispersion):
        return real(interface.normal(index, ambient * jnp.sin(theta)))
    if propagating:
        over, slope = (wavelength,), (-(wavelength**2),)
        group = jax.jvp(lambda wavelength: layer.index(wavelength) / wavelength, over, slope)[1]
        q1: Any = interface.normal(index, interface.transverse(ambient, theta)[0])
        return q1 + index * (group - index) / q1

    def phase(wavelength):
        n1 = interface.allow_tunnelling(layer.index(wavelength))
        return real(interface.normal(n1, ambient * jnp.sin(theta))) / wavelength

    return jax.jvp(phase, (wavelength,), (-(wavelength**2),))[1]
