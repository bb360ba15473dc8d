"""Ψ and Δ from the quantities that ellipsometers write in their place; angles in degrees."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from pellicle.data.tabular.table import Table
from pellicle.errors import DataError
from pellicle.signals.limits import refuse_first

PSI_DELTA, NCS = ("psi", "delta"), ("N", "C", "S")
ALPHA_BETA, TAN_COS = ("alpha", "beta"), ("tan_psi", "cos_delta")
FORMS = (PSI_DELTA, NCS, ALPHA_BETA, TAN_COS)
"""The columns of each form; where a file has several, the first is read."""
FOLDED_FORMS = (ALPHA_BETA, TAN_COS)
"""Forms that contain cos Δ only."""
POLARISED = (0.5, 1.05)
"""Accepted degrees of polarisation of N, C, S: below, noise dominates; above, the columns are not N, C, S."""
HIGHEST_COSINE = 1.05
"""Noise takes cos Δ this far beyond 1; further, the column is not cos Δ."""
_REMEDY = "correct or delete that row"
_ROUNDED = 3e-3
"""1 − N² − C² − S² below this is rounding: of three decimals in each it reaches 0.0017."""


class PsiDelta(NamedTuple):
    """Ψ and Δ in degrees, a sentence on the conversion, and the depolarisation, where it is known."""

    psi: Float[np.ndarray, " points"]
    delta: Float[np.ndarray, " points"]
    note: str | None = None
    depolarisation: Float[np.ndarray, " points"] | None = None


def from_ncs(table: Table, position: int, columns: Float[np.ndarray, "3 points"]) -> PsiDelta:
    """Convert N = cos 2Ψ, C = sin 2Ψ cos Δ, S = sin 2Ψ sin Δ, each times the degree of polarisation.

    `position` is the column that errors name. Raises DataError for an impossible degree of polarisation.
    """
    polarised = np.sqrt(np.sum(columns**2, axis=0))
    wrong = (polarised < POLARISED[0]) | (polarised > POLARISED[1])
    if wrong.any():
        row = int(np.argmax(wrong))
        raise DataError(
            f"{table.where(row, position)}: N, C and S make a degree of polarisation of "
            f"{polarised[row]:.3g}, where about 1 is possible; correct or delete that row"
        )
    psi = np.rad2deg(0.5 * np.arctan2(np.hypot(columns[1], columns[2]), columns[0]))
    delta, share = np.rad2deg(np.arctan2(columns[2], columns[1])), 1 - polarised**2
    note = "N, C, S converted to psi and delta"
    if np.max(np.abs(share)) < _ROUNDED:
        return PsiDelta(psi, delta, note)
    return PsiDelta(psi, delta, f"{note}, and 1 - N² - C² - S² read as the depolarisation", share)


def from_alpha_beta(
    table: Table,
    position: int,
    alpha_beta: Float[np.ndarray, "2 points"],
    analyser: Float[np.ndarray, " points"],
) -> PsiDelta:
    """Convert α, β of a rotating analyser; Δ is in 0 to 180, since only cos Δ is measured.

    `analyser` is the angle of the fixed polariser from the plane of incidence. tan Ψ = tan A
    √((1 + α)/(1 − α)) and cos Δ = β/√(1 − α²), the inverse of `optics.ellipsometry.alpha_beta`. Where
    noise takes β beyond √(1 − α²), Δ is 0 or 180. `position` is the column that errors name.

    Raises DataError for a contrast above 1.
    """
    alpha, beta = alpha_beta
    contrast = np.hypot(alpha, beta)
    wrong = (contrast > POLARISED[1]) | (np.abs(alpha) > 1)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise DataError(
            f"{table.where(row, position)}: alpha {alpha[row]:g} and beta {beta[row]:g} make a contrast of "
            f"{contrast[row]:.3g}, where at most 1 is possible; correct or delete that row"
        )
    psi = np.rad2deg(np.arctan2(np.tan(np.deg2rad(analyser)) * np.sqrt(1 + alpha), np.sqrt(1 - alpha)))
    delta = np.rad2deg(np.arctan2(np.sqrt(np.maximum(1 - contrast**2, 0.0)), beta))
    over = int(np.sum(contrast > 1))
    limited = f"; delta is 0 or 180 at {over} points whose contrast is above 1" if over else ""
    return PsiDelta(psi, delta, f"alpha and beta converted to psi and delta{limited}")


def from_tan_cos(table: Table, positions: Sequence[int], tan_cos: Float[np.ndarray, "2 points"]) -> PsiDelta:
    """Convert tan Ψ and cos Δ; Δ is in 0 to 180. Where noise takes cos Δ beyond 1, Δ is 0 or 180.

    `positions` are the columns that errors name. Raises DataError for a tangent below 0, or a cosine beyond
    ±1.05.
    """
    tangent, cosine = tan_cos
    refuse_first(tangent, tangent < 0, table.places(positions[0]), f"is no tan(psi), below zero; {_REMEDY}")
    reason = f"is no cos(delta), beyond 1; {_REMEDY}, or name the columns psi_deg and delta_deg"
    refuse_first(cosine, np.abs(cosine) > HIGHEST_COSINE, table.places(positions[1]), reason)
    over = int(np.sum(np.abs(cosine) > 1))
    limited = f"; delta is 0 or 180 at {over} points whose cosine is above 1" if over else ""
    delta = np.rad2deg(np.arccos(np.clip(cosine, -1, 1)))
    return PsiDelta(np.rad2deg(np.arctan(tangent)), delta, f"tan(psi) and cos(delta) converted{limited}")
