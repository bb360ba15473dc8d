"""Systematic effects of a spectrum: what each that a scene takes for granted does to the signal."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pellicle.dispersion.effective_medium import AbstractMixture
from pellicle.fitting.film.colour_view import ColoursView
from pellicle.fitting.film.extended_scene import ExtendedScene, Number, extended
from pellicle.fitting.film.view import Local, SpectrumView
from pellicle.fitting.linear_system import HALF_NORMAL, Effect
from pellicle.optics.orders import FWHM
from pellicle.scene.film import Scene
from pellicle.scene.free import is_free
from pellicle.scene.instrument import Drift
from pellicle.scene.layers import Layer
from pellicle.scene.names import layer_name

_STEP = 1e-2
"""Finite step of a linear effect, in standard uncertainties: on a thick film a whole one is not linear."""
_WIDEST_SPREAD = 12.0
"""Largest usual spread of a thickness (nm)."""
_THIN_MIXTURE, _MIXING_RULE = 15.0, 0.03
"""Thickness (nm) below which the grains of a mixture are no longer small, and its index therefore more
uncertain. Linear mixing and Bruggeman's differ by 2 % for silica with 50 % air, 5 % for titania with 30 %."""
_LAMP, _LAMP_TERMS = 0.12, 16
"""Usual size of a term of a lamp's structure, relative, and the highest one."""
_ROUND_PUPIL = 0.5
"""Standard deviation of the angle in the plane of incidence over an evenly lit cone, by its half angle."""


class SimulatedEffect(NamedTuple):
    """An effect that is simulated: weighted sum of signals with one number changed."""

    name: str
    size: float
    unit: str
    number: Any  # `Number` that changes; None where the scene cannot have it
    changes: tuple[tuple[float, float], ...]  # of the number, and the weight of its signal
    power: int = 1
    positive: bool = False
    shared: bool = True
    material: bool = False
    owner: str = ""  # of a medium, which samples may have in common
    relative: float = 0.0  # size by the number itself, at most `_WIDEST_SPREAD`; 0 for a size of its own
    thickness: Number | None = None  # of a mixture, from `_THIN_MIXTURE` of which the effect has no size

    def sizes(self, values: np.ndarray) -> Any:
        """The size where all numbers of the scene are `values` (..., numbers)."""
        if self.thickness is not None:
            return np.where(values[..., self.thickness.position] < _THIN_MIXTURE, self.size, 0.0)
        if not self.relative:
            return np.full(values.shape[:-1], self.size)
        return np.minimum(self.relative * values[..., self.number.position], _WIDEST_SPREAD)

    def effect(self, change: np.ndarray) -> Effect:
        """The effect with its `change` of the data."""
        about = self.name, self.size, self.unit, change
        return Effect(*about, self.power, self.positive, self.shared, self.material)


def systematic_effects(
    view: SpectrumView, values: np.ndarray, at: Local, scene: Scene, example: np.ndarray
) -> list[Effect]:
    """Every effect to which the `scene` gives an uncertainty, at `values` (the parameters of the view,).

    `at` is the local model there, and simulations are planned as at the values of an `example`. What
    the scene describes itself, free or fixed, is no effect.
    """
    result = []
    for row, weights, own in simulated_effects(view, values, scene, example):
        change = change_of_data(view, at, weights @ own)
        if view.signal.depolarisation:
            change[:, -1] = _depolarising(view, at, own, weights)
        result.append(row.effect(change))
    return named_for([*result, *effects_on_signal(view, at, scene)], view.name)


def change_of_data(view: SpectrumView, at: Local, change: np.ndarray) -> np.ndarray:
    """Change of the data (..., rows, measured channels) by a change of the signal (..., data values)."""
    columns = view.in_columns(at.signal)
    return view.signal.along(
        columns, _columns(view, np.asarray(at.gain) * change), view.data.frame is not None
    )


def named_for(effects: list[Effect], name: str) -> list[Effect]:
    """The effects, those of one measurement among several under its name."""
    of = f" of {name}" if name else ""
    return [e if e.shared else replace(e, name=f"{e.name}{of}") for e in effects]


