"""What ellipsometers write in place of Ψ and Δ, turned into them; arrays of one length, angles in degrees."""

from __future__ import annotations

import numpy as np

from pellicle.data.tabular.table import Table
from pellicle.errors import DataError

PSI_DELTA, NCS, ALPHA_BETA = ("psi", "delta"), ("N", "C", "S"), ("alpha", "beta")
FORMS = (PSI_DELTA, NCS, ALPHA_BETA)
"""The columns of each form; where a file has several, the first is read."""
POLARISED = (0.5, 1.05)
"""Degrees of polarisation that N, C, S may have: below, noise rules; above, they are something else."""

Turned = tuple[np.ndarray, np.ndarray, str]
"""Ψ, Δ, and a sentence on what was done."""


def from_ncs(table: Table, position: int, ncs: np.ndarray) -> Turned:
    """Of N, C, S (3, points), whatever their common factor, the degree of polarisation. Raises DataError."""
    polarised = np.sqrt(np.sum(ncs**2, axis=0))
    wrong = (polarised < POLARISED[0]) | (polarised > POLARISED[1])
    if wrong.any():
        row = int(np.argmax(wrong))
        raise DataError(
            f"{table.where(row, position)}: N, C and S make a degree of polarisation of "
            f"{polarised[row]:.3g}, where about 1 is possible; correct or delete that row"
        )
    psi = np.rad2deg(0.5 * np.arctan2(np.hypot(ncs[1], ncs[2]), ncs[0]))
    span = f"{polarised.min():.4g} to {polarised.max():.4g}"
    note = f"N, C, S turned into psi and delta; their degree of polarisation, {span}, was divided out"
    return psi, np.rad2deg(np.arctan2(ncs[2], ncs[1])), note


def from_alpha_beta(table: Table, position: int, ab: np.ndarray, analyser: np.ndarray) -> Turned:
    """Of α, β (2, points) of a rotating analyser: Δ in 0 to 180, for it sees cos Δ only. Raises DataError.

    `analyser` is the angle of the polariser that stands, from the plane of incidence. tan Ψ = tan A
    √((1 + α)/(1 − α)) and cos Δ = β/√(1 − α²), the inverse of `optics.ellipsometry.alpha_beta`. Where
    noise takes β beyond √(1 − α²), Δ is 0 or 180.
    """
    alpha, beta = ab
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
    note = "alpha and beta turned into psi and delta"
    return (
        psi,
        delta,
        note + (f"; of {over} points whose contrast is above 1 delta is 0 or 180" if over else ""),
    )
