"""Surfaces: a BRDF model by name, with each of its numbers fixed or free, and indices of its media.

`check_scene` is for verbs that take a film or a surface.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, Protocol, final, runtime_checkable

import equinox as eqx
import numpy as np

from pellicle.brdf.directions import direction
from pellicle.brdf.models import Model, Parameter, model
from pellicle.brdf.sensor_bands import Quadrature, quadrature
from pellicle.colour.observers import Sensor
from pellicle.data.brdf_samples import spread
from pellicle.dispersion.base import known_index
from pellicle.errors import UsageError, did_you_mean
from pellicle.materials import materials_in
from pellicle.optics.pair import imag, real
from pellicle.scene.film import Scene
from pellicle.scene.free import Free, free_leaves
from pellicle.scene.layers import Interface, Layer, MediumLike, Plate, medium
from pellicle.scene.uncertainty import StandardUncertainties

KEYS = {"film": ("n", "k"), "base": ("base_n", "base_k")}
"""Keys of the index of each part of a surface."""
CLEAR = 1e-4
"""Extinction below which a medium counts as clear in a model whose film or base cannot absorb: over 1000 nm
it absorbs 0.3 % of blue light."""


def index_numbers(
    part: str, value: MediumLike | None, nm: np.ndarray, numbers: Mapping[str, Any], brdf: Model
) -> dict[str, np.ndarray]:
    """Return n and k of the `part` "film" or "base" of a model at wavelengths `nm`, by the model's keys.

    Empty without a medium.

    **Raises:** UsageError where the model has no such part, and where it is given twice, free, or absorbs in
    a model that has no extinction for it; ValueError for an unknown medium and for missing data.
    """
    if value is None:
        return {}
    n_key, k_key = KEYS[part]
    known = {parameter.key for parameter in brdf.parameters}
    if n_key not in known:
        raise UsageError(f"{brdf.name} has no {part}: its lower boundary reflects everything")
    if clash := {n_key, k_key} & numbers.keys():
        raise UsageError(f"{part} and {' and '.join(sorted(clash))} exclude each other")
    dispersion = medium(value)
    if free_leaves(dispersion):
        keys = " and ".join(key for key in KEYS[part] if key in known)
        raise UsageError(f"{part} cannot be free: give {keys} with bounds of their own in its place")
    for material in materials_in(dispersion):
        material.check_range(nm)
    index = known_index(dispersion, nm)
    n, k = (np.broadcast_to(np.asarray(part_of(index), float), nm.shape) for part_of in (real, imag))
    if not (np.all(np.isfinite(n)) and np.all(np.isfinite(k))):
        raise UsageError(f"{part}: its index is not finite at {nm.min():g} to {nm.max():g} nm")
    if k_key in known:
        return {n_key: n, k_key: k}
    if np.max(k) > CLEAR:
        raise UsageError(
            f"{part}: {brdf.name} knows no extinction there, and this medium has k up to {np.max(k):.2g}"
        )
    return {n_key: n}


@dataclass(frozen=True)
class SurfaceUncertainty(StandardUncertainties):
    """Standard uncertainties of numbers that a surface states, and usual sizes of effects that it leaves out.

    The defaults are those of ordinary samples and cameras. 0 is a number that is known, or an effect that is
    known to be absent. What a surface has as a free parameter does not count.

    **Arguments:**

    - `index`: relative, of the given index of the film.
    - `base`: relative, of the given index and of the given extinction of the base.
    - `gain`: relative, of each channel.
    - `band`: of the wavelength of each channel, in nm.
    - `bandwidth`: full width at half maximum of the band of a channel that is one wavelength, in nm.
    - `thickness_spread`: standard deviation of the thickness over the measured area, relative.
    - `angle`: of the angles from the normal to the light and to the viewer, in degrees.

    **Raises:** ValueError for a negative or infinite number.

    >>> SurfaceUncertainty(band=1.0).index
    0.005
    """

    index: float = 0.005
    base: float = 0.02
    gain: float = 0.02
    band: float = 5.0
    bandwidth: float = 20.0
    thickness_spread: float = 0.02
    angle: float = 0.5


LETTERS = ("r", "g", "b")
INDICES = ("ambient_n", "n", "k", "base_n", "base_k")
"""Keys that may have one number for each channel."""


class FreeNumber(NamedTuple):
    """One free number: the `n_g` of the key `n`, its bounds, and its entry in the model's table."""

    name: str
    key: str
    channel: int | None
    free: Free
    parameter: Parameter

    @property
    def log(self) -> bool:
        """True where the search runs over the logarithm."""
        return self.parameter.log and self.free.lower > 0