def simulated_effects(
    view: SpectrumView | ColoursView, values: np.ndarray, scene: Scene, example: np.ndarray
) -> list[tuple[SimulatedEffect, np.ndarray, np.ndarray]]:
    """Every effect that is simulated at `values`, planned as at those of an `example`, with weights
    (signals,) and signals (signals, data values).

    The weighted sum of the signals is the change by the effect.
    """
    simulations = simulations_of(view, example, scene)
    if not simulations:
        return []
    extension, every = simulations
    every = [row for row in every if row.sizes(extension.start(values)) > 0]
    each = [(row.number, change) for row in every for change, _ in row.changes]
    signals = extension.signals(view.data, values, each) if each else np.zeros((0, 0))
    result, first = [], 0
    for row in every:
        weights = np.array([weight for _, weight in row.changes])
        result.append((row, weights, signals[first : first + len(weights)]))
        first += len(weights)
    return result


def simulations_of(
    view: SpectrumView | ColoursView, values: np.ndarray, scene: Scene
) -> tuple[ExtendedScene, list[SimulatedEffect]] | None:
    """The extended scene, and every effect that it simulates; None where there are none."""
    extension = extended(view, values)
    every = [*_of_light(view, scene, extension), *_of_media(scene, extension, extension.start(values))]
    rows = [_of_sample(scene, row) for row in every if row.number is not None and row.size > 0]
    return (extension, rows) if rows else None


def _of_sample(scene: Scene, row: SimulatedEffect) -> SimulatedEffect:
    """The effect by the name that tells it from those of other samples."""
    if not row.shared or scene.sample is None:
        return row
    return row._replace(name=row.name + scene.sample.of(row.owner))


def _linear(name: str, size: float, unit: str, number: Number | None, **kind: Any) -> SimulatedEffect:
    step, weight = _STEP * size, 0.5 / _STEP
    return SimulatedEffect(name, size, unit, number, ((step, weight), (-step, -weight)), **kind)


def _width(
    name: str, size: float, unit: str, number: Number | None, sd: float, **kind: Any
) -> SimulatedEffect:
    # a normal distribution by three nodes, for a variance of the prior's root mean square
    reach = math.sqrt(3) * sd
    nodes = (reach, HALF_NORMAL / 6), (-reach, HALF_NORMAL / 6), (0.0, -HALF_NORMAL / 3)
    return SimulatedEffect(name, size, unit, number, nodes, power=2, **kind)


def _of_light(
    view: SpectrumView | ColoursView, scene: Scene, extension: ExtendedScene
) -> Iterator[SimulatedEffect]:
    """Effects of the light and the instrument; those of no size or without a number are left out later."""
    allowed, instrument = scene.uncertainty, scene.instrument
    yield _linear("wavelength shift", allowed.wavelength, "nm", extension.wavelength, shared=False)
    if instrument.bandwidth is None:
        sd = allowed.bandwidth / FWHM
        yield _width("bandwidth", allowed.bandwidth, "nm", extension.wavelength, sd, shared=False)
    free = is_free(view.scene.light.angle)
    oblique = free or bool(np.any(np.asarray(view.scene.light.angle)))
    if oblique and not free:
        yield _linear("angle of incidence", allowed.angle, "deg", extension.angle, shared=False)
    if not instrument.has_cone:
        # at normal incidence both directions of the cone turn the light away from the normal
        sd = allowed.angle_spread * _ROUND_PUPIL * (1.0 if oblique else math.sqrt(2))
        yield _width("angle spread", allowed.angle_spread, "deg", extension.angle, sd, shared=False)


