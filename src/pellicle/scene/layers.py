"""Layers of a scene: coherent layers, mixed interfaces, thick plates and the substrate."""

from __future__ import annotations

import math
import os
import re
from typing import Any, NamedTuple, TypeAlias, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import pellicle.dispersion
from pellicle.dispersion.anisotropic import Anisotropic, principal_media, require_isotropic
from pellicle.dispersion.base import AbstractDispersion, known_index
from pellicle.dispersion.effective_medium import MIXTURES
from pellicle.dispersion.empirical import Constant
from pellicle.dispersion.oscillators import AbstractOscillator
from pellicle.errors import UsageError
from pellicle.materials import Material, UnknownMaterial, material
from pellicle.optics.pair import is_real
from pellicle.scene.free import Free, insert, is_free, start_values
from pellicle.scene.ties import Tied
from pellicle.scene.uncertainty import check_uncertainty

SCATTERING_BACKS = ("rough", "taped")
"""Words of recipes and flags for a back face that returns no light to the detector."""
MOST_REFLECTIONS = 100
"""Largest number of reflections at a back face that can be counted."""
METRE = 1e9
"""Largest length in nm that a layer can have."""

Quantity = float | Free | Tied | np.ndarray | jax.Array
"""A number, a parameter to be fitted, one tied to others, or a traced number."""

MediumLike: TypeAlias = AbstractDispersion | str | complex | Free | Any
"""A dispersion, a name of the catalogue or path of a file of n and k, an index n + ik, or a `Free` index."""


def why_no_index(values: Any) -> str:
    """Return the reason why no medium has one of these numbers for its index, empty where all may be one."""
    known: Any = np.ravel(np.asarray(values))
    if (gain := known[known.imag < 0]).size:
        said = f"index {gain[np.argmin(gain.imag)]:g} has a negative imaginary part, which is gain:"
        return f"{said} absorption is n + ik with k ≥ 0"
    if (below := known[known.real < 0]).size:
        return f"index {below[np.argmin(below.real)]:g} has a negative real part"
    return (
        "index 0 is that of no medium: light has an infinite wavelength in it" if np.any(known == 0) else ""
    )


def medium(value: MediumLike) -> AbstractDispersion:
    """Return the dispersion of a medium: what layers, substrates and ambients are made of.

    **Arguments:** `value`: a catalogue name (`"SiO2"`) or the path of an n,k table, an index n + ik, a `Free`
    index, or a dispersion, which is returned; the principal media of a `pl.Anisotropic` may be all of these.

    **Returns:** a dispersion, whose `index(wavelength)` takes nm.

    **Raises:** ValueError for an index with k < 0 (gain), of 0 and not finite, and for an unknown name;
    UsageError for an object that is no medium.

    >>> medium(1.5)
    Constant(n=1.5)
    """
    if isinstance(value, Anisotropic):
        return value.with_media(medium)
    if isinstance(value, AbstractDispersion):
        return value
    if isinstance(value, str | os.PathLike):
        return _named(os.fspath(value))
    if is_free(value) or type(value) is Tied:
        return Constant(value)
    if isinstance(value, int | float | complex | np.number):
        if not np.isfinite(value):
            raise ValueError(f"index {value} is not finite")
        if reason := why_no_index(value):
            raise ValueError(reason)
    if isinstance(value, complex | np.complexfloating):
        return Constant(float(value.real), float(value.imag))
    if value is None or isinstance(value, list | tuple | dict | eqx.Module):
        kind = type(value).__name__
        term = f": write Oscillators(1.0, ({kind}(...),))" if isinstance(value, AbstractOscillator) else ""
        raise UsageError(
            "a medium is a name ('SiO2'), an index (1.46, 2.9 + 0.1j), pl.Free(1.3, 1.7) or a dispersion,"
            f" not {kind}{term}"
        )
    return Constant(value)


