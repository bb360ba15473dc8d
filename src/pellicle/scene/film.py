"""Scenes of films: layers on a substrate, the light and the instrument.

Scenes are pytrees of numbers. A `Free`, a parameter to be fitted, may stand in place of any number. None
marks an absent effect, which costs nothing.
"""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar, final

import equinox as eqx
import jax
import numpy as np
from jax.core import Tracer

from pellicle.dispersion.anisotropic import Anisotropic, principal_media, require_isotropic
from pellicle.dispersion.base import AbstractDispersion
from pellicle.errors import UsageError
from pellicle.scene.free import Free, free_leaves, is_free
from pellicle.scene.graded import AtDepth, Graded, face
from pellicle.scene.groups import listed
from pellicle.scene.instrument import Instrument
from pellicle.scene.layers import (
    Interface,
    Layer,
    Plate,
    Quantity,
    Substrate,
    absorbs,
    ambient_medium,
    divided,
)
from pellicle.scene.samples import Sample, as_sample
from pellicle.scene.ties import bound
from pellicle.scene.uncertainty import Uncertainty
from pellicle.signals.base import Signal
from pellicle.signals.contrast import FORMS
from pellicle.signals.registry import SIMULATED, of_light

Whole = TypeVar("Whole")


@final
class Reference(eqx.Module):
    """A known sample: a substrate, bare or below layers.

    **Arguments:** `substrate`: a `Substrate`, or its material; `layers` from the ambient down; `form` of a
    contrast against it: "relative", (R − R₀)/R₀, or "normalised", (R − R₀)/(R + R₀).

    A number may be tied to one of the sample, as the oxide that both have: `Tied("oxide.thickness")`.

    **Raises:** UsageError for another form, and for free parameters.

    >>> Reference("Si", [Layer("SiO2", 285.0)]).form
    'relative'
    """

    substrate: Substrate = eqx.field(converter=lambda s: s if isinstance(s, Substrate) else Substrate(s))
    layers: tuple[Layer | Interface | Plate, ...] = eqx.field(converter=listed, default=())
    form: str = eqx.field(static=True, default="relative")

    def __check_init__(self):
        if self.form not in FORMS:
            raise UsageError(f"`form` must be one of {', '.join(FORMS)}, not {self.form!r}")
        numbers = jax.tree_util.tree_leaves((self.substrate, self.layers), is_leaf=is_free)
        if any(is_free(x) and x.tie is None for x in numbers):
            raise UsageError(
                "a `reference` is known: give its thicknesses and indices as plain numbers, or tie them to"
                ' those of the sample, as in thickness = "oxide.thickness"'
            )


POLARISATIONS = ("unpolarised", "s", "p")


def _listed(value: Any) -> Any:
    """A list or a tuple of numbers as an array; other values as they are."""
    return np.asarray(value, float) if isinstance(value, list | tuple) else value


@final
class Light(eqx.Module):
    """Light and signal of a measurement.

    **Arguments:** `wavelength` in nm (None leaves it to the data); `angle` of incidence in degrees, one or
    one per wavelength (without wavelengths, several that each have all of them, as a recipe and the explorer
    take them); `signal`, "R", "T", "psi-delta", "mueller" or "generalised-psi-delta"; `polarisation`,
    "unpolarised", "s" or "p"; `azimuth` in degrees, one or one per wavelength: the rotation of the sample
    about its normal, clockwise as seen from the side of the light, which adds to the angle φ of every axis
    (None is 0); `transmission`: Ψ and Δ are those of transmitted light, conj(t_p/t_s).

    **Raises:** ValueError for an unknown word, for angles outside 0 to 90 degrees, and for a free azimuth.

    >>> Light(angle=70.0, signal="psi-delta").polarisation
    'unpolarised'
    """

    wavelength: Any = None
    angle: Any = eqx.field(converter=_listed, default=0.0)
    signal: str = eqx.field(static=True, default="R")
    polarisation: str = eqx.field(static=True, default="unpolarised")
    azimuth: Any = eqx.field(converter=_listed, default=None)
    transmission: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        if self.signal not in SIMULATED:
            raise ValueError(f"`signal` must be one of {', '.join(SIMULATED)}, not {self.signal!r}")
        of_light(self.signal, self.transmission)
        check_polarisation(self.polarisation)
        for name in ("wavelength", "angle", "azimuth"):
            if isinstance(getattr(self, name), str):
                raise UsageError(f"`{name}` must be a number or an array, not {getattr(self, name)!r}")
        if isinstance(self.azimuth, Free):
            raise ValueError("`azimuth` of the sample cannot be free: free the angle phi of an axis instead")
        angle = [self.angle.lower, self.angle.upper] if isinstance(self.angle, Free) else self.angle
        if isinstance(angle, int | float | list | np.ndarray):
            wrong = [x for x in np.ravel(angle) if not 0 <= x <= 90]
            if wrong:
                raise ValueError(f"`angle` of incidence must lie in 0 to 90 degrees, got {wrong[0]:g}")

    @property
    def ellipsometric(self) -> bool:
        """True for signals that compare polarisations: Ψ and Δ, also generalised, or Mueller elements."""
        return self.kind.ellipsometric

    @property
    def kind(self) -> Signal:
        """The kind of the signal."""
        return of_light(self.signal, self.transmission)

    @property
    def largest_angle(self) -> float:
        """Largest angle of incidence in degrees, by value or upper bound."""
        return float(self.angle.upper if isinstance(self.angle, Free) else np.max(self.angle))


