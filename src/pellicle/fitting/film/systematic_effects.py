"""Systematic effects of a spectrum: what each that a scene takes for granted does to the signal."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pellicle.data.generalised import RATIOS
from pellicle.data.mueller import ELEMENTS
from pellicle.fitting.discrepancy import HALF_NORMAL, Effect
from pellicle.fitting.film import generalised
from pellicle.fitting.film.colour_view import ColoursView
from pellicle.fitting.film.extended_scene import ExtendedScene, Number, extended
from pellicle.fitting.film.form import Local
from pellicle.fitting.film.view import SpectrumView
from pellicle.optics.orders import FWHM
from pellicle.scene.film import Scene
from pellicle.scene.free import is_free
from pellicle.scene.instrument import Drift
from pellicle.scene.layers import Layer, Uncertainty

_STEP = 1e-2
"""Finite step of a linear effect, in standard uncertainties: on a thick film a whole one is not linear."""
_WIDEST_SPREAD = 12.0
"""Largest usual spread of a thickness (nm)."""
_LAMP, _LAMP_TERMS = 0.12, 16
"""Usual size of a term of a lamp's structure, relative, and the highest one."""
_ROUND_PUPIL = 0.5
"""Standard deviation of the angle in the plane of incidence over an evenly lit cone, by its half angle."""


class SimulatedEffect(NamedTuple):
    """An effect that is simulated: weighted sum of signals with one number changed."""

    name: str
    size: float
    unit: str
    number: Number
    changes: tuple[tuple[float, float], ...]  # of the number, and the weight of its signal
    power: int = 1
    positive: bool = False
    shared: bool = True
    material: bool = False
    relative: float = 0.0  # size by the number itself, at most `_WIDEST_SPREAD`; 0 for a size of its own

    def sizes(self, values: np.ndarray) -> np.ndarray:
        """The size where all numbers of the scene are `values` (..., numbers)."""
        if not self.relative:
            return np.full(values.shape[:-1], self.size)
        return np.minimum(self.relative * values[..., self.number.position], _WIDEST_SPREAD)

    def effect(self, change: np.ndarray) -> Effect:
        """The effect with its `change` of the data."""
        about = self.name, self.size, self.unit, change
        return Effect(*about, self.power, self.positive, self.shared, self.material)


def systematic_effects(view: SpectrumView, values: np.ndarray, at: Local, scene: Scene) -> list[Effect]:
    """Every effect to which the `scene` gives an uncertainty, at `values` (the parameters of the view,).

    `at` is the local model there. What the scene describes itself, free or fixed, is no effect.
    """
    result = []
    for row, weights, own in simulated_effects(view, values, scene):
        change = change_of_data(view, at, weights @ own)
        if view.depolarisation is not None:
            change[:, -1] = _depolarising(view, at, own, weights)
        result.append(row.effect(change))
    return named_for([*result, *effects_on_signal(view, at, scene)], view.name)


def change_of_data(view: SpectrumView, at: Local, change: np.ndarray) -> np.ndarray:
    """Change of the data (..., rows, measured channels) by a change of the signal (..., data values)."""
    return _on_sphere(view, at, _columns(view, np.asarray(at.gain) * change))


def named_for(effects: list[Effect], name: str) -> list[Effect]:
    """The effects, those of one measurement among several under its name."""
    of = f" of {name}" if name else ""
    return [e if e.shared else replace(e, name=f"{e.name}{of}") for e in effects]


