"""Rays of a cone of light behind a lens, each with its plane of incidence and the turn of its polarisation.

A lens that illuminates the sample turns each ray about the axis perpendicular to its meridional plane, and
the polarisation with it. In the frame (p, s) of the ray's own plane of incidence the light of the axis is
turned by ψ, and by ψ again behind the lens that collects the light, the mirror image of the first:

    J = Q(ψ) J_ray Q(ψ),    Q = [[cos ψ, −sin ψ], [sin ψ, cos ψ]]

J_ray is the Jones matrix in the ray's frame, where the azimuth φ of an optic axis is smaller by that of the
ray's plane of incidence. Where s and p stay apart `pellicle.optics.quadrature.cone_rays` needs half the rays.

Source: B. Richards and E. Wolf, Proc. R. Soc. A 253, 358 (1959).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from pellicle.optics.array_namespace import namespace
from pellicle.optics.berreman.matrices import Elements
from pellicle.optics.berreman.stack import Polarised
from pellicle.optics.mueller import mueller
from pellicle.optics.quadrature import disc_rule


class Turn(NamedTuple):
    """Cosine and sine of the angle ψ of a ray."""

    cosine: Any
    sine: Any


class LensRays(NamedTuple):
    """Rays of a cone of light, along a new first axis."""

    angle: Any  # of incidence, radians
    azimuth: Any  # of the plane of incidence, from x towards y, radians
    turn: Turn
    weight: np.ndarray


def lens_rays(angle: Any, sine: Any, count: int, around: int) -> LensRays:
    """Return rays that fill a pupil evenly, over all azimuths.

    `around` is best odd: of rays at opposite azimuths, which may be equal by symmetry or reciprocity, only
    one is then computed. Likewise no ray has its mirror image in the plane of incidence.

    **Arguments:** `angle` of the axis (radians) and `sine` of the half angle broadcast. `count` is the number
    of rings, `around` the number of azimuths.
    """
    xp = namespace(angle, sine)
    radius, phi, weight = disc_rule(count, 2 * np.pi * (np.arange(around) + 0.25) / around)
    new_axis = (-1, *[1] * np.ndim(angle + sine))
    cos_phi, sin_phi, r = (x.reshape(new_axis) for x in (np.cos(phi), np.sin(phi), radius))
    rho = r * sine
    along, c0, s0 = xp.sqrt(1 - rho**2), xp.cos(angle), xp.sin(angle)
    x, y, z = along * s0 - rho * cos_phi * c0, rho * sin_phi + 0.0 * c0, along * c0 + rho * cos_phi * s0
    across = x * x + y * y
    dark = across < xp.finfo(across.dtype).tiny  # along the normal, where any azimuth is right
    scale = 1 / xp.sqrt(xp.where(dark, 1.0, across))
    cosine = (s0 * (along * cos_phi**2 + sin_phi**2) - rho * cos_phi * c0) * scale
    sine_of_turn = -sin_phi * (rho * c0 + cos_phi * (1 - along) * s0) * scale
    return LensRays(
        angle=xp.arctan2(xp.where(dark, 0.0, across * scale), z),
        azimuth=xp.arctan2(xp.where(dark, 0.0, y), xp.where(dark, 1.0, x)),
        turn=Turn(xp.where(dark, 1.0, cosine), xp.where(dark, 0.0, sine_of_turn)),
        weight=weight,
    )


def turned_response(response: Polarised, turn: Turn) -> Polarised:
    """Return the response to the light of a ray in the frames of both lenses: J = Q J_ray Q."""
    c, s = turn

    def before(j: Elements) -> Elements:
        return Elements(j.pp * c + j.ps * s, j.ps * c - j.pp * s, j.sp * c + j.ss * s, j.ss * c - j.sp * s)

    j = before(response.reflected)
    turned = Elements(j.pp * c - j.sp * s, j.ps * c - j.ss * s, j.sp * c + j.pp * s, j.ss * c + j.ps * s)
    E, H = response.fields
    return response._replace(reflected=turned, fields=(before(E), before(H)))


def turned_stokes(turn: Turn) -> Any:
    """Return the Mueller matrix (..., 4, 4) of Q."""
    c, s = turn
    rows = [jnp.stack([c, -s], axis=-1), jnp.stack([s, c], axis=-1)]
    return mueller(jnp.stack(rows, axis=-2))
