"""A scene: what is there and how it is looked at.

Scenes are pytrees of numbers. Wherever a number may stand, a `Free` may stand instead: a
parameter to be fitted. What is absent is None, and costs nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, final

import equinox as eqx
import jax
import numpy as np

from pellicle.materials import lookup
from pellicle.optics.dispersion import AbstractDispersion, Constant
from pellicle.optics.number import is_real

SIGNALS = ("R", "T", "psi-delta")
POLARISATIONS = ("unpolarised", "s", "p")


@final
class Normal(eqx.Module):
    """A normal prior on a free parameter, in the parameter's unit."""

    mean: float = eqx.field(static=True)
    sd: float = eqx.field(static=True)

    def __check_init__(self):
        if not self.sd > 0:
            raise ValueError(f"a prior's standard deviation must be positive, not {self.sd}")


@final
class Free(eqx.Module):
    """A parameter to be fitted, standing where its number would.

    **Arguments:** `value` to start from (the middle of the bounds if None), `lower` and `upper`
    bounds, and an optional `prior`; all in the parameter's own unit. Raises ValueError where the
    bounds are reversed or the value is outside them.
    """

    value: float = eqx.field(static=True)
    lower: float = eqx.field(static=True)
    upper: float = eqx.field(static=True)
    prior: Normal | None

    def __init__(
        self,
        value: float | None = None,
        lower: float = -math.inf,
        upper: float = math.inf,
        prior: Normal | None = None,
    ):
        if not lower < upper:
            raise ValueError(f"bounds are reversed or equal: lower {lower:g} is not below upper {upper:g}")
        if not (math.isfinite(lower) and math.isfinite(upper)):
            raise ValueError("a free parameter needs two finite bounds: give lower and upper")
        value = 0.5 * (lower + upper) if value is None else value
        if not lower <= value <= upper:
            raise ValueError(f"the start value {value:g} is outside its bounds {lower:g} to {upper:g}")
        self.value, self.lower, self.upper, self.prior = float(value), float(lower), float(upper), prior


def is_free(leaf: Any) -> bool:
    """True for a `Free`, which a pytree's traversal must take as one leaf."""
    return isinstance(leaf, Free)


def free_leaves(tree: Any) -> list[tuple[Any, Free]]:
    """(path, Free) for every free parameter in a pytree, in the pytree's own order."""
    leaves = jax.tree_util.tree_leaves_with_path(tree, is_leaf=is_free)
    return [(path, leaf) for path, leaf in leaves if is_free(leaf)]


def insert(tree: Any, values: Any) -> Any:
    """The pytree with its free parameters replaced by `values`, in the order of `free_leaves`."""
    leaves, structure = jax.tree_util.tree_flatten(tree, is_leaf=is_free)
    numbers = iter(values)
    return jax.tree_util.tree_unflatten(structure, [next(numbers) if is_free(x) else x for x in leaves])


def start_values(tree: Any) -> np.ndarray:
    """The value of each free parameter, shape (parameters,)."""
    return np.array([free.value for _, free in free_leaves(tree)])


def medium(what: Any) -> AbstractDispersion:
    """A medium from a material, a catalogue name or path, a number (n + ik), or a `Free` index.

    Raises ValueError for an absorbing index with k < 0 (gain) and for an unknown name.
    """
    if isinstance(what, AbstractDispersion):
        return what
    if isinstance(what, str):
        return lookup(what)
    if is_free(what):
        return Constant(what)
    if isinstance(what, complex | np.complexfloating):
        if what.imag < 0:
            raise ValueError(
                f"index {what} has a negative imaginary part, which is gain: absorption is n + ik with k ≥ 0"
            )
        return Constant(float(what.real), float(what.imag))
    return Constant(what)


def _not_negative(name: str, number: Any, unit: str) -> None:
    lowest = number.lower if isinstance(number, Free) else number
    if isinstance(lowest, int | float) and lowest < 0:
        raise ValueError(f"{name} must not be negative, got {lowest:g} {unit}")


@final
class Layer(eqx.Module):
    """A coherent layer: its material (anything `medium` takes) and its thickness in nm."""

    material: AbstractDispersion = eqx.field(converter=medium)
    thickness: float | Free
    name: str | None = eqx.field(static=True, default=None)

    def __check_init__(self):
        _not_negative("thickness", self.thickness, "nm")


def _medium_or_none(what: Any) -> AbstractDispersion | None:
    return None if what is None else medium(what)


@final
class Substrate(eqx.Module):
    """What the layer lies on: a half space, or, with `back`, a plate with an incoherent back face.

    `back` is the medium behind the plate and `plate_mm` the plate's thickness in mm.
    """

    material: AbstractDispersion = eqx.field(converter=medium)
    back: AbstractDispersion | None = eqx.field(converter=_medium_or_none, default=None)
    plate_mm: float | Free = 1.0

    def __check_init__(self):
        _not_negative("plate_mm", self.plate_mm, "mm")


