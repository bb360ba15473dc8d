"""Misfit: when the residuals put the answer itself in doubt.

Small structured residuals are everyday: a discrepancy enlarges the errors by them. A scene is wrong where
effects of ordinary size leave a large part of the residuals unexplained, or explain them only at sizes that
they do not have.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from pellicle.fitting.discrepancy import DOUBTFUL, Contribution, Discrepancy, Remaining

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


class Accuracy(NamedTuple):
    """The structure in residuals that no instrument makes; infinite where a number says nothing.

    `largest` is in the unit of the data, `span` the signal's range, and `weighted` in units of the σ of the
    points, where that is the error of a model whose lamp drifts. `noise` is the root mean square, in the unit
    of the data, of what cannot be noise where none was given.
    """

    largest: float = math.inf
    span: Any = math.inf
    weighted: float = math.inf
    noise: float = math.inf


def misfit(discrepancy: Discrepancy, remaining: Remaining, accuracy: Accuracy) -> Any:
    """True (...) where the scene does not explain the data of one view."""
    wrong = discrepancy.implausible | beyond_accuracy(remaining, accuracy)
    return wrong | ((remaining.ratio > DOUBTFUL) & (other_material(discrepancy.contributions) >= 0))


def beyond_accuracy(remaining: Remaining, accuracy: Accuracy) -> Any:
    """True (...) where residuals that no effect explains are larger than instruments make."""
    largest = np.minimum(accuracy.largest, SPAN * accuracy.span)
    large = (remaining.typical > largest) | (remaining.weighted > accuracy.weighted)
    # the misfit of a wrong order may be in some of the fringes alone
    contradicted = (remaining.rms > largest) & (remaining.weighted > CONTRADICTED)
    return (large & (remaining.ratio > STRUCTURED)) | contradicted | (remaining.rms > accuracy.noise)


def other_material(contributions: Sequence[Contribution]) -> Any:
    """Position (...) of the index far from the given one that explains the residuals as no effect of ordinary
    size does, −1 where there is none."""
    if not contributions:
        return -1
    explains = np.stack([c.explains for c in contributions])
    far = np.stack([np.abs(c.alone) > BEYOND * c.effect.size for c in contributions])
    material = np.reshape([c.effect.material for c in contributions], (-1, *[1] * (far.ndim - 1)))
    usual = np.max(np.where(far, 0.0, explains), axis=0, initial=0.0)
    least = np.maximum(EXPLAINS, usual + BETTER)
    explains = np.where(far & material, explains, -np.inf)
    return np.where(np.max(explains, axis=0) > least, np.argmax(explains, axis=0), -1)[()]