def _named(name: str) -> AbstractDispersion:
    try:
        return material(name)
    except UnknownMaterial:
        models = {x.lower(): x for x in vars(pellicle.dispersion) if x[0].isupper()}
        model = models.get(re.sub(r"[^a-z]", "", name.partition("(")[0].lower()))
        if model is None:
            raise
        raise UnknownMaterial(
            f"{name!r} is a dispersion model, not a material: give pl.dispersion.{model}(...), with"
            " pl.Free(lower, upper) for each number to be fitted"
        ) from None


def medium_or_none(value: MediumLike | None) -> AbstractDispersion | None:
    """Return `medium(value)`, or None for None."""
    if isinstance(value, str) and value in SCATTERING_BACKS:
        raise UsageError(
            f"{value!r} is no medium: give the medium behind the plate, and a `back_collected` of 0 where its"
            " back face is rough or taped over"
        )
    return None if value is None else medium(value)


def absorbs(dispersion: AbstractDispersion) -> bool:
    """Return False where the type of the index, or an extinction fixed at 0, rules absorption out."""
    if isinstance(dispersion, Anisotropic):
        return any(map(absorbs, principal_media(dispersion)))
    if isinstance(dispersion, Constant) and isinstance(dispersion.k, int | float) and dispersion.k == 0:
        return False
    known = jax.tree_util.tree_map(
        lambda x: 0.0 if type(x) is Tied else x, dispersion, is_leaf=lambda x: is_free(x) or type(x) is Tied
    )
    numbers = insert(known, start_values(known))
    # the type does not depend on the numbers, which may be tracers
    zeros = jax.tree_util.tree_map(lambda x: np.zeros(np.shape(x), jnp.result_type(x)), numbers)
    return not is_real(known_index(zeros, np.ones(1)))


def ambient_medium(value: MediumLike) -> AbstractDispersion:
    """Return `medium(value)`; of a material with a little absorption (`CLEAR`) only the real part."""
    dispersion = medium(value)
    require_isotropic(dispersion, "the ambient is made of")
    if isinstance(dispersion, Material) and absorbs(dispersion):
        return dispersion.as_ambient()
    return dispersion


def check_not_negative(name: str, number: Quantity | None, unit: str) -> None:
    """Raise ValueError where a number, or a bound of a free one, is negative, not finite or above a metre.

    UsageError for what is no number.
    """
    if isinstance(number, str | list | tuple | dict):
        raise UsageError(f"`{name}` must be a number or pl.Free(lower, upper), not {number!r}")
    lowest = number.lower if isinstance(number, Free) else number
    largest = number.upper if isinstance(number, Free) else number
    if not isinstance(lowest, int | float):
        return
    if not math.isfinite(lowest):
        raise ValueError(f"`{name}` must be finite, got {lowest:g}")
    if lowest < 0:
        raise ValueError(f"`{name}` must not be negative, got {lowest:g} {unit}".rstrip())
    if unit == "nm" and isinstance(largest, int | float) and largest > METRE:
        raise UsageError(f"`{name}` must be at most {METRE:g} nm, a metre, got {largest:g} nm")


def none_if_zero(number: Quantity | None) -> Quantity | None:
    """Return None for a width of exactly 0, which costs nothing."""
    return None if isinstance(number, int | float) and number == 0 else number


class Repetition(NamedTuple):
    """Number of repeats of a group of layers, and the number of the group in its scene."""

    repeats: int
    number: int