def simulated_effects(
    view: SpectrumView | ColoursView, values: np.ndarray, scene: Scene
) -> list[tuple[SimulatedEffect, np.ndarray, np.ndarray]]:
    """Every effect that is simulated, with weights (signals,) and signals (signals, data values).

    The weighted sum of the signals is the change by the effect.
    """
    simulations = simulations_of(view, values, scene)
    if not simulations:
        return []
    extension, every = simulations
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
    allowed, instrument = scene.uncertainty, scene.instrument
    extension, rows = extended(view, values), []
    start = extension.start(values)

    def add(name: str, size: float, unit: str, number: Number | None, changes: Any, **kind: Any) -> None:
        if number is not None and size > 0:
            rows.append(SimulatedEffect(name, size, unit, number, tuple(changes), **kind))

    def linear(name: str, size: float, unit: str, number: Number | None, **kind: Any) -> None:
        step, weight = _STEP * size, 0.5 / _STEP
        add(name, size, unit, number, [(step, weight), (-step, -weight)], **kind)

    def width(name: str, size: float, unit: str, number: Number | None, sd: float, **kind: Any) -> None:
        # a normal distribution by three nodes, for a variance of the prior's root mean square
        reach = math.sqrt(3) * sd
        nodes = [(reach, HALF_NORMAL / 6), (-reach, HALF_NORMAL / 6), (0.0, -HALF_NORMAL / 3)]
        add(name, size, unit, number, nodes, power=2, **kind)

    linear("wavelength shift", allowed.wavelength, "nm", extension.wavelength, shared=False)
    if instrument.bandwidth is None:
        sd = allowed.bandwidth / FWHM
        width("bandwidth", allowed.bandwidth, "nm", extension.wavelength, sd, shared=False)
    free = is_free(view.scene.light.angle)
    oblique = free or bool(np.any(np.asarray(view.scene.light.angle)))
    if oblique and not free:
        linear("angle of incidence", allowed.angle, "deg", extension.angle, shared=False)
    if not instrument.has_cone:
        # at normal incidence both directions of the cone turn the light away from the normal
        sd = allowed.angle_spread * _ROUND_PUPIL * (1.0 if oblique else math.sqrt(2))
        width("angle spread", allowed.angle_spread, "deg", extension.angle, sd, shared=False)
    several = len(scene.layers) > 1
    for i, layer in enumerate(scene.layers):
        if not isinstance(layer, Layer):
            continue
        of = f" of {layer.name or f'layer{i + 1}'}" if several else ""
        if i in extension.index:
            own = allowed.index if layer.index_uncertainty is None else layer.index_uncertainty
            linear(f"index{of or ' of the layer'}", own, "", extension.index[i], material=True)
        if i in extension.shape:
            linear(f"dispersion{of}", allowed.dispersion, "", extension.shape[i])
        if instrument.thickness_spread is None and layer.thickness_spread is None:
            size = min(allowed.thickness_spread * start[extension.thickness[i].position], _WIDEST_SPREAD)
            relative = allowed.thickness_spread
            width(f"thickness spread{of}", size, "nm", extension.thickness[i], size, relative=relative)
    substrate = scene.substrate
    own = allowed.index if substrate.index_uncertainty is None else substrate.index_uncertainty
    linear("index of the substrate", own, "", extension.substrate_index, material=True)
    reach = allowed.roughness
    both = [(reach, HALF_NORMAL), (0.0, -HALF_NORMAL)]
    add("roughness", reach, "nm", extension.roughness, both, power=2)
    for name, size, number in (
        ("native oxide", allowed.interlayer, extension.oxide),
        ("mixed interface with the substrate", allowed.interlayer / 2, extension.mixture),
    ):
        add(name, size, "nm", number, [(size, 1.0), (0.0, -1.0)], positive=True)
    return (extension, rows) if rows else None


def effects_on_signal(view: SpectrumView, at: Local, scene: Scene) -> list[Effect]:
    """Effects that act on the signal alone; leading axes of `at` are those of the changes too."""
    allowed, signal = scene.uncertainty, np.asarray(at.signal)
    if view.elements:
        return _of_elements(view, signal, allowed)
    if view.ratios:
        each, names = _spheres(view, signal), [RATIOS[i] for i in view.ratios]
        offsets = generalised.offsets(names, each[..., : view.rows, :, :], allowed)
        return [
            replace(e, change=_in_frame(view, e.change.reshape(*e.change.shape[:-2], -1))) for e in offsets
        ]
    if not view.of_power:
        return _of_angles(view, at, allowed)
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


def _of_angles(view: SpectrumView, at: Local, allowed: Uncertainty) -> list[Effect]:
    """Offsets of Ψ and Δ, and depolarisation as a rotating analyser takes it: N and C lose a share.

    An instrument that measures the depolarisation divides it out; its offset counts instead.
    """
    n, c, s = np.moveaxis(_sphere(view, at.signal), -1, 0)
    sine = np.maximum(np.hypot(c, s), 1e-9)
    psi, delta, share = np.deg2rad(2 * allowed.psi), np.deg2rad(allowed.delta), 1 - allowed.depolarisation
    third = np.where(s < 0, -1, 1) * np.sqrt(np.maximum(1 - (share * n) ** 2 - (share * c) ** 2, 0.0))
    less = np.stack([share * n - n, share * c - c, third - s], axis=-1)
    of_psi = psi * np.stack([-sine, n * c / sine, n * s / sine], axis=-1)
    of_delta = delta * np.stack([0 * n, -s, c], axis=-1)
    changes = (
        ("offset of psi", allowed.psi, "deg", of_psi, False),
        ("offset of delta", allowed.delta, "deg", of_delta, False),
        ("depolarisation", 0.0 if view.depolarisation else allowed.depolarisation, "", less, True),
    )
    result = []
    for name, size, unit, change, positive in changes:
        if size:
            data = _in_frame(view, change[..., : view.rows, :])
            result.append(Effect(name, size, unit, data, positive=positive, shared=False))
    size = allowed.depolarisation
    if size and view.depolarisation is not None:
        change = np.zeros((view.rows, view.measured_channels))
        change[:, -1] = size
        result.append(Effect("offset of the depolarisation", size, "", change, shared=False))
    return result


