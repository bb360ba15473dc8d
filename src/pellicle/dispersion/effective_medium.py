"""Effective media: spheres of one material in another, much smaller than the wavelength.

Each mixes the permittivities ε = (n + ik)² of a `host` and an `inclusion`, which may be mixtures
themselves; `fraction` is the inclusion's share of the volume. Two transparent media stay transparent.
Sources: D. E. Aspnes, Thin Solid Films 89, 249 (1982), and H. Looyenga, Physica 31, 401 (1965).
"""

from typing import Any, final

import jax
import numpy as np

from pellicle.dispersion.anisotropic import require_isotropic
from pellicle.dispersion.base import AbstractDispersion, bounds_of
from pellicle.optics import pair
from pellicle.optics.pair import Number, Pair, abs2, imag, is_real, namespace, real, times_i


class AbstractMixture(AbstractDispersion):
    """Mixture of two isotropic media. Subclasses are final."""

    host: AbstractDispersion
    inclusion: AbstractDispersion
    fraction: Any

    def __check_init__(self):
        for part in (self.host, self.inclusion):
            require_isotropic(part, "a mixture is made of")
        bounds = bounds_of(self.fraction)
        if bounds is not None and not 0 <= bounds[0] <= bounds[1] <= 1:
            wrong = bounds[0] if not 0 <= bounds[0] <= 1 else bounds[1]
            raise ValueError(f"fraction must lie in 0 to 1, got {wrong:g}")

    def _permittivities(self, wavelength: Any) -> tuple[Number, Number]:
        h, i = self.host.index(wavelength), self.inclusion.index(wavelength)
        return h * h, i * i


@final
class Linear(AbstractMixture):
    """ε = f ε_i + (1 − f) ε_h: boundaries along the field, the upper Wiener bound."""

    def index(self, wavelength):
        h, i = self._permittivities(wavelength)
        return _root(h + (i - h) * self.fraction)


@final
class Looyenga(AbstractMixture):
    """ε^(1/3) = f ε_i^(1/3) + (1 − f) ε_h^(1/3): irregular grains, neither of which is the matrix."""

    def index(self, wavelength):
        h = _two_thirds(self.host.index(wavelength))
        i = _two_thirds(self.inclusion.index(wavelength))
        third = h + (i - h) * self.fraction
        return third * pair.sqrt(third)


@final
class MaxwellGarnett(AbstractMixture):
    """(ε − ε_h)/(ε + 2ε_h) = f (ε_i − ε_h)/(ε_i + 2ε_h): separate spheres in a matrix, the `host`.

    Not symmetric: with `fraction` above about 0.5 the roles should change.
    """

    def index(self, wavelength):
        h, i = self._permittivities(wavelength)
        pull = (i - h) * self.fraction
        return _root(h * (i + 2 * h + 2 * pull) / (i + 2 * h - pull))


@final
class Bruggeman(AbstractMixture):
    """f (ε_i − ε)/(ε_i + 2ε) + (1 − f)(ε_h − ε)/(ε_h + 2ε) = 0: spheres of both, on an equal footing.

    With w = ε/(n_h n_i) and q = n_i/n_h this is 2w² − 4βw − 1 = 0, β = [(3f − 1) q + (2 − 3f)/q]/4.
    The physical root is w = β + √(β² + ½) with the principal square root everywhere: its cut
    would need an imaginary β beyond ±i/√2, and for n_h and n_i in the first quadrant Re β vanishes
    only where |Im β| ≤ √((1 − 3f)(2 − 3f))/2 < 1/√2 (for f > 2/3 the same with the roles changed).
    So no root is picked at run time and the gradient is smooth in f, n and k.
    """

    def index(self, wavelength):
        h, i = self.host.index(wavelength), self.inclusion.index(wavelength)
        ratio = i / h
        beta = 0.25 * (ratio * (3 * self.fraction - 1) + (2 - 3 * self.fraction) / ratio)
        return _root(h * i * (beta + _principal(beta * beta + 0.5)))


MIXTURES: dict[str, Any] = {
    "bruggeman": Bruggeman,
    "maxwell-garnett": MaxwellGarnett,
    "looyenga": Looyenga,
    "linear": Linear,
}
"""Mixing rules by name."""


def _root(epsilon: Number) -> Number:
    """√ε of a passive medium: an Im ε rounded below zero counts as zero, its slope unchanged."""
    if is_real(epsilon):
        return namespace(epsilon).sqrt(real(epsilon))
    im = imag(epsilon)
    xp = namespace(im)
    below = xp.minimum(im, 0.0)
    return pair.sqrt(Pair(real(epsilon), im - (below if xp is np else jax.lax.stop_gradient(below))))


def _principal(z: Number) -> Number:
    """The square root with a nonnegative real part."""
    return namespace(z).sqrt(real(z)) if is_real(z) else -times_i(pair.sqrt(-z))


def _two_thirds(n: Number) -> Number:
    """n^(2/3) = ε^(1/3) of an index in the first quadrant."""
    if is_real(n):
        return real(n) ** (2 / 3)
    xp = namespace(n)
    size, angle = abs2(n) ** (1 / 3), 2 / 3 * xp.arctan2(imag(n), real(n))
    return Pair(size * xp.cos(angle), size * xp.sin(angle))