@final
class Layer(eqx.Module):
    """Coherent layer.

    **Arguments:**

    - `material`: a catalogue name, path of a file of n and k, index n + ik, `Free` index or dispersion.
    - `thickness` in nm.
    - `name` of its parameters in results, where there are several layers.
    - `thickness_spread`: standard deviation of the thickness over the spot in nm.
    - `roughness`: root mean square height of the upper face in nm, which damps its reflection (Névot and
      Croce, 1980).

    - `index_uncertainty`: relative standard uncertainty of a given index; None takes the scene's.
    - `drift`, in a `Group`: linear change of the thickness from the uppermost to the lowest repeat, relative
      to `thickness`, which is then the mean of all repeats.
    - `group`: the group that the layer is repeated in, which a scene sets.

    A `thickness_spread`, `roughness` or `drift` of None or 0 is absent.

    **Raises:** ValueError for an unknown material, gain, a negative length or uncertainty.

    >>> Layer("SiO2", Free(10, 3000)).thickness.upper
    3000.0
    """

    material: AbstractDispersion = eqx.field(converter=medium)
    thickness: Quantity
    name: str | None = eqx.field(static=True, default=None)
    thickness_spread: Quantity | None = eqx.field(converter=none_if_zero, default=None)
    roughness: Quantity | None = eqx.field(converter=none_if_zero, default=None)
    index_uncertainty: float | None = eqx.field(static=True, default=None)
    drift: Quantity | None = eqx.field(converter=none_if_zero, default=None)
    group: Repetition | None = eqx.field(static=True, default=None)

    @property
    def repeats(self) -> int:
        """Number of times that the layer stands in its scene."""
        return 1 if self.group is None else self.group.repeats

    def __check_init__(self):
        check_uncertainty("index", self.index_uncertainty)
        if self.thickness is None:
            raise UsageError("`thickness` is missing: a number of nm, or pl.Free(10, 3000) to fit it")
        for key in ("thickness", "thickness_spread", "roughness"):
            check_not_negative(key, getattr(self, key), "nm")


@final
class Interface(eqx.Module):
    """Rough or graded interface as a layer of its own: a mixture of the media above and below.

    **Arguments:** `thickness` in nm, divided among `steps` slices in which the medium below has the volume
    fractions ½/steps, 1½/steps, ...; one slice is the usual layer of half and half. `mix` is a rule of
    `pl.mixing`, by its name in recipes. `name` as in `Layer`. `fraction` is another share of the medium below
    in the one slice, as of a porous top of the film below: the numbers of that film are the same in both.

    **Raises:** ValueError for a negative thickness, other than 1 to 100 steps, an unknown rule, a fraction
    outside 0 to 1, and one for several steps.

    >>> Interface(4.0, steps=2).mix
    'bruggeman'
    """

    thickness: Quantity
    steps: int = eqx.field(static=True, default=1)
    mix: str = eqx.field(static=True, default="bruggeman")
    name: str | None = eqx.field(static=True, default=None)
    fraction: Quantity | None = None

    def __check_init__(self):
        check_not_negative("thickness", self.thickness, "nm")
        if not 1 <= self.steps <= 100:
            raise ValueError(f"an interface has 1 to 100 steps, not {self.steps}")
        if self.mix not in MIXTURES:
            raise ValueError(f"no mix {self.mix!r}; known: {', '.join(MIXTURES)}")
        if self.fraction is not None and self.steps != 1:
            raise ValueError(f"`fraction` goes with one step, not with a gradient of {self.steps}")
        MIXTURES[self.mix](Constant(1.0), Constant(1.0), 0.5 if self.fraction is None else self.fraction)

    def slices(self, above: AbstractDispersion, below: AbstractDispersion) -> tuple[Layer, ...]:
        """Return the layers that replace the interface between two media."""
        rule, thickness = MIXTURES[self.mix], divided(self.thickness, self.steps)
        if self.fraction is not None:
            return (Layer(rule(above, below, self.fraction), thickness),)
        return tuple(Layer(rule(above, below, (i + 0.5) / self.steps), thickness) for i in range(self.steps))


def divided(thickness: Quantity, parts: float) -> Quantity:
    """Return one of several equal parts of a thickness; a free one keeps its bounds, divided."""
    if isinstance(thickness, Free):
        return Free(thickness.lower / parts, thickness.upper / parts, start=thickness.start / parts)
    assert not isinstance(thickness, Tied), "a scene resolves ties"
    return thickness / parts


