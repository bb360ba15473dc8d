"""Usual mistakes of data and scenes, as changes of the targets of a fit, with what states them.

A unit, a reflectance relative to a wafer, an angle of incidence, a substrate or a layer other than stated.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np

from pellicle.dispersion.base import AbstractDispersion, known_index
from pellicle.errors import DataError
from pellicle.fitting.film.problem import Measured
from pellicle.materials import Material, material
from pellicle.optics.pair import Pair, imag, is_real, real, to_complex
from pellicle.scene.film import Scene, with_wavelength
from pellicle.scene.free import Free, free_leaves, is_free
from pellicle.scene.layers import Interface, Layer, Substrate

_FAMILIES = (
    ("SiO2", "Al2O3", "Si3N4", "TiO2", "Ta2O5", "HfO2", "ZrO2", "Nb2O5", "Y2O3", "AlN", "MgF2", "ZnO"),
    ("PMMA", "polystyrene", "polycarbonate", "PDMS", "SU-8", "PET"),
)
_SUBSTRATES = ("Si", "BK7", "SiO2", "Al2O3", "Al", "Ge", "GaAs", "stainless-steel", "Ag", "Au", "Cr")
_CLEAR, _WIDER, _BLACK = 1e-4, 4.0, 1e-3
"""Extinction of a substrate up to which light returns from its lower face, the factor on bounds, and the
least reflectance of a reference."""


class Mistake(NamedTuple):
    """A mistake: what holds in its place, in words, what states that, and the change of a target by it.

    It is tried at each of the `values`, between them too where they are an array. `words` and `remedy` have a
    place {} for that, or for the fitted number whose name has `key`. `effects` begin the names of systematic
    effects that point to it, and that are not the cause where it is not.
    """

    words: str
    remedy: str
    effects: tuple[str, ...]
    change: Callable[[Measured, Any], Measured]
    values: Sequence[Any] | np.ndarray = (0.0,)
    key: str = ""

    @property
    def stage(self) -> str:
        """`try an offset of …`, as progress of the fit."""
        return f"try {re.sub('{[^}]*}', '…', self.words)}"


class _InForm(AbstractDispersion):
    """Index of a medium times a factor, real or complex, so that it runs in the program of another medium."""

    medium: AbstractDispersion
    clear: bool = eqx.field(static=True)
    factor: float

    def index(self, wavelength):
        value = self.factor * self.medium.index(wavelength)
        return real(value) if self.clear else Pair(real(value), imag(value) + 0 * real(value))


def of_light(targets: list[Measured]) -> list[Mistake]:
    """Mistakes of units, calibration and light, whose fits run the same programs."""
    nm = "set `wavelength_shift = {:.3g}` under `[instrument]`"
    shift = "wavelengths that are {:+.3g} nm off"
    rows = [Mistake(shift, nm, ("wavelength shift",), _shifted, np.linspace(-16, 16, 9))]
    angles = [target.scene.light.angle for target in targets]
    if not any(map(is_free, angles)) and any(np.any(x) for x in angles):
        words, remedy = (
            "an angle of incidence that is {:+.3g} degrees off",
            "set `angle_shift = {:.3g}` under `[instrument]`",
        )
        rows.append(Mistake(words, remedy, ("angle of incidence",), _turned, np.linspace(-6, 6, 9)))
    if not all(target.signal.has_scale for target in targets):
        return rows
    rows += [
        Mistake(
            "values times {:g}",
            'give `signal_unit="fraction"` or `signal_unit="percent"`',
            (),
            _times,
            (100.0, 0.01),
        ),
        Mistake("a scale of {:.3g}", 'give `scale="free"`', ("scale",), _over, np.geomspace(0.5, 2, 9)),
        Mistake("an offset of {:.2g}", 'give `offset="free"`', ("offset",), _less, np.linspace(-0.1, 0.1, 9)),
    ]
    scene = targets[0].scene
    if all(target.scene.light.signal == "R" for target in targets) and not free_leaves(scene.ambient):
        words, remedy = "values relative to bare {}", 'state `[reference] substrate = "{}"` in the recipe'
        known = [x.name for x in [scene.substrate.material] if isinstance(x, Material)]
        rows.insert(0, Mistake(words, remedy, (), _relative, tuple(dict.fromkeys([*known, "Si", "Al"]))))
    return rows


def of_media(targets: list[Measured], depth: int | None) -> list[Mistake]:
    """Mistakes of the substrate, of the layer at `depth` and its bounds, whose fits run the same programs."""
    scene, rows = targets[0].scene, []
    index, check = (
        "an index of the {} that is {{:.3g}} times the stated one",
        "check its material, or free its index",
    )
    if not free_leaves(scene.substrate.material):
        of = ("index of the substrate",)
        rows += [
            Mistake(index.format("substrate"), check, of, _on, np.geomspace(0.6, 1 / 0.6, 9)),
            Mistake("{} as the substrate", 'give `substrate="{}"`', of, _on, _SUBSTRATES),
        ]
    layer = None if depth is None else scene.layers[depth]
    if not isinstance(layer, Layer):
        return rows
    own, of = layer.material, ("index of the layer", f"index of {layer.name or f'layer{(depth or 0) + 1}'}")
    if not free_leaves(own):
        change = partial(_made_of, i=depth)
        rows.append(Mistake(index.format("layer"), check, of, change, np.geomspace(0.78, 1 / 0.78, 9)))
        family = next((x for x in _FAMILIES if getattr(own, "name", "") in x), ())
        rows.append(Mistake("a layer of {}", 'give `layer="{}"`', of, change, family))
    if is_free(free := layer.thickness):
        wider = Free(free.lower / _WIDER, _WIDER * free.upper, prior=free.prior)
        words, remedy = (
            "bounds that are {:g} times wider",
            f"give `thickness=Free({wider.lower:g}, {wider.upper:g})`",
        )
        change = _scene(lambda s: _with_layer(s, depth, thickness=wider))
        rows.append(Mistake(words, remedy, (), change, (_WIDER,)))
    return rows


def of_structure(targets: list[Measured]) -> list[Mistake]:
    """Mistakes whose fits take a program of their own: back faces, widths, layers beneath and their order."""
    scene, power = targets[0].scene, all(target.signal.has_scale for target in targets)
    first: Any = scene.layers[0]
    k = imag(known_index(scene.substrate.material, np.asarray(targets[0].wavelength)))
    rows = [*_back_face(scene.substrate, bool(np.median(k) < _CLEAR))] if power else []
    if scene.instrument.thickness_spread is None and len(scene.layers) == 1:
        rows.append(_width("thickness_spread", 150.0))
    if scene.instrument.bandwidth is None:
        rows.append(_width("bandwidth", 40.0))
    if len(scene.layers) > 1:
        swapped = _scene(lambda s: replace(s, layers=s.layers[::-1]))
        rows.append(Mistake("layers in the opposite order", "swap them", ("index of layer",), swapped))
    if isinstance(first, Layer) and first.roughness is None:
        rows.append(_rough(power))
    oxide, remedy = Layer("SiO2", Free(0, 300), "oxide"), "add a `[[scene.layer]]` of SiO2"
    below = _scene(lambda s: replace(s, layers=(*s.layers, oxide)))
    words = "{:.3g} nm of SiO2 under the layer"
    return [*rows, Mistake(words, remedy, ("native oxide",), below, key="oxide.thickness")]


def _back_face(substrate: Substrate, clear: bool) -> Iterator[Mistake]:
    """Light from the lower face of a substrate: all of it, where it is clear, or another share."""

    def with_plate(plate: Substrate) -> Callable[[Measured, Any], Measured]:
        return _scene(lambda s: replace(s, substrate=plate))

    effects = "offset", "scale"
    if substrate.back is not None and substrate.back_collected is None:
        shared = with_plate(replace(substrate, back_collected=Free(0, 1)))
        words = "a share of {:.2g} of the light from the back face"
        yield Mistake(words, "give `back_collected=Free(0, 1)`", effects, shared, key="back_collected")
    elif clear:
        plate = with_plate(Substrate(substrate.material, back="air"))
        yield Mistake("a back face", 'give `back="air"`', effects, plate)


def _width(key: str, most: float) -> Mistake:
    """A width of the instrument or of the spot that is free up to `most` nm."""
    free, words = {key: Free(0, most, start=most / 10)}, key.replace("_", " ")
    remedy = f"set `{key} = {{{{ lower = 0, upper = {most:g} }}}}` under `[instrument]`"
    change = _scene(lambda s: replace(s, instrument=replace(s.instrument, **free)))
    return Mistake(f"a {words} of {{:.3g}} nm", remedy, (words,), change, key=key)


def _rough(power: bool) -> Mistake:
    """A rough upper face: less light in R and T; no ratio changes by that, but by a zone of film and air."""
    effects = "roughness", "overlayer"
    if power:
        change = _scene(lambda s: _with_layer(s, 0, roughness=Free(0, 30, start=3)))
        remedy = "set `roughness = {{ lower = 0, upper = 30 }}` of the layer"
        return Mistake("a roughness of {:.3g} nm", remedy, effects, change, key="roughness")
    zone = Interface(Free(0, 60, start=5), name="rough")
    change = _scene(lambda s: replace(s, layers=(zone, *s.layers)))
    remedy = 'add a `[[scene.layer]]` on top, with `between = "bruggeman"`'
    return Mistake("{:.3g} nm of rough surface", remedy, effects, change, key="rough.thickness")


def _scene(change: Callable[[Scene], Scene]) -> Callable[[Measured, Any], Measured]:
    return lambda target, value: target._replace(scene=change(target.scene))


def _with_layer(scene: Scene, i: int | None, **changes: Any) -> Scene:
    layers: list[Any] = list(scene.layers)
    layers[i or 0] = replace(layers[i or 0], **changes)
    return replace(scene, layers=tuple(layers))


def _times(target: Measured, factor: Any) -> Measured:
    return target._replace(values=target.values * factor, sigma=target.sigma * factor)


def _over(target: Measured, scale: float) -> Measured:
    return _times(target, 1 / scale)


def _less(target: Measured, offset: float) -> Measured:
    return target._replace(values=target.values - offset)


def _shifted(target: Measured, nm: float) -> Measured:
    moved = target.wavelength + nm
    return target._replace(wavelength=moved, scene=with_wavelength(target.scene, moved))


def _turned(target: Measured, degrees: float) -> Measured:
    angle = np.clip(target.scene.light.angle + degrees, 0, 89.9)
    return target._replace(scene=eqx.tree_at(lambda s: s.light.angle, target.scene, angle))


def _other(own: Any, target: Measured, value: str | float) -> AbstractDispersion:
    """A material, or a medium times a factor, in the form of the medium. DataError outside its range."""
    medium = material(value) if isinstance(value, str) else own
    if isinstance(medium, Material):
        medium.check_range(target.wavelength)
    clear = is_real(known_index(own, target.wavelength))
    return _InForm(medium, clear, 1.0 if isinstance(value, str) else value)


def _on(target: Measured, value: str | float) -> Measured:
    substrate = target.scene.substrate
    substrate = replace(substrate, material=_other(substrate.material, target, value))
    return target._replace(scene=replace(target.scene, substrate=substrate))


def _made_of(target: Measured, value: str | float, i: int | None) -> Measured:
    own: Any = target.scene.layers[i or 0]
    return target._replace(scene=_with_layer(target.scene, i, material=_other(own.material, target, value)))


def _relative(target: Measured, name: str) -> Measured:
    """Values times the reflectance of a bare surface, by Fresnel's equations. DataError if that is none."""
    light, medium = target.scene.light, material(name)
    if isinstance(medium, Material):
        medium.check_range(target.wavelength)
    media = target.scene.ambient, medium
    first, n = (np.asarray(to_complex(known_index(x, target.wavelength))) for x in media)
    sine = first * np.sin(np.deg2rad(light.angle))
    above, below = np.sqrt(first**2 - sine**2), np.sqrt(n**2 - sine**2)
    s = (above - below) / (above + below)
    p = (n**2 * above - first**2 * below) / (n**2 * above + first**2 * below)
    parts = {"s": (s,), "p": (p,)}.get(light.polarisation, (s, p))
    reflected = np.mean(np.abs(parts) ** 2, axis=0)
    if np.min(reflected) < _BLACK:
        raise DataError(f"bare {name} reflects too little for a reference")
    return _times(target, reflected)
