"""Misfit: when the residuals put the answer itself in doubt.

Small structured residuals are everyday: a discrepancy enlarges the errors by them. A scene is wrong where
effects of ordinary size leave a large part of the residuals unexplained, or explain them only at sizes that
they do not have.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pellicle.fitting.discrepancy import Contribution, Discrepancy, Remaining

STRUCTURED = 2.5
"""Ratio of unexplained residuals to the noise of neighbouring points, above which they have structure."""
SPAN = 0.015
"""Share of the signal's range above which unexplained structure is a large one."""
CONTRADICTED = 10.0
"""Root mean square of unexplained residuals in units of a given σ, above which large ones are a misfit even
without structure: that is no noise of which someone knew the size."""
BEYOND = 5.0
"""Standard uncertainties beyond which an index is that of another material."""
EXPLAINS = 0.6
"""Share of the residuals' sum of squares that such an index explains alone where the scene has it wrong."""
BETTER = 0.1
"""Share that it explains more than any effect of ordinary size does."""
DOUBTFUL = 1.5
"""Ratio of unexplained residuals to noise above which such an index is looked for."""


class Accuracy(NamedTuple):
    """The structure in residuals that no instrument makes; infinite where a number says nothing.

    `largest` is in the unit of the data, `span` the signal's range, and `weighted` in units of the σ of the
    points, where that is the error of a model whose lamp drifts.
    """

    largest: float = math.inf
    span: Any = math.inf
    weighted: float = math.inf


def misfit(discrepancy: Discrepancy, remaining: Remaining, accuracy: Accuracy) -> bool:
    """True where the scene does not explain the data of one view."""
    if discrepancy.implausible or beyond_accuracy(remaining, accuracy):
        return True
    return remaining.ratio > DOUBTFUL and other_material(discrepancy) is not None


def beyond_accuracy(remaining: Remaining, accuracy: Accuracy) -> Any:
    """True where residuals that no effect explains are larger than instruments make; numbers or arrays."""
    large = remaining.typical > np.minimum(accuracy.largest, SPAN * accuracy.span)
    structured = (remaining.ratio > STRUCTURED) & (large | (remaining.weighted > accuracy.weighted))
    return structured | (large & (remaining.weighted > CONTRADICTED))


def other_material(discrepancy: Discrepancy) -> Contribution | None:
    """The index far from the given one that explains the residuals as no effect of ordinary size does."""
    rows = discrepancy.contributions
    usual = max((c.explains for c in rows if abs(c.alone) <= BEYOND * c.effect.size), default=0.0)
    far = [c for c in rows if c.effect.material and abs(c.alone) > BEYOND * c.effect.size]
    best = max(far, key=lambda c: c.explains, default=None)
    return best if best is not None and best.explains > max(EXPLAINS, usual + BETTER) else None
