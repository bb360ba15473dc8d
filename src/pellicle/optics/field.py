"""Electric and magnetic field at any depth of a coherent stack, and the absorptance of each of its layers.

Within a layer the field is followed upwards from its lower face, and multiplied by e^{iqx} over the distance
x to its upper face: no exponential grows, and under a millimetre of metal the field is 0.

The fields at the interfaces are followed upwards from the wave that leaves into the substrate, as in
`pellicle.optics.coherent`: in that direction the wave that grows is the physical one, and rounding errors
decay against it. They are scaled so that none overflows.

The power absorbed at a depth is Im ε |E|² in units of the incident wave, and its integral over a layer is
known in closed form. So a weakly absorbing layer has all its digits, which the difference between the powers
through its faces would lose, and R + T + ΣA = 1 is a check and no definition.

The integrals of |cos(qt)|² and |sin(qt)/q|² over a layer are multiplied by Im Q. With q = p + ib they are
built from sinh(2bt)/2b and sin(2pt)/2p, which are g(b²) and g(−p²) for one entire function g. So the integral
of |sin(qt)/q|² is a divided difference of g, symmetric in b² and −p², and smooth in Re Q and Im Q where q is
0 (Byrnes, arXiv:1603.02720, section 4, integrated over the layer).

Source: Macleod, Thin-Film Optical Filters, chapter 2; Byrnes, arXiv:1603.02720, section 4; Born and Wolf,
Principles of Optics, section 1.6; Pettersson, Roman and Inganäs, J. Appl. Phys. 86, 487 (1999).
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from pellicle.optics.anisotropy import Medium, is_anisotropic
from pellicle.optics.characteristic import Characteristic, matrix_elements, scale_exponent
from pellicle.optics.interface import Transverse, incident_factor, normal, normal_square, transverse
from pellicle.optics.pair import Number, Pair, abs2, conj, imag, real, sqrt, times_i, where
from pellicle.optics.special import exp_and_expm1


class Media(NamedTuple):
    """Numbers of a stack that s and p share; those of layers have them along the first axis."""

    ambient: Number
    permittivity: Number  # of the layers
    squares: Number  # q² of the layers
    phases: Any  # k₀d of the layers
    elements: Characteristic  # of the layers
    substrate: Number
    q_top: Number
    q_bottom: Number
    a: Any  # transverse index


class InterfaceFields(NamedTuple):
    """Fields of one polarisation at the lower face of each layer, and the ratios between them.

    U and V are E and H along the interfaces for s, H and E for p. Those of different layers have different
    scales: at the upper face of a layer the field is (U, V) of the layer above times the root of `size`.
    """

    U: Number
    V: Number
    size: Any  # of the fields at the layer's upper face
    weight: Any  # 1 for s, the permittivity for p
    top: tuple[Number, Number]  # at the first interface
    denominator: Number  # 2 Y₀ U of the incident wave, Y₀ the ambient's admittance


def media(
    ambient: Any, layers: Sequence[Any], substrate: Any, phases: Sequence[Any] | jax.Array, angle: Any
) -> Media:
    """Prepare a stack; arguments as for `coherent.responses`, except that no real index is a promise."""
    if any(map(is_anisotropic, (ambient, *layers, substrate))):
        raise ValueError("fields and absorptances of birefringent layers are not computed: give one index")
    a, q_top = transverse(ambient, angle)
    leaves = jax.tree.leaves((ambient, list(layers), substrate, list(phases), a))
    shape = jnp.broadcast_shapes(*(jnp.shape(x) for x in leaves))
    dtype = jnp.finfo(jnp.promote_types(jnp.result_type(*leaves), jnp.float32)).dtype

    def full(number: Any) -> Any:
        return jnp.broadcast_to(jnp.asarray(number, dtype), shape)

    def rows(numbers: Any) -> Any:
        return jnp.stack([full(n) for n in numbers]) if len(numbers) else jnp.zeros((0, *shape), dtype)

    index = Pair(rows([real(n) for n in layers]), rows([imag(n) for n in layers]))
    bottom = Pair(full(real(substrate)), full(imag(substrate)))
    squares, depth = normal_square(index, a), rows(phases)
    squares = Pair(real(squares), imag(squares))
    elements, a_ = matrix_elements(squares, depth), a.index if isinstance(a, Transverse) else a
    q_bottom = normal(bottom, a)
    return Media(ambient, index * index, squares, depth, elements, bottom * bottom, q_top, q_bottom, a_)


def interface_fields(stack: Media, polarisation: str) -> InterfaceFields:
    """Return the fields of one polarisation, "s" or "p", at the interfaces of a stack."""
    s = polarisation == "s"
    one = Pair(jnp.ones_like(real(stack.substrate)), jnp.zeros_like(real(stack.substrate)))
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
    top, (U, V, size) = jax.lax.scan(through_layer, (one, bottom * one), layers, reverse=True)
    return InterfaceFields(U, V, size, weight, top, admittance * top[0] + top[1])


def _incident(stack: Media, polarisation: str) -> Any:
    """Return the factor of the incident wave in powers."""
    factor = incident_factor(stack.ambient, stack.q_top, polarisation)
    return factor if polarisation == "s" else factor / abs2(stack.ambient * stack.ambient)


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

    U: Number
    V: Number
    phase: Any
    permittivity: Number


class _Layer(NamedTuple):
    """A layer's fields at its lower face, the logarithm of their scale, and what they are followed by."""

    U: Number
    V: Number
    exponent: Number
    square: Number
    weight: Number
    permittivity: Number
    upper: Any  # depth of its faces, nm
    lower: Any