@dataclass(frozen=True)
class Surface:
    """A surface: a BRDF model by name, with its numbers.

    **Arguments:**

    - `model`: a name such as "microfacet-film".
    - `numbers`: for each key of the model one number, one number per channel or a `Free`; missing keys keep
      the model's defaults, fixed. A `Free` of a key that differs between channels becomes `n_r`, `n_g` and
      `n_b`.
    - `wavelengths` in nm, one for each channel of the samples; the model's own if None.
    - `sensor`, in place of `wavelengths`: the bands of each channel, as `pellicle.colour.sensor` returns
      those of an observer and `pellicle.colour.camera_sensor` those of a camera. Every channel of a white
      surface is the same. An index is then one number for all wavelengths, or that of a medium.
    - `film`, `base`: media of the film and of the base, in place of `n` and `k`, `base_n` and `base_k`: a
      name of the catalogue, a file of n and k, or a dispersion without free parameters.
    - `uncertainty`: a `SurfaceUncertainty` of what the surface states or leaves out; it enters the errors of
      a fit.

    **Raises:** UsageError for an unknown name or key, a number that no surface has, and where the count of
    numbers does not match;
    ValueError for an unknown medium, or one without data at a wavelength.

    >>> surface = Surface("microfacet-film", {"thickness": Free(0, 500), "n": [1.5, 1.52, 1.54]}, base="Si")
    >>> [number.name for number in surface.free_numbers()]
    ['thickness']
    """

    model: str
    numbers: Mapping[str, float | Sequence[float] | Free] = field(default_factory=dict)
    wavelengths: tuple[float, ...] | None = None
    sensor: Sensor | None = None
    film: MediumLike | None = None
    base: MediumLike | None = None
    uncertainty: SurfaceUncertainty = SurfaceUncertainty()

    def __post_init__(self) -> None:
        try:
            known = [p.key for p in self.brdf.parameters]
        except ValueError as error:
            raise UsageError(str(error)) from None
        if self.sensor is not None and self.wavelengths is not None:
            raise UsageError("a surface has either wavelengths or a sensor, whose bands have their own")
        for key, value in self.numbers.items():
            if key not in known:
                raise UsageError(
                    f"{self.model} has no {key!r}{did_you_mean(key, known)}; it has {', '.join(known)}"
                )
            count = np.size(value) if not isinstance(value, Free) else 1
            if key not in INDICES and count != 1:
                raise UsageError(f"{key}: one number for all channels was expected, got {count}")
            if count != 1 and self.sensor is not None:
                raise UsageError(f"{key}: {count} numbers for bands of wavelengths; give one, or a medium")
            if count not in (1, self.channels):
                raise UsageError(f"{key}: {count} numbers for {self.channels} wavelengths; give one or each")
            _check_sign(next(p for p in self.brdf.parameters if p.key == key), value)
        _ = self.bands, self.media

    @property
    def brdf(self) -> Model:
        """The BRDF model."""
        return model(self.model)

    @property
    def channels(self) -> int:
        """Number of channels."""
        if self.sensor is not None:
            return self.sensor.weights.shape[1]
        return len(self.brdf.wavelengths if self.wavelengths is None else self.wavelengths)

    @property
    def channel_wavelengths(self) -> tuple[float, ...]:
        """Wavelength of each channel in nm, the mean of its band with a sensor."""
        return tuple((self.bands.wavelength @ self.bands.weights).tolist())

    @cached_property
    def bands(self) -> Quadrature:
        """Wavelengths (N,) in nm and their weights (N, channels): few of a sensor, one of each channel
        without one."""
        if self.sensor is None:
            nm = self.brdf.wavelengths if self.wavelengths is None else self.wavelengths
            return Quadrature(np.array(nm, float), np.eye(len(nm)))
        table = np.asarray(self.sensor.wavelength, float), np.asarray(self.sensor.weights, float)
        thickest, index = self._largest("thickness"), self._largest("n")
        if self.film is not None:
            index = float(np.max(self._index("film", table[0])["n"]))
        return quadrature(*table, thickest * index)

    @cached_property
    def media(self) -> dict[str, np.ndarray]:
        """The numbers of `film` and `base`, (wavelengths,)."""
        nm = self.bands.wavelength
        return {key: x for part in ("film", "base") for key, x in self._index(part, nm).items()}

    def _index(self, part: str, nm: np.ndarray) -> dict[str, np.ndarray]:
        return index_numbers(part, getattr(self, part), nm, self.numbers, self.brdf)

    def _largest(self, key: str) -> float:
        default = next(p.value for p in self.brdf.parameters if p.key == key)
        value: Any = self.numbers.get(key, default)
        return float(value.upper if isinstance(value, Free) else np.max(value))

    def free_numbers(self) -> tuple[FreeNumber, ...]:
        """Return every free number, in the model's order."""
        return tuple(number for parameter in self.brdf.parameters for number in self._free(parameter))

    def _free(self, parameter: Parameter) -> list[FreeNumber]:
        key, value = parameter.key, self.numbers.get(parameter.key)
        if not isinstance(value, Free):
            return []
        if not parameter.per_channel or self.channels == 1 or self.sensor is not None:
            return [FreeNumber(key, key, None, value, parameter)]
        names = LETTERS if self.channels == 3 else [str(c + 1) for c in range(self.channels)]
        return [FreeNumber(f"{key}_{name}", key, c, value, parameter) for c, name in enumerate(names)]

    def fixed_numbers(self) -> dict[str, np.ndarray]:
        """Return every fixed number as an array () or (wavelengths,), and the wavelengths; with a sensor also
        their weights (wavelengths, channels)."""
        fixed = {"wavelengths": self.bands.wavelength}
        if self.sensor is not None:
            fixed["weights"] = self.bands.weights
        for parameter in self.brdf.parameters:
            value: Any = self.numbers.get(parameter.key, parameter.value)
            if isinstance(value, Free) or parameter.key in self.media:
                continue
            default = parameter.key not in self.numbers and parameter.per_channel
            number = np.asarray(value[0] if default else value, dtype=float)
            fixed[parameter.key] = number if parameter.key in INDICES else number.reshape(())
        return fixed | self.media

    def start_numbers(self) -> dict[str, np.ndarray]:
        """Return every number as an array, free ones at their start values."""
        free = {key: np.asarray(x.start) for key, x in self.numbers.items() if isinstance(x, Free)}
        return self.fixed_numbers() | free

    def at_start(self) -> Surface:
        """Return the surface with its free numbers fixed at their start values."""
        start = {key: x.start if isinstance(x, Free) else x for key, x in self.numbers.items()}
        return replace(self, numbers=start)


