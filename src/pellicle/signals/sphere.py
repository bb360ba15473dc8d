"""Ψ and Δ as points N, C, S of a unit sphere, where they do not wrap around: angles in degrees.

N = cos 2Ψ, C = sin 2Ψ cos Δ, S = sin 2Ψ sin Δ (Jellison and Modine 1990, Appl. Opt. 29, 959). Files may have
these, α and β of a rotating analyser, or tan Ψ and cos Δ, which lack only the sign of S.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from pellicle.errors import DataError
from pellicle.signals.limits import Where, refuse_first

ROUGH = 0.01
"""First guess of the noise of N, C, S, of a depolarisation and of Mueller elements."""


def ncs(psi: Float[np.ndarray, "*points"], delta: Float[np.ndarray, "*points"]) -> np.ndarray:
    """N, C, S (..., 3) of Ψ and Δ: a point on the unit sphere."""
    psi, delta = 2 * np.deg2rad(psi), np.deg2rad(delta)
    return np.stack([np.cos(psi), np.sin(psi) * np.cos(delta), np.sin(psi) * np.sin(delta)], axis=-1)


def psi_delta(sphere: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ψ and Δ from N, C, S (..., 3), or from N and C (..., 2): then Δ is in 0 to 180."""
    n, c, *measured = np.moveaxis(sphere, -1, 0)
    s = measured[0] if measured else np.sqrt(np.maximum(1 - n**2 - c**2, 0.0))
    return np.rad2deg(np.arctan2(np.hypot(c, s), n)) / 2, np.rad2deg(np.arctan2(s, c)) % 360.0


def with_third(columns: Float[np.ndarray, "*points channels"]) -> np.ndarray:
    """N, C, S (..., 3) from these, or from N and C alone with S ≥ 0."""
    if columns.shape[-1] == 3:
        return columns
    third = np.sqrt(np.maximum(1 - np.sum(columns**2, axis=-1, keepdims=True), 0.0))
    return np.concatenate([columns, third], axis=-1)


def sphere_frame(psi: np.ndarray, delta: np.ndarray) -> np.ndarray:
    """Directions of N, C, S along Ψ, along Δ and outwards, (..., 3, 3), at Ψ and Δ (...).

    In them the measured point is (0, 0, 1), and errors of Ψ and of Δ are errors of one component each.
    """
    outwards = ncs(psi, delta)
    psi, delta = 2 * np.deg2rad(psi), np.deg2rad(delta)
    zero = np.zeros_like(psi)
    along = np.stack([-np.sin(psi), np.cos(psi) * np.cos(delta), np.cos(psi) * np.sin(delta)], axis=-1)
    across = np.stack([zero, -np.sin(delta), np.cos(delta)], axis=-1)
    return np.stack([along, across, outwards], axis=-2)


def sphere_sigma(
    psi: np.ndarray, delta: np.ndarray, psi_sigma: np.ndarray, delta_sigma: np.ndarray, folded: bool = False
) -> np.ndarray:
    """σ of N, C, S in their `sphere_frame`, (..., 3), of Ψ and Δ and their σ (...).

    On the sphere of N, C, S an error of Ψ moves a point by 2σ_Ψ along its meridian, one of Δ by sin(2Ψ) σ_Δ
    across it, of which Ψ's own error leaves something at the poles. Outwards there is no first order: the
    mean serves. A folded Δ leaves N and C, which share one σ (...): the mean square of what both errors move.
    An error of Δ at 0 or 180° moves neither to first order; the second order of σ_Ψ keeps σ above zero.
    """
    psi, delta, psi_sigma, delta_sigma = (np.deg2rad(x) for x in (psi, delta, psi_sigma, delta_sigma))
    along, sine = 2 * psi_sigma, np.sin(2 * psi)
    if folded:
        visible = sine**2 + (np.cos(2 * psi) * np.cos(delta)) ** 2
        return np.sqrt(0.5 * (visible * along**2 + (sine * delta_sigma * np.sin(delta)) ** 2 + along**4))
    across = np.hypot(sine, along) * delta_sigma
    return np.stack([along, across, np.sqrt(0.5 * (along**2 + across**2))], axis=-1)


def angle_changes(
    sphere: Float[np.ndarray, "*points 3"], psi: float, delta: float
) -> tuple[np.ndarray, np.ndarray]:
    """Changes of N, C, S (..., 3) by offsets of Ψ and of Δ."""
    n, c, s = np.moveaxis(sphere, -1, 0)
    sine = np.maximum(np.hypot(c, s), 1e-9)
    of_psi = 2 * np.deg2rad(psi) * np.stack([-sine, n * c / sine, n * s / sine], axis=-1)
    return of_psi, np.deg2rad(delta) * np.stack([0 * n, -s, c], axis=-1)


def rms_of_psi(residual: Float[np.ndarray, "*lanes points columns"], directions: int) -> Any:
    """rms (*lanes) in degrees of Ψ of residuals on the sphere: half the distance, in each direction."""
    return np.rad2deg(np.sqrt(np.sum(residual**2, axis=(-2, -1)) / directions)) / 2


