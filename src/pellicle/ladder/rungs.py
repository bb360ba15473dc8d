"""The forward rungs: ways to simulate a scene, each of which leaves something out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from pellicle.ladder.case import Case, altered, disperses, media
from pellicle.optics.dispersion import AbstractDispersion
from pellicle.optics.number import Pair, is_real, parts, real
from pellicle.planning import Plan, plan
from pellicle.scene import Free, Layer, Light, Scene, Substrate, coherent_layers, with_wavelength


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


def _replanned(scene: Scene) -> Way:
    return Way(plan(scene), scene)


def _normal(case: Case) -> Way | str:
    light = case.scene.light
    if case.ellipsometric:
        return "ellipsometry compares s and p, which are one at normal incidence"
    if not isinstance(light.angle, Free) and not np.any(light.angle):
        return "light comes at normal incidence"
    return _replanned(
        eqx.tree_at(
            lambda s: s.light, case.scene, Light(light.wavelength, 0.0, light.signal, light.polarisation)
        )
    )


def _has_series(case: Case) -> bool:
    """Whether there is one smooth coherent layer, of which only intensities are asked for."""
    smooth = not case.plan.on("roughness")
    return smooth and not case.ellipsometric and len(coherent_layers(case.scene)) == 1


def _closed(case: Case) -> Way | str:
    if not case.plan.on("coherence"):
        return "the full plan is the closed form"
    sharp = replace(case.scene.instrument, bandwidth=None, thickness_spread=None)
    layers = [replace(x, thickness_spread=None) if isinstance(x, Layer) else x for x in case.scene.layers]
    scene = eqx.tree_at(lambda s: (s.instrument, s.layers), case.scene, (sharp, tuple(layers)))
    return Way(altered(altered(plan(scene), "coherence", False), "orders", False), scene)


def _orders(count: int, case: Case) -> Way | str:
    if not _has_series(case):
        return "there is no series of one smooth layer's orders to cut off"
    if case.plan.on("coherence") and case.plan.row("orders").count <= count:
        return f"the full plan has no more than {case.plan.row('orders').count}"
    return Way(altered(altered(case.plan, "coherence", True), "orders", True, count), case.scene)


def _nodes(count: int, case: Case) -> Way | str:
    if case.plan.row("coherence").count <= count:
        return "nothing is averaged over nodes"
    return Way(altered(case.plan, "coherence", True, count), case.scene)


def _one_ray(case: Case) -> Way | str:
    if not case.scene.instrument.has_cone:
        return "there is no cone of light"
    narrow = replace(case.scene.instrument, angle_spread=None, numerical_aperture=None)
    return _replanned(eqx.tree_at(lambda s: s.instrument, case.scene, narrow))


def _no_back(case: Case) -> Way | str:
    substrate = case.scene.substrate
    if substrate.back is None:
        return "the substrate has no back face"
    if case.plan.signal == "T":
        return "what passes a plate has met its back face"
    deep = Substrate(substrate.material, roughness=substrate.roughness)
    return _replanned(eqx.tree_at(lambda s: s.substrate, case.scene, deep))


def _smooth(case: Case) -> Way | str:
    if not case.plan.on("roughness"):
        return "every face is smooth"
    layers = [replace(x, roughness=None) if isinstance(x, Layer) else x for x in case.scene.layers]
    substrate = replace(case.scene.substrate, roughness=None)
    return _replanned(eqx.tree_at(lambda s: (s.layers, s.substrate), case.scene, (tuple(layers), substrate)))


@final
class Transparent(AbstractDispersion):
    """The real index of another medium."""

    base: AbstractDispersion

    def index(self, wavelength):
        return real(self.base.index(wavelength))


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


def _transparent(case: Case) -> Way | str:
    if not case.plan.on("absorption"):
        return "no layer absorbs"
    layers = tuple(
        replace(x, material=Transparent(x.material)) if isinstance(x, Layer) else x for x in case.scene.layers
    )
    return _replanned(eqx.tree_at(lambda s: s.layers, case.scene, layers))


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
    Rung("closed form", "what damps the fringes", _closed),
    *(Rung(f"{m} order{'s' * (m > 1)}", "higher orders", partial(_orders, m)) for m in ORDERS),
    Rung("incoherent", "interference", partial(_orders, 0)),
    *(Rung(f"{n} nodes", "finer averages", partial(_nodes, n)) for n in (3, 7)),
    Rung("normal incidence", "the angle", _normal),
    Rung("one ray", "the cone of light", _one_ray),
    Rung("half space", "the plate's back face", _no_back),
    Rung("smooth faces", "roughness", _smooth),
    Rung("transparent layer", "its absorption", _transparent),
    Rung("constant index", "dispersion: the index of mid-band", _constant_index),
    Rung("twice the wavelengths", "nothing", _finer),
    *(
        Rung(f"every {nth} wavelength", "the others: a line between", partial(_coarser, step))
        for step, nth in ((2, "2nd"), (4, "4th"), (8, "8th"))
    ),
)
"""Every forward rung there is, in the order of the table."""