def _check_sign(parameter: Parameter, value: Any) -> None:
    """Raise UsageError for a number that no surface has, such as a negative thickness."""
    key, free = parameter.key, isinstance(value, Free)
    try:
        numbers = np.asarray(value.lower if free else value, float)
    except (TypeError, ValueError):
        raise UsageError(f"{key} must be a number, got {value!r}") from None
    if not free and not np.all(np.isfinite(numbers)):
        raise UsageError(f"{key} must be finite, got {value}")
    if parameter.lower >= 0 and np.any(numbers < 0):
        raise UsageError(f"{key} must not be negative, got {np.min(numbers):g} {parameter.unit}".rstrip())
    if parameter.lower > 0 and not free and np.any(numbers == 0):
        raise UsageError(f"{key} must be above 0")


VIEW_DIRECTIONS = 256
"""Directions at which a plan compares models, spread over those of the samples."""

LAYERED = ("granier-heidrich-diffuse", "granier-heidrich-full")
"""Models whose diffuse part has passed through the layer."""

ZERO_IS_ABSENT = ("k", "base_k", "deviation", "multiple_scattering", "specular", "coat", "diffuse")
"""Keys whose effect is absent where they are fixed at zero."""


@runtime_checkable
class HasDirections(Protocol):
    """Directions to light and viewer, degrees from the normal and around it, each (samples,).

    `Directions` and `BrdfSamples` are of this kind.
    """

    @property
    def theta_i(self) -> np.ndarray: ...
    @property
    def phi_i(self) -> np.ndarray: ...
    @property
    def theta_o(self) -> np.ndarray: ...
    @property
    def phi_o(self) -> np.ndarray: ...


