"""Birefringent media, by principal dispersions and axes, and names of numbers inside any dispersion."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex

from pellicle.dispersion.base import AbstractDispersion, known_index
from pellicle.optics.anisotropy import Medium, Principal, permittivity, uniaxial
from pellicle.optics.pair import Number, namespace


@final
class Anisotropic(AbstractDispersion):
    """Uniaxial or biaxial medium.

    **Arguments:**

    - `ordinary`, `extraordinary`: the media of a uniaxial crystal, each anything that a medium may be.
    - `x`, `y`, `z`: in place of these, the principal media of a biaxial crystal.
    - `axis`: angles in degrees. (θ, φ) of the optic axis: θ to the surface normal, φ from the plane of
      incidence. Biaxial: (θ, φ, ψ) of the third axis and of the rotation about it, Euler angles z-y-z
      (`pellicle.optics.anisotropy`). By default the third axis is the surface normal.

    Angles that are literally multiples of 90° keep the axes along those of the laboratory.

    Called with a wavelength in nm, it returns its principal indices, complex, along a last axis: (n_o, n_e)
    or (n_x, n_y, n_z). `pellicle.refractive_index` also does where the principal media are names.

    >>> [round(float(n.real), 2) for n in Anisotropic(1.66, 1.49)(550.0)]
    [1.66, 1.49]
    """

    x: Any  # the ordinary medium of a uniaxial crystal
    y: Any  # None for a uniaxial crystal
    z: Any  # the extraordinary medium of a uniaxial crystal
    theta: Any
    phi: Any
    psi: Any
    azimuth: Any  # rotation of the sample about its normal in degrees, added to φ; None is 0
    order: tuple[int, int, int] | None = eqx.field(static=True)
    """Number of the principal axis along each laboratory axis; None if any orientation is possible."""

    def __init__(
        self,
        ordinary: Any = None,
        extraordinary: Any = None,
        *,
        x: Any = None,
        y: Any = None,
        z: Any = None,
        axis: Any = (0.0, 0.0),
    ):
        uniaxial = ordinary is not None and extraordinary is not None and x is y is z is None
        biaxial = ordinary is extraordinary is None and None not in (x, y, z)
        if not (uniaxial or biaxial):
            raise ValueError("give `ordinary` and `extraordinary`, or all of `x`, `y` and `z`")
        if len(axis) not in ((2,) if uniaxial else (2, 3)):
            raise ValueError(f"`axis`: expected (theta, phi){'' if uniaxial else ' or (theta, phi, psi)'}")
        self.x, self.y, self.z = (ordinary, None, extraordinary) if uniaxial else (x, y, z)
        self.theta, self.phi, self.psi = (*axis, None if uniaxial else 0.0)[:3]
        self.azimuth = None
        self.order = _axis_order(self.theta, self.phi, None if uniaxial else self.psi)

    def with_media(self, convert: Callable[[Any], AbstractDispersion]) -> Anisotropic:
        """Return a copy whose principal media are `convert(medium)`."""
        media = {name: getattr(self, name) for name in "xyz"}
        return self._with(**{name: convert(x) for name, x in media.items() if x is not None})

    def _with(self, **fields: Any) -> Anisotropic:
        # neither by the constructor, where traced angles lose the order of the axes, nor by `eqx.tree_at`,
        # which copies free parameters
        other = object.__new__(Anisotropic)
        for name, value in (vars(self) | fields).items():
            object.__setattr__(other, name, value)
        return other

    def with_angles(self, convert: Callable[[Any], Any]) -> Anisotropic:
        """Return a copy whose angles of the axis are `convert(angle)`."""
        arguments = self.arguments
        return Anisotropic(**arguments | {"axis": tuple(map(convert, arguments["axis"]))})

    def turned(self, azimuth: Any) -> Anisotropic:
        """Return the medium in a sample turned about its normal by `azimuth` degrees, from x towards y.

        A uniaxial medium whose axis is the normal stays as it is. In another one s and p mix, whatever the
        azimuth is.
        """
        return self if isotropic_in_plane(self) else self._with(azimuth=azimuth, order=None)

    @property
    def names(self) -> dict[str, str]:
        """Names of the fields in results."""
        media = {"x": "ordinary", "z": "extraordinary"} if self.is_uniaxial else {x: x for x in "xyz"}
        return media | {"theta": "axis_theta", "phi": "axis_phi", "psi": "axis_psi"}

    @property
    def arguments(self) -> dict[str, Any]:
        """Arguments with which the constructor makes this medium, in a sample that is not turned."""
        media = {name: getattr(self, field) for field, name in self.names.items() if field in "xyz"}
        return media | {"axis": (self.theta, self.phi, self.psi)[: 2 if self.is_uniaxial else 3]}

    @property
    def is_uniaxial(self) -> bool:
        """True for a medium of two indices."""
        return self.y is None

    def __call__(self, wavelength: Any) -> Complex[Array, "..."]:
        """Return the principal indices n + ik at `wavelength` (nm, any shape), along a last axis.

        **Raises:** ValueError for a principal medium that is a name: `pellicle.refractive_index` looks it up.
        """
        nm = jnp.asarray(wavelength, dtype=jnp.result_type(float, wavelength))
        indices = []
        for medium in (self.x, self.y, self.z):
            if isinstance(medium, str):
                raise ValueError(f"{medium!r} is a name: use pl.refractive_index(wavelength, medium)")
            if medium is not None:
                index = medium(nm) if isinstance(medium, AbstractDispersion) else medium
                indices.append(jnp.broadcast_to(index, nm.shape) * (1 + 0j))
        return jnp.stack(indices, axis=-1)

    def index(self, wavelength) -> Medium:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return a `Principal` where the axes are those of the laboratory, else a `Uniaxial` or `Tensor`."""
        x, z = self.x.index(wavelength), self.z.index(wavelength)
        y = x if self.y is None else self.y.index(wavelength)
        if self.order is not None:
            return Principal(*((x, y, z)[i] for i in self.order))
        xp = namespace(self.theta, self.phi, self.psi, wavelength)
        azimuth = self.phi if self.azimuth is None else self.phi + self.azimuth
        theta, phi = (xp.deg2rad(angle * 1.0) for angle in (self.theta, azimuth))
        if self.y is None:
            return uniaxial(x, z, theta, phi)
        return permittivity(Principal(x, y, z), theta, phi, xp.deg2rad(self.psi * 1.0))


