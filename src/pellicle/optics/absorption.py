"""Absorptance of each layer of a coherent stack.

The power absorbed at a depth is Im ε |E|² in units of the incident wave, and its integral over a layer is
known in closed form. So a weakly absorbing layer has all its digits, which the difference between the powers
through its faces would lose, and R + T + ΣA = 1 is a check and no definition.

Source: Byrnes, arXiv:1603.02720, section 4; Pettersson, Roman and Inganäs, J. Appl. Phys. 86, 487 (1999).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp

from pellicle.optics.anisotropy import is_anisotropic
from pellicle.optics.interface import incident_factor
from pellicle.optics.interface_fields import InterfaceFields, Media, interface_fields, media
from pellicle.optics.layer_integrals import LayerIntegrals, layer_integrals
from pellicle.optics.pair import Number, abs2, conj, real, times_i


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
