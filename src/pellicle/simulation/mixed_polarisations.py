"""Signals of coherent layers that mix s and p, by the 4×4 method."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp

from pellicle.effects.anisotropy import SLICED
from pellicle.effects.plan import Plan
from pellicle.optics import ellipsometry
from pellicle.optics.berreman.matrices import Elements
from pellicle.optics.berreman.stack import polarised, transmittances
from pellicle.optics.hoisting import stored
from pellicle.optics.mueller import inverse_intensity, mueller_elements
from pellicle.optics.pair import abs2, conj, imag, real, to_pair
from pellicle.simulation import mixed_plates
from pellicle.simulation.coherent_groups import CoherentGroup


def rows(plan: Plan, groups: list[CoherentGroup]) -> list[Any]:
    """Return sums of intensities, which averages of an instrument are taken over.

    R or T of the incident polarisations, with all light that is reflected or transmitted; for Ψ and Δ the
    Stokes sums of r_pp and r_ss; for a Mueller matrix its 16 elements.
    """
    if len(groups) > 1:
        return _rows_of_plates(plan, groups)
    (group,) = groups
    angle = jnp.zeros_like(group.phases[0]) if group.angle is None else group.angle
    dichroic = plan.row("anisotropy").count == SLICED
    response = polarised(group.above, group.layers, group.below, group.phases, angle, dichroic)
    jones = Elements(*map(to_pair, response.reflected))
    if plan.signal == "mueller":
        return [jnp.ravel(x) for row in mueller_elements(*jones) for x in row]
    if plan.signal == "psi-delta":
        both = 2 * (conj(jones.pp) * jones.ss)
        p, s = abs2(jones.pp), abs2(jones.ss)
        return [s - p, real(both), imag(both), s + p]
    if plan.signal == "T":
        p, s = transmittances(response)
    else:
        p, s = abs2(jones.pp) + abs2(jones.sp), abs2(jones.ps) + abs2(jones.ss)
    return [s, p] if plan.on("polarisation") else [s if plan.polarisation == "s" else p]


def _rows_of_plates(plan: Plan, groups: list[CoherentGroup]) -> list[Any]:
    if plan.signal == "T":
        p, s = mixed_plates.transmitted(plan, groups)
    elif plan.signal == "psi-delta":
        return list(mixed_plates.stokes(plan, groups))
    else:
        m = mixed_plates.mueller_matrix(plan, groups)
        if plan.signal == "mueller":
            return [x for row in m for x in row]
        p, s = m[0][0] + m[0][1], m[0][0] - m[0][1]
    return [s, p] if plan.on("polarisation") else [s if plan.polarisation == "s" else p]


def finished(plan: Plan, sums: Sequence[Any]) -> Sequence[Any]:
    """Return the rows of the signal from averaged sums of intensities."""
    if plan.signal == "mueller":
        factor = stored(inverse_intensity(sums[0]))
        return [element * factor for element in sums[1:]]
    if plan.signal == "psi-delta":
        return ellipsometry.normalised(ellipsometry.Stokes(*sums))
    return sums if len(sums) == 1 else [0.5 * (sums[0] + sums[1])]
