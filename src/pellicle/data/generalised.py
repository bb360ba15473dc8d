"""Generalised Ψ and Δ: three ratios of the elements of a Jones matrix, of samples that turn p into s.

With r_ab the amplitude of the reflected b for incident a, as in files of J. A. Woollam:

- AnE: r_pp/r_ss,
- Aps: r_ps/r_pp, s over p of the light that is reflected where p is incident,
- Asp: r_sp/r_ss, p over s of the light that is reflected where s is incident.

`pellicle.jones` has the indices in the other order: its r_sp, row s and column p, is r_ps here. Each ratio
is tan Ψ exp(iΔ), with the sign of Δ of `pellicle.ellipsometry`. Of a sample that does not mix s and p, Aps
and Asp are 0.

Source: M. Schubert, Phys. Rev. B 53, 4265 (1996), for the ratios and the order of the indices.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from pellicle.errors import UsageError

SIGNAL = "generalised-psi-delta"
RATIOS = ("ane", "aps", "asp")
FORMULAS = {"ane": "r_pp/r_ss", "aps": "r_ps/r_pp", "asp": "r_sp/r_ss"}
"""Ratios in Woollam's indices, the first of them incident."""


def check_ratios(ratios: Sequence[str]) -> None:
    """Raise UsageError for unknown and repeated ratios."""
    for name in ratios:
        if name not in RATIOS:
            raise UsageError(
                f"`elements` of generalised psi and delta must be among ane, aps, asp, not {name!r}"
            )
    if len(set(ratios)) < len(ratios):
        raise UsageError(f"`elements` are repeated: {', '.join(ratios)}")


def delta_sigma(
    psi: Float[np.ndarray, "*points"], psi_sigma: Float[np.ndarray, "*points"] | float
) -> Float[np.ndarray, "*points"]:
    """Return the σ of Δ where a ratio has the same error along Ψ and across it; all in degrees.

    On the sphere of N, C, S a σ of Ψ is 2σ in any direction, and one of Δ moves a point by sin 2Ψ σ_Δ. Where
    the ratio is 0 or infinite Δ has no meaning, and its σ ends at 1 radian.
    """
    along = 2 * np.deg2rad(psi_sigma)
    return np.rad2deg(along / np.hypot(np.sin(2 * np.deg2rad(psi)), along))
