"""Electric and magnetic field at any depth of a coherent stack, in its ambient and in its substrate.

Within a layer the field is followed upwards from its lower face, and multiplied by e^{iqx} over the distance
x to its upper face: no exponential grows, and under a millimetre of metal the field is 0.

The fields at the interfaces are followed upwards from the wave that leaves into the substrate, as in
`pellicle.optics.stack`: in that direction the wave that grows is the physical one, and rounding errors decay
against it. They are scaled so that none overflows.

Source: Macleod, Thin-Film Optical Filters, chapter 2; Byrnes, arXiv:1603.02720, section 4; Born and Wolf,
Principles of Optics, section 1.6.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from pellicle.optics.anisotropy import is_anisotropic
from pellicle.optics.characteristic import Characteristic, matrix_elements, scale_exponent
from pellicle.optics.interface import Transverse, incident_factor, normal, normal_square, transverse
from pellicle.optics.pair import Number, Pair, abs2, imag, real, times_i, where


class Media(NamedTuple):
    """Numbers of a stack that s and p share; those of layers have them along the first axis."""

    ambient: Number
    permittivity: Pair  # of the layers
    squares: Pair  # q² of the layers
    phases: Any  # k₀d of the layers
    elements: Characteristic  # of the layers
    substrate: Pair
    q_top: Number
    q_bottom: Pair
    a: Any  # transverse index


class InterfaceFields(NamedTuple):
    """Fields of one polarisation at the lower face of each layer, and the ratios between them.

    U and V are E and H along the interfaces for s, H and E for p. Those of different layers have different
    scales: at the upper face of a layer the field is (U, V) of the layer above times the root of `size`.
    """

    U: Pair
    V: Pair
    size: Any  # of the fields at the layer's upper face
    weight: Any  # 1 for s, the permittivity for p
    top: tuple[Pair, Pair]  # at the first interface
    denominator: Pair  # 2 Y₀ U of the incident wave, Y₀ the ambient's admittance
    admittance: Number  # Y₀


def media(
    ambient: Number, layers: Sequence[Number], substrate: Number, phases: Sequence[Any], angle: Any
) -> Media:
    """Prepare a stack; arguments as for `coherent.responses`, except that no real index is a promise."""
    a, q_top = transverse(ambient, angle)
    leaves = jax.tree_util.tree_leaves((ambient, list(layers), substrate, list(phases), a))
    shape = jnp.broadcast_shapes(*(jnp.shape(x) for x in leaves))
    dtype = jnp.finfo(jnp.promote_types(jnp.result_type(*leaves), jnp.float32)).dtype

    def full(number: Any) -> Any:
        return jnp.broadcast_to(jnp.asarray(number, dtype), shape)

    def rows(numbers: Sequence[Any]) -> Any:
        return jnp.stack([full(n) for n in numbers]) if numbers else jnp.zeros((0, *shape), dtype)

    index = Pair(rows([real(n) for n in layers]), rows([imag(n) for n in layers]))
    bottom = Pair(full(real(substrate)), full(imag(substrate)))
    squares, depth = normal_square(index, a), rows(phases)
    squares = Pair(real(squares), imag(squares))
    return Media(
        ambient,
        index * index,
        squares,
        depth,
        matrix_elements(squares, depth),
        bottom * bottom,
        q_top,
        normal(bottom, a),
        a.index if isinstance(a, Transverse) else a,
    )


def interface_fields(stack: Media, polarisation: str) -> InterfaceFields:
    """Return the fields of one polarisation, "s" or "p", at the interfaces of a stack."""
    s = polarisation == "s"
    one = Pair(jnp.ones_like(stack.substrate.re), jnp.zeros_like(stack.substrate.re))
    weight = 0.0 * stack.permittivity + 1.0 if s else stack.permittivity
    bottom = stack.q_bottom if s else stack.q_bottom / stack.substrate
    admittance = stack.q_top if s else stack.q_top / (stack.ambient * stack.ambient)
    c, g = stack.elements.c, times_i(-stack.elements.f)

    def through_layer(fields, layer):
        (U, V), (c, across, back) = fields, layer
        above = U * c + across * V, V * c + back * U
        size = jax.lax.stop_gradient(abs2(above[0]) + abs2(above[1]))
        shrink = jax.lax.rsqrt(size)
        return (above[0] * shrink, above[1] * shrink), (U, V, size)

    layers = (c, g * weight, g * (stack.squares / weight))
    bottom_fields = (one, bottom * one)
    top, (U, V, size) = jax.lax.scan(through_layer, bottom_fields, layers, reverse=True)
    denominator = admittance * top[0] + top[1]
    return InterfaceFields(U, V, size, weight, top, denominator, admittance)


class PolarisedField(NamedTuple):
    """Field of one polarisation at a depth, for an incident wave of unit power along the normal.

    x lies in the plane of incidence, along the interfaces; z points from the ambient into the substrate.
    `magnetic` is in the unit in which a plane wave has |H| = |n E|.
    """

    electric: tuple[Number, Number, Number]  # without the common factor e^{i phase}
    magnetic: tuple[Number, Number, Number]
    phase: Any
    loss: Any  # Im ε at that depth

    def energy(self) -> Any:
        """Return |E|²; Im ε times it is the power absorbed over a depth of 1/k₀."""
        return sum(abs2(component) for component in self.electric)


class _Place(NamedTuple):
    """Fields along the interfaces, their common phase, and the permittivity, at a depth.

    The phase is apart because its slopes, as large as k₀d, would cancel in |E|² but for their rounding.
    """

    U: Pair
    V: Pair
    phase: Any
    permittivity: Pair


class _Layer(NamedTuple):
    """A layer's fields at its lower face, the logarithm of their scale, and what they are followed by."""

    U: Pair
    V: Pair
    exponent: Pair
    square: Pair
    weight: Pair
    permittivity: Pair
    upper: Any  # depth of its faces, nm
    lower: Any