def _of_media(scene: Scene, extension: ExtendedScene, start: np.ndarray) -> Iterator[SimulatedEffect]:
    """Effects of layers, substrate and faces; `start` are all numbers of the extended scene."""
    allowed, instrument, substrate = scene.uncertainty, scene.instrument, scene.substrate
    for i, layer in enumerate(scene.layers):
        if not isinstance(layer, Layer):
            continue
        name = layer_name(scene, i)
        of = f" of {name}" if len(scene.layers) > 1 or scene.sample is not None else ""
        if i in extension.index:
            size = allowed.index if layer.index_uncertainty is None else layer.index_uncertainty
            words, about = f"index{of or ' of the layer'}", ("", extension.index[i])
            yield _linear(words, size, *about, material=True, owner=name)
            if isinstance(layer.material, AbstractMixture) and layer.index_uncertainty is None and size:
                deep = extension.thickness[i]
                yield _linear(f"mixing rule{of}", _MIXING_RULE, *about, thickness=deep, owner=name)
        if i in extension.shape:
            yield _linear(f"dispersion{of}", allowed.dispersion, "", extension.shape[i], owner=name)
        if instrument.thickness_spread is None and layer.thickness_spread is None:
            relative, number = allowed.thickness_spread, extension.thickness[i]
            size = min(relative * start[number.position], _WIDEST_SPREAD)
            yield _width(f"thickness spread{of}", size, "nm", number, size, relative=relative)
    size = allowed.index if substrate.index_uncertainty is None else substrate.index_uncertainty
    about = "", extension.substrate_index
    yield _linear("index of the substrate", size, *about, material=True, owner="substrate")
    reach = allowed.roughness
    both = (reach, HALF_NORMAL), (0.0, -HALF_NORMAL)
    yield SimulatedEffect("roughness", reach, "nm", extension.roughness, both, power=2)
    for name, size, number in (
        ("overlayer", allowed.overlayer, extension.overlayer),
        ("native oxide", allowed.interlayer, extension.oxide),
        ("mixed interface with the substrate", allowed.interlayer / 2, extension.mixture),
    ):
        yield SimulatedEffect(name, size, "nm", number, ((size, 1.0), (0.0, -1.0)), positive=True)


def effects_on_signal(view: SpectrumView, at: Local, scene: Scene) -> list[Effect]:
    """Effects that act on the signal alone; leading axes of `at` are those of the changes too."""
    allowed, signal = scene.uncertainty, np.asarray(at.signal)
    offsets = view.signal.offsets(view.in_columns(signal), allowed)
    effects = [
        Effect(x.name, x.size, x.unit, view.in_channels(x.change), positive=x.positive, shared=False)
        for x in offsets
        if x.size
    ]
    if not view.signal.has_scale:
        return effects
    position, curves = np.asarray(view.data.position), []
    if not isinstance(scene.instrument.scale, Drift):
        size, bent = allowed.scale, allowed.scale / 2
        curves += [
            ("scale", size, size * signal),
            ("slope of the scale", size, size * signal * position),
            ("curvature of the scale", bent, bent * signal * (2 * position**2 - 1)),
        ]
    elif scene.instrument.scale.degree:
        curves += _lamp_structure(view, np.asarray(at.gain) * signal, scene.instrument.scale.degree)
    if not isinstance(scene.instrument.offset, Drift):
        curves.append(("offset", allowed.offset, np.full(signal.shape, allowed.offset)))
    return [
        Effect(name, size, "", _columns(view, change), shared=False) for name, size, change in curves if size
    ]


def _lamp_structure(
    view: SpectrumView, signal: np.ndarray, degree: int
) -> list[tuple[str, float, np.ndarray]]:
    """Structure of a lamp that a scale of this degree does not follow: terms of the scale up to half the
    frequency of the fringes, which they must not imitate."""
    position, real = np.asarray(view.data.position), signal[..., : view.points]
    extrema = np.sum(np.diff(np.sign(np.diff(real))) != 0, axis=-1)
    last = np.minimum(extrema // 2, _LAMP_TERMS)
    terms = range(degree + 1, int(np.max(last)) + 1)
    wave = {k: np.cos(k * np.arccos(np.clip(position, -1, 1))) for k in terms}
    has = {k: (k <= last)[..., None] for k in terms}
    return [(f"term {k} of the scale", _LAMP, _LAMP * signal * wave[k] * has[k]) for k in terms]


def _columns(view: SpectrumView, values: np.ndarray) -> np.ndarray:
    """Data values, or a change of them, (..., data values) as (..., rows, measured channels)."""
    columns = values[..., : view.points].reshape(*values.shape[:-1], view.rows, view.channels)
    return columns[..., : view.measured_channels]


def _depolarising(view: SpectrumView, at: Local, changed: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Change of the depolarisation (rows,) by a weighted sum of signals.

    Averaged are N, C, S before they are brought to their sphere: of v = (N, C, S), 1 − v² changes by −2 v dv.
    """
    signal, pairs = view.signal, zip(weights, changed, strict=True)
    change = sum(weight * signal.polarised(view.in_columns(own)) for weight, own in pairs)
    return -2 * np.sum(signal.polarised(view.in_columns(at.signal)) * change, axis=1)
