"""Principal media of isotropic and anisotropic media alike, for code that looks at each index of a medium."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, final

import numpy as np

from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.dispersion.base import AbstractDispersion, known_index
from pellicle.optics.pair import Number


def principal_media(medium: Any) -> list[Any]:
    """Return the two or three principal media of an anisotropic medium, each once; of another one itself."""
    if not isinstance(medium, Anisotropic):
        return [medium]
    return [own for own in (medium.x, medium.y, medium.z) if own is not None]


def each_principal(function: Callable[[Any], Any], medium: Any) -> Any:
    """Return function(medium), or an anisotropic medium with the function of each principal medium."""
    return medium.with_media(function) if isinstance(medium, Anisotropic) else function(medium)


def ordinary_index(medium: AbstractDispersion, wavelength: np.ndarray) -> Number:
    """Return the known index of a medium, of an anisotropic one the ordinary one (n_x of a biaxial one)."""
    return known_index(principal_media(medium)[0], wavelength)


def mixes_polarisations(medium: Any) -> bool:
    """True where the axes of a medium are not fixed along those of the laboratory: s and p mix in it."""
    return isinstance(medium, Anisotropic) and medium.order is None


def isotropic_in_plane(medium: Any) -> bool:
    """True where a medium is provably isotropic in the plane of the surface: its optic axis is the normal."""
    if not isinstance(medium, Anisotropic):
        return True
    return medium.is_uniaxial and medium.order is not None and medium.order[2] == 2


def require_isotropic(medium: Any, what: str) -> None:
    """ValueError where a medium is anisotropic; `what` begins the sentence: "a mixture is made of"."""
    if isinstance(medium, Anisotropic):
        raise ValueError(f"{what} isotropic media, not of an anisotropic one: give it one index")


@final
class MeanIndex(AbstractDispersion):
    """Isotropic medium with the mean of the principal indices of an anisotropic one."""

    x: Any  # each medium once, by its name in `Anisotropic`: free parameters are known by their paths
    y: Any
    z: Any

    def index(self, wavelength):
        x, z = self.x.index(wavelength), self.z.index(wavelength)
        y = x if self.y is None else self.y.index(wavelength)
        return (x + y + z) * (1 / 3)


def mean_medium(medium: Anisotropic) -> MeanIndex:
    """Return the isotropic mean of an anisotropic medium."""
    return MeanIndex(medium.x, medium.y, medium.z)