def fields(
    ambient: Number,
    layers: Sequence[Number],
    substrate: Number,
    wavenumber: Any,
    thicknesses: Sequence[Any],
    depth: Any,
    angle: Any,
    polarisations: str = "sp",
) -> tuple[PolarisedField, ...]:
    """Return the field at a depth, for each letter of `polarisations`.

    **Arguments:** as for `coherent.responses`, with `wavenumber` k₀ in 1/nm, `thicknesses` in nm, and `depth`
    in nm from the first interface downwards, negative in the ambient. At an interface the field is that just
    below it. `angle` has no None.
    """
    if any(map(is_anisotropic, (ambient, *layers, substrate))):
        raise ValueError("fields and absorptances of birefringent layers are not computed: give one index")
    stack = media(ambient, layers, substrate, [wavenumber * d for d in thicknesses], angle)
    shape, dtype = stack.substrate.re.shape, stack.substrate.re.dtype
    rows = [jnp.broadcast_to(jnp.asarray(d, dtype), shape) for d in thicknesses]
    lower = jnp.cumsum(jnp.stack(rows), axis=0) if rows else jnp.zeros((0, *shape), dtype)
    return tuple(_field(stack, wavenumber, lower, depth, letter) for letter in polarisations)


def _field(stack: Media, wavenumber: Any, lower: Any, depth: Any, polarisation: str) -> PolarisedField:
    fields = interface_fields(stack, polarisation)
    s = polarisation == "s"
    zero = jnp.zeros_like(stack.substrate.re)
    # logarithms of the scales: from the first interface to the upper face of each layer, and within it
    within = scale_exponent(stack.squares, stack.phases) - 0.5 * jnp.log(fields.size)
    sums = jax.tree.map(lambda x: jnp.cumsum(x, axis=0), within)
    layers = _Layer(
        fields.U,
        fields.V,
        sums,
        stack.squares,
        fields.weight,
        stack.permittivity,
        jnp.concatenate([zero[None], lower[:-1]]) if lower.shape[0] else lower,
        lower,
    )
    e0 = stack.ambient * stack.ambient
    top = _Layer(
        *fields.top,
        Pair(zero, zero),
        _pair(stack.q_top * stack.q_top, zero),
        _pair(1.0 if s else e0, zero),
        _pair(e0, zero),
        jnp.full_like(zero, -jnp.inf),
        zero,
    )
    passed, foot = Pair(zero, zero), zero
    if lower.shape[0]:
        passed, foot = jax.tree.map(lambda x: x[-1], (sums, lower))
    below = jnp.where(depth >= foot, wavenumber * (depth - foot), 0.0)
    exponent = passed + times_i(stack.q_bottom * below)
    wave = jnp.exp(exponent.re)
    admittance = stack.q_bottom if s else stack.q_bottom / stack.substrate
    place = _Place(Pair(wave, 0.0 * wave), admittance * wave, exponent.im, stack.substrate + 0.0 * below)

    def choose(place: _Place, layer: _Layer) -> tuple[_Place, None]:
        inside = (depth >= layer.upper) & (depth < layer.lower)
        # of other layers any distance will do, if its slope is finite
        here = _within(layer, jnp.where(inside, wavenumber * (layer.lower - depth), 0.0))
        return _Place(*(where(inside, new, old) for new, old in zip(here, place, strict=True))), None

    place, _ = jax.lax.scan(choose, choose(place, top)[0], layers)
    return _components(stack, fields.denominator, place, polarisation)


def _within(layer: _Layer, height: Any) -> _Place:
    """Fields of a layer at a height k₀t above its lower face."""
    c, f, _, _ = matrix_elements(layer.square + 0.0 * height, height)
    exponent = layer.exponent - scale_exponent(layer.square + 0.0 * height, height)
    scale, g = jnp.exp(exponent.re), times_i(-f)
    U = (layer.U * c + layer.weight * layer.V * g) * scale
    V = (layer.V * c + layer.square / layer.weight * layer.U * g) * scale
    return _Place(U, V, exponent.im, layer.permittivity + 0.0 * height)


def _components(stack: Media, denominator: Number, place: _Place, polarisation: str) -> PolarisedField:
    factor = incident_factor(stack.ambient, stack.q_top, polarisation)
    if polarisation == "p":
        factor = factor / abs2(stack.ambient * stack.ambient)
    amplitude = jnp.sqrt(factor) / denominator
    U, V = place.U * amplitude, place.V * amplitude
    nothing = 0.0 * U
    loss = imag(place.permittivity)
    if polarisation == "s":
        return PolarisedField((nothing, U, nothing), (-V, nothing, stack.a * U), place.phase, loss)
    upright = -stack.a * U / place.permittivity
    return PolarisedField((V, nothing, upright), (nothing, U, nothing), place.phase, loss)


def _pair(number: Number, zero: Any) -> Pair:
    return Pair(real(number) + zero, imag(number) + zero)
