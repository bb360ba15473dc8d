"""A fitted scene with further numbers: one for each systematic effect of light and sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.dispersion.empirical import Constant
from pellicle.effects.film_plan import exact
from pellicle.effects.presence import computes_roughness, scene_media
from pellicle.fitting.evaluation import share_without_slopes
from pellicle.fitting.film.changed_media import (
    OXIDE_INDEX,
    AllowedEffects,
    allowed_effects,
    like_oxide,
    scaled,
    with_slope,
)
from pellicle.fitting.film.colour_view import ColourForm, ColoursView
from pellicle.fitting.film.indices import free_media
from pellicle.fitting.film.parameters import anonymous
from pellicle.fitting.film.view import SpectrumForm, SpectrumView
from pellicle.forward_model.film_signal import depolarises
from pellicle.forward_model.plan import Plan, Row
from pellicle.optics.coherent import FEW
from pellicle.programs.cache import kept
from pellicle.scene.expressions import value
from pellicle.scene.film import Reference, Scene, thickness_spread, unchecked
from pellicle.scene.free import Content, Free, free_leaves, insert, is_free, remembered
from pellicle.scene.graded import each_medium, face
from pellicle.scene.layers import Interface, Layer

OVERLAYER_INDEX = 1.5
"""Index of an overlayer, about that of adventitious carbon and of water with organics in it."""
_ROUND = 16
"""Numbers of candidates are multiples of this."""
_WIDEST = 10.0
"""Upper bound of the further numbers, in their own units."""
_AZIMUTHS = 3
"""Fewest azimuths of the rays of a cone, half of those of the pupil: enough for a turn by less than 1°."""
_PLAIN, _WITH_FACES = 0, 1
"""Positions of the stack without faces of its own, and of that with all but an overlayer."""
_ANY = 1.0
"""Number for a parameter on which no plan depends."""


class Simulated(NamedTuple):
    """The signal of each candidate, (candidates, data values)."""

    signal: Any


def _simulated(form: SpectrumForm | ColourForm, scene: Scene, data: Any, values: Any) -> Simulated:
    """Signals of a scene at candidates `values` (candidates, its free numbers)."""
    # one after the other: a cone of light through a stack may need gigabytes for all at once
    return Simulated(jax.lax.map(lambda each: form.simulate(insert(scene, each), data), values))


def _by_numpy(form: Any, scene: Scene, data: Any, values: np.ndarray) -> Simulated | None:
    """Signals as of `_simulated`, by NumPy; None for a plan that it does not evaluate."""
    rows, each = np.unique(values, axis=0, return_inverse=True)  # without those that are padding
    signals = form.signals(scene, data, rows) if isinstance(form, SpectrumForm) else None
    return None if signals is None else Simulated(signals[each.ravel()])


def _share(form: Any, scene: Scene, data: Any, values: np.ndarray) -> float:
    return share_without_slopes(form, (scene, data), np.unique(values, axis=0))


simulated = kept(_simulated, at_first=_by_numpy, share=_share)
simulated_once = kept(_simulated, calls="few", at_first=_by_numpy, share=_share)


class Number(NamedTuple):
    """A further number of a scene: its position among all numbers."""

    position: int


class SideBySide(NamedTuple):
    """Signals of many candidates, (pixels, candidates, data values)."""

    signal: Any


def _many_by_numpy(form: Any, scene: Scene, data: Any, frame: Any, values: np.ndarray) -> SideBySide | None:
    """Signals as of `simulated_side_by_side`, by NumPy, where all pixels have one frame."""
    simulated = (
        None if frame is not None else _by_numpy(form, scene, data, values.reshape(-1, values.shape[-1]))
    )
    return None if simulated is None else SideBySide(simulated.signal.reshape(*values.shape[:2], -1))


@partial(kept, calls="many", at_first=_many_by_numpy)
def simulated_side_by_side(
    form: SpectrumForm | ColourForm, scene: Scene, data: Any, frame: Any, values: Any
) -> SideBySide:
    """Signals of a scene at candidates `values` (pixels, candidates, its free numbers), all at once.

    `frame` (pixels, ...) are the frames of N, C, S of pixels that have their own; None else.
    """

    def of_pixel(frame: Any, rows: Any) -> Any:
        own = data if frame is None else data._replace(frame=frame)
        return jax.vmap(lambda each: form.simulate(insert(scene, each), own))(rows)

    axes = None if frame is None else 0
    return SideBySide(jax.vmap(of_pixel, in_axes=(axes, 0))(frame, values))


class Program(NamedTuple):
    """The form and the scene of a program that simulates, and which numbers it takes, in its order."""

    form: Any
    scene: Scene
    order: list[int]


def extended(view: SpectrumView | ColoursView, values: np.ndarray) -> ExtendedScene:
    """The extended scene of a view whose parameters are at `values` (parameters,).

    It is prepared once for all views of one form and scene. Where media have free numbers, it depends on
    whether these values make them gases; where fringes are averaged or media birefringent, its plan depends
    on the values themselves.
    """
    scene, given = view.scene, tuple(map(float, values))
    allowed = allowed_effects(scene, given if free_media(scene) else None)
    return _extended(view.form, scene, allowed, given if _planned_by_values(scene) else None)


@remembered
def _planned_by_values(scene: Scene) -> bool:
    """Test if the free numbers of a scene change its plan."""
    blurred = scene.instrument.bandwidth is not None or any(
        isinstance(layer, Layer) and thickness_spread(scene, layer) is not None for layer in scene.layers
    )
    return blurred or any(isinstance(medium, Anisotropic) for medium in scene_media(scene))


@remembered
def _extended(
    form: SpectrumForm | ColourForm, scene: Scene, allowed: AllowedEffects, values: tuple[float, ...] | None
) -> ExtendedScene:
    return ExtendedScene(form, scene, allowed, values)


class ExtendedScene:
    """A fitted scene with further numbers; None stands for those that it cannot have.

    The first numbers are the parameters of the view.
    `wavelength` and `angle` are shifts, `roughness` that of the upper face, `overlayer` a thickness on it,
    `oxide` and `mixture` thicknesses on the substrate. Of each coherent layer, by its position: `thickness`;
    `index`, a relative change of a given one; `shape`, one of a model with free numbers. `substrate_index` is
    a relative change.
    """

    def __init__(
        self,
        form: SpectrumForm | ColourForm,
        scene: Scene,
        allowed: AllowedEffects,
        values: tuple[float, ...] | None,
    ):
        self._form, self._fitted, self._allowed, self._free = form, scene, allowed, list[Free]()
        self.parameters = len(free_leaves(scene))
        # as the scene, with its parameters still free: another best fit is no other program
        starts = [_ANY] * self.parameters if values is None else values
        opened = insert(scene, [self._number(value)[1] for value in starts])
        self._free = [free for _, free in free_leaves(opened)]  # with their labels
        nm = np.asarray(scene.light.wavelength)
        instrument = opened.instrument
        self.wavelength = self.angle = self.roughness = self.overlayer = None
        self.oxide = self.mixture = None
        self.substrate_index: Number | None = None
        self.thickness: dict[int, Number] = {}
        self._tied: dict[int, Any] = {}
        self.index: dict[int, Number] = {}
        self.shape: dict[int, Number] = {}
        if instrument.wavelength_shift is None:
            self.wavelength, shift = self._number(0.0, -_WIDEST)
            instrument = replace(instrument, wavelength_shift=shift)
        if instrument.angle_shift is None:
            self.angle, turn = self._number(0.0, -_WIDEST)
            instrument = replace(instrument, angle_shift=turn)
        # a spread of the only layer, which will not be the only one
        spread, instrument = instrument.thickness_spread, replace(instrument, thickness_spread=None)
        layers: list[Any] = list(opened.layers)
        for i, layer in enumerate(opened.layers):
            if isinstance(layer, Layer):
                own = layer if spread is None else replace(layer, thickness_spread=spread)
                layers[i] = self._layer(i, own, nm)
        below = with_slope(opened.substrate.material, nm)
        if allowed.substrate:
            self.substrate_index, change = self._number(0.0, -0.5)
            below = scaled(below, change)
        self._plain = unchecked(
            opened,
            layers=tuple(layers),
            substrate=replace(opened.substrate, material=below),
            ambient=with_slope(opened.ambient, nm),
            instrument=instrument,
            reference=self._reference(opened, layers, below),
        )
        self._native: Layer | None = None
        self._mixed: Layer | None = None
        self._with_face: dict[int, tuple[Any, ...]] = {}
        self._stacks, self._programs = [tuple(layers)], dict[int, Program]()
        if allowed.substrate:
            self._stacks.append(tuple(self._faces(layers)))
        self._stack_of = dict.fromkeys(self._with_face, _WITH_FACES)
        if allowed.substrate and isinstance(layers[0], Layer):
            self._cover(layers)

    def _reference(self, opened: Scene, layers: list[Any], below: Any) -> Reference | None:
        """The reference. Media that the sample has too are those of one wafer, and layers of one thickness
        one layer: they change together."""
        if opened.reference is None:
            return None
        own, nm = opened.reference, np.asarray(opened.light.wavelength)
        pairs = zip(opened.layers, layers, strict=True)
        alike = {Content(x.material): (x, y) for x, y in pairs if isinstance(x, Layer)}

        def known(x: Any) -> Any:
            if isinstance(x, Interface):
                return x
            given, changed = alike.get(Content(x.material), (None, None))
            if changed is None or given is None:
                return replace(x, material=with_slope(x.material, nm))
            same = isinstance(x, Layer) and not is_free(x.thickness) and x.thickness == given.thickness
            thickness = {"thickness": changed.thickness} if same else {}
            return replace(x, material=changed.material, **thickness)

        self._one_wafer = Content(own.substrate.material) == Content(opened.substrate.material)
        substrate = replace(own.substrate, material=below) if self._one_wafer else known(own.substrate)
        return unchecked(own, substrate=substrate, layers=tuple(map(known, own.layers)))

    def _on_reference(self, layers: Sequence[Any]) -> Reference | None:
        """The reference of a stack: on a substrate that the sample has too lies the same oxide, unless the
        reference ends with one, and below the same last layer the same mixed interface."""
        reference, fitted = self._plain.reference, self._fitted.reference
        if reference is None or fitted is None or not self._one_wafer:
            return reference
        foot, own = (next(iter(x.layers[::-1]), None) for x in (fitted, self._fitted))
        same = oxidised = False
        if isinstance(foot, Layer):
            oxidised = like_oxide(foot.material, np.asarray(self._fitted.light.wavelength))
            same = isinstance(own, Layer) and Content(foot.material) == Content(own.material)
        # of an oxide where the layer has no index of its own
        mixes = same or (isinstance(own, Layer) and isinstance(own.material, Anisotropic) and not oxidised)
        added = [x for x in layers if (x is self._native and not oxidised) or (x is self._mixed and mixes)]
        return unchecked(reference, layers=(*reference.layers, *added))

    def _faces(self, layers: list[Any]) -> list[Any]:
        """The layers with a roughness, a mixed interface and an oxide of no size."""
        plain, top, foot = tuple(layers), layers[0], layers[-1]
        single = isinstance(top, Layer) and top.repeats == 1  # a face in a group is rough in every repeat
        if single and top.roughness is None and computes_roughness(self._fitted):
            self.roughness, rough = self._number(0.0)
            layers = [replace(top, roughness=rough), *plain[1:]]
            self._with_face[self.roughness.position] = tuple(layers)
        if isinstance(foot, Layer) and self._allowed.oxidises:
            if not self._allowed.like_oxide:
                self.oxide, thickness = self._number(0.0)
                self._native = Layer(Constant(OXIDE_INDEX), thickness)
                self._with_face[self.oxide.position] = (*plain, self._native)
            native = [] if self._native is None else [self._native]
            # media with an index of their own mix: under a birefringent layer an oxide does
            on_oxide, below = isinstance(foot.material, Anisotropic), self._plain.substrate.material
            if not on_oxide or native:
                self.mixture, thickness = self._number(0.0)
                above = native[0].material if on_oxide else face(foot.material, 1.0)
                [half] = Interface(0.0).slices(above, below)
                self._mixed = replace(half, thickness=thickness)
                self._with_face[self.mixture.position] = (*plain, *(native if on_oxide else []), self._mixed)
                native.insert(len(native) if on_oxide else 0, self._mixed)
            layers = [*layers, *native]
        return layers

    def _cover(self, layers: list[Any]) -> None:
        """An overlayer. Where that is as quick, other numbers than its own are simulated with one of no
        thickness: in one program less."""
        self.overlayer, thin = self._number(0.0)
        cover, at = Layer(Constant(OVERLAYER_INDEX), thin), self.overlayer.position
        self._with_face[at] = (cover, *layers)
        if not computes_roughness(self._fitted):
            # s and p mix: a program takes seconds to compile
            self._stacks, self._stack_of = [(cover, *self._stacks[_WITH_FACES])], {}
        elif layers[0].roughness is None and len(layers) != FEW and not depolarises(self._form.plan):
            # apart from other faces: the roughness of a covered face is that of two
            self._stacks[_PLAIN] = self._with_face[at]
        else:
            self._stack_of[at] = len(self._stacks)
            self._stacks.append(self._with_face[at])

    def _number(self, value: float, lower: float = 0.0) -> tuple[Number, Free]:
        free = Free(min(lower, value), value + _WIDEST, start=value)
        self._free.append(free)
        return Number(len(self._free) - 1), free

    def _layer(self, i: int, layer: Layer, nm: np.ndarray) -> Layer:
        material = each_medium(lambda medium: with_slope(medium, nm), layer.material)
        if self._allowed.layers[i]:
            position = 2 * (nm - nm.min()) / max(np.ptp(nm), 1e-9) - 1
            given = not free_leaves(getattr(self._fitted.layers[i], "material", None))
            number, change = self._number(0.0, -0.5)
            (self.index if given else self.shape)[i] = number
            # level and slope of a model are its own: what it may lack is a curvature
            shape = 1.0 if given else 2 * position**2 - 1
            material = each_medium(lambda medium: scaled(medium, change, shape), material)
        thickness: Any = layer.thickness
        if is_free(thickness) and thickness.tie is not None:
            # the thickness of this layer alone, from where the tie has it
            self.thickness[i], own = self._number(_ANY)
            self._tied[self.thickness[i].position], thickness = thickness.tie.tree, own
        elif is_free(thickness):
            self.thickness[i] = Number(next(j for j, own in enumerate(self._free) if own is thickness))
        else:
            self.thickness[i], thickness = self._number(float(np.asarray(thickness)))
        return replace(layer, material=material, thickness=thickness)

    def start(self, values: np.ndarray) -> np.ndarray:
        """All numbers (numbers,) of the scene that is fitted at `values` (its parameters,)."""
        further = [own.start for own in self._free[self.parameters :]]
        numbers = np.concatenate([np.asarray(values, dtype=float), further])
        for position, expression in self._tied.items():
            numbers[position] = value(expression, values.__getitem__)
        return numbers

    def signals(self, data: Any, values: np.ndarray, changes: Sequence[tuple[Number, float]]) -> np.ndarray:
        """Signals (changes, data values) at `values` (parameters,) of the fitted scene with one number
        changed in each, without scale and offset."""
        start = self.start(values)
        keys = [(number.position if change else -1, change) for number, change in changes]
        result: dict[tuple[int, float], np.ndarray] = {}
        by_stack: dict[int, list[tuple[int, float]]] = {}
        for key in dict.fromkeys(keys):
            by_stack.setdefault(self._stack_of.get(key[0], _PLAIN), []).append(key)
        # a stack with all faces takes a hundred times as long for each of its rows. Padded: scenes with other
        # uncertainties share a program
        for stack, own in by_stack.items():
            multiple = list(self._stack_of.values()).count(stack) or _ROUND
            rows = np.tile(start, (-(-len(own) // multiple) * multiple, 1))
            for row, (position, change) in zip(rows, own, strict=False):
                row[position] += change  # of the last number, 0 where nothing changes
            form, scene, order = self._program_of(stack)
            # one or two rows of a monochromatic plane wave take 5 ms more, and the compilation 1 s less
            quick = stack != _PLAIN and not depolarises(form.plan)
            program = simulated_once if quick else simulated
            simulations = np.asarray(program(form, scene, data, rows[:, order]).signal)
            result |= dict(zip(own, simulations, strict=False))
        return np.stack([result[key] for key in keys])

    def _program_of(self, stack: int) -> Program:
        if stack not in self._programs:
            self._programs[stack] = self._program(self._stacks[stack])
        return self._programs[stack]

    def programs(self) -> dict[int | None, Program]:
        """Programs of scenes with one number of a face alone, by its position, and of the scene without any.

        A scene with all of them is a deep stack, which takes a hundred times as long.
        """
        faces = {position: self._program(layers) for position, layers in self._with_face.items()}
        return {None: self._program(self._plain.layers), **faces}

    def _program(self, layers: tuple[Any, ...]) -> Program:
        scene = unchecked(self._plain, layers=layers, reference=self._on_reference(layers))
        # the order of a pytree is that of its fields
        order = [next(i for i, own in enumerate(self._free) if own is x) for _, x in free_leaves(scene)]
        form = self._form.with_plan(exact(scene, _rows_of_fit(self._form.plan)).static_key)
        return Program(form, jax.tree_util.tree_map(np.asarray, anonymous(scene)), order)


def _rows_of_fit(plan: Plan) -> list[Row]:
    """Slices of graded layers and rays of a cone, which the fit has too.

    The further numbers have wide bounds, but change little. Judged by these bounds, a cone of aperture 0.8
    through layers of glass, half of whose index is below the aperture, takes 576 rays in place of 6.
    """
    rows, cone = [plan.row("gradient")], plan.row("angle-spread")
    if cone.on:
        counts = [own.row("angle-spread").count for own in (plan, plan.reference) if own is not None]
        rows.append(replace(cone, count=max(counts), around=max(cone.around, _AZIMUTHS)))
    return rows
