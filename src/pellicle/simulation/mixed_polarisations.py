"""Signals of coherent layers that mix s and p, by the 4×4 method."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp

from pellicle.data import generalised
from pellicle.effects.anisotropy import SLICED
from pellicle.effects.plan import Plan
from pellicle.optics import ellipsometry
from pellicle.optics.berreman.matrices import Elements
from pellicle.optics.berreman.stack import polarised, transmittances
from pellicle.optics.hoisting import stored
from pellicle.optics.lens import Turn, turned_response
from pellicle.optics.mueller import inverse_intensity, mueller_elements
from pellicle.optics.pair import Number, abs2, conj, imag, real, to_pair
from pellicle.simulation import mixed_plates
from pellicle.simulation.coherent_groups import CoherentGroup


def rows(plan: Plan, groups: list[CoherentGroup], turn: Turn | None = None) -> list[Any]:
    """Return sums of intensities, which averages of an instrument are taken over; `turn` is that of a ray.

    R or T of the incident polarisations, with all light that is reflected or transmitted; for Ψ and Δ the
    Stokes sums of r_pp and r_ss; for generalised ones those of each ratio of `data.generalised`; for a
    Mueller matrix its 16 elements.
    """
    if len(groups) > 1:
        return _rows_of_plates(plan, groups, turn)
    (group,) = groups
    angle = jnp.zeros_like(group.phases[0]) if group.angle is None else group.angle
    dichroic = plan.row("anisotropy").count == SLICED
    response = polarised(group.above, group.layers, group.below, group.phases, angle, dichroic)
    response = response if turn is None else turned_response(response, turn)
    jones = Elements(*map(to_pair, response.reflected))
    if plan.signal == "mueller":
        return [jnp.atleast_1d(x) for row in mueller_elements(*jones) for x in row]
    if plan.signal == generalised.SIGNAL:
        return ratio_sums(jones)
    if plan.signal == "psi-delta":
        both = 2 * (conj(jones.pp) * jones.ss)
        p, s = abs2(jones.pp), abs2(jones.ss)
        return [s - p, real(both), imag(both), s + p]
    if plan.signal == "T":
        p, s = transmittances(response)
    else:
        p, s = abs2(jones.pp) + abs2(jones.sp), abs2(jones.ps) + abs2(jones.ss)
    return [s, p] if plan.on("polarisation") else [s if plan.polarisation == "s" else p]


def _rows_of_plates(plan: Plan, groups: list[CoherentGroup], turn: Turn | None) -> list[Any]:
    if plan.signal == "T":
        p, s = mixed_plates.transmitted(plan, groups, turn)
    elif plan.signal == "psi-delta":
        return list(mixed_plates.stokes(plan, groups, turn))
    else:
        m = mixed_plates.mueller_matrix(plan, groups, turn)
        if plan.signal == "mueller":
            return [x for row in m for x in row]
        if plan.signal == generalised.SIGNAL:
            return ratio_sums_of_mueller(m)
        p, s = m[0][0] + m[0][1], m[0][0] - m[0][1]
    return [s, p] if plan.on("polarisation") else [s if plan.polarisation == "s" else p]


def ratio_sums(jones: Elements) -> list[Any]:
    """Return the Stokes sums of each ratio x/y of `data.generalised`, four for AnE, then for Aps and Asp.

    They are |y|² − |x|², the parts of 2 conj(x) y, and |y|² + |x|², with conj(x/y) = tan Ψ exp(iΔ); smooth
    where x = 0.
    """

    def sums(x: Number, y: Number) -> list[Any]:
        cross = 2 * (conj(x) * y)
        return [abs2(y) - abs2(x), real(cross), imag(cross), abs2(y) + abs2(x)]

    # Woollam's r_ps is the element in row s and column p
    return [*sums(jones.pp, jones.ss), *sums(jones.sp, jones.pp), *sums(jones.ps, jones.ss)]


def ratio_sums_of_mueller(m: Sequence[Sequence[Any]]) -> list[Any]:
    """Return the sums of `ratio_sums`, averaged over light that adds incoherently, from its Mueller matrix.

    Every product of two elements of a Jones matrix in one row, in one column or on one diagonal is a sum of
    elements of the Mueller matrix (`optics.mueller.mueller_elements`).
    """
    even, odd = 0.5 * (m[0][0] + m[1][1]), 0.5 * (m[0][1] + m[1][0])
    other_even, other_odd = 0.5 * (m[0][0] - m[1][1]), 0.5 * (m[0][1] - m[1][0])
    pp, ss, sp, ps = even + odd, even - odd, other_even + other_odd, other_even - other_odd  # |r|²
    ane = [ss - pp, m[2][2] + m[3][3], m[2][3] - m[3][2], ss + pp]
    aps = [pp - sp, m[2][0] + m[2][1], m[3][0] + m[3][1], pp + sp]
    asp = [ss - ps, m[2][0] - m[2][1], m[3][1] - m[3][0], ss + ps]
    return [*ane, *aps, *asp]


def ratio_angles(sums: Sequence[Any]) -> list[Any]:
    """Return N, C and S of each ratio from its Stokes sums; 0 where both amplitudes are."""
    each = (ellipsometry.Stokes(*sums[i : i + 4]) for i in range(0, len(sums), 4))
    return [row for one in each for row in ellipsometry.normalised(one)]


def finished(plan: Plan, sums: Sequence[Any]) -> Sequence[Any]:
    """Return the rows of the signal from averaged sums of intensities."""
    if plan.signal == "mueller":
        factor = stored(inverse_intensity(sums[0]))
        return [element * factor for element in sums[1:]]
    if plan.signal == "psi-delta":
        return ellipsometry.normalised(ellipsometry.Stokes(*sums))
    if plan.signal == generalised.SIGNAL:
        return ratio_angles(sums)
    return sums if len(sums) == 1 else [0.5 * (sums[0] + sums[1])]
