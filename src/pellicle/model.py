"""From a plan to a function that predicts the signal: it composes what the plan names, nothing else."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle import averages
from pellicle.averages import Intensities
from pellicle.materials import materials_in
from pellicle.optics import ellipsometry, film, interface, orders, plate, stack
from pellicle.optics.dispersion import AbstractDispersion, Sampled
from pellicle.optics.number import Number, imag, is_real, real, sincos_poly
from pellicle.planning import Plan
from pellicle.scene import Group, Interface, Layer, Scene, free_leaves, groups, thickness_spread

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
        mix = averages.unmixed if ellipsometric else averages.mixed(plan.polarisation)
        rows = averages.over_cone(rows, cone.count, cone.around, mix)
    finish = _on_sphere if ellipsometric else _mean
    return lambda scene: finish(rows(_simplified(plan, scene)))


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
                averaged = averages.over_thickness(averaged, count, position, spread)
        if scene.instrument.bandwidth is not None:
            averaged = averages.over_bandwidth(averaged, count)
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
    follow = _reflected if plan.signal == "R" else _transmitted

    def simulate(scene: Scene):
        sheets = _sheets(plan, scene)
        return jnp.stack([follow(plan, sheets, p) for p in _polarisations(plan)])

    return simulate


def _ellipsometer(plan: Plan) -> Intensities:
    """Sums of intensities, (4, wavelengths)."""

    def simulate(scene: Scene):
        sheet, *under = sheets = _sheets(plan, scene)
        if not under:
            return jnp.stack(ellipsometry.stokes(_wave(plan, sheet, "s"), _wave(plan, sheet, "p")))
        s, p = (_reflected(plan, sheets, polarisation) for polarisation in "sp")
        return jnp.stack(ellipsometry.summed(s, p, _crossed(plan, sheets)))

    return simulate


def _crossed(plan: Plan, sheets: list[_Sheet]):
    """conj(r_p) r_s of the first sheet and everything under it."""
    sheet, *under = sheets
    front = ellipsometry.crossed(_wave(plan, sheet, "s"), _wave(plan, sheet, "p"))
    if not under:
        return front.reflected
    return plate.bounced(*front, _crossed(plan, under), sheet.internal)


def _polarisations(plan: Plan) -> str:
    if plan.on("polarisation"):
        return "sp"
    return plan.polarisation if plan.on("oblique") and plan.polarisation != "unpolarised" else "s"


class _Sheet(NamedTuple):
    """Coherent layers between two thick media, as numbers of the types that the plan allows."""

    scene: Scene
    group: Group
    above: Number
    layers: list[Number]
    below: Number
    phases: list[Any]
    angle: Any  # of incidence in radians; None is normal, `Inside` within a plate
    internal: Any  # what one passage through the plate beneath leaves, None on a half space


def _sheets(plan: Plan, scene: Scene) -> list[_Sheet]:
    """One for each group of coherent layers, from the ambient down."""
    wavelength = scene.light.wavelength
    found, plates = groups(scene)
    angle = jnp.deg2rad(scene.light.angle) if plan.on("oblique") else None
    ambient = scene.ambient.index(wavelength)
    a = interface.transverse(ambient, angle)[0]
    any_root = interface.allow_tunnelling if plan.on("tunnelling") else _unchanged
    thick = [ambient, *(any_root(group.below.index(wavelength)) for group in found)]
    sheets = []
    for i, group in enumerate(found):
        internal = None
        if i < len(plates):
            extinction = imag(interface.normal(thick[i + 1], a))
            internal = plate.internal_transmittance(extinction, plates[i].plate_mm, wavelength)
        layers = [_layer_index(plan, layer, wavelength) for layer in group.layers]
        phases = [2 * jnp.pi / wavelength * layer.thickness for layer in group.layers]
        incidence = angle if i == 0 or angle is None else interface.Inside(a)
        sheets.append(_Sheet(scene, group, thick[i], layers, thick[i + 1], phases, incidence, internal))
    return sheets


def _layer_index(plan: Plan, layer: Layer, wavelength: Any) -> Number:
    index = layer.material.index(wavelength)
    return index if plan.on("absorption") else real(index)


def _unchanged(index: Number) -> Number:
    return index


def _reflected(plan: Plan, sheets: list[_Sheet], polarisation: str):
    """R of the first sheet and everything under it."""
    sheet, *under = sheets
    faces = _faces(plan, sheet, polarisation)
    if not under:
        return faces["R"]()
    front = plate.Face(faces["R"](), faces["T"](), faces["below"]())
    return plate.plate_reflectance(front, _reflected(plan, under, polarisation), sheet.internal)


def _transmitted(plan: Plan, sheets: list[_Sheet], polarisation: str):
    """T through the first sheet and everything under it, into the last medium."""
    sheet, *under = sheets
    faces = _faces(plan, sheet, polarisation)
    if not under:
        return faces["T"]()
    front = plate.Face(faces["R"](), faces["T"](), faces["below"]())
    back, passed = _reflected(plan, under, polarisation), _transmitted(plan, under, polarisation)
    return plate.plate_transmittance(front, back, passed, sheet.internal)


def _faces(plan: Plan, sheet: _Sheet, polarisation: str) -> dict[str, Any]:
    """Functions that give a sheet's power coefficients; one that is not called costs nothing."""
    if not sheet.layers and not _rough(sheet):
        return _bare_faces(sheet, polarisation)
    if plan.on("orders"):
        return _windowed_faces(plan, sheet, polarisation)
    wave = _wave(plan, sheet, polarisation)
    return {
        "R": partial(film.reflectance, wave),
        "T": partial(film.transmittance, wave),
        "below": partial(film.reflectance_below, wave),
    }


