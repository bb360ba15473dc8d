"""Absorptance of each layer of a coherent stack.

The power absorbed at a depth is Im ε |E|² in units of the incident wave, and its integral over a layer is
known in closed form. So a weakly absorbing layer has all its digits, which the difference between the powers
through its faces would lose, and R + T + ΣA = 1 is a check and no definition.

Source: Byrnes, arXiv:1603.02720, section 4; Pettersson, Roman and Inganäs, J. Appl. Phys. 86, 487 (1999).

The integrals of |cos(qt)|² and |sin(qt)/q|² over a layer are multiplied by Im Q, without a difference between
the powers through the faces: a layer of k = 1e-30 has all its digits. With q = p + ib they are built from
sinh(2bt)/2b and sin(2pt)/2p, which are g(b²) and g(−p²) for one entire function g. So the integral of
|sin(qt)/q|² is a divided difference of g, symmetric in b² and −p², and smooth in Re Q and Im Q where q is 0
(Byrnes, arXiv:1603.02720, section 4, integrated over the layer).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp

from pellicle.optics.anisotropy import is_anisotropic
from pellicle.optics.characteristic import Characteristic
from pellicle.optics.elementary import exp_and_expm1
from pellicle.optics.field import InterfaceFields, Media, interface_fields, media
from pellicle.optics.interface import incident_factor
from pellicle.optics.pair import Number, Pair, abs2, conj, imag, real, sqrt, times_i, where


def absorptances(
    ambient: Number,
    layers: Sequence[Number],
    substrate: Number,
    phases: Sequence[Any],
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
    if any(map(is_anisotropic, (ambient, *layers, substrate))):
        raise ValueError("fields and absorptances of birefringent layers are not computed: give one index")
    stack = media(ambient, layers, substrate, phases, angle)
    integrals = layer_integrals(stack.squares, stack.phases, stack.elements)
    letters = polarisations[:1] if angle is None else polarisations
    return tuple(_absorptance(stack, integrals, letter) for letter in letters)


def _absorptance(stack: Media, integrals: LayerIntegrals, polarisation: str) -> Any:
    fields = interface_fields(stack, polarisation)
    factor = incident_factor(stack.ambient, stack.q_top, polarisation)
    if polarisation == "p":
        factor = factor / abs2(stack.ambient * stack.ambient)
    # the fields at the upper face of each layer relative to those at the first interface
    ratios = stack.elements.scale_square / fields.size
    above = jnp.concatenate([jnp.ones_like(ratios[:1]), jnp.cumprod(ratios, axis=0)[:-1]])
    absorbed = _absorbed(stack, fields, integrals, polarisation)
    return absorbed * (above / fields.size) * (factor / abs2(fields.denominator))


def _absorbed(stack: Media, fields: InterfaceFields, integrals: LayerIntegrals, polarisation: str) -> Any:
    """Return Im ε times the integral of |E|² over each layer, in the scale of the field at its upper face.

    Im Q is Im ε, because the transverse index is real.
    """
    if polarisation == "s":
        return _integral(fields.U, fields.weight * fields.V, integrals)
    along = _integral(fields.V, stack.squares / fields.weight * fields.U, integrals)
    magnetic = _integral(fields.U, fields.weight * fields.V, integrals)
    return along + stack.a * stack.a / abs2(stack.permittivity) * magnetic


def _integral(value: Number, slope: Number, integrals: LayerIntegrals) -> Any:
    """Return Im ε times the integral of |value cos(qt) − i slope sin(qt)/q|²."""
    mixed = conj(value) * times_i(-slope) * integrals.cf
    return abs2(value) * integrals.cc + abs2(slope) * integrals.ff + 2 * real(mixed)


_TERMS = 14
"""Terms of the series at |k²Q| < 1: the next ones are below 1e-18 of the sum."""


class LayerIntegrals(NamedTuple):
    """Im Q times integrals over k₀t from 0 to k, times |scale|² of the layer's matrix elements."""

    cc: Any  # of |cos(qt)|²
    ff: Any  # of |sin(qt)/q|²
    cf: Number  # of conj(cos(qt)) sin(qt)/q


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