def check_polarisation(polarisation: str) -> None:
    """Raise ValueError for an unknown polarisation."""
    if polarisation not in POLARISATIONS:
        raise ValueError(f"`polarisation` must be one of {', '.join(POLARISATIONS)}, not {polarisation!r}")


@final
class Scene(eqx.Module):
    """Layers on a substrate, the ambient, the light and the instrument.

    **Arguments:**

    - `layers`: one `Layer`, or several from the ambient down; an `Interface`, a `Plate` or a
      `Group` may be among them.
    - `substrate`: a `Substrate`, or its material.
    - `ambient`: the medium of the incident light, which must not absorb.
    - `light`: a `Light`.
    - `instrument`: an `Instrument`.
    - `reference`: a `Reference`, with which a contrast or raw counts are measured.
    - `uncertainty`: an `Uncertainty` of what the scene states or leaves out; it enters the errors of a fit.
    - `sample`: the name of the sample in a fit of several (`shared` of `pellicle.fit`).

    **Raises:** ValueError where the ambient absorbs, without layers, and where the parts contradict.

    >>> scene = Scene(Layer("SiO2", Free(10, 3000)), "Si", light=Light(angle=30.0))
    >>> scene.layers[0].material.name
    'SiO2'
    """

    layers: tuple[Layer | Interface | Plate, ...] = eqx.field(converter=listed)
    substrate: Substrate = eqx.field(converter=lambda s: s if isinstance(s, Substrate) else Substrate(s))
    ambient: AbstractDispersion = eqx.field(converter=ambient_medium, default=1.0)
    light: Light = Light()
    instrument: Instrument = Instrument()
    uncertainty: Uncertainty = eqx.field(static=True, default=Uncertainty())
    reference: Reference | None = None
    sample: Sample | None = eqx.field(static=True, converter=as_sample, default=None)

    def __check_init__(self):
        for name, part in vars(bound(self)).items():
            object.__setattr__(self, name, part)
        if not self.layers:
            raise ValueError("a scene needs at least one layer; a bare surface is a layer of thickness 0")
        fitted = [x.name for x in self.layers if x.name and free_leaves(x)]  # repeats of a layer share a name
        if twice := [name for name in fitted if fitted.count(name) > 1]:
            raise UsageError(f"two layers are named {twice[0]!r}: give each a name of its own")
        if any(isinstance(a, Interface) and isinstance(b, Interface) for a, b in pairwise(self.layers)):
            raise ValueError("two interfaces are adjacent: an interface mixes the media at its sides")
        thick = [x.material for x in self.layers if isinstance(x, Plate)]
        for medium in (*thick, self.substrate.material, self.substrate.back, self.ambient):
            if isinstance(medium, Graded):
                raise UsageError("a graded medium has a depth: it is the material of a pl.Layer")
        for position, layer in enumerate(self.layers):
            if isinstance(layer, Interface):
                for medium in _neighbours(self, position):
                    require_isotropic(medium, "a mixed interface is made of")
        if absorbs(self.ambient):
            raise ValueError("the ambient must not absorb: give it a real index")
        plates: list[Any] = [x for x in self.layers if isinstance(x, Plate)]
        if self.substrate.back is not None:
            plates.append(self.substrate)
        collected = [x for x in plates if (x.back_collected, x.back_reflections) != (None, None)]
        if collected and len(plates) > 1:
            raise ValueError(
                "`back_collected` and `back_reflections` are for a scene with one plate, and this one has"
                f" {len(plates)}"
            )
        if self.instrument.thickness_spread is not None:
            if len(self.layers) > 1:
                raise ValueError(
                    "with several layers give each its own `thickness_spread`, not the instrument"
                )
            if not any(isinstance(x, Layer) and x.thickness_spread is None for x in self.layers):
                raise ValueError("`thickness_spread` is given twice, or without a coherent layer")
        if self.instrument.has_cone and not isinstance(self.light.angle, Tracer):
            ambient = getattr(self.ambient, "n", None)
            known = isinstance(ambient, int | float)
            half_angle = math.degrees(self.instrument.largest_half_angle(ambient if known else 1.0))
            if known and half_angle >= 90:
                raise UsageError(
                    "`numerical_aperture` is the index of the ambient times the sine of the half angle of the"
                    f" cone: it must be below {ambient:g}"
                )
            if self.light.largest_angle + half_angle > 90:
                raise ValueError(
                    f"the cone of light reaches beyond 90 degrees: {self.light.largest_angle:g} and a half "
                    f"angle of {half_angle:.3g}"
                )


