"""Media with principal axes along those of the laboratory, as s and p waves propagate in them.

The electric field of s waves is along y: to them the medium is isotropic, of index n_y. p waves have
q² = (n_x/n_z)² (n_z² − a²), and n_x² in place of n² in the boundary condition. So the formulas of isotropic
media serve, one polarisation at a time.

Source: R. M. A. Azzam and N. M. Bashara, Ellipsometry and Polarized Light (North-Holland, 1977), section
4.7.3; with a = n₀ sin θ₀.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pellicle.optics.anisotropy import Principal, Tensor, Uniaxial
from pellicle.optics.pair import Number


def seen_by(index: Any, polarisation: str) -> Any:
    """Return the medium in which waves of one polarisation ("s" or "p") propagate.

    To s a `Principal` is an isotropic medium of index n_y; to p it stays what it is. Isotropic media are
    returned unchanged.
    """
    return index.y if polarisation == "s" and isinstance(index, Principal) else index


def tangential_permittivity(index: Any) -> Number:
    """Return n², of a `Principal` n_x²: the permittivity along the surface in the plane of incidence."""
    return index.x * index.x if isinstance(index, Principal) else index * index


def each_index(function: Callable[[Number], Any], index: Any) -> Any:
    """Return function(index); of an anisotropic medium, the medium with the function of each number."""
    if isinstance(index, Uniaxial):
        return Uniaxial(function(index.ordinary), function(index.extraordinary), index.axis)
    if isinstance(index, Principal | Tensor):
        return type(index)(*map(function, index))
    return function(index)
