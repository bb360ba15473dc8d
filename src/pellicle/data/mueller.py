"""Elements of a normalised Mueller matrix: their names, limits and usual symmetries.

Stokes vectors are (I, Q, U, V) with Q = I_p − I_s, and the matrix of an isotropic sample is m12 = m21 = −N,
m33 = m44 = C, m34 = −m43 = S, m22 = 1, the others 0, with N, C, S of `data.ellipsometry_angles` (Jellison
and Modine 1997, Appl. Opt. 36, 8184; CompleteEASE). Elements are those of the matrix divided by m11.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from pellicle.data.signal_checks import Where, refuse_first
from pellicle.errors import UsageError

SIGNAL = "mueller"
ELEMENTS = tuple(f"m{i}{j}" for i in range(1, 5) for j in range(1, 5))[1:]
"""Names of the elements beside m11, row by row."""
HIGHEST, MOST_SIGMA = 1.1, 5.0
"""Largest element that calibration leaves, and noise beyond it in σ: of a passive sample none exceeds 1."""
_PAIRS = (("m12", "m21", 1), ("m33", "m44", 1), ("m34", "m43", -1))
"""Elements of a reflection that are equal, or opposite, for isotropic samples."""
_OPPOSED = -0.9
_DARK = 0.02
"""Elements smaller than this have no sign beyond noise and calibration."""


def check_elements(elements: Sequence[str]) -> None:
    """Raise UsageError for unknown and repeated elements."""
    for name in elements:
        if name not in ELEMENTS:
            raise UsageError(
                f"`elements` must be among {ELEMENTS[0]} to {ELEMENTS[-1]} without m11, not {name!r}"
            )
    if len(set(elements)) < len(elements):
        raise UsageError(f"`elements` are repeated: {', '.join(elements)}")


def check_mueller(
    values: Float[np.ndarray, " points"],
    sigma: Float[np.ndarray, " points"] | None,
    element: str,
    where: Where,
    remedy: str,
) -> None:
    """Refuse what no normalised element is. Raises DataError."""
    reason = f"is beyond {HIGHEST:g} for {element}, a normalised element of a Mueller matrix; {remedy}"
    limit = HIGHEST + (0.0 if sigma is None else MOST_SIGMA * sigma)
    refuse_first(values, np.abs(values) > limit, where, reason)


def sign_notes(elements: Sequence[str], values: Float[np.ndarray, "points elements"]) -> list[str]:
    """A sentence for each pair of elements whose signs are not those of an isotropic sample."""
    column = dict(zip(elements, values.T, strict=True))
    found = []
    for one, other, sign in _PAIRS:
        if one not in column or other not in column:
            continue
        first, second = column[one], column[other]
        sizes = np.sqrt(np.mean(first**2)), np.sqrt(np.mean(second**2))
        if min(sizes) > _DARK and np.mean(first * second) * sign < _OPPOSED * sizes[0] * sizes[1]:
            have, want = ("opposite signs", "equal") if sign > 0 else ("the same sign", "opposite")
            found.append(
                f"{one} and {other} have {have}, and of an isotropic sample they are {want}: the file may"
                " follow another convention of signs"
            )
    return found