class CoherentLayers(NamedTuple):
    """Coherent layers between two thick media, and the roughness of each face from the top down.

    Layers of a `Group` stand there once.
    """

    above: AbstractDispersion
    layers: tuple[Layer, ...]
    below: AbstractDispersion
    roughness: tuple[Quantity | None, ...]


def groups(scene: Scene) -> tuple[tuple[CoherentLayers, ...], tuple[Plate, ...]]:
    """Return the coherent groups from the ambient down, and the plates between them."""
    substrate = scene.substrate
    plates = [layer for layer in scene.layers if isinstance(layer, Plate)]
    if substrate.back is not None:
        part = substrate.back_collected, substrate.back_reflections
        plates.append(Plate(substrate.material, substrate.plate_mm, None, *part))
    runs: list[list[Layer]] = [[]]
    for position, item in enumerate(scene.layers):
        if isinstance(item, Plate):
            runs.append([])
        elif isinstance(item, Layer):
            runs[-1].append(item)
        else:
            runs[-1].extend(item.slices(*_neighbours(scene, position)))
    foot = len(runs) - 1  # the group that ends on the substrate's upper face
    if substrate.back is not None:
        runs.append([])
    last = substrate.material if substrate.back is None else substrate.back
    media = [scene.ambient, *(plate.material for plate in plates), last]
    feet = [substrate.roughness if i == foot else None for i in range(len(runs))]
    coherent = [
        CoherentLayers(above, tuple(run), below, (*(layer.roughness for layer in run), roughness))
        for above, run, below, roughness in zip(media[:-1], runs, media[1:], feet, strict=True)
    ]
    return tuple(coherent), tuple(plates)


def all_collected(scene: Scene) -> Scene:
    """Return the scene with all light from its plates collected by the detector."""
    everything = {"back_collected": None, "back_reflections": None}
    layers = tuple(replace(x, **everything) if isinstance(x, Plate) else x for x in scene.layers)
    return replace(scene, layers=layers, substrate=replace(scene.substrate, **everything))


def _neighbours(scene: Scene, position: int) -> tuple[AbstractDispersion, AbstractDispersion]:
    media = [scene.ambient, *(getattr(x, "material", None) for x in scene.layers), scene.substrate.material]
    above, below = media[position], media[position + 2]
    assert above is not None and below is not None  # two interfaces are never adjacent  # noqa: PT018
    return face(above, 1.0), face(below, 0.0)


def of_reference(scene: Scene) -> Scene:
    """Return the scene of the reference, in the same light and instrument. Raises UsageError without one."""
    reference, light = scene.reference, scene.light
    if reference is None:
        raise UsageError(
            f"the signal {light.signal} needs a reference: give the scene `reference=pl.Reference(...)`, or a"
            " recipe [reference] with its substrate"
        )
    reference = jax.tree_util.tree_map(_untied, reference, is_leaf=is_free)
    instrument = {"scale": 1.0, "offset": 0.0, "thickness_spread": None, "stray_light": None}
    return unchecked(
        scene,
        layers=reference.layers or (Layer(1.0, 0.0),),
        substrate=reference.substrate,
        light=Light(light.wavelength, light.angle, "R", light.polarisation, light.azimuth),
        instrument=replace(scene.instrument, **instrument),
        reference=None,
    )


