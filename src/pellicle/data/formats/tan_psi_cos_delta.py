"""tan Ψ and cos Δ, which some programs write in place of Ψ and Δ, as columns α and β.

With the fixed polariser at A = 45 degrees, α = (tan²Ψ − tan²A)/(tan²Ψ + tan²A) and β = √(1 − α²) cos Δ are
the same measurement: the sign of Δ is unknown.
"""

from __future__ import annotations

import math

from pellicle.data.tabular.text import Line, is_number
from pellicle.errors import DataError

COLUMNS = ("alpha", "beta", "analyser_deg")
HIGHEST_COSINE = 1.05
"""Noise takes cos Δ this far beyond 1; further, the column holds something else."""


def cells_of(tangent: str, cosine: str, line: Line, path: str) -> list[str]:
    """Return α, β and the angle of 45 degrees as text.

    Raises DataError for a cell that is no number, a tangent below 0, or a cosine beyond ±1.05.
    """
    limits = (("tan(psi)", tangent, 0.0, math.inf), ("cos(delta)", cosine, -HIGHEST_COSINE, HIGHEST_COSINE))
    for name, cell, low, high in limits:
        if not is_number(cell) or not low <= float(cell) <= high or math.isinf(float(cell)):
            raise DataError(
                f"{path}: line {line.number}: {cell!r} is no {name}, which the heading announces; correct "
                "that row, or export psi and delta in degrees"
            )
    squared = float(tangent) ** 2
    alpha = (squared - 1) / (squared + 1)
    return [repr(alpha), repr(math.sqrt(1 - alpha**2) * float(cosine)), "45"]