def _bare_faces(sheet: _Sheet, polarisation: str) -> dict[str, Any]:
    a, q_above = interface.transverse(sheet.above, sheet.angle)
    face = (sheet.above, q_above, sheet.below, interface.normal(sheet.below, a), polarisation)
    reflectance = partial(interface.reflectance, *face)
    return {"R": reflectance, "T": partial(interface.transmittance, *face), "below": reflectance}


def _rough(sheet: _Sheet) -> bool:
    return any(face is not None for face in sheet.group.roughness)


def _wave(plan: Plan, sheet: _Sheet, polarisation: str) -> film.Wave:
    ends = (sheet.angle, polarisation)
    if len(sheet.layers) == 1 and not _rough(sheet):
        only_waves = not plan.on("absorption") and not plan.on("tunnelling") and is_real(sheet.layers[0])
        through = film.through_wave if only_waves else film.through
        one = (sheet.above, sheet.layers[0], sheet.below, sheet.phases[0])
        (wave,) = film.film(*one, *ends, through=through, sincos=sincos_poly)
        return wave
    wavenumber = 2 * jnp.pi / sheet.scene.light.wavelength
    faces = [0.0 if x is None else wavenumber * x for x in sheet.group.roughness] if _rough(sheet) else None
    several = (sheet.above, sheet.layers, sheet.below, sheet.phases)
    (wave,) = stack.stack(*several, *ends, sincos=sincos_poly, roughness=faces)
    return wave


def _windowed_faces(plan: Plan, sheet: _Sheet, polarisation: str) -> dict[str, Any]:
    """The same, order by order through the instrument's window."""
    layer = interface.allow_tunnelling(sheet.layers[0]) if plan.on("tunnelling") else sheet.layers[0]
    b = orders.bounces(sheet.above, layer, sheet.below, sheet.phases[0], sheet.angle, polarisation)
    widths = (sheet.scene.instrument.bandwidth, thickness_spread(sheet.scene, sheet.group.layers[0]))
    window = orders.monochromatic if widths == (None, None) else orders.gaussian(_blur(plan, sheet))
    count = plan.row("orders").count
    back = orders.reversed_bounces(b)
    return {
        "R": lambda: orders.reflectance(b, window, count, sincos_poly),
        "T": lambda: orders.transmittance(b, window, count, sincos_poly),
        "below": lambda: orders.reflectance(back, window, count, sincos_poly),
    }


def _blur(plan: Plan, sheet: _Sheet):
    """Variance of the phase from the spectrometer's bandwidth and the layer's uneven thickness."""
    scene, layer = sheet.scene, sheet.group.layers[0]
    angle, at = None if sheet.angle is None else jnp.deg2rad(scene.light.angle), scene.light.wavelength

    def cosine_index(wavelength):
        a, _ = interface.transverse(scene.ambient.index(wavelength), angle)
        index = _layer_index(plan, layer, wavelength)
        index = interface.allow_tunnelling(index) if plan.on("tunnelling") else index
        return real(interface.normal(index, a))

    def phase(wavelength):
        return 4 * jnp.pi / wavelength * cosine_index(wavelength) * layer.thickness

    _, slope = jax.jvp(phase, (at,), (jnp.ones_like(at),))
    widths = (scene.instrument.bandwidth, thickness_spread(scene, layer))
    bandwidth, spread = (0.0 if width is None else width for width in widths)
    return orders.blur(slope, bandwidth, cosine_index(at), spread, at)