def fields(
    ambient: Medium,
    layers: Sequence[Medium],
    substrate: Medium,
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
    stack = media(ambient, layers, substrate, [wavenumber * d for d in thicknesses], angle)
    shape, dtype = real(stack.substrate).shape, real(stack.substrate).dtype
    rows = [jnp.broadcast_to(jnp.asarray(d, dtype), shape) for d in thicknesses]
    lower = jnp.cumsum(jnp.stack(rows), axis=0) if rows else jnp.zeros((0, *shape), dtype)
    return tuple(_field(stack, wavenumber, lower, depth, letter) for letter in polarisations)


def _field(stack: Media, wavenumber: Any, lower: Any, depth: Any, polarisation: str) -> PolarisedField:
    fields = interface_fields(stack, polarisation)
    s = polarisation == "s"
    zero = jnp.zeros_like(real(stack.substrate))
    # logarithms of the scales: from the first interface to the upper face of each layer, and within it
    within = scale_exponent(stack.squares, stack.phases) - 0.5 * jnp.log(fields.size)
    sums = jax.tree.map(lambda x: jnp.cumsum(x, axis=0), within)
    upper = jnp.concatenate([zero[None], lower[:-1]]) if lower.shape[0] else lower
    layer_media = (stack.squares, fields.weight, stack.permittivity)
    layers = _Layer(fields.U, fields.V, sums, *layer_media, upper, lower)
    e0 = stack.ambient * stack.ambient
    ambient = (stack.q_top * stack.q_top, 1.0 if s else e0, e0)
    square, weight, epsilon = (Pair(real(number) + zero, imag(number) + zero) for number in ambient)
    top = _Layer(*fields.top, Pair(zero, zero), square, weight, epsilon, jnp.full_like(zero, -jnp.inf), zero)
    passed, foot = Pair(zero, zero), zero
    if lower.shape[0]:
        passed, foot = jax.tree.map(lambda x: x[-1], (sums, lower))
    below = jnp.where(depth >= foot, wavenumber * (depth - foot), 0.0)
    exponent = passed + times_i(stack.q_bottom * below)
    wave = jnp.exp(real(exponent))
    admittance = stack.q_bottom if s else stack.q_bottom / stack.substrate
    place = _Place(Pair(wave, 0.0 * wave), admittance * wave, imag(exponent), stack.substrate + 0.0 * below)

    def choose(place: _Place, layer: _Layer) -> tuple[_Place, None]:
        inside = (depth >= layer.upper) & (depth < layer.lower)
        # of other layers any distance will do, if its slope is finite
        here = _within(layer, jnp.where(inside, wavenumber * (layer.lower - depth), 0.0))
        return _Place(*(where(inside, new, old) for new, old in zip(here, place, strict=True))), None

    place, _ = jax.lax.scan(choose, choose(place, top)[0], layers)
    amplitude = jnp.sqrt(_incident(stack, polarisation)) / fields.denominator
    U, V, loss = place.U * amplitude, place.V * amplitude, imag(place.permittivity)
    nothing = 0.0 * U
    if s:
        return PolarisedField((nothing, U, nothing), (-V, nothing, stack.a * U), place.phase, loss)
    upright = -stack.a * U / place.permittivity
    return PolarisedField((V, nothing, upright), (nothing, U, nothing), place.phase, loss)


def _within(layer: _Layer, height: Any) -> _Place:
    """Fields of a layer at a height k₀t above its lower face."""
    c, f, _, _ = matrix_elements(layer.square + 0.0 * height, height)
    exponent = layer.exponent - scale_exponent(layer.square + 0.0 * height, height)
    scale, g = jnp.exp(real(exponent)), times_i(-f)
    U = (layer.U * c + layer.weight * layer.V * g) * scale
    V = (layer.V * c + layer.square / layer.weight * layer.U * g) * scale
    return _Place(U, V, imag(exponent), layer.permittivity + 0.0 * height)


_TERMS = 14
"""Terms of the series at |k²Q| < 1: the next ones are below 1e-18 of the sum."""


class LayerIntegrals(NamedTuple):
    """Im Q times integrals over k₀t from 0 to k, times |scale|² of the layer's matrix elements."""

    cc: Any  # of |cos(qt)|²
    ff: Any  # of |sin(qt)/q|²
    cf: Number  # of conj(cos(qt)) sin(qt)/q


def absorptances(
    ambient: Medium,
    layers: Sequence[Medium],
    substrate: Medium,
    phases: Sequence[Any] | jax.Array,
    angle: Any = None,
    polarisations: str = "sp",
) -> tuple[Any, ...]:
    """Return the absorptance of each layer, (layers, ...), for each letter of `polarisations`.

    The power absorbed in a layer over the power of the incident wave along the normal. The substrate, which
    absorbs what enters it if it absorbs at all, is none of the layers.

    **Arguments:** as for `coherent.responses`, except that every wave may be evanescent.

    ```python
    >>> (absorbed,) = absorptances(1.0, [1.46 + 1e-30j], 1.52, [1.138])
    >>> bool(1e-30 < absorbed[0] < 1e-29)
    True

    ```
    """
    stack = media(ambient, layers, substrate, phases, angle)
    integrals = layer_integrals(stack.squares, stack.phases, stack.elements)
    results = []
    for letter in polarisations[:1] if angle is None else polarisations:
        fields = interface_fields(stack, letter)
        # the fields at the upper face of each layer relative to those at the first interface
        ratios = stack.elements.scale_square / fields.size
        above = jnp.concatenate([jnp.ones_like(ratios[:1]), jnp.cumprod(ratios, axis=0)[:-1]])
        # Im ε times the integral of |E|² over each layer; Im Q is Im ε, because the transverse index is real
        absorbed = _integral(fields.U, fields.weight * fields.V, integrals)
        if letter == "p":
            along = _integral(fields.V, stack.squares / fields.weight * fields.U, integrals)
            absorbed = along + stack.a * stack.a / abs2(stack.permittivity) * absorbed
        power = _incident(stack, letter) / abs2(fields.denominator)
        results.append(absorbed * (above / fields.size) * power)
    return tuple(results)


def _integral(value: Number, slope: Number, integrals: LayerIntegrals) -> Any:
    """Return Im ε times the integral of |value cos(qt) − i slope sin(qt)/q|²."""
    mixed = conj(value) * times_i(-slope) * integrals.cf
    return abs2(value) * integrals.cc + abs2(slope) * integrals.ff + 2 * real(mixed)


def layer_integrals(Q: Number, k: Any, elements: Characteristic) -> LayerIntegrals:
    """Return Im Q times the integrals, finite in opaque layers and smooth where Q or k is 0.

    **Arguments:** `Q` = q² as a `Pair`; `k` = k₀d, real; `elements` = matrix_elements(Q, k), whose scale is
    taken, with its derivative.
    """
    w = k * k * Q
    near = abs2(w) < 1
    cc, ff, across = _series(jnp.where(near, real(w), 0.0), jnp.where(near, imag(w), 0.0))
    cc_far, ff_far, across_far = _by_functions(
        where(near, 1.0, Q), jnp.where(near, 1.0, k), elements.scale_square
    )

    def scaled(power: int, series: Any, far: Any) -> Any:
        return jnp.where(near, k**power * imag(Q) * series * elements.scale_square, far)

    # d|f|²/dt = 2 Re(conj(c) f)
    cf = Pair(0.5 * imag(Q) * abs2(elements.f), scaled(2, across, across_far))
    return LayerIntegrals(scaled(1, cc, cc_far), scaled(3, ff, ff_far), cf)


def _series(x: Any, y: Any) -> tuple[Any, Any, Any]:
    """Integrals for k = 1 without scale: of cc, of ff and the imaginary part of cf, from w = x + iy.

    Power sums P_n and complete homogeneous polynomials H_n of the two numbers 4b² and −4p², whose sum is −4x
    and whose product is −4y².
    """
    total, product = -4 * x, -4 * y * y
    powers, before = total, 2.0 + 0.0 * x
    complete, complete_before = 1.0 + 0.0 * x, 0.0 * x
    cc, ff, across = 0.5 * before, 0.0 * x, 0.0 * x
    for n in range(_TERMS):
        cc = cc + powers * (0.5 / math.factorial(2 * n + 3))
        ff = ff + complete * (2 / math.factorial(2 * n + 3))
        across = across + complete * (2 / math.factorial(2 * n + 4))
        powers, before = total * powers - product * before, powers
        complete, complete_before = total * complete - product * complete_before, complete
    return cc, ff, across * y


def _by_functions(Q: Number, k: Any, scale_square: Any) -> tuple[Any, Any, Any]:
    """Im Q times the same for any k with the scale, where |k²Q| is not small.

    Im Q = 2pb is multiplied out, so that neither p nor b divides, and an opaque layer has no terms in 1/b.
    """
    q = sqrt(Q)
    p, b = real(q), imag(q)
    square = p * p + b * b
    # not jnp.expm1, whose slope is rounded to 1 + expm1: in an opaque layer k times nothing
    grown = -0.25 * p * exp_and_expm1(-4 * b * k)[1]
    swung = 0.5 * b * scale_square * jnp.sin(2 * p * k)
    up, turned = 0.5 * p * exp_and_expm1(-2 * b * k)[1], b * jnp.sin(p * k)
    across = up * up - scale_square * turned * turned
    return grown + swung, (grown - swung) / square, across / square
