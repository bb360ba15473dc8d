"""A fitted scene with further numbers: one for each systematic effect of light and sample."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.dispersion.empirical import Constant, Scaled, Tabulated
from pellicle.dispersion.principal_media import each_principal, ordinary_index
from pellicle.effects.anisotropy import computes_roughness
from pellicle.effects.film_plan import exact
from pellicle.fitting.film.colour_view import ColourForm, ColoursView
from pellicle.fitting.film.form import SpectrumForm
from pellicle.fitting.film.parameters import anonymous
from pellicle.fitting.film.view import SpectrumView
from pellicle.fitting.program_cache import kept
from pellicle.optics.pair import Pair, imag, real
from pellicle.scene.film import Scene
from pellicle.scene.free import Free, free_leaves, insert, is_free
from pellicle.scene.graded import each_medium
from pellicle.scene.layers import Interface, Layer

OXIDE_INDEX = 1.46
"""Index of a native oxide, about that of SiO₂."""
_LIKE_OXIDE = 0.05
_OXIDISES = 2.0
"""Substrates of a higher index than this, or with absorption, are semiconductors and metals with an oxide."""
_GAS = 0.01
"""Media whose index is within this of 1 are gases."""
_ROUND = 16
"""Numbers of candidates are multiples of this."""
_WIDEST = 10.0
"""Upper bound of the further numbers, in their own units."""


class Simulated(NamedTuple):
    """The signal of each candidate, (candidates, data values)."""

    signal: Any


@kept
def simulated(form: SpectrumForm | ColourForm, scene: Scene, data: Any, values: Any) -> Simulated:
    """Signals of a scene at candidates `values` (candidates, its free numbers)."""
    # one after the other: a cone of light through a stack may need gigabytes for all at once
    return Simulated(jax.lax.map(lambda each: form.simulate(insert(scene, each), data), values))


class Number(NamedTuple):
    """A further number of a scene: its position among them, and the value that the fit has."""

    position: int
    value: float


class SideBySide(NamedTuple):
    """Signals of many candidates, (pixels, candidates, data values)."""

    signal: Any


@partial(kept, many_calls=True)
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


class ExtendedScene:
    """The scene of a view at the best fit, with further numbers; None stands for those that it cannot have.

    The first numbers are the parameters of the view.
    `wavelength` and `angle` are shifts, `roughness` that of the upper face, `oxide` and `mixture` thicknesses
    on the substrate. Of each coherent layer, by its position: `thickness`; `index`, a relative change of a
    given one; `shape`, one of a model with free numbers. `substrate_index` is a relative change.
    """

    def __init__(self, view: SpectrumView | ColoursView, values: np.ndarray):
        self._view, self._free = view, []
        scene = insert(view.scene, np.asarray(values).tolist())
        # as the scene, with its parameters still free: another best fit is no other program
        opened = insert(view.scene, [self._number(value)[1] for value in np.asarray(values).tolist()])
        nm = np.asarray(scene.light.wavelength)
        instrument = opened.instrument
        self.wavelength = self.angle = self.roughness = self.oxide = self.mixture = None
        self.substrate_index: Number | None = None
        self.thickness: dict[int, Number] = {}
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
                layers[i] = self._layer(i, own, scene.layers[i], nm)
        plain = tuple(layers)
        self._with_face: dict[int, tuple[Any, ...]] = {}
        top, foot, bulk = layers[0], scene.layers[-1], scene.substrate.material
        below = _with_slope(opened.substrate.material, nm)
        if _solid(bulk, nm):
            self.substrate_index, change = self._number(0.0, -0.5)
            if isinstance(top, Layer) and top.roughness is None and computes_roughness(scene):
                self.roughness, rough = self._number(0.0)
                layers[0] = replace(top, roughness=rough)
                self._with_face[self.roughness.position] = (layers[0], *plain[1:])
            if isinstance(foot, Layer) and _oxidises(bulk, nm):
                fixed = not free_leaves(getattr(view.scene.layers[-1], "material", None))
                if not (fixed and abs(_median(foot.material, nm) - OXIDE_INDEX) < _LIKE_OXIDE):
                    self.oxide, thin = self._number(0.0)
                    layers.append(Layer(Constant(OXIDE_INDEX), thin))
                    self._with_face[self.oxide.position] = (*plain, layers[-1])
                # media with an index of their own mix: under a birefringent layer an oxide does
                isotropic = not isinstance(foot.material, Anisotropic)
                if isotropic or self.oxide is not None:
                    self.mixture, thin = self._number(0.0)
                    layers.append(Interface(thin))
                    between = layers[-1:] if isotropic else layers[len(plain) :]
                    self._with_face[self.mixture.position] = (*plain, *between)
            below = _scaled(below, change)
        self._scene = replace(
            opened,
            layers=tuple(layers),
            substrate=replace(opened.substrate, material=below),
            ambient=_with_slope(opened.ambient, nm),
            instrument=instrument,
        )
        self._plain = replace(self._scene, layers=plain)

    def _number(self, value: float, lower: float = 0.0) -> tuple[Number, Free]:
        free = Free(min(lower, value), value + _WIDEST, start=value)
        self._free.append(free)
        return Number(len(self._free) - 1, value), free

    def _layer(self, i: int, layer: Layer, fitted: Layer, nm: np.ndarray) -> Layer:
        material = each_medium(lambda medium: _with_slope(medium, nm), layer.material)
        if _solid(fitted.material, nm):
            position = 2 * (nm - nm.min()) / max(np.ptp(nm), 1e-9) - 1
            given = not free_leaves(getattr(self._view.scene.layers[i], "material", None))
            number, change = self._number(0.0, -0.5)
            (self.index if given else self.shape)[i] = number
            # level and slope of a model are its own: what it may lack is a curvature
            shape = 1.0 if given else 2 * position**2 - 1
            material = each_medium(lambda medium: _scaled(medium, change, shape), material)
        thickness: Any = layer.thickness
        if is_free(thickness):
            position = next(j for j, own in enumerate(self._free) if own is thickness)
            self.thickness[i] = Number(position, thickness.start)
        else:
            self.thickness[i], thickness = self._number(float(np.asarray(thickness)))
        return replace(layer, material=material, thickness=thickness)

    @property
    def start(self) -> np.ndarray:
        """All numbers (numbers,) as the fit has them."""
        return np.array([own.start for own in self._free])

    def signals(self, changes: list[tuple[Number, float]]) -> np.ndarray:
        """Signals (changes, data values) with one number changed in each, without scale and offset."""
        # padded: scenes with other uncertainties share a program
        count = -(-len(changes) // _ROUND) * _ROUND
        values = np.tile(self.start, (count, 1))
        for row, (number, change) in zip(values, changes, strict=False):
            row[number.position] += change
        form, scene, order = _program(self._view, self._free, self._scene)
        signals = simulated(form, scene, self._view.data, values[:, order]).signal
        return np.asarray(signals)[: len(changes)]

    def programs(self) -> dict[int | None, Program]:
        """Programs of scenes with one number of a face alone, by its position, and of the scene without any.

        A scene with all of them is a deep stack, which takes a hundred times as long.
        """
        scenes: dict[int | None, Scene] = {None: self._plain}
        for position, layers in self._with_face.items():
            scenes[position] = replace(self._scene, layers=layers)
        return {at: _program(self._view, self._free, scene) for at, scene in scenes.items()}


class Program(NamedTuple):
    """The form and the scene of a program that simulates, and which numbers it takes, in its order."""

    form: Any
    scene: Scene
    order: list[int]


def _program(view: SpectrumView | ColoursView, numbers: list[Free], scene: Scene) -> Program:
    # the order of a pytree is that of its fields
    order = [next(i for i, own in enumerate(numbers) if own is x) for _, x in free_leaves(scene)]
    # the further numbers have wide bounds, but change little: the slices of the fit are enough
    form = view.form.with_plan(exact(scene, [view.form.plan.row("gradient")]).static_key)
    return Program(form, jax.tree_util.tree_map(np.asarray, anonymous(scene)), order)


def _scaled(medium: Any, change: Any, shape: Any = 1.0) -> Any:
    """The medium with a relative change of its index, in an anisotropic one the same of all its indices."""
    return each_principal(lambda own: Scaled(own, change, shape), medium)


def _with_slope(medium: Any, nm: np.ndarray) -> Any:
    """The medium with the slope in wavelength of all that is tabulated in it, from neighbouring points."""
    if isinstance(medium, Anisotropic):
        return medium.with_media(lambda own: _with_slope(own, nm))
    if not isinstance(medium, Tabulated):
        return jax.tree.map(
            lambda part: _with_slope(part, nm) if isinstance(part, Tabulated) else part,
            medium,
            is_leaf=lambda part: isinstance(part, Tabulated) or is_free(part),
        )
    if medium.slope is not None:
        return medium
    order, first, inverse = np.unique(nm, return_index=True, return_inverse=True)

    def slope(x: Any) -> Any:
        column = np.broadcast_to(np.asarray(x), nm.shape)[first]
        return (np.gradient(column, order) if len(order) > 1 else np.zeros(1))[inverse]

    value = medium.value
    if isinstance(value, Pair):
        parts = [None if x is None else slope(x) for x in (value.re, value.im)]
        return Tabulated(medium.wavelength, value, Pair(*parts))
    return Tabulated(medium.wavelength, value, slope(value))


def _median(medium: Any, nm: np.ndarray) -> float:
    return float(np.median(np.asarray(real(ordinary_index(medium, nm)))))


def _solid(medium: Any, nm: np.ndarray) -> bool:
    index = ordinary_index(medium, nm)
    return bool(np.max(np.hypot(np.asarray(real(index)) - 1, np.asarray(imag(index)))) > _GAS)


def _oxidises(medium: Any, nm: np.ndarray) -> bool:
    return bool(
        _median(medium, nm) > _OXIDISES or np.median(np.asarray(imag(ordinary_index(medium, nm)))) > 0.1
    )