def unchecked(whole: Whole, **parts: Any) -> Whole:
    """Return a scene, or a reference, with other parts, without checks: its numbers may have bounds that
    nobody chose, as an aperture of 0 to 1 beside an oblique angle."""
    other = object.__new__(type(whole))
    for name, own in (vars(whole) | parts).items():
        object.__setattr__(other, name, own)
    return other


def _untied(number: Any) -> Any:
    """A tied number as a free one of its bounds, for a part of a scene that lacks what it is tied to."""
    if not is_free(number) or number.tie is None:
        return number
    if not number.lower < number.upper:
        return number.start
    return Free(number.lower, number.upper, start=number.start)


def media(scene: Scene) -> list[AbstractDispersion]:
    """Return every medium of a scene: of its layers, the substrate, the ambient, and that behind a plate.

    Of a graded layer both of its media, of an anisotropic medium the principal ones.
    """
    back = [] if scene.substrate.back is None else [scene.substrate.back]
    layers = [layer.material for layer in scene.layers if not isinstance(layer, Interface)]
    of_layers = [part for x in layers for part in ((x.first, x.second) if isinstance(x, Graded) else (x,))]
    every = (*of_layers, scene.substrate.material, scene.ambient, *back)
    return [principal for medium in every for principal in principal_media(medium)]


def is_graded(scene: Scene) -> bool:
    """Return True where the index of a layer varies with depth."""
    return any(isinstance(layer, Layer) and isinstance(layer.material, Graded) for layer in scene.layers)


def sliced(scene: Scene, count: int) -> Scene:
    """Return the scene with every graded layer replaced by `count` homogeneous slices of it."""
    layers: list[Any] = []
    for layer in scene.layers:
        if not (isinstance(layer, Layer) and isinstance(layer.material, Graded)):
            layers.append(layer)
            continue
        for i in range(count):
            rough = layer.roughness if i == 0 else None
            medium = AtDepth(layer.material, (i + 0.5) / count)
            layers.append(Layer(medium, divided(layer.thickness, count), layer.name, roughness=rough))
    return eqx.tree_at(lambda s: s.layers, scene, tuple(layers))


def coherent_layers(scene: Scene) -> tuple[Layer, ...]:
    """Return every coherent layer from the ambient down, interfaces as their slices.

    A layer of a `Group` is returned once, with the thickness and its spread of all repeats.
    """
    every = (layer for group in groups(scene)[0] for layer in group.layers)
    return tuple(layer if layer.repeats == 1 else in_all_repeats(layer) for layer in every)


def in_all_repeats(layer: Layer) -> Layer:
    """Return a layer with the thickness and the spread of all its repeats."""
    spread = None if layer.thickness_spread is None else divided(layer.thickness_spread, 1 / layer.repeats)
    return replace(layer, thickness=divided(layer.thickness, 1 / layer.repeats), thickness_spread=spread)


def thickness_spread(scene: Scene, layer: Layer) -> Quantity | None:
    """Return the standard deviation of a layer's thickness in nm: its own, or the instrument's; None if 0."""
    return scene.instrument.thickness_spread if layer.thickness_spread is None else layer.thickness_spread


def turned(scene: Scene, against: Any = None) -> Scene:
    """Return a scene of numbers with its anisotropic media turned by the azimuth of its light.

    In the frame of a ray whose plane of incidence has the azimuth `against` (degrees), they turn back by it.
    """
    azimuth = scene.light.azimuth
    if against is not None:
        azimuth = -against if azimuth is None else azimuth - against
    if azimuth is None:
        return scene
    anisotropic = lambda x: isinstance(x, Anisotropic)  # noqa: E731
    turn = lambda x: x.turned(azimuth) if anisotropic(x) else x  # noqa: E731
    return jax.tree_util.tree_map(turn, scene, is_leaf=anisotropic)


def with_wavelength(scene: Scene, wavelength: Any, angle: Any = None, azimuth: Any = None) -> Scene:
    """Return the scene with other wavelengths (nm), and other angles and azimuths (degrees) if given."""
    light = scene.light
    angle, azimuth = light.angle if angle is None else angle, light.azimuth if azimuth is None else azimuth
    light = replace(light, wavelength=wavelength, angle=angle, azimuth=azimuth)
    return eqx.tree_at(lambda s: s.light, scene, light)
