"""Signals of layers that mix s and p, by the 4×4 method, alone or on incoherent plates.

Orders of light between the faces of a plate add. In an isotropic plate s and p have the same phase, which
differs at random from order to order. So each order keeps its polarisation, and the Mueller matrices of all
orders add:

    M = M_r + M_t′ B (1 − M_r′ B)⁻¹ M_t,    B = τ² M_b

with the matrices of the layers from above (r, t) and from below (r′, t′), of the back face and all beneath it
(b), and the transmittance τ of one passage through the plate.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp

from pellicle.errors import UsageError
from pellicle.forward_model.coherent_groups import CoherentGroup
from pellicle.forward_model.plan import SLICED, Plan
from pellicle.optics import plate
from pellicle.optics.berreman.matrices import Elements
from pellicle.optics.berreman.stack import Polarised, polarised, transmittances, two_sided
from pellicle.optics.ellipsometry import Stokes, mueller, mueller_elements
from pellicle.optics.interface import Inside, normal, normal_flux, transverse
from pellicle.optics.pair import abs2, conj, fori_loop, imag, namespace, real, to_pair
from pellicle.optics.quadrature import Turn, turned_response, turned_stokes
from pellicle.signals.waves import stokes_of_mueller


def rows(plan: Plan, groups: list[CoherentGroup], turn: Turn | None = None) -> list[Any]:
    """Return sums of intensities, which averages of an instrument are taken over; `turn` is that of a ray.

    R or T of the incident polarisations, with all light that is reflected or transmitted; for ellipsometry
    the sums of `Signal.of_jones`.
    """
    if len(groups) > 1:
        return _rows_of_plates(plan, groups, turn)
    (group,) = groups
    phase = group.phases[0]
    angle = namespace(phase).zeros_like(phase) if group.angle is None else group.angle
    dichroic = plan.row("anisotropy").count == SLICED
    response = polarised(group.above, group.layers, group.below, group.phases, angle, dichroic)
    response = response if turn is None else turned_response(response, turn)
    if plan.kind.ellipsometric:
        reflection = not plan.kind.transmitted
        return plan.kind.of_jones(
            Elements(*map(to_pair, response.reflected if reflection else _passed(group, response, turn)))
        )
    if plan.kind.transmitted:
        p, s = transmittances(response)
    else:
        jones = Elements(*map(to_pair, response.reflected))
        p, s = abs2(jones.pp) + abs2(jones.sp), abs2(jones.ps) + abs2(jones.ss)
    return [s, p] if plan.on("polarisation") else [s if plan.polarisation == "s" else p]


def _rows_of_plates(plan: Plan, groups: list[CoherentGroup], turn: Turn | None) -> list[Any]:
    if plan.kind.ellipsometric and plan.kind.transmitted:
        raise UsageError(NO_PLATE)
    if plan.kind.transmitted:
        p, s = transmitted(plan, groups, turn)
    else:
        m = mueller_matrix(plan, groups, turn)
        if plan.kind.ellipsometric:
            return plan.kind.of_mueller(m)
        p, s = m[0][0] + m[0][1], m[0][0] - m[0][1]
    return [s, p] if plan.on("polarisation") else [s if plan.polarisation == "s" else p]


NO_PLATE = (
    "psi and delta in transmission of layers that turn p into s are simulated on a half space in parallel"
    " light only: leave out `back`, plates, `angle_spread` and `numerical_aperture`"
)


def _passed(group: CoherentGroup, response: Polarised, turn: Turn | None) -> Elements:
    """The Jones matrix of the power that enters a transparent substrate. Raises UsageError in a lens."""
    if turn is not None:
        raise UsageError(NO_PLATE)
    E, H = response.fields
    q = normal(group.below, transverse(group.above, group.angle)[0])
    p, s = (namespace(q).sqrt(normal_flux(group.below, q, letter)) for letter in "ps")
    p = p / abs2(group.below)
    return Elements(H.pp * p, H.ps * p, E.sp * s, E.ss * s)


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
    return Stokes(*stokes_of_mueller(mueller_matrix(plan, groups, turn)))


def transmitted(plan: Plan, groups: Sequence[CoherentGroup], turn: Turn | None = None) -> tuple[Any, Any]:
    """Return the transmittances into the substrate for p and for s incident."""
    first = groups[0]
    _, row = _lit(plan, groups, turn)
    _, q0 = transverse(first.above, _angle(first))
    mean, difference = row[..., 0, 0], row[..., 0, 1]
    return (mean + difference) / q0, (mean - difference) / q0


def _angle(group: CoherentGroup) -> Any:
    above: Any = group.above
    return namespace(above).zeros_like(above) if group.angle is None else group.angle


def _lit(plan: Plan, groups: Sequence[CoherentGroup], turn: Turn | None) -> _Lit:
    a, _ = transverse(groups[0].above, _angle(groups[0]))
    dichroic = plan.row("anisotropy").count == SLICED
    *plates, last = groups
    waves = polarised(last.above, last.layers, last.below, last.phases, Inside(a), dichroic)
    rows = mueller_elements(*waves.reflected)
    shape = jnp.broadcast_shapes(*(jnp.shape(x) for row in rows for x in row))
    xp = namespace(rows)
    columns = [xp.stack([xp.broadcast_to(x, shape) for x in row], axis=-1) for row in rows]
    lit = _Lit(xp.stack(columns, axis=-2), _power(waves))
    for group in reversed(plates):
        angle = _angle(groups[0]) if group is groups[0] else Inside(a)
        lit = _on_plate(group, angle, dichroic, lit)
    if turn is None:
        return lit
    turned = turned_stokes(turn)
    return _Lit(turned @ lit.reflected @ turned, lit.passed @ turned)


def _power(waves: Polarised) -> Any:
    """Return the power that enters a substrate as a row of factors of the four Stokes parameters."""
    E, H = waves.fields
    p = real(E.pp * conj(H.pp)) + real(E.sp * conj(H.sp))
    s = real(E.ps * conj(H.ps)) + real(E.ss * conj(H.ss))
    both = E.pp * conj(H.ps) + E.sp * conj(H.ss) + conj(E.ps) * H.pp + conj(E.ss) * H.sp
    xp = namespace(p, s)
    row = xp.broadcast_arrays(p + s, p - s, real(both), -imag(both))
    return 0.5 * xp.stack(row, axis=-1)[..., None, :]


def _on_plate(group: CoherentGroup, angle: Any, dichroic: bool, beneath: _Lit) -> _Lit:
    """Return what layers on a plate do, from what the back face and all beneath it do."""
    sides = two_sided(group.above, group.layers, group.below, group.phases, angle, dichroic)
    xp = namespace(*sides)
    r, down, up, below = (mueller(xp.moveaxis(jones, (0, 1), (-2, -1))) for jones in sides)
    internal = xp.asarray(group.internal)[..., None, None]
    returned = internal * internal * beneath.reflected
    part = group.collected or plate.Collection()
    round_trip = below @ returned
    if part.reflections is None:
        inside = xp.linalg.solve(xp.eye(4, dtype=r.dtype) - round_trip, down)
        further = round_trip @ inside
    else:
        # up to n reflections at the back face: n orders of the reflected light, n further ones of the passed
        inside = fori_loop(0, part.reflections - 1, lambda _, x: down + round_trip @ x, down)
        further = round_trip @ inside
    share = 1.0 if part.share is None else part.share
    return _Lit(r + share * (up @ returned @ inside), internal * beneath.passed @ (down + share * further))