@final
class SurfaceView(eqx.Module):
    """A surface along given directions: numbers of its model and unit vectors to light and viewer.

    `numbers` leaves out effects fixed at zero; some are `Free`. A number per wavelength is an array, or a
    list where it is free. `i` and `o` have shape (samples, 3). The other fields are effects without a number
    of their own that a plan may leave out.
    """

    model: str = eqx.field(static=True)
    numbers: dict[str, Any]
    i: Any
    o: Any
    coherent: bool = eqx.field(static=True, default=True)
    oblique: bool = eqx.field(static=True, default=True)
    polarisation: str = eqx.field(static=True, default="unpolarised")

    @property
    def brdf(self) -> Model:
        """The BRDF model."""
        return model(self.model)

    @property
    def layered(self) -> bool:
        """True where the layer affects the BRDF; a grey diffuse part alone does not show it."""
        return "specular" in self.numbers or self.model in LAYERED

    @property
    def channels(self) -> int:
        """Number of channels."""
        weights = self.numbers.get("weights")
        return np.shape(self.numbers["wavelengths"])[0] if weights is None else np.shape(weights)[1]


def surface_view(surface: Surface, directions: HasDirections, count: int = VIEW_DIRECTIONS) -> SurfaceView:
    """Return the surface along at most `count` of the directions.

    Raises UsageError for a surface that reflects nothing.
    """
    numbers = nonzero_numbers(surface)
    weights = {p.key for p in surface.brdf.parameters if p.linear}
    if not weights & numbers.keys():
        zero = ", ".join(sorted(weights, reverse=True))
        raise UsageError(f"there is nothing to compute: the surface reflects nothing ({zero} 0)")
    rows = spread(len(directions.theta_i), count)
    i, o = (
        direction(theta[rows], phi[rows], np)
        for theta, phi in ((directions.theta_i, directions.phi_i), (directions.theta_o, directions.phi_o))
    )
    return SurfaceView(surface.model, numbers, i, o)


def nonzero_numbers(surface: Surface) -> dict[str, Any]:
    """Return the surface's numbers, fixed and `Free`, without those of effects fixed at zero."""
    numbers: dict[str, Any] = dict(surface.fixed_numbers())
    absent = {key for key in ZERO_IS_ABSENT if key in numbers and not np.any(numbers[key])}
    absent |= {"azimuth"} if "deviation" in absent else set()
    for number in surface.free_numbers():
        value = number.free if number.channel is None else [*numbers.get(number.key, []), number.free]
        numbers[number.key] = value
    return {key: x for key, x in numbers.items() if key not in absent}


def check_scene(scene: Any, several: bool = False) -> None:
    """Raise UsageError unless `scene` is a `Scene` or a `Surface`, or with `several` a list of scenes.

    The message has the call that makes one.
    """
    kinds = "a Scene, a Surface or a list of scenes" if several else "a Scene or a Surface"
    for each in scene if several and isinstance(scene, list | tuple) else [scene]:
        if isinstance(each, Scene | Surface):
            continue
        name, remedy = type(each).__name__, "pl.Scene(pl.Layer(material, thickness), substrate) makes one"
        if isinstance(each, str | os.PathLike):
            name = repr(os.fspath(each))
            remedy = f"a recipe gives one by pl.read_recipe({name}).scene()"
        elif isinstance(each, Layer | Interface | Plate):
            remedy = "give it a substrate, as in pl.Scene(layer, 'Si')"
        elif callable(getattr(each, "scene", None)):
            remedy = "its .scene() is one"
        raise UsageError(f"`scene` must be {kinds}, not {name}: {remedy}")


def refuse(kind: str, **arguments: Any) -> None:
    """Raise TypeError where an argument of the other kind of scene is given."""
    for name, value in arguments.items():
        if value is not None:
            raise TypeError(f"`{name}` has no meaning for {kind}")
