"""Films by the package tmm (S. J. Byrnes, arXiv:1603.02720), an independent code."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import tmm


def films(
    letters: str,
    nm: Any,
    indices: Sequence[Any],
    depths: Sequence[Any],
    angle: Any = 0.0,
    kind: str = "R",
    coherence: str = "",
) -> np.ndarray:
    """R, T, r or t of films (points,), the mean over the polarisations `letters`; angles in degrees.

    Indices are those of ambient, layers and substrate, depths (nm) those of the layers; each a number or one
    at each point. `coherence` has a letter for each medium, "i" where intensities add.
    """
    columns = np.broadcast_arrays(np.atleast_1d(nm), angle, *indices, *depths)
    rows = np.stack(columns, axis=-1).astype(complex)
    count, found = len(indices), []
    for row in rows:
        n, d = row[2 : 2 + count].tolist(), [np.inf, *row[2 + count :].real.tolist(), np.inf]
        light = np.deg2rad(row[1].real), row[0].real
        each = [
            tmm.inc_tmm(x, n, d, list(coherence), *light) if coherence else tmm.coh_tmm(x, n, d, *light)
            for x in letters
        ]
        found.append(np.mean([one[kind] for one in each]))
    return np.array(found)


def stokes(nm: Any, indices: Sequence[Any], depths: Sequence[Any], angle: Any) -> np.ndarray:
    """|s|² − |p|², 2 Re conj(p) s, 2 Im conj(p) s and |s|² + |p|² of the reflected amplitudes (points, 4).

    The first three in units of the last are N, C, S of tan Ψ exp(iΔ) = conj(r_p / r_s): tmm's sign of time.
    """
    s, p = (films(x, nm, indices, depths, angle, "r") for x in "sp")
    cross, ss, pp = 2 * np.conj(p) * s, abs(s) ** 2, abs(p) ** 2
    return np.stack([ss - pp, cross.real, cross.imag, ss + pp], axis=-1)


def ncs(nm: Any, indices: Sequence[Any], depths: Sequence[Any], angle: Any) -> np.ndarray:
    """N, C and S (points, 3)."""
    sums = stokes(nm, indices, depths, angle)
    return sums[:, :3] / sums[:, 3:]


def psi_delta(n: np.ndarray, c: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ψ, and Δ from 0 to 360, in degrees."""
    return np.rad2deg(np.arctan2(np.hypot(c, s), n)) / 2, np.rad2deg(np.arctan2(s, c)) % 360
