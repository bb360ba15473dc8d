"""The forward rungs: ways to simulate a scene, each of which leaves something out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from pellicle.accuracy.case import Case, altered, disperses, media
from pellicle.dispersion.base import AbstractDispersion
from pellicle.effects.plan import Plan
from pellicle.effects.removal import FilmRemoval, RealPart
from pellicle.optics.pair import Pair, is_real, parts
from pellicle.planning.film import full_plan, plan
from pellicle.scene.film import Scene, coherent_layers, with_wavelength
from pellicle.scene.layers import Layer


class Way(NamedTuple):
    """How a rung simulates: its plan and scene, what a second program makes of the signal, the precision."""

    plan: Plan
    scene: Scene
    finish: Callable[[Any], Any] | None = None
    double: bool = True


@dataclass(frozen=True)
class Rung:
    """One way to the answer. `way` gives the way, or the reason why it makes no sense for a case."""

    name: str
    leaves_out: str
    way: Callable[[Case], Way | str]


def _full(case: Case) -> Way:
    return Way(case.plan, case.scene)


def _single(case: Case) -> Way:
    return Way(case.plan, case.scene, double=False)


def _planned(case: Case) -> Way:
    return Way(plan(case.scene, case.tolerance), case.scene)


def _without(effect: str, absent: str, case: Case) -> Way | str:
    """The scene without one effect, all else in full; `absent` is what to say where it has none."""
    if not case.plan.on(effect):
        return absent
    return _left_out(effect, case)


def _left_out(effect: str, case: Case) -> Way:
    leave_out = FilmRemoval(effect)
    return Way(replace(full_plan(leave_out(case.scene)), left_out=(leave_out,)), case.scene)


def _without_angle(case: Case) -> Way | str:
    if case.ellipsometric:
        return "ellipsometry compares s and p, which are one at normal incidence"
    return _without("oblique", "light comes at normal incidence", case)


def _s_alone(case: Case) -> Way | str:
    if case.ellipsometric or case.scene.instrument.has_cone:
        return "this scene is seen in both polarisations"
    return _without("polarisation", "one polarisation is all there is", case)


def _half_space(case: Case) -> Way | str:
    if case.plan.signal == "T":
        return "what passes a plate has met its back face"
    return _without("back-face", "the substrate has no back face", case)


def _closed(case: Case) -> Way | str:
    if not case.plan.on("coherence"):
        return "the full plan is the closed form"
    return Way(altered(altered(case.plan, "coherence", False), "orders", False), case.scene)


def _orders(count: int, case: Case) -> Way | str:
    smooth = not case.plan.on("roughness")
    if case.ellipsometric or not smooth or len(coherent_layers(case.scene)) != 1:
        return "there is no series of one smooth layer's orders to cut off"
    if case.plan.on("orders"):
        return "fringes narrower than the sampling leave no order" if count else "that is the full plan"
    return Way(altered(altered(case.plan, "coherence", True), "orders", True, count), case.scene)


def _nodes(count: int, case: Case) -> Way | str:
    if case.plan.row("coherence").count <= count:
        return "nothing is averaged over nodes"
    return Way(altered(case.plan, "coherence", True, count), case.scene)


def _transparent(case: Case) -> Way | str:
    if not case.plan.on("absorption"):
        return "no layer absorbs"
    layers = tuple(
        replace(x, material=RealPart(x.material)) if isinstance(x, Layer) else x for x in case.scene.layers
    )
    clear = eqx.tree_at(lambda s: s.layers, case.scene, layers)
    return Way(full_plan(clear), clear)


@final
class AtOne(AbstractDispersion):
    """The index that another medium has at one wavelength (nm), at all of them."""

    base: AbstractDispersion
    at: float

    def index(self, wavelength):
        one = jnp.ones_like(wavelength)
        index = self.base.index(self.at * one[..., :1] if one.ndim else self.at * one)
        re, im = parts(index)
        return re * one if is_real(index) else Pair(re * one, im * one)


def _constant_index(case: Case) -> Way | str:
    if not disperses(case):
        return "no medium's index changes along the spectrum"
    middle = float(0.5 * (case.wavelength.min() + case.wavelength.max()))
    flat = [AtOne(m, middle) for m in media(case.scene)]
    return Way(case.plan, eqx.tree_at(media, case.scene, flat))


def _rises(case: Case) -> bool:
    return not np.ndim(case.scene.light.angle) and bool(np.all(np.diff(case.wavelength) > 0))


def _coarser(step: int, case: Case) -> Way | str:
    """Every so-many-th wavelength and the last, and straight lines between them."""
    own = case.wavelength
    if not _rises(case) or len(own) < 3 * step:
        return "there are too few wavelengths to leave any out"
    some = np.unique([*own[::step], own[-1]])
    size, left = len(own) - 1, np.arange(len(own) - 1) // step
    share = ((own[:-1] - some[left]) / (some[left + 1] - some[left]))[:, None]

    def finish(signal):
        rows = signal.reshape(len(some), -1)
        first, second = (jnp.repeat(x, step, axis=0)[:size] for x in (rows[:-1], rows[1:]))
        return jnp.concatenate([first + (second - first) * share.astype(rows.dtype), rows[-1:]]).reshape(-1)

    return Way(case.plan, with_wavelength(case.scene, some), finish)


def _finer(case: Case) -> Way | str:
    """A wavelength between any two, whose signals are then not used."""
    own = case.wavelength
    if not _rises(case) or len(own) < 2:
        return "there are no wavelengths between which others lie"
    more = np.sort(np.concatenate([own, 0.5 * (own[1:] + own[:-1])]))
    return Way(
        case.plan,
        with_wavelength(case.scene, more),
        lambda signal: signal.reshape(len(more), -1)[::2].reshape(-1),
    )


ORDERS = (1, 2, 3, 5, 8)

FORWARD = (
    Rung("float64", "nothing", _full),
    Rung("float32", "nine digits of sixteen", _single),
    Rung("planned", "what a plan within the tolerance does", _planned),
    Rung("closed form", "what damps the fringes", _closed),
    *(Rung(f"{m} order{'s' * (m > 1)}", "higher orders", partial(_orders, m)) for m in ORDERS),
    Rung("incoherent", "interference", partial(_orders, 0)),
    *(Rung(f"{n} nodes", "finer averages", partial(_nodes, n)) for n in (3, 7)),
    Rung("normal incidence", "the angle", _without_angle),
    Rung("s alone", "p", _s_alone),
    Rung("one ray", "the cone of light", partial(_without, "angle-spread", "there is no cone of light")),
    Rung("half space", "the plate's back face", _half_space),
    Rung("smooth faces", "roughness", partial(_without, "roughness", "every face is smooth")),
    Rung("transparent layer", "its absorption", _transparent),
    Rung("constant index", "dispersion: the index of mid-band", _constant_index),
    Rung("twice the wavelengths", "nothing", _finer),
    *(
        Rung(f"every {nth} wavelength", "the others: a line between", partial(_coarser, step))
        for step, nth in ((2, "2nd"), (4, "4th"), (8, "8th"))
    ),
)
"""Every forward rung there is, in the order of the table."""
