"""Graded medium: a mixture of two media whose proportions vary with depth in a layer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from pellicle.dispersion.anisotropic import require_isotropic
from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.effective_medium import MIXTURES
from pellicle.dispersion.profiles import AbstractProfile, Linear
from pellicle.errors import UsageError
from pellicle.optics.pair import Number, namespace, narrow, parts, sqrt
from pellicle.scene.layers import medium

MEAN_NODES = 16
"""Depths of the mean index, by Gauss and Legendre: exact to 1e-12 for a smooth profile."""


@final
class Graded(AbstractDispersion):
    """Medium of a graded layer: a mixture of two media whose proportions follow a profile of the depth.

    **Arguments:**

    - `first` and `second`: media, as a layer takes them.
    - `profile` of `pl.profile`: volume fraction of `second` against relative depth, 0 at the upper face and 1
      at the lower one. `Linear()` goes from `first` to `second`.
    - `mix`: a mixing rule of `pl.mixing`, by its name in recipes; "linear" interpolates the permittivity.

    `index` is that of the homogeneous layer with the mean permittivity over depth; `at` gives the index at a
    depth.

    **Raises:** ValueError for an unknown rule; UsageError for what is no medium and no profile.

    >>> import pellicle as pl
    >>> Graded("SiO2", "Si3N4", pl.profile.Exponential(1.0, 0.2, length=0.3)).mix
    'bruggeman'
    """

    first: AbstractDispersion = eqx.field(converter=medium)
    second: AbstractDispersion = eqx.field(converter=medium)
    profile: Any = Linear()
    mix: str = eqx.field(static=True, default="bruggeman")

    def __check_init__(self):
        if self.mix not in MIXTURES:
            raise ValueError(f"no mix {self.mix!r}; known: {', '.join(MIXTURES)}")
        if not isinstance(self.profile, AbstractProfile):
            raise UsageError(f"`profile` must be as pl.profile.Linear(0.0, 1.0), not {self.profile!r}")
        for each in (self.first, self.second):
            require_isotropic(each, "a graded medium is made of")
        if isinstance(self.first, Graded) or isinstance(self.second, Graded):
            raise UsageError("a graded medium mixes homogeneous media: stack graded layers instead")

    def at(self, depth: Any, wavelength: Any) -> Number:
        """Return the index at relative depths 0 to 1 (d,) for wavelengths in nm of any shape: (d, ...)."""
        dtype = jnp.result_type(float, wavelength)
        depth = (
            namespace(depth).asarray(depth, dtype=dtype)
            if hasattr(depth, "dtype")
            else np.array(depth, dtype)
        )
        column = self.profile.fraction(depth.reshape(depth.shape + (1,) * np.ndim(wavelength)))
        return MIXTURES[self.mix](self.first, self.second, column).index(wavelength)

    def index(self, wavelength):
        nodes, weights = np.polynomial.legendre.leggauss(MEAN_NODES)
        index = self.at(0.5 * (nodes + 1), wavelength)
        weights = np.asarray(0.5 * weights, dtype=jnp.result_type(float, wavelength))
        re, im = (
            None if x is None else namespace(x).tensordot(weights, x, axes=1) for x in parts(index * index)
        )
        return sqrt(narrow(re, im))

    def with_media(self, change: Callable[[AbstractDispersion], AbstractDispersion]) -> Graded:
        """Return the graded medium with both of its media changed."""
        return replace(self, first=change(self.first), second=change(self.second))


@final
class AtDepth(AbstractDispersion):
    """Homogeneous medium that a graded one is at one relative depth, 0 to 1."""

    graded: Graded
    depth: Any

    def index(self, wavelength):
        index = self.graded.at(namespace(self.depth, wavelength).reshape(self.depth, (1,)), wavelength)
        return narrow(*(None if x is None else x[0] for x in parts(index)))


def each_medium(
    change: Callable[[AbstractDispersion], AbstractDispersion], material: AbstractDispersion
) -> AbstractDispersion:
    """Return change(material); of a graded medium, that of both of its media."""
    return material.with_media(change) if isinstance(material, Graded) else change(material)


def face(material: AbstractDispersion, depth: float) -> AbstractDispersion:
    """Return the medium at a face of its layer, depth 0 or 1; a homogeneous one is returned."""
    return AtDepth(material, depth) if isinstance(material, Graded) else material
