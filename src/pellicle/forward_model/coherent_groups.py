"""Coherent groups of layers between incoherent plates, and the intensities of all groups together."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.forward_model.plan import GENERAL, Plan
from pellicle.optics import coherent, interface, orders, plate, response
from pellicle.optics.anisotropy import Principal, each_index, mixes_polarisations, seen_by
from pellicle.optics.gradient import Gradient, gauss_points
from pellicle.optics.layer_rows import StackedLayers, stack_numbers
from pellicle.optics.pair import Pair, imag, is_real, joined, namespace, real
from pellicle.optics.repeats import Repeats
from pellicle.scene.film import CoherentLayers, Scene, groups, thickness_spread
from pellicle.scene.graded import Graded
from pellicle.scene.groups import runs, written_out
from pellicle.scene.layers import Layer, Plate


class CoherentGroup(NamedTuple):
    """Coherent layers between two thick media: numbers at each wavelength, of the types the plan needs."""

    above: Any  # media of optics
    layers: Sequence[Any]  # of a graded one its `Gradient`
    below: Any
    phases: Any  # a list, or an array of the layers in rows
    angle: Any  # of incidence in radians; None is normal, `Inside` within a plate
    internal: Any  # internal transmittance of the plate below, None on a half space; may be `PerPolarisation`
    collected: plate.Collection | None  # part of the light from beneath that plate, None for all
    roughness: list[Any] | None  # k₀σ of each face, None where all are smooth
    phase_variance: Any  # of the round-trip phase, None without damped orders; may be `PerPolarisation`
    repeats: Repeats  # of layers that stand in `layers` once


class PerPolarisation(NamedTuple):
    """A number that is not the same for s and p, as in a birefringent medium."""

    s: Any
    p: Any


def _per_polarisation(function: Callable[[str], Any], medium: Any) -> Any:
    """function(polarisation), for s and p apart where the medium is birefringent, else one for both."""
    return PerPolarisation(function("s"), function("p")) if isinstance(medium, Principal) else function("s")


def _of(number: Any, polarisation: str) -> Any:
    return getattr(number, polarisation) if isinstance(number, PerPolarisation) else number


def coherent_groups(plan: Plan, scene: Scene) -> list[CoherentGroup]:
    """The coherent groups of a scene from the ambient down."""
    wavelength = scene.light.wavelength
    if plan.row("anisotropy").count >= GENERAL:  # matrices of 4×4 have no powers
        scene = eqx.tree_at(lambda s: s.layers, scene, written_out(scene.layers))
    described, plates = groups(scene)
    if not plan.on("back-face"):
        described, plates = described[:1], ()
    angle = namespace(scene.light.angle).deg2rad(scene.light.angle) if plan.on("oblique") else None
    thick = [scene.ambient.index(wavelength)]
    a = interface.transverse(thick[0], angle)[0]
    for group in described:
        index = group.below.index(wavelength)
        opened = plan.on("tunnelling") and not mixes_polarisations(index)
        thick.append(each_index(joined, interface.allow_tunnelling(index) if opened else index))
    evaluated = []
    for i, group in enumerate(described):
        internal, collected = None, None
        if i < len(plates):
            medium = thick[i + 1]
            internal = _per_polarisation(partial(_internal, medium, a, plates[i], wavelength), medium)
            part = plates[i].back_collected, plates[i].back_reflections
            collected = plate.Collection(*part) if any(x is not None for x in part) else None
        layers, phases = _layers_and_phases(plan, group.layers, wavelength)
        smooth = all(face is None for face in group.roughness)
        rough = [0.0 if face is None else 2 * np.pi / wavelength * face for face in group.roughness]
        evaluated.append(
            CoherentGroup(
                above=thick[i],
                layers=layers,
                below=thick[i + 1],
                phases=phases,
                angle=angle if i == 0 or angle is None else interface.Inside(a),
                internal=internal,
                collected=collected,
                roughness=None if smooth else rough,
                phase_variance=_phase_variance(plan, scene, group, angle),
                repeats=Repeats(
                    tuple((count, len(own)) for count, own in runs(group.layers)),
                    tuple(layer.drift for layer in group.layers),
                ),
            )
        )
    return evaluated


def _layers_and_phases(plan: Plan, layers: Sequence[Layer], wavelength: Any) -> tuple[Any, Any]:
    """Indices and phases of layers; of many homogeneous ones in rows of arrays."""
    k0 = 2 * np.pi / wavelength
    thickness: list[Any] = [layer.thickness for layer in layers]
    columns = jnp.ndim(k0) != 1 or any(map(jnp.ndim, thickness))
    if len(layers) <= coherent.FEW or plan.on("anisotropy") or plan.on("gradient") or columns:
        return [_layer_index(plan, x, wavelength) for x in layers], [k0 * x for x in thickness]
    indices = _index_rows(plan, [layer.material for layer in layers], wavelength)
    return indices, k0 * stack_numbers(thickness, k0)[:, None]


def _index_rows(plan: Plan, materials: Sequence[Any], wavelength: Any) -> StackedLayers:
    """Indices of materials: those of one kind together, and one whose numbers are the same objects once."""
    kinds: dict[Any, dict[Any, list[Any]]] = {}
    places = []
    for material in materials:
        leaves, structure = jax.tree.flatten(material)
        kind, key = (structure, *map(jnp.shape, leaves)), tuple(map(id, leaves))
        kinds.setdefault(kind, {})[key] = leaves
        places.append((kind, key))
    order = {
        place: row for row, place in enumerate((kind, key) for kind, own in kinds.items() for key in own)
    }
    rows = [_index_of_kind(kind[0], [*own.values()], wavelength) for kind, own in kinds.items()]
    xp = namespace(rows)
    re = xp.concatenate([real(x) for x in rows])
    lossless = not plan.on("absorption") or all(map(is_real, rows))
    distinct = re if lossless else Pair(re, xp.concatenate([imag(x) + 0.0 * real(x) for x in rows]))
    return StackedLayers(distinct, tuple(order[place] for place in places))


def _index_of_kind(structure: Any, numbers: Sequence[Sequence[Any]], wavelength: Any) -> Any:
    """Index (materials, wavelengths) of materials of one structure, by the numbers of each."""
    if namespace(numbers, wavelength) is np:
        each = [structure.unflatten(leaves).index(wavelength) for leaves in numbers]
        return jax.tree.map(lambda *rows: np.stack(np.broadcast_arrays(*rows, wavelength)[:-1]), *each)
    columns = [*zip(*numbers, strict=True)]
    same = [all(x is column[0] for x in column) for column in columns]
    axes = tuple(None if alike else 0 for alike in same)
    stacks = [x[0] if alike else stack_numbers(x, wavelength) for x, alike in zip(columns, same, strict=True)]

    def index(*leaves: Any) -> Any:
        return structure.unflatten(leaves).index(wavelength)

    if all(same):
        return jax.tree.map(lambda x: x[None], index(*stacks))
    return jax.vmap(index, axes)(*stacks)


def _layer_index(plan: Plan, layer: Layer, wavelength: Any) -> Any:
    if isinstance(layer.material, Graded):
        points = [layer.material.at(z, wavelength) for z in gauss_points(plan.row("gradient").count)]
        return Gradient(*(point if plan.on("absorption") else real(point) for point in points))
    index = layer.material.index(wavelength)
    return each_index(joined if plan.on("absorption") else real, index)


def _internal(medium: Any, a: Any, below: Plate, wavelength: Any, polarisation: str) -> Any:
    extinction = imag(interface.normal(seen_by(medium, polarisation), a))
    return plate.internal_transmittance(extinction, below.plate_mm, wavelength)


class _Powers(NamedTuple):
    """Functions for the power coefficients of a group; one that is not called costs nothing."""

    R: Callable[[], Any]
    T: Callable[[], Any]
    R_below: Callable[[], Any]


def powers(plan: Plan, groups: list[CoherentGroup], polarisations: str, transmitted: bool) -> list[Any]:
    """R of the first group and everything below it, or T through them into the last medium, for each letter
    of `polarisations`."""
    each = [_powers(plan, group, polarisations) for group in groups]
    return [
        _together(groups, own, letter, transmitted) for letter, *own in zip(polarisations, *each, strict=True)
    ]


def _together(groups: list[CoherentGroup], each: list[_Powers], polarisation: str, transmitted: bool) -> Any:
    (group, *below), (own, *others) = groups, each
    if not below:
        return own.T() if transmitted else own.R()
    front = plate.Face(own.R(), own.T(), own.R_below())
    back = _together(below, others, polarisation, False)
    medium = _of(group.internal, polarisation), group.collected
    if not transmitted:
        return plate.plate_reflectance(front, back, *medium)
    return plate.plate_transmittance(front, back, _together(below, others, polarisation, True), *medium)


def _powers(plan: Plan, group: CoherentGroup, polarisations: str) -> list[_Powers]:
    if not group.layers and group.roughness is None:
        return [_of_face(group, letter) for letter in polarisations]
    if plan.on("orders"):
        return [_damped_orders(plan, group, letter) for letter in polarisations]
    amplitudes = responses_of(plan, group, polarisations)
    if len(amplitudes) < len(polarisations):  # both are equal at normal incidence
        amplitudes *= len(polarisations)
    functions = response.reflectance, response.transmittance, response.reflectance_below
    return [_Powers(*(partial(function, own) for function in functions)) for own in amplitudes]


def _of_face(group: CoherentGroup, polarisation: str) -> _Powers:
    above, below = (seen_by(medium, polarisation) for medium in (group.above, group.below))
    a, q_above = interface.transverse(above, group.angle)
    face = (above, q_above, below, interface.normal(below, a), polarisation)
    reflectance = partial(interface.reflectance, *face)
    return _Powers(reflectance, partial(interface.transmittance, *face), reflectance)


def responses_of(plan: Plan, group: CoherentGroup, polarisations: str) -> tuple[response.Response, ...]:
    """The response of a group to each polarisation."""
    film = (group.above, group.layers, group.below, group.phases, group.angle, polarisations)
    propagating = not plan.on("tunnelling")
    return coherent.responses(
        *film, propagating=propagating, roughness=group.roughness, repeats=group.repeats
    )


def _damped_orders(plan: Plan, group: CoherentGroup, polarisation: str) -> _Powers:
    """Sums of orders of interference, each damped by the instrument."""
    layer = interface.allow_tunnelling(group.layers[0]) if plan.on("tunnelling") else group.layers[0]
    series = orders.airy_series(group.above, layer, group.below, group.phases[0], group.angle, polarisation)
    variance = _of(group.phase_variance, polarisation)
    window = orders.monochromatic if group.phase_variance is None else orders.gaussian(variance)
    count = plan.row("orders").count
    from_below = orders.reversed_series(series)
    return _Powers(
        lambda: orders.reflectance(series, window, count),
        lambda: orders.transmittance(series, window, count),
        lambda: orders.reflectance(from_below, window, count),
    )


def _phase_variance(plan: Plan, scene: Scene, group: CoherentLayers, angle: Any) -> Any:
    """Variance of the round-trip phase from bandwidth and thickness spread; None without damped orders."""
    if not plan.on("orders") or not group.layers:
        return None
    layer = group.layers[0]
    widths = (scene.instrument.bandwidth, thickness_spread(scene, layer))
    if widths == (None, None):
        return None
    wavelength = scene.light.wavelength
    bandwidth, spread = (0.0 if width is None else width for width in widths)

    def variance(polarisation):
        def cosine_index(at):
            a, _ = interface.transverse(scene.ambient.index(at), angle)
            index = seen_by(_layer_index(plan, layer, at), polarisation)
            index = interface.allow_tunnelling(index) if plan.on("tunnelling") else index
            return real(interface.normal(index, a))

        def phase(at):
            return 4 * jnp.pi / at * cosine_index(at) * layer.thickness

        _, slope = jax.jvp(phase, (wavelength,), (jnp.ones_like(wavelength),))
        return orders.phase_variance(slope, bandwidth, cosine_index(wavelength), spread, wavelength)

    return _per_polarisation(variance, layer.material.index(wavelength))
