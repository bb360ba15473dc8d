"""A free parameter of a fit: its name, unit, bounds and prior."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pellicle.scene.priors import Prior

_SHARE, _RELATIVE = 0.02, 0.002
"""Two minima, not one: parameters differ by this share of their range, or by this share of their value."""


@dataclass(frozen=True)
class Parameter:
    """One free parameter; `key` is the last part of its full `name` (`thickness`, `n`, `A`).

    `natural` says of the lower and the upper bound whether physics sets it: a best value there gives a
    one-sided limit, not a warning. The ends of a `periodic` parameter are one. Minima closer than
    `resolution` (in its unit, at least 0.2 % of the value; 2 % of the range if None) are one.

    `limits` marks default bounds, and is how far they may be widened; None for bounds that the user set.

    The rest are hints for a search: whether the parameter is `searched` or starts from `start`, the `group`
    of parameters that move together, and how many `levels` to try (None: by the width of the bounds).
    """

    name: str
    key: str
    unit: str
    start: float
    lower: float
    upper: float
    prior: Prior | None = None
    limits: tuple[float, float] | None = None
    natural: tuple[bool, bool] = (False, False)
    periodic: bool = False
    resolution: float | None = None
    searched: bool = True
    group: str = ""
    levels: int | None = None

    def resolution_at(self, unit: float) -> float:
        """Distance from a point of the unit interval within which minima are one."""
        return float(self.resolutions_at(np.array(unit)))

    def resolutions_at(self, units: np.ndarray) -> np.ndarray:
        """Distances from points of the unit interval within which minima are one."""
        if self.resolution is None:
            return np.full(np.shape(units), _SHARE)
        span = self.upper - self.lower
        return np.asarray(np.maximum(self.resolution, _RELATIVE * np.abs(self.lower + units * span)) / span)