@final
class Light(eqx.Module):
    """How the scene is looked at: signal "R", "T" or "psi-delta", polarisation, angle of incidence
    (degrees; one for all or one per wavelength) and wavelengths (nm; None leaves them to the data)."""

    wavelength: Any = None
    angle: Any = 0.0
    signal: str = eqx.field(static=True, default="R")
    polarisation: str = eqx.field(static=True, default="unpolarised")

    def __check_init__(self):
        if self.signal not in SIGNALS:
            raise ValueError(f"signal must be one of {', '.join(SIGNALS)}, not {self.signal!r}")
        check_polarisation(self.polarisation)
        angle = [self.angle.lower, self.angle.upper] if isinstance(self.angle, Free) else self.angle
        if isinstance(angle, int | float | list | np.ndarray):
            wrong = [x for x in np.ravel(angle) if not 0 <= x <= 90]
            if wrong:
                raise ValueError(f"the angle of incidence must lie in 0 to 90 degrees, got {wrong[0]:g}")


def check_polarisation(polarisation: str) -> None:
    """ValueError unless the word is one that we know."""
    if polarisation not in POLARISATIONS:
        raise ValueError(f"polarisation must be one of {', '.join(POLARISATIONS)}, not {polarisation!r}")


@final
class Drift(eqx.Module):
    """A linear nuisance solved exactly in each evaluation: a polynomial in wavelength of a degree.

    Degree 0 is one free number. The coefficients of higher degree shrink under Gaussian priors:
    of degree j, standard deviation `width`·2^(1−j) of the signal's own level.
    """

    degree: int = eqx.field(static=True, default=0)
    width: float = eqx.field(static=True, default=0.3)


SLOW_SCALE, SLOW_OFFSET, ONE_NUMBER = Drift(3), Drift(2), Drift(0)


def scale_word(what: float | str | Drift) -> float | Drift:
    """'free', 'slow' or a number, for the scale."""
    return _word(what, SLOW_SCALE, "scale")


def offset_word(what: float | str | Drift) -> float | Drift:
    """'free', 'slow' or a number, for the offset."""
    return _word(what, SLOW_OFFSET, "offset")


def _word(what, slow, name):
    if what in ("free", "slow"):
        return ONE_NUMBER if what == "free" else slow
    if isinstance(what, str):
        raise ValueError(f"{name} must be 'free', 'slow' or a number, not {what!r}")
    return what


@final
class Instrument(eqx.Module):
    """What the instrument does to the signal.

    `scale` and `offset` are numbers, "free" or "slow"; `bandwidth` is the full width at half maximum
    in nm and `thickness_spread` the standard deviation of the thickness over the spot in nm, None or
    0 being absent.
    """

    scale: float | Drift = eqx.field(converter=scale_word, default=1.0)
    offset: float | Drift = eqx.field(converter=offset_word, default=0.0)
    bandwidth: float | Free | None = None
    thickness_spread: float | Free | None = None

    def __check_init__(self):
        _not_negative("bandwidth", self.bandwidth, "nm")
        _not_negative("thickness_spread", self.thickness_spread, "nm")


def _layers(what: Layer | Sequence[Layer]) -> tuple[Layer, ...]:
    return (what,) if isinstance(what, Layer) else tuple(what)


@final
class Scene(eqx.Module):
    """Layers on a substrate, the medium they are seen from, the light and the instrument.

    `layers` is one `Layer`, or several from the ambient down.

    ```python
    pl.Scene(pl.Layer("SiO2", thickness=pl.Free(lower=10, upper=3000)), substrate="Si")
    ```

    Raises ValueError where the ambient absorbs, or where there is no layer.
    """

    layers: tuple[Layer, ...] = eqx.field(converter=_layers)
    substrate: Substrate = eqx.field(converter=lambda s: s if isinstance(s, Substrate) else Substrate(s))
    ambient: AbstractDispersion = eqx.field(converter=medium, default=1.0)
    light: Light = Light()
    instrument: Instrument = Instrument()

    def __check_init__(self):
        if not self.layers:
            raise ValueError("a scene needs at least one layer; a bare surface is a layer of thickness 0")
        ellipsometric = self.light.signal == "psi-delta"
        if (len(self.layers) > 1 or ellipsometric) and self.instrument.thickness_spread is not None:
            raise ValueError("thickness_spread is known for R and T of one layer only: leave it out here")
        if ellipsometric and self.substrate.back is not None:
            raise ValueError("ellipsometry of a plate's back face is not simulated: leave back out")
        if absorbs(self.ambient):
            raise ValueError("the ambient must not absorb: give it a real index")


def with_wavelength(scene: Scene, wavelength: Any, angle: Any = None) -> Scene:
    """The same scene looked at at other wavelengths (nm), and angles (degrees) if given."""
    angle = scene.light.angle if angle is None else angle
    light = Light(wavelength, angle, scene.light.signal, scene.light.polarisation)
    return eqx.tree_at(lambda s: s.light, scene, light)


def absorbs(dispersion: AbstractDispersion) -> bool:
    """False where the type of the index, or an extinction fixed at exactly 0, rules absorption out."""
    if isinstance(dispersion, Constant) and isinstance(dispersion.k, int | float) and dispersion.k == 0:
        return False
    numbers = insert(dispersion, start_values(dispersion))
    return not is_real(jax.eval_shape(numbers.index, jax.ShapeDtypeStruct((1,), np.float32)))
