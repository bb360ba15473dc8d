"""From a plan to a function that predicts the signal: it composes what the plan names, nothing else."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.empirical import Sampled
from pellicle.effects.plan import Plan
from pellicle.materials import materials_in
from pellicle.optics import ellipsometry, plate
from pellicle.scene.film import Scene, thickness_spread
from pellicle.scene.free import free_leaves
from pellicle.scene.layers import Interface, Layer
from pellicle.simulation import instrument
from pellicle.simulation.coherent_groups import Sheet, reflected, response_of, sheets_of, transmitted
from pellicle.simulation.instrument import Intensities

Simulate = Callable[[Scene], Any]


@jax.jit
def _index_and_slope(dispersion: AbstractDispersion, wavelength):
    return jax.jvp(dispersion.index, (wavelength,), (jnp.ones_like(wavelength),))


def sample(dispersion: AbstractDispersion, wavelength: np.ndarray, slope: bool = True) -> AbstractDispersion:
    """The dispersion at these wavelengths (nm), evaluated once; one with free parameters is kept.

    Raises ValueError where a material has no data, naming it and the wavelengths.
    """
    for material in materials_in(dispersion):
        material.check_range(wavelength)
    if free_leaves(dispersion):
        return dispersion
    index, rate = jax.device_get(_index_and_slope(dispersion, wavelength))
    return Sampled(wavelength, index, rate if slope else None)


def sampled(scene: Scene, slope: bool = True) -> Scene:
    """The scene with every medium that has no free parameter evaluated at the light's wavelengths.

    A fit then compiles one program for all tables, and evaluates them once.
    """
    wavelength = np.asarray(scene.light.wavelength, dtype=float)

    def media(s: Scene) -> list[AbstractDispersion]:
        back = [] if s.substrate.back is None else [s.substrate.back]
        layers = [layer.material for layer in s.layers if not isinstance(layer, Interface)]
        return [*layers, s.substrate.material, s.ambient, *back]

    return eqx.tree_at(media, scene, [sample(m, wavelength, slope) for m in media(scene)])


@lru_cache(maxsize=64)
def build(plan: Plan) -> Simulate:
    """simulate(scene) → the signal at `scene.light.wavelength`, as a fraction, without scale or offset.

    For ellipsometry it is N, C, S of the first wavelength, then of the next, in one array. `scene`
    holds numbers only (see `scene.insert`). The function is pure and can be traced.
    """
    ellipsometric = plan.signal == "psi-delta"
    rows = _ellipsometer(plan) if ellipsometric else _photometer(plan)
    rows = _blurred(rows, plan.row("coherence").count) if plan.row("coherence").count else rows
    if plan.on("angle-spread"):
        cone = plan.row("angle-spread")
        mix = instrument.unmixed if ellipsometric else instrument.mixed(plan.polarisation)
        rows = instrument.over_cone(rows, cone.count, cone.around, mix)
    finish = _on_sphere if ellipsometric else _mean
    return lambda scene: finish(rows(_simplified(plan, _shifted(scene))))


def _shifted(scene: Scene) -> Scene:
    """The scene at the wavelengths that the light had, where the instrument tells them wrong.

    A sampled medium follows by its slope, which is enough for the few nm of a calibration.
    """
    shift = scene.instrument.wavelength_shift
    if shift is None:
        return scene
    return eqx.tree_at(lambda s: s.light.wavelength, scene, scene.light.wavelength + shift)


def _simplified(plan: Plan, scene: Scene) -> Scene:
    for leave_out in plan.left_out:
        scene = leave_out(scene)
    return scene


def _blurred(rows: Intensities, count: int) -> Intensities:
    """Averaged over whatever the scene gives a width to."""

    def average(scene: Scene):
        averaged = rows
        for position, layer in enumerate(scene.layers):
            if isinstance(layer, Layer) and thickness_spread(scene, layer) is not None:
                spread = partial(_spread_of, position)
                averaged = instrument.over_thickness(averaged, count, position, spread)
        if scene.instrument.bandwidth is not None:
            averaged = instrument.over_bandwidth(averaged, count)
        return averaged(scene)

    return average


def _spread_of(position: int, scene: Scene):
    layer: Any = scene.layers[position]
    return thickness_spread(scene, layer)


def _mean(rows: Any) -> Any:
    return rows[0] if len(rows) == 1 else 0.5 * (rows[0] + rows[1])


def _on_sphere(rows: Any) -> Any:
    return jnp.stack(ellipsometry.normalised(ellipsometry.Stokes(*rows)), -1).reshape(-1)


def _photometer(plan: Plan) -> Intensities:
    """R or T of one polarisation, or of both."""
    follow = reflected if plan.signal == "R" else transmitted

    def simulate(scene: Scene):
        sheets = sheets_of(plan, scene)
        return jnp.stack([follow(plan, sheets, p) for p in _polarisations(plan)])

    return simulate


def _ellipsometer(plan: Plan) -> Intensities:
    """Sums of intensities, (4, wavelengths)."""

    def simulate(scene: Scene):
        sheet, *under = sheets = sheets_of(plan, scene)
        if not under:
            return jnp.stack(
                ellipsometry.stokes(response_of(plan, sheet, "s"), response_of(plan, sheet, "p"))
            )
        s, p = (reflected(plan, sheets, polarisation) for polarisation in "sp")
        return jnp.stack(ellipsometry.stokes_from_sums(s, p, _crossed(plan, sheets)))

    return simulate


def _crossed(plan: Plan, sheets: list[Sheet]):
    """conj(r_p) r_s of the first sheet and everything under it."""
    sheet, *under = sheets
    front = ellipsometry.cross_products(response_of(plan, sheet, "s"), response_of(plan, sheet, "p"))
    if not under:
        return front.reflected
    return plate.multiple_reflections(*front, _crossed(plan, under), sheet.internal)


def _polarisations(plan: Plan) -> str:
    if plan.on("polarisation"):
        return "sp"
    return plan.polarisation if plan.on("oblique") and plan.polarisation != "unpolarised" else "s"