def _check_plate(plate: Plate | Substrate) -> None:
    check_not_negative("plate_mm", plate.plate_mm, "mm")
    if isinstance(plate.plate_mm, int | float) and plate.plate_mm == 0:
        raise ValueError("`plate_mm` must be above 0 mm")
    check_not_negative("back_collected", plate.back_collected, "")
    share, count = plate.back_collected, plate.back_reflections
    if isinstance(share, int | float) and share > 1:
        raise ValueError(f"`back_collected` must be at most 1, all of the light, got {share:g}")
    if count is not None and (isinstance(count, bool) or not isinstance(count, int)):
        raise UsageError(f"`back_reflections` must be a whole number, not {count!r}")
    if count is not None and not 1 <= count <= MOST_REFLECTIONS:
        raise ValueError(
            f"`back_reflections` must be 1 to {MOST_REFLECTIONS}, got {count};"
            " a `back_collected` of 0 collects none"
        )


def _none_if_all(share: Quantity | None) -> Quantity | None:
    """None for a share of exactly 1, which costs nothing."""
    return None if isinstance(share, int | float) and share == 1 else share


@final
class Plate(eqx.Module):
    """Thick, incoherent layer: light between its faces adds as intensities.

    **Arguments:** `material` and `name` as in `Layer`; thickness `plate_mm` in mm; `back_collected` and
    `back_reflections` as in `Substrate`, of the light from beneath the plate.

    **Raises:** ValueError for an unknown material, a thickness that is not positive, a share outside 0 to 1
    or a number of reflections below 1.

    >>> Plate("BK7", 1.1).plate_mm
    1.1
    """

    material: AbstractDispersion = eqx.field(converter=medium)
    plate_mm: Quantity = 1.0
    name: str | None = eqx.field(static=True, default=None)
    back_collected: Quantity | None = eqx.field(converter=_none_if_all, default=None)
    back_reflections: int | None = eqx.field(static=True, default=None)

    def __check_init__(self):
        _check_plate(self)


@final
class Substrate(eqx.Module):
    """Substrate: a half space, or with `back` a plate with an incoherent back face.

    **Arguments:**

    - `material` as in `Layer`.
    - `back`: the medium behind the plate.
    - `plate_mm`: the plate's thickness in mm.
    - `roughness`: the root mean square height of its upper face in nm.
    - `index_uncertainty` as in `Layer`.
    - `back_collected`: share, 0 to 1, of the light reflected at the back face that reaches the detector; None
      or 1 is all. 0 is a back that is roughened or taped over. In a thick plate the beams from the back face
      are displaced, and a small spot or an aperture cuts part of them off.
    - `back_reflections`: largest number of reflections at the back face after which light still reaches the
      detector; None is any.

    Light transmitted without a reflection at the back face is collected in any case.

    **Raises:** ValueError for an unknown material, an impossible length, a negative uncertainty, a share
    outside 0 to 1, other than 1 to 100 reflections, and for either of them without a `back`.

    >>> Substrate("BK7", back="air").plate_mm
    1.0
    """

    material: AbstractDispersion = eqx.field(converter=medium)
    back: AbstractDispersion | None = eqx.field(converter=medium_or_none, default=None)
    plate_mm: Quantity = 1.0
    roughness: Quantity | None = eqx.field(converter=none_if_zero, default=None)
    index_uncertainty: float | None = eqx.field(static=True, default=None)
    back_collected: Quantity | None = eqx.field(converter=_none_if_all, default=None)
    back_reflections: int | None = eqx.field(static=True, default=None)

    def __check_init__(self):
        check_uncertainty("index", self.index_uncertainty)
        _check_plate(self)
        check_not_negative("roughness", self.roughness, "nm")
        if self.back is None and (self.back_collected, self.back_reflections) != (None, None):
            stated = "back_reflections" if self.back_collected is None else "back_collected"
            raise UsageError(f"`{stated}` needs the medium behind the plate, as `back` air")