def _axis_order(theta: Any, phi: Any, psi: Any) -> tuple[int, int, int] | None:
    """Return the principal axis along each laboratory axis; None unless the angles are literal right angles.

    `psi` is None for a uniaxial medium. With the optic axis along the normal φ is of no consequence.
    """

    def quarter_turns(angle: Any) -> int | None:
        literal = isinstance(angle, int | float) and math.isfinite(angle) and angle % 90 == 0
        return int(angle // 90) % 2 if literal else None

    tilt, twist = quarter_turns(theta), 0 if psi is None else quarter_turns(psi)
    azimuth = 0 if psi is None and tilt == 0 else quarter_turns(phi)
    if None in (tilt, azimuth, twist):
        return None
    x, y, z = (1, 0, 2) if twist else (0, 1, 2)
    x, z = (z, x) if tilt else (x, z)
    return (y, x, z) if azimuth else (x, y, z)


def principal_media(medium: Any) -> list[Any]:
    """Return the two or three principal media of an anisotropic medium, each once; of another one itself."""
    if not isinstance(medium, Anisotropic):
        return [medium]
    return [principal for principal in (medium.x, medium.y, medium.z) if principal is not None]


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


_BRANCHES = ("host", "inclusion", "first", "second")


class ParameterLocation(NamedTuple):
    """A number's full name in its dispersion, its last part, the field that holds it, and whose it is."""

    name: str
    key: str
    field: str
    owner: Any

    @property
    def unit(self) -> str:
        """The unit that the model gives it, empty for none."""
        if isinstance(self.owner, Anisotropic):
            return "deg"
        return getattr(self.owner, "units", {}).get(self.field, "")


def locate_parameter(tree: Any, path: tuple) -> ParameterLocation:
    """Location of the leaf at `path` (as of `jax.tree_util`) in a dispersion.

    The numbers of a tuple are counted from 1 (`B1`); a mixture's components and, where there are
    several, the terms of a sum go in front.
    """
    node: Any = tree
    owner: Any = tree
    field, count, words = "", "", []
    for depth, step in enumerate(path):
        if hasattr(step, "name"):
            owner, field, count = node, step.name, ""
            node = getattr(node, field)
            if isinstance(owner, Anisotropic):
                field = owner.names[field]
                if isinstance(getattr(owner, step.name), AbstractDispersion):
                    words.append(field)
            elif field in _BRANCHES:
                words.append(field)
            continue
        index = step.idx if hasattr(step, "idx") else step.key
        if depth == len(path) - 1:
            count = str(index + 1)
        elif len(node) > 1:
            words.append(f"term{index + 1}")
        node = node[index]
    return ParameterLocation(".".join([*words, field + count]), field + count, field, owner)