def _of_elements(view: SpectrumView, signal: np.ndarray, allowed: Uncertainty) -> list[Effect]:
    """An offset of each element, and a depolarisation that mixes the phases of s and p: elements of the third
    and fourth rows and columns lose a share."""
    columns = signal[: view.points].reshape(view.rows, view.channels)
    names = [ELEMENTS[i] for i in view.elements]
    result = []
    for channel, name in enumerate(names) if allowed.mueller else ():
        change = np.zeros(columns.shape)
        change[:, channel] = allowed.mueller
        result.append(Effect(f"offset of {name}", allowed.mueller, "", change, shared=False))
    mixed = [allowed.depolarisation * bool({"3", "4"} & set(name[1:])) for name in names]
    if any(mixed):
        size = allowed.depolarisation
        result.append(Effect("depolarisation", size, "", -columns * mixed, positive=True, shared=False))
    return result


def _in_frame(view: SpectrumView, change: np.ndarray) -> np.ndarray:
    """A change of N, C and S (..., rows, 3), which leaves the depolarisation, as (..., rows, measured
    channels)."""
    keep = view.measured_channels
    if view.depolarisation is not None:
        change = np.insert(change, 3 if view.channels == 4 else 2, 0.0, axis=-1)
    if view.data.frame is not None:
        frame = np.asarray(view.data.frame)[..., : view.rows, :, :]
        change = np.einsum("...pij,...pj->...pi", frame, change)
    return change[..., :keep]


def _columns(view: SpectrumView, values: np.ndarray) -> np.ndarray:
    """Data values, or a change of them, (..., data values) as (..., rows, measured channels)."""
    columns = values[..., : view.points].reshape(*values.shape[:-1], view.rows, view.channels)
    return columns[..., : view.measured_channels]


def _on_sphere(view: SpectrumView, at: Local, change: np.ndarray) -> np.ndarray:
    """Change of N, C, S without its part outwards: Ψ and Δ do not depend on the degree of polarisation."""
    if view.elements:
        return change
    sphere = view.channels if view.depolarisation is None else view.channels - 1
    if sphere < 3 or view.data.frame is not None:
        return change
    outwards = _sphere(view, at.signal)[..., : view.rows, :]
    change[..., :3] -= outwards * np.sum(change[..., :3] * outwards, axis=-1, keepdims=True)
    return change


def _depolarising(view: SpectrumView, at: Local, signals: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Change of the depolarisation (rows,) by a weighted sum of signals.

    Averaged are N, C, S before they are brought to their sphere: of v = (N, C, S), 1 − v² changes by −2 v dv.
    """

    def polarised(signal: Any) -> np.ndarray:
        share = np.asarray(signal)[: view.points].reshape(view.rows, -1)[:, view.measured_channels - 1]
        return _sphere(view, signal)[: view.rows] * np.sqrt(np.maximum(1 - share, 0.0))[:, None]

    change = sum(weight * polarised(signal) for weight, signal in zip(weights, signals, strict=True))
    return -2 * np.sum(polarised(at.signal) * change, axis=1)


def _spheres(view: SpectrumView, signal: Any) -> np.ndarray:
    """N, C, S of each ratio of a signal (..., data values), (..., wavelengths with padding, ratios, 3)."""
    signal = np.asarray(signal)
    columns = signal.reshape(*signal.shape[:-1], -1, view.channels)
    columns = np.einsum("...pij,...pi->...pj", np.asarray(view.data.frame), columns)
    return columns.reshape(*columns.shape[:-1], -1, generalised.CHANNELS)


def _sphere(view: SpectrumView, signal: Any) -> np.ndarray:
    """N, C, S of a signal (..., data values), (..., wavelengths with padding, 3)."""
    signal = np.asarray(signal)
    columns = signal.reshape(*signal.shape[:-1], -1, view.channels)
    if view.data.frame is not None:
        columns = np.einsum("...pij,...pi->...pj", np.asarray(view.data.frame), columns)
    if view.depolarisation is not None:
        columns = columns[..., :-1]
    if columns.shape[-1] == 3:
        return columns
    third = np.sqrt(np.maximum(1 - np.sum(columns**2, axis=-1, keepdims=True), 0.0))
    return np.concatenate([columns, third], axis=-1)
