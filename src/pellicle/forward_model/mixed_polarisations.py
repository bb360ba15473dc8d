"""Signals of layers that mix s and p, by the 4×4 method, alone or on incoherent plates.

Orders of light between the faces of a plate add. In an isotropic plate s and p have the same phase, which
differs at random from order to order. So each order keeps its polarisation, and the Mueller matrices of all
orders add:

    M = M_r + M_t′ B (1 − M_r′ B)⁻¹ M_t,    B = τ² M_b

with the matrices of the layers from above (r, t) and from below (r′, t′), of the back face and all beneath it
(b), and the transmittance τ of one passage through the plate.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from pellicle.data import generalised
from pellicle.forward_model.coherent_groups import CoherentGroup
from pellicle.forward_model.plan import SLICED, Plan
from pellicle.optics import ellipsometry, plate
from pellicle.optics.berreman.matrices import Elements
from pellicle.optics.berreman.stack import Polarised, polarised, transmittances
from pellicle.optics.berreman.two_sided import two_sided
from pellicle.optics.ellipsometry import Stokes
from pellicle.optics.hoisting import stored
from pellicle.optics.interface import Inside, transverse
from pellicle.optics.lens import Turn, turned_response, turned_stokes
from pellicle.optics.mueller import inverse_intensity, mueller, mueller_elements
from pellicle.optics.pair import Number, abs2, conj, imag, real, to_pair


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
        p, s = transmitted(plan, groups, turn)
    elif plan.signal == "psi-delta":
        return list(stokes(plan, groups, turn))
    else:
        m = mueller_matrix(plan, groups, turn)
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


class _Lit(NamedTuple):
    """Light that layers and plates return and pass on, by the Stokes parameters of the light from above."""

    reflected: Any  # Mueller matrix (..., 4, 4) of electric fields
    passed: Any  # row (..., 1, 4): the power that enters the substrate, per squared electric field


def mueller_matrix(plan: Plan, groups: Sequence[CoherentGroup], turn: Turn | None = None) -> list[list[Any]]:
    """Return the Mueller matrix of reflection, not normalised, as rows of arrays; `turn` is that of a ray."""
    matrix, _ = _lit(plan, groups, turn)
    return [[matrix[..., i, j] for j in range(4)] for i in range(4)]


def stokes(plan: Plan, groups: Sequence[CoherentGroup], turn: Turn | None = None) -> Stokes:
    """Return the Stokes sums of r_pp and r_ss: over all orders, |r_ss|² ± |r_pp|² and 2 conj(r_pp) r_ss."""
    m = mueller_matrix(plan, groups, turn)
    return Stokes(-m[0][1] - m[1][0], m[2][2] + m[3][3], m[2][3] - m[3][2], m[0][0] + m[1][1])


def transmitted(plan: Plan, groups: Sequence[CoherentGroup], turn: Turn | None = None) -> tuple[Any, Any]:
    """Return the transmittances into the substrate for p and for s incident."""
    first = groups[0]
    _, row = _lit(plan, groups, turn)
    _, q0 = transverse(first.above, _angle(first))
    mean, difference = row[..., 0, 0], row[..., 0, 1]
    return (mean + difference) / q0, (mean - difference) / q0


def _angle(group: CoherentGroup) -> Any:
    return jnp.zeros_like(group.above) if group.angle is None else group.angle


def _lit(plan: Plan, groups: Sequence[CoherentGroup], turn: Turn | None) -> _Lit:
    a, _ = transverse(groups[0].above, _angle(groups[0]))
    dichroic = plan.row("anisotropy").count == SLICED
    *plates, last = groups
    lit = _last(last, Inside(a), dichroic)
    for group in reversed(plates):
        angle = _angle(groups[0]) if group is groups[0] else Inside(a)
        lit = _on_plate(group, angle, dichroic, lit)
    if turn is None:
        return lit
    turned = turned_stokes(turn)
    return _Lit(turned @ lit.reflected @ turned, lit.passed @ turned)


def _last(group: CoherentGroup, angle: Any, dichroic: bool) -> _Lit:
    found = polarised(group.above, group.layers, group.below, group.phases, angle, dichroic)
    rows = mueller_elements(*found.reflected)
    shape = jnp.broadcast_shapes(*(jnp.shape(x) for row in rows for x in row))
    columns = [jnp.stack([jnp.broadcast_to(x, shape) for x in row], axis=-1) for row in rows]
    return _Lit(jnp.stack(columns, axis=-2), _power(found))


def _power(found: Polarised) -> Any:
    """Return the power that enters a substrate as a row of factors of the four Stokes parameters."""
    E, H = found.fields
    p = real(E.pp * conj(H.pp)) + real(E.sp * conj(H.sp))
    s = real(E.ps * conj(H.ps)) + real(E.ss * conj(H.ss))
    both = E.pp * conj(H.ps) + E.sp * conj(H.ss) + conj(E.ps) * H.pp + conj(E.ss) * H.sp
    row = jnp.broadcast_arrays(p + s, p - s, real(both), -imag(both))
    return 0.5 * jnp.stack(row, axis=-1)[..., None, :]


def _on_plate(group: CoherentGroup, angle: Any, dichroic: bool, beneath: _Lit) -> _Lit:
    """Return what layers on a plate do, from what the back face and all beneath it do."""
    sides = two_sided(group.above, group.layers, group.below, group.phases, angle, dichroic)
    r, down, up, below = (mueller(jnp.moveaxis(jones, (0, 1), (-2, -1))) for jones in sides)
    internal = jnp.asarray(group.internal)[..., None, None]
    returned = internal * internal * beneath.reflected
    part = group.collected or plate.Collection()
    round_trip = below @ returned
    if part.reflections is None:
        inside = jnp.linalg.solve(jnp.eye(4, dtype=r.dtype) - round_trip, down)
        further = round_trip @ inside
    else:
        # up to n reflections at the back face: n orders of the reflected light, n further ones of the passed
        inside = jax.lax.fori_loop(0, part.reflections - 1, lambda _, x: down + round_trip @ x, down)
        further = round_trip @ inside
    share = 1.0 if part.share is None else part.share
    return _Lit(r + share * (up @ returned @ inside), internal * beneath.passed @ (down + share * further))
