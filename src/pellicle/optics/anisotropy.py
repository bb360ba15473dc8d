"""Anisotropic media: principal indices, orientation and permittivity tensor.

Laboratory axes: x lies in the surface and in the plane of incidence, in the direction in which the light
travels along the surface; z is the surface normal and points into the sample; y = z × x. The permittivity is
symmetric: no magneto-optical effects and no optical activity.

A medium of optics is one of four types, known when the program is traced: a number (isotropic), `Principal`
(axes along the laboratory axes: s and p stay apart), `Uniaxial` and `Tensor` (any orientation: s and p mix).

**Principal axes along those of the laboratory.** The electric field of s waves is along y: to them the medium
is isotropic, of index n_y. p waves have q² = (n_x/n_z)² (n_z² − a²), and n_x² in place of n² in the boundary
condition. So the formulas of isotropic media serve, one polarisation at a time; a = n₀ sin θ₀ (R. M. A. Azzam
and N. M. Bashara, Ellipsometry and Polarized Light (North-Holland, 1977), section 4.7.3).
"""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

from pellicle.optics.pair import Number, namespace


class Principal(NamedTuple):
    """Principal refractive indices along the laboratory axes x, y and z."""

    x: Number
    y: Number
    z: Number


Index: TypeAlias = Number | Principal
"""The refractive index of a medium in which s and p stay apart."""


class Uniaxial(NamedTuple):
    """Uniaxial medium: both refractive indices, and the direction cosines of the optic axis (real)."""

    ordinary: Number
    extraordinary: Number
    axis: tuple[Any, Any, Any]


class Tensor(NamedTuple):
    """Relative permittivity in laboratory axes, a symmetric tensor of six elements."""

    xx: Number
    yy: Number
    zz: Number
    xy: Number
    xz: Number
    yz: Number


Medium: TypeAlias = Index | Uniaxial | Tensor
"""A refractive index (number), or an anisotropic medium."""


def mixes_polarisations(*media: Any) -> bool:
    """Return True if s and p mix in one of the media: the 4×4 method is then needed."""
    return any(isinstance(medium, Uniaxial | Tensor) for medium in media)


def is_anisotropic(medium: Any) -> bool:
    """Return True for a `Principal`, `Uniaxial` or `Tensor`, False for a number."""
    return isinstance(medium, Principal | Uniaxial | Tensor)


def axis_direction(theta: Any, phi: Any) -> tuple[Any, Any, Any]:
    """Return the direction cosines of an axis at the angle θ to the normal and the azimuth φ (radians).

    φ counts from the plane of incidence, from x towards y.
    """
    xp = namespace(theta, phi)
    across = xp.sin(theta)
    return across * xp.cos(phi), across * xp.sin(phi), xp.cos(theta)


def uniaxial(ordinary: Number, extraordinary: Number, theta: Any, phi: Any) -> Uniaxial:
    """Return a uniaxial medium whose optic axis has the angle θ to the normal and the azimuth φ (radians)."""
    return Uniaxial(ordinary, extraordinary, axis_direction(theta, phi))


def permittivity(indices: Principal, theta: Any, phi: Any, psi: Any = 0.0) -> Tensor:
    """Return the permittivity of a medium whose principal axes are turned by Euler angles (z-y-z).

    **Arguments:**

    - `indices`: principal refractive indices, in the medium's own axes.
    - `theta`: angle of the third axis to the surface normal in radians.
    - `phi`: azimuth of the third axis, from the plane of incidence (from x towards y).
    - `psi`: rotation about the third axis, applied first. At θ = φ = ψ = 0 the axes are those of the
      laboratory.
    """
    xp = namespace(theta, phi, psi)
    (st, ct), (sp, cp), (ss, cs) = ((xp.sin(angle), xp.cos(angle)) for angle in (theta, phi, psi))
    rows = (
        (cp * ct * cs - sp * ss, -cp * ct * ss - sp * cs, cp * st),
        (sp * ct * cs + cp * ss, -sp * ct * ss + cp * cs, sp * st),
        (-st * cs, st * ss, ct),
    )
    squares = [index * index for index in indices]

    def element(i: int, j: int) -> Number:
        return sum(squares[k] * (rows[i][k] * rows[j][k]) for k in range(3))

    return Tensor(
        xx=element(0, 0),
        yy=element(1, 1),
        zz=element(2, 2),
        xy=element(0, 1),
        xz=element(0, 2),
        yz=element(1, 2),
    )


def tensor(medium: Medium) -> Tensor:
    """Return the permittivity tensor of any medium."""
    if isinstance(medium, Tensor):
        return medium
    if isinstance(medium, Uniaxial):
        square, difference, (x, y, z) = medium.ordinary * medium.ordinary, birefringence(medium), medium.axis
        return Tensor(
            xx=square + difference * (x * x),
            yy=square + difference * (y * y),
            zz=square + difference * (z * z),
            xy=difference * (x * y),
            xz=difference * (x * z),
            yz=difference * (y * z),
        )
    x, y, z = medium if isinstance(medium, Principal) else (medium, medium, medium)
    zero = 0.0 * (x * x)
    return Tensor(xx=x * x, yy=y * y, zz=z * z, xy=zero, xz=zero, yz=zero)


def birefringence(medium: Uniaxial) -> Number:
    """Return ε_e − ε_o, without cancellation where both are nearly equal."""
    o, e = medium.ordinary, medium.extraordinary
    return (e - o) * (e + o)


def seen_by(index: Any, polarisation: str) -> Any:
    """Return the medium in which waves of one polarisation ("s" or "p") propagate.

    To s a `Principal` is an isotropic medium of index n_y; to p it stays what it is. Isotropic media are
    returned unchanged.
    """
    return index.y if polarisation == "s" and isinstance(index, Principal) else index


def tangential_permittivity(index: Index) -> Number:
    """Return n², of a `Principal` n_x²: the permittivity along the surface in the plane of incidence."""
    return index.x * index.x if isinstance(index, Principal) else index * index


def each_index(function: Callable[[Number], Any], index: Medium) -> Any:
    """Return function(index); of an anisotropic medium, the medium with the function of each number."""
    if isinstance(index, Uniaxial):
        return Uniaxial(function(index.ordinary), function(index.extraordinary), index.axis)
    if isinstance(index, Principal | Tensor):
        return type(index)(*map(function, index))
    return function(index)
