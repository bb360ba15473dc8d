"""Lack of fit of repeated sweeps: residuals of their mean against their scatter, which needs no model."""

import math
from dataclasses import dataclass

from pellicle.data.repeated_sweeps import repeatability
from pellicle.data.spectrum import Spectrum
from pellicle.fitting.result import Part

_UNLIKELY = 0.01


@dataclass(frozen=True)
class LackOfFit:
    """F test for lack of fit (N. Draper and H. Smith 1998, Applied regression analysis, section 2.1).

    - `sweeps`: their number.
    - `repeatability`: standard deviation of a point of one sweep ("pure error"), in the unit of the rms.
    - `ratio`: F, the mean square of the residuals over what the scatter of the sweeps leaves in their mean.
    - `freedom`: degrees of freedom of the residuals and of the scatter.
    """

    sweeps: int
    repeatability: float
    ratio: float
    freedom: tuple[int, int]

    @property
    def probability(self) -> float:
        """Probability that a scene that explains the data gives at least this ratio."""
        from scipy.special import fdtrc  # slow to import

        return float(fdtrc(*self.freedom, self.ratio))

    @property
    def verdict(self) -> str:
        """Verdict of the test: residuals larger than the noise left in the mean, smaller, or equal to it."""
        times = math.sqrt(self.ratio)
        if self.probability < _UNLIKELY:
            return (
                f"residuals are {times:.2g} times the noise that is left in the mean: the scene misses"
                " something, or the sweeps share an error"
            )
        if self.probability > 1 - _UNLIKELY:
            return (
                f"residuals are {times:.2g} times the noise that is left in the mean: the sweeps drift as a"
                " whole; compare them as repeats"
            )
        return "residuals are the noise that is left in the mean: the scene explains the data"


def lack_of_fit(part: Part, free: int) -> LackOfFit | None:
    """Compare the residuals of a part of a fit with the scatter of its sweeps, None where it has none.

    `free` is the number of free parameters and coefficients.
    """
    data = part.data
    if not isinstance(data, Spectrum) or not data.sweeps:
        return None
    count, size = len(data.sweeps), repeatability(data.sweeps)
    values = len(data) * data.kind.independent
    freedom = max(values - free, 1), values * (count - 1)
    if not size:
        return None  # copies
    return LackOfFit(count, size, count * part.rms**2 * values / (freedom[0] * size**2), freedom)
