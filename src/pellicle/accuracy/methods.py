"""Methods of simulating a scene, each of which leaves something out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from pellicle.accuracy.case import Case, disperses, with_effect
from pellicle.dispersion.base import AbstractDispersion
from pellicle.effects.plan import Plan
from pellicle.effects.removal import FilmRemoval, RealPart
from pellicle.optics.pair import Pair, is_real, parts
from pellicle.planning.film import full_plan, plan
from pellicle.scene.film import Scene, all_collected, coherent_layers, media, with_wavelength
from pellicle.scene.graded import each_medium
from pellicle.scene.layers import Layer, Plate


class Variant(NamedTuple):
    """A method applied to a case: its plan and scene, a second program that completes the signal, and its
    precision."""

    plan: Plan
    scene: Scene
    finish: Callable[[Any], Any] | None = None
    double: bool = True


@dataclass(frozen=True)
class Method:
    """A method of simulating a scene; `variant` applies it to a case, or returns why it does not apply."""

    name: str
    leaves_out: str
    variant: Callable[[Case], Variant | str]


def _left_out(effect: str, case: Case) -> Variant:
    removal = FilmRemoval(effect)
    return Variant(replace(full_plan(removal(case.scene)), left_out=(removal,)), case.scene)


def _without(effect: str, absent: str, case: Case) -> Variant | str:
    """The scene without one effect, otherwise in full; `absent` is the reason where it does not have it."""
    return _left_out(effect, case) if case.plan.on(effect) else absent


def _without_angle(case: Case) -> Variant | str:
    if case.ellipsometric:
        return "ellipsometry compares s and p, which are equal at normal incidence"
    return _without("oblique", "the light is at normal incidence", case)


def _s_alone(case: Case) -> Variant | str:
    if case.ellipsometric or case.scene.instrument.has_cone:
        return "this signal needs both polarisations"
    return _without("polarisation", "there is only one polarisation", case)


def _half_space(case: Case) -> Variant | str:
    if case.plan.signal == "T":
        return "light transmitted by a plate passes its back face"
    return _without("back-face", "the substrate has no back face", case)


def _collection(reflections: int | None, case: Case) -> Variant | str:
    """The scene with all light from its back face collected, or that of so many reflections there."""
    if not case.plan.on("back-face"):
        return "the substrate has no back face"
    if reflections is None:
        scene = all_collected(case.scene)
        same = scene.substrate == case.scene.substrate and scene.layers == case.scene.layers
        return "all light from the back face is collected" if same else Variant(full_plan(scene), scene)
    plates = [x for x in case.scene.layers if isinstance(x, Plate)]
    if plates or case.scene.substrate.back_reflections is not None:
        return "reflections are counted at the back of a substrate, where all are collected"
    scene = replace(case.scene, substrate=replace(case.scene.substrate, back_reflections=reflections))
    return Variant(full_plan(scene), scene)


def _closed_form(case: Case) -> Variant | str:
    if not case.plan.on("coherence"):
        return "the full plan is the closed form"
    return Variant(with_effect(with_effect(case.plan, "coherence", False), "orders", False), case.scene)


def _orders(count: int, case: Case) -> Variant | str:
    smooth = not case.plan.on("roughness")
    if case.ellipsometric or not smooth or len(coherent_layers(case.scene)) != 1:
        return "only one smooth layer has a series of orders"
    if case.plan.on("orders"):
        return "fringes narrower than the sampling have no orders" if count else "this is the full plan"
    return Variant(with_effect(with_effect(case.plan, "coherence", True), "orders", True, count), case.scene)


def _nodes(count: int, case: Case) -> Variant | str:
    if case.plan.row("coherence").count <= count:
        return "no average over nodes"
    return Variant(with_effect(case.plan, "coherence", True, count), case.scene)


def _transparent(case: Case) -> Variant | str:
    if not case.plan.on("absorption"):
        return "no layer absorbs"
    layers = tuple(
        replace(x, material=each_medium(RealPart, x.material)) if isinstance(x, Layer) else x
        for x in case.scene.layers
    )
    clear = eqx.tree_at(lambda s: s.layers, case.scene, layers)
    return Variant(full_plan(clear), clear)


@final
class AtOne(AbstractDispersion):
    """Constant index: that of another medium at one wavelength (nm)."""

    base: AbstractDispersion
    at: float

    def index(self, wavelength):
        one = jnp.ones_like(wavelength)
        index = self.base.index(self.at * one[..., :1] if one.ndim else self.at * one)
        re, im = parts(index)
        return re * one if is_real(index) else Pair(re * one, im * one)


def _constant_index(case: Case) -> Variant | str:
    if not disperses(case):
        return "no index varies over the spectrum"
    middle = float(0.5 * (case.wavelength.min() + case.wavelength.max()))
    flat = [AtOne(m, middle) for m in media(case.scene)]
    return Variant(case.plan, eqx.tree_at(media, case.scene, flat))


def _is_rising(case: Case) -> bool:
    """True for one angle of incidence and rising wavelengths."""
    return not np.ndim(case.scene.light.angle) and bool(np.all(np.diff(case.wavelength) > 0))


def _coarser(step: int, case: Case) -> Variant | str:
    """Every `step`-th wavelength and the last, with linear interpolation between them."""
    own = case.wavelength
    if not _is_rising(case) or len(own) < 3 * step:
        return "too few wavelengths to leave any out"
    nodes = np.unique([*own[::step], own[-1]])
    size, left = len(own) - 1, np.arange(len(own) - 1) // step
    share = ((own[:-1] - nodes[left]) / (nodes[left + 1] - nodes[left]))[:, None]

    def finish(signal):
        rows = signal.reshape(len(nodes), -1)
        first, second = (jnp.repeat(x, step, axis=0)[:size] for x in (rows[:-1], rows[1:]))
        return jnp.concatenate([first + (second - first) * share.astype(rows.dtype), rows[-1:]]).reshape(-1)

    return Variant(case.plan, with_wavelength(case.scene, nodes), finish)


def _finer(case: Case) -> Variant | str:
    """One more wavelength between any two, whose signals are then discarded."""
    own = case.wavelength
    if not _is_rising(case) or len(own) < 2:
        return "too few wavelengths to insert others"
    more = np.sort(np.concatenate([own, 0.5 * (own[1:] + own[:-1])]))
    return Variant(
        case.plan,
        with_wavelength(case.scene, more),
        lambda signal: signal.reshape(len(more), -1)[::2].reshape(-1),
    )


ORDERS = (1, 2, 3, 5, 8)

METHODS = (
    Method("float64", "nothing", lambda case: Variant(case.plan, case.scene)),
    Method("float32", "nine digits of sixteen", lambda case: Variant(case.plan, case.scene, double=False)),
    Method(
        "planned",
        "what its plan leaves out",
        lambda case: Variant(plan(case.scene, case.tolerance), case.scene),
    ),
    Method("closed form", "the damping of fringes", _closed_form),
    *(Method(f"{m} order{'s' * (m > 1)}", "higher orders", partial(_orders, m)) for m in ORDERS),
    Method("incoherent", "interference", partial(_orders, 0)),
    *(Method(f"{n} nodes", "finer averages", partial(_nodes, n)) for n in (3, 7)),
    Method("normal incidence", "the angle", _without_angle),
    Method("s alone", "p", _s_alone),
    Method("one ray", "the cone of light", partial(_without, "angle-spread", "no cone of light")),
    Method("half space", "the plate's back face", _half_space),
    Method("one back reflection", "later ones", partial(_collection, 1)),
    Method("all collected", "that part of the light misses the detector", partial(_collection, None)),
    Method("smooth faces", "roughness", partial(_without, "roughness", "every face is smooth")),
    Method("transparent layer", "its absorption", _transparent),
    Method("constant index", "dispersion: the index of mid-band", _constant_index),
    Method("twice the wavelengths", "nothing", _finer),
    *(
        Method(f"every {nth} wavelength", "the others: interpolated", partial(_coarser, step))
        for step, nth in ((2, "2nd"), (4, "4th"), (8, "8th"))
    ),
)
"""Every method of simulating a scene, in the order of the table."""
