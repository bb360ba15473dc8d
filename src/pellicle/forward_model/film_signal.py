"""Forward model of a film: composes the effects of a plan into a function of a scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.dispersion.base import AbstractDispersion, known_index
from pellicle.dispersion.empirical import Tabulated
from pellicle.errors import UsageError
from pellicle.forward_model import instrument, mixed_polarisations
from pellicle.forward_model.coherent_groups import (
    CoherentGroup,
    coherent_groups,
    reflected,
    response_of,
    transmitted,
)
from pellicle.forward_model.instrument import Intensities
from pellicle.forward_model.plan import GENERAL, Plan
from pellicle.materials import Material, materials_in
from pellicle.optics import ellipsometry, plate
from pellicle.optics.hoisting import pointwise, stack_rows
from pellicle.optics.lens import Turn
from pellicle.scene.film import Reference, Scene, media, of_reference, thickness_spread, turned
from pellicle.scene.free import free_leaves
from pellicle.scene.layers import Layer

Simulate = Callable[[Scene], Any]


def tabulated(scene: Scene, slope: bool = True) -> Scene:
    """The scene with every medium evaluated at the wavelengths of its light.

    Of a medium with free parameters, the materials in it are evaluated. A fit then compiles one program for
    all materials, and evaluates each once. `slope` includes the derivative in wavelength, with which the
    index goes on where a shift of the wavelengths leaves the range of a table.

    **Raises:** ValueError where a material has no data, naming it and the wavelengths.
    """
    wavelength = np.asarray(scene.light.wavelength, dtype=float)

    if (reference := scene.reference) is not None:
        known = tabulated(of_reference(scene), slope)
        layers = known.layers if reference.layers else ()
        scene = replace(scene, reference=Reference(known.substrate, layers, reference.form))
    return eqx.tree_at(media, scene, [_tabulated(m, wavelength, slope) for m in media(scene)])


def _tabulated(dispersion: AbstractDispersion, wavelength: np.ndarray, slope: bool) -> AbstractDispersion:
    for material in materials_in(dispersion):
        material.check_range(wavelength)
    if free_leaves(dispersion):

        def known(part: Any) -> bool:
            return isinstance(part, Material) and not free_leaves(part)

        def at_wavelengths(part: Any) -> Any:
            return _tabulated(part, wavelength, slope) if known(part) else part

        return jax.tree.map(at_wavelengths, dispersion, is_leaf=known)
    if not slope:
        return Tabulated(wavelength, known_index(dispersion, wavelength), None)
    return Tabulated(wavelength, *jax.device_get(_index_and_slope(dispersion, wavelength)))


@jax.jit
def _index_and_slope(dispersion: AbstractDispersion, wavelength):
    return jax.jvp(dispersion.index, (wavelength,), (jnp.ones_like(wavelength),))


@lru_cache(maxsize=64)
def build(plan: Plan) -> Simulate:
    """The forward model of a plan: simulate(scene) → signal at `scene.light.wavelength`.

    The signal is a fraction, without scale or offset; for ellipsometry it is one array with N, C, S of the
    first wavelength, then of the next, or with the other rows of its kind of signal. `scene` contains numbers
    only (see `scene.free.insert`). The function is pure and can be traced.
    """
    kind, ellipsometric = plan.kind, plan.kind.ellipsometric
    powers = partial(_stokes_rows if ellipsometric else _power_rows, plan)
    finish = _normalised_rows if ellipsometric else _mean
    mixed = plan.row("anisotropy").count >= GENERAL
    if mixed:
        powers, finish = partial(mixed_polarisations.rows, plan), kind.of_sums
    averaged = plan.row("coherence").count or plan.on("angle-spread")

    def at_each_wavelength(groups: list[CoherentGroup], **turn: Any) -> Sequence[Any]:
        return list(powers(groups, **turn)) if averaged else finish(powers(groups))

    def monochromatic(scene: Scene, /, **turn: Any) -> Any:
        groups = coherent_groups(plan, scene)
        # slices have an axis of their own, along which nothing acts element by element; a program of the 4×4
        # method with its slopes in each number one by one takes a minute to compile
        if plan.on("gradient") or mixed or _birefringent_on_plates(plan):
            return at_each_wavelength(groups, **turn)
        return pointwise(at_each_wavelength, groups)

    def of_ray(turn: Turn | None = None) -> Intensities:
        one: Intensities = monochromatic if turn is None else partial(monochromatic, turn=turn)
        count = plan.row("coherence").count
        return _averaged(one, count) if count else one

    intensities, cone = of_ray(), plan.row("angle-spread")
    if cone.on and mixed:
        intensities = instrument.over_lens(of_ray, cone.count, cone.around)
    elif cone.on:
        mix = instrument.turned_stokes if ellipsometric else instrument.mixed(plan.polarisation)
        intensities = instrument.over_cone(intensities, cone.count, cone.around, mix)

    def simulate(scene: Scene) -> Any:
        scene = turned(_shifted(scene))
        for remove in plan.left_out:
            scene = remove(scene)
        rows = finish(intensities(scene)) if averaged else intensities(scene)
        # behind the averages, whose slopes then have three rows
        rows = kind.isotropic(rows) if ellipsometric and not mixed else rows
        return stack_rows(rows).T.reshape(-1) if ellipsometric else kind.of_power(rows[0])

    return simulate if plan.reference is None else _against(simulate, build(plan.reference))


def _against(simulate: Simulate, reference: Simulate) -> Simulate:
    """The contrast of a scene against its reference."""

    def contrast(scene: Scene) -> Any:
        kind = scene.light.kind.seen_in(scene, False)
        return kind.against(simulate(scene), reference(of_reference(scene)))

    return contrast


def depolarises(plan: Plan) -> bool:
    """True where intensities of several polarisations add, so that some light is unpolarised.

    (N, C, S) of `build` is then shorter than 1: the depolarisation is 1 − N² − C² − S².
    """
    return plan.on("back-face") or plan.on("angle-spread") or bool(plan.row("coherence").count)


def _shifted(scene: Scene) -> Scene:
    """The scene at its true wavelengths and angles, where the instrument's are shifted.

    A tabulated medium follows to first order, which is enough for the few nm of a calibration.
    """
    nm, degrees = scene.instrument.wavelength_shift, scene.instrument.angle_shift
    if nm is not None:
        scene = eqx.tree_at(lambda s: s.light.wavelength, scene, scene.light.wavelength + nm)
    if degrees is not None:
        scene = eqx.tree_at(lambda s: s.light.angle, scene, scene.light.angle + degrees)
    return scene


def _averaged(intensities: Intensities, count: int) -> Intensities:
    """Intensities averaged over the thickness spreads and the bandwidth of a scene."""

    def average(scene: Scene):
        averaged = intensities
        for position, layer in enumerate(scene.layers):
            if isinstance(layer, Layer) and thickness_spread(scene, layer) is not None:
                averaged = instrument.over_thickness(averaged, count, position)
        if scene.instrument.bandwidth is not None:
            averaged = instrument.over_bandwidth(averaged, count)
        return averaged(scene)

    return average


def _mean(rows: Sequence[Any]) -> Sequence[Any]:
    """The mean over polarisations."""
    return rows if len(rows) == 1 else [0.5 * (rows[0] + rows[1])]


def _normalised_rows(rows: Sequence[Any]) -> Sequence[Any]:
    """N, C and S; behind a cone of light also m22 and m44 of the Mueller matrix."""
    n, c, s, intensity, *others = rows
    found = ellipsometry.normalised(ellipsometry.Stokes(n, c, s, intensity))
    if not others:
        return found
    m22, m44 = others
    return [*found, *ellipsometry.normalised(ellipsometry.Stokes(n, m22, m44, intensity))[1:]]


def _power_rows(plan: Plan, groups: list[CoherentGroup]) -> list[Any]:
    """R or T of one polarisation, or of both."""
    power = transmitted if plan.kind.transmitted else reflected
    polarisations = "sp"
    if not plan.on("polarisation"):
        one = (plan.on("oblique") or plan.on("anisotropy")) and plan.polarisation != "unpolarised"
        polarisations = plan.polarisation if one else "s"
    return [power(plan, groups, p) for p in polarisations]


def _stokes_rows(plan: Plan, groups: list[CoherentGroup]) -> ellipsometry.Stokes:
    """Stokes parameters before normalisation."""
    through = plan.kind.transmitted
    if len(groups) == 1:
        s, p = (response_of(plan, groups[0], polarisation) for polarisation in "sp")
        return ellipsometry.transmitted_stokes(s, p) if through else ellipsometry.stokes(s, p)
    if _birefringent_on_plates(plan):
        if through:
            raise UsageError(mixed_polarisations.NO_PLATE)
        return mixed_polarisations.stokes(plan, groups)
    s, p = ((transmitted if through else reflected)(plan, groups, polarisation) for polarisation in "sp")
    cross = _transmitted_product(plan, groups) if through else _cross_product(plan, groups)
    return ellipsometry.stokes_from_sums(s, p, cross)


def _birefringent_on_plates(plan: Plan) -> bool:
    """True where s and p may cross the layers with different phases that the 2×2 method leaves out.

    Its amplitudes have a scale, which is real and the same for s and p in one layer without losses.
    """
    scaled = plan.on("absorption") or plan.on("tunnelling") or plan.on("stack")
    return plan.on("anisotropy") and plan.on("back-face") and plan.ellipsometric and scaled


def _cross_product(plan: Plan, groups: list[CoherentGroup]):
    """conj(r_p) r_s of the first group and everything below it."""
    group, *below = groups
    front = ellipsometry.cross_products(response_of(plan, group, "s"), response_of(plan, group, "p"))
    if not below:
        return front.reflected
    orders = front.reflected, front.passed_twice, front.below, _cross_product(plan, below)
    return plate.multiple_reflections(*orders, group.internal, group.collected)


def _transmitted_product(plan: Plan, groups: list[CoherentGroup]):
    """conj(t_p) t_s through the first group and everything below it."""
    group, *below = groups
    front = ellipsometry.cross_products(response_of(plan, group, "s"), response_of(plan, group, "p"))
    if not below:
        return front.passed
    face = plate.Face(front.reflected, front.passed, front.below)
    back, passed = _cross_product(plan, below), _transmitted_product(plan, below)
    return plate.plate_transmittance(face, back, passed, group.internal, group.collected)