def scattered(sphere: Float[np.ndarray, "*points 3"], noise: float, seed: int) -> np.ndarray:
    """N, C, S with noise of 2 · `noise` (degrees of Ψ) in any direction along their sphere."""
    length = np.linalg.norm(sphere, axis=-1, keepdims=True)
    points = sphere / np.where(length > 0, length, 1.0)
    step = 2 * math.radians(noise) * np.random.default_rng(seed).normal(size=points.shape)
    return points + step - points * np.sum(step * points, axis=-1, keepdims=True)


POLARISED = (0.5, 1.05)
"""Accepted degrees of polarisation of N, C, S: below, noise dominates; above, the columns are not N, C, S."""
HIGHEST_COSINE = 1.05
"""Noise takes cos Δ this far beyond 1; further, the column is not cos Δ."""
_ROUNDED = 3e-3
"""1 − N² − C² − S² below this is rounding: of three decimals in each it reaches 0.0017."""


class Angles(NamedTuple):
    """Ψ and Δ in degrees, a sentence on the conversion, and the depolarisation, where it is known."""

    psi: Float[np.ndarray, " points"]
    delta: Float[np.ndarray, " points"]
    note: str | None = None
    depolarisation: Float[np.ndarray, " points"] | None = None


def from_ncs(columns: Float[np.ndarray, "3 points"], place: Where, remedy: str) -> Angles:
    """Convert N = cos 2Ψ, C = sin 2Ψ cos Δ, S = sin 2Ψ sin Δ, each times the degree of polarisation.

    Raises DataError for an impossible degree of polarisation.
    """
    polarised = np.sqrt(np.sum(columns**2, axis=0))
    wrong = (polarised < POLARISED[0]) | (polarised > POLARISED[1])
    if wrong.any():
        row = int(np.argmax(wrong))
        raise DataError(
            f"{place(row)}: N, C and S make a degree of polarisation of "
            f"{polarised[row]:.3g}, where about 1 is possible; {remedy}"
        )
    psi = np.rad2deg(0.5 * np.arctan2(np.hypot(columns[1], columns[2]), columns[0]))
    delta, share = np.rad2deg(np.arctan2(columns[2], columns[1])), 1 - polarised**2
    note = "N, C, S converted to psi and delta"
    if np.max(np.abs(share)) < _ROUNDED:
        return Angles(psi, delta, note)
    return Angles(psi, delta, f"{note}, and 1 - N² - C² - S² read as the depolarisation", share)


def from_alpha_beta(
    alpha_beta: Float[np.ndarray, "2 points"],
    analyser: Float[np.ndarray, " points"],
    place: Where,
    remedy: str,
) -> Angles:
    """Convert α, β of a rotating analyser; Δ is in 0 to 180, since only cos Δ is measured.

    `analyser` is the angle of the fixed polariser from the plane of incidence. tan Ψ = tan A
    √((1 + α)/(1 − α)) and cos Δ = β/√(1 − α²), the inverse of `optics.ellipsometry.alpha_beta`. Where
    noise takes β beyond √(1 − α²), Δ is 0 or 180. Raises DataError for a contrast above 1.
    """
    alpha, beta = alpha_beta
    contrast = np.hypot(alpha, beta)
    wrong = (contrast > POLARISED[1]) | (np.abs(alpha) > 1)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise DataError(
            f"{place(row)}: alpha {alpha[row]:g} and beta {beta[row]:g} make a contrast of "
            f"{contrast[row]:.3g}, where at most 1 is possible; {remedy}"
        )
    psi = np.rad2deg(np.arctan2(np.tan(np.deg2rad(analyser)) * np.sqrt(1 + alpha), np.sqrt(1 - alpha)))
    delta = np.rad2deg(np.arctan2(np.sqrt(np.maximum(1 - contrast**2, 0.0)), beta))
    over = int(np.sum(contrast > 1))
    limited = f"; delta is 0 or 180 at {over} points whose contrast is above 1" if over else ""
    return Angles(psi, delta, f"alpha and beta converted to psi and delta{limited}")


def from_tan_cos(tan_cos: Float[np.ndarray, "2 points"], places: Sequence[Where], remedy: str) -> Angles:
    """Convert tan Ψ and cos Δ; Δ is in 0 to 180. Where noise takes cos Δ beyond 1, Δ is 0 or 180.

    Raises DataError for a tangent below 0, or a cosine beyond ±1.05.
    """
    tangent, cosine = tan_cos
    refuse_first(tangent, tangent < 0, places[0], f"is no tan(psi), below zero; {remedy}")
    reason = f"is no cos(delta), beyond 1; {remedy}, or name the columns psi_deg and delta_deg"
    refuse_first(cosine, np.abs(cosine) > HIGHEST_COSINE, places[1], reason)
    over = int(np.sum(np.abs(cosine) > 1))
    limited = f"; delta is 0 or 180 at {over} points whose cosine is above 1" if over else ""
    delta = np.rad2deg(np.arccos(np.clip(cosine, -1, 1)))
    return Angles(np.rad2deg(np.arctan(tangent)), delta, f"tan(psi) and cos(delta) converted{limited}")
