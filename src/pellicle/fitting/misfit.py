"""Misfit: when the residuals put the answer itself in doubt.

Small structured residuals are everyday: a discrepancy enlarges the errors by them. A scene is wrong where
effects of ordinary size leave a large part of the residuals unexplained, or explain them only at sizes that
they do not have.
"""

from __future__ import annotations

from typing import NamedTuple

from pellicle.fitting.discrepancy import Discrepancy, Remaining

STRUCTURED = 2.5
"""Ratio of unexplained residuals to the noise of neighbouring points, above which they have structure."""
SPAN = 0.015
"""Share of the signal's range above which unexplained structure is a large one."""
_BEYOND = 5.0
"""Standard uncertainties beyond which an effect is not one of ordinary size."""
_EXPLAINS = 0.6
"""Share of the residuals' sum of squares that such an effect explains alone where the scene has it wrong."""
_DOUBTFUL = 1.5
"""Ratio of unexplained residuals to noise above which such an effect is looked for."""


class Accuracy(NamedTuple):
    """The structure in residuals that no instrument makes: in the unit of the data, and the signal's range
    (infinite where it says nothing)."""

    largest: float
    span: float


def misfit(discrepancy: Discrepancy, remaining: Remaining, accuracy: Accuracy) -> bool:
    """True where the scene does not explain the data of one view."""
    if discrepancy.implausible:
        return True
    large = remaining.typical > min(accuracy.largest, SPAN * accuracy.span)
    if remaining.ratio > STRUCTURED and large:
        return True
    return remaining.ratio > _DOUBTFUL and any(
        c.explains > _EXPLAINS and abs(c.alone) > _BEYOND * c.effect.size for c in discrepancy.contributions
    )
