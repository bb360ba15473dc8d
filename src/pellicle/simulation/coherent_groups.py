"""Coherent groups of layers between thick media, and what light makes of one on top of another."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from pellicle.effects.plan import Plan
from pellicle.optics import coherent, interface, orders, plate, response
from pellicle.optics.pair import Number, imag, real
from pellicle.scene.film import Group, Scene, groups, thickness_spread
from pellicle.scene.layers import Layer


class Sheet(NamedTuple):
    """Coherent layers between two thick media, as numbers of the types that the plan allows."""

    scene: Scene
    group: Group
    above: Number
    layers: list[Number]
    below: Number
    phases: list[Any]
    angle: Any  # of incidence in radians; None is normal, `Inside` within a plate
    internal: Any  # what one passage through the plate beneath leaves, None on a half space


def sheets_of(plan: Plan, scene: Scene) -> list[Sheet]:
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
        sheets.append(Sheet(scene, group, thick[i], layers, thick[i + 1], phases, incidence, internal))
    return sheets


def _layer_index(plan: Plan, layer: Layer, wavelength: Any) -> Number:
    index = layer.material.index(wavelength)
    return index if plan.on("absorption") else real(index)


def _unchanged(index: Number) -> Number:
    return index


def reflected(plan: Plan, sheets: list[Sheet], polarisation: str):
    """R of the first sheet and everything under it."""
    sheet, *under = sheets
    faces = _faces(plan, sheet, polarisation)
    if not under:
        return faces["R"]()
    front = plate.Face(faces["R"](), faces["T"](), faces["below"]())
    return plate.plate_reflectance(front, reflected(plan, under, polarisation), sheet.internal)


def transmitted(plan: Plan, sheets: list[Sheet], polarisation: str):
    """T through the first sheet and everything under it, into the last medium."""
    sheet, *under = sheets
    faces = _faces(plan, sheet, polarisation)
    if not under:
        return faces["T"]()
    front = plate.Face(faces["R"](), faces["T"](), faces["below"]())
    back, passed = reflected(plan, under, polarisation), transmitted(plan, under, polarisation)
    return plate.plate_transmittance(front, back, passed, sheet.internal)


def _faces(plan: Plan, sheet: Sheet, polarisation: str) -> dict[str, Any]:
    """Functions that give a sheet's power coefficients; one that is not called costs nothing."""
    if not sheet.layers and not _rough(sheet):
        return _bare_faces(sheet, polarisation)
    if plan.on("orders"):
        return _windowed_faces(plan, sheet, polarisation)
    sheet_response = response_of(plan, sheet, polarisation)
    return {
        "R": partial(response.reflectance, sheet_response),
        "T": partial(response.transmittance, sheet_response),
        "below": partial(response.reflectance_below, sheet_response),
    }


def _bare_faces(sheet: Sheet, polarisation: str) -> dict[str, Any]:
    a, q_above = interface.transverse(sheet.above, sheet.angle)
    face = (sheet.above, q_above, sheet.below, interface.normal(sheet.below, a), polarisation)
    reflectance = partial(interface.reflectance, *face)
    return {"R": reflectance, "T": partial(interface.transmittance, *face), "below": reflectance}


def _rough(sheet: Sheet) -> bool:
    return any(face is not None for face in sheet.group.roughness)


def response_of(plan: Plan, sheet: Sheet, polarisation: str) -> response.Response:
    """The response of a sheet to one polarisation."""
    wavenumber = 2 * jnp.pi / sheet.scene.light.wavelength
    faces = [0.0 if x is None else wavenumber * x for x in sheet.group.roughness] if _rough(sheet) else None
    (sheet_response,) = coherent.responses(
        sheet.above,
        sheet.layers,
        sheet.below,
        sheet.phases,
        sheet.angle,
        polarisation,
        propagating=not plan.on("tunnelling"),
        roughness=faces,
    )
    return sheet_response


def _windowed_faces(plan: Plan, sheet: Sheet, polarisation: str) -> dict[str, Any]:
    """The same, order by order through the instrument's window."""
    layer = interface.allow_tunnelling(sheet.layers[0]) if plan.on("tunnelling") else sheet.layers[0]
    b = orders.airy_series(sheet.above, layer, sheet.below, sheet.phases[0], sheet.angle, polarisation)
    widths = (sheet.scene.instrument.bandwidth, thickness_spread(sheet.scene, sheet.group.layers[0]))
    window = orders.monochromatic if widths == (None, None) else orders.gaussian(_blur(plan, sheet))
    count = plan.row("orders").count
    back = orders.reversed_series(b)
    return {
        "R": lambda: orders.reflectance(b, window, count),
        "T": lambda: orders.transmittance(b, window, count),
        "below": lambda: orders.reflectance(back, window, count),
    }


def _blur(plan: Plan, sheet: Sheet):
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
    return orders.phase_variance(slope, bandwidth, cosine_index(at), spread, at)
