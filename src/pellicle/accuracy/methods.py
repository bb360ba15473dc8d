"""Methods of simulating a scene, each of which leaves something out."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import jax.numpy as jnp
import numpy as np

from pellicle.accuracy.case import Case, with_effect
from pellicle.accuracy.media_methods import (
    aligned_axes,
    constant_index,
    fewer_slices,
    general_matrices,
    homogeneous_slices,
    transparent,
)
from pellicle.accuracy.variant import Method, Variant, without
from pellicle.effects.film_plan import full_plan, plan
from pellicle.forward_model.plan import GENERAL
from pellicle.scene.film import all_collected, coherent_layers, with_wavelength
from pellicle.scene.layers import Plate


def _without_angle(case: Case) -> Variant | str:
    if case.ellipsometric:
        return "ellipsometry compares s and p, which are equal at normal incidence"
    return without("oblique", "the light is at normal incidence", case)


def _s_alone(case: Case) -> Variant | str:
    if case.ellipsometric or case.scene.instrument.has_cone:
        return "this signal needs both polarisations"
    return without("polarisation", "there is only one polarisation", case)


def _half_space(case: Case) -> Variant | str:
    if case.plan.signal == "T":
        return "light transmitted by a plate passes its back face"
    return without("back-face", "the substrate has no back face", case)


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
    if case.plan.row("anisotropy").count >= GENERAL:
        return "layers in which s and p mix have no series of orders"
    if case.plan.on("orders"):
        return "fringes narrower than the sampling have no orders" if count else "this is the full plan"
    return Variant(with_effect(with_effect(case.plan, "coherence", True), "orders", True, count), case.scene)


def _nodes(count: int, case: Case) -> Variant | str:
    if case.plan.row("coherence").count <= count:
        return "no average over nodes"
    return Variant(with_effect(case.plan, "coherence", True, count), case.scene)


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
SLICES, HOMOGENEOUS_SLICES = (2, 4, 8), (8, 32)

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
    Method("one ray", "the cone of light", partial(without, "angle-spread", "no cone of light")),
    Method("half space", "the plate's back face", _half_space),
    Method("one back reflection", "later ones", partial(_collection, 1)),
    Method("all collected", "that part of the light misses the detector", partial(_collection, None)),
    Method("smooth faces", "roughness", partial(without, "roughness", "every face is smooth")),
    Method("isotropic average", "birefringence", partial(without, "anisotropy", "no medium is birefringent")),
    Method("aligned axes", "the tilt of optic axes", aligned_axes),
    Method("4×4 matrices", "nothing", general_matrices),
    Method("mean of the depth", "the gradient", partial(without, "gradient", "no layer is graded")),
    *(Method(f"{n} slices", "finer slices", partial(fewer_slices, n)) for n in SLICES),
    *(
        Method(f"{n} homogeneous slices", "the gradient within each", partial(homogeneous_slices, n))
        for n in HOMOGENEOUS_SLICES
    ),
    Method("transparent layer", "its absorption", transparent),
    Method("constant index", "dispersion: the index of mid-band", constant_index),
    Method("twice the wavelengths", "nothing", _finer),
    *(
        Method(f"every {nth} wavelength", "the others: interpolated", partial(_coarser, step))
        for step, nth in ((2, "2nd"), (4, "4th"), (8, "8th"))
    ),
)
"""Every method of simulating a scene, in the order of the table."""
