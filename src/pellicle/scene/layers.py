"""What light meets on its way down: coherent layers, mixed interfaces, thick plates, a substrate."""

from __future__ import annotations

from typing import Any, final

import equinox as eqx
import jax
import numpy as np

from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.effective_medium import MIXTURES
from pellicle.dispersion.empirical import Constant
from pellicle.materials import Material, material
from pellicle.optics.pair import is_real
from pellicle.scene.free import Free, insert, is_free, start_values

Quantity = float | Free | jax.Array
"""A number, one to be fitted, or one that is being traced."""


def medium(what: Any) -> AbstractDispersion:
    """A medium from a material, a catalogue name or path, a number (n + ik), or a `Free` index.

    Raises ValueError for an absorbing index with k < 0 (gain) and for an unknown name.
    """
    if isinstance(what, AbstractDispersion):
        return what
    if isinstance(what, str):
        return material(what)
    if is_free(what):
        return Constant(what)
    if isinstance(what, complex | np.complexfloating):
        if what.imag < 0:
            raise ValueError(
                f"index {what} has a negative imaginary part, which is gain: absorption is n + ik with k ≥ 0"
            )
        return Constant(float(what.real), float(what.imag))
    return Constant(what)


def medium_or_none(what: Any) -> AbstractDispersion | None:
    """The same; None stays None."""
    return None if what is None else medium(what)


def absorbs(dispersion: AbstractDispersion) -> bool:
    """False where the type of the index, or an extinction fixed at exactly 0, rules absorption out."""
    if isinstance(dispersion, Constant) and isinstance(dispersion.k, int | float) and dispersion.k == 0:
        return False
    numbers = insert(dispersion, start_values(dispersion))
    return not is_real(jax.eval_shape(numbers.index, jax.ShapeDtypeStruct((1,), np.float32)))


def surroundings(what: Any) -> AbstractDispersion:
    """A medium as an ambient: of a material with a little absorption (`CLEAR`) only the real part."""
    found = medium(what)
    return found.as_ambient() if isinstance(found, Material) and absorbs(found) else found


def check_not_negative(name: str, number: Any, unit: str) -> None:
    """ValueError where a number, or the lower bound of a free one, is below 0."""
    lowest = number.lower if isinstance(number, Free) else number
    if isinstance(lowest, int | float) and lowest < 0:
        raise ValueError(f"{name} must not be negative, got {lowest:g} {unit}")


def none_if_zero(number: Any) -> Any:
    """A width of exactly 0 is absent, so that it costs nothing."""
    return None if isinstance(number, int | float) and number == 0 else number


@final
class Layer(eqx.Module):
    """A coherent layer: its material (anything `medium` takes) and its thickness in nm.

    `thickness_spread` is the standard deviation of the thickness over the spot and `roughness` the
    root mean square height of the upper face (nm), which damps what that face reflects as Névot and
    Croce do; None or 0 is absent.
    """

    material: AbstractDispersion = eqx.field(converter=medium)
    thickness: Quantity
    name: str | None = eqx.field(static=True, default=None)
    thickness_spread: Quantity | None = eqx.field(converter=none_if_zero, default=None)
    roughness: Quantity | None = eqx.field(converter=none_if_zero, default=None)

    def __check_init__(self):
        for key in ("thickness", "thickness_spread", "roughness"):
            check_not_negative(key, getattr(self, key), "nm")


@final
class Interface(eqx.Module):
    """A rough or graded interface as a layer of its own: the media above and below it, mixed.

    `thickness` in nm is divided among `steps` slices, in which the medium below has the shares
    ½/steps, 1½/steps, ... of the volume; one slice is the usual layer of half and half. `mix` is a
    rule of `pellicle.dispersion.effective_medium`.
    """

    thickness: Quantity
    steps: int = eqx.field(static=True, default=1)
    mix: str = eqx.field(static=True, default="bruggeman")
    name: str | None = eqx.field(static=True, default=None)

    def __check_init__(self):
        check_not_negative("thickness", self.thickness, "nm")
        if not 1 <= self.steps <= 100:
            raise ValueError(f"an interface has 1 to 100 steps, not {self.steps}")
        if self.mix not in MIXTURES:
            raise ValueError(f"no mix {self.mix!r}; known: {', '.join(MIXTURES)}")

    def slices(self, above: AbstractDispersion, below: AbstractDispersion) -> tuple[Layer, ...]:
        """The layers that stand for it between two media."""
        rule, each = MIXTURES[self.mix], share(self.thickness, self.steps)
        return tuple(Layer(rule(above, below, (i + 0.5) / self.steps), each) for i in range(self.steps))


def share(thickness: Any, parts: int) -> Any:
    """One of several equal parts of a thickness; a free one keeps its bounds, divided."""
    if isinstance(thickness, Free):
        return Free(thickness.lower / parts, thickness.upper / parts, start=thickness.start / parts)
    return thickness / parts


def _check_thick(plate_mm: Any) -> None:
    """ValueError where a plate's thickness, or the lower bound of a free one, is no thickness."""
    check_not_negative("plate_mm", plate_mm, "mm")
    if isinstance(plate_mm, int | float) and plate_mm == 0:
        raise ValueError("plate_mm must be above 0 mm: what has no thickness is no plate")


@final
class Plate(eqx.Module):
    """A thick, incoherent layer: light between its faces adds as intensities. `plate_mm` in mm."""

    material: AbstractDispersion = eqx.field(converter=medium)
    plate_mm: Quantity = 1.0
    name: str | None = eqx.field(static=True, default=None)

    def __check_init__(self):
        _check_thick(self.plate_mm)


@final
class Substrate(eqx.Module):
    """What the layers lie on: a half space, or, with `back`, a plate with an incoherent back face.

    `back` is the medium behind the plate, `plate_mm` the plate's thickness in mm and `roughness` the
    root mean square height of its upper face in nm.
    """

    material: AbstractDispersion = eqx.field(converter=medium)
    back: AbstractDispersion | None = eqx.field(converter=medium_or_none, default=None)
    plate_mm: Quantity = 1.0
    roughness: Quantity | None = eqx.field(converter=none_if_zero, default=None)

    def __check_init__(self):
        _check_thick(self.plate_mm)
        check_not_negative("roughness", self.roughness, "nm")
