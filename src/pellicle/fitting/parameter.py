"""A free parameter of a fit: its name, unit, bounds and prior."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from pellicle.scene.priors import Normal, Prior

_SHARE, _RELATIVE = 0.02, 0.002
"""Two minima, not one: parameters differ by this share of their range, or by this share of their value."""


ON_BOUND = 1e-6
"""Distance from a bound, as a share of the range, within which a value rests on it."""


@dataclass(frozen=True)
class Parameter:
    """One free parameter; `key` is the last part of its full `name` (`thickness`, `n`, `A`).

    `natural` says of the lower and the upper bound whether physics sets it: a best value there gives a
    one-sided limit, not a warning. The ends of a `periodic` parameter are one. Minima closer than
    `resolution` (in its unit, at least 0.2 % of the value; 2 % of the range if None) are one.

    `varies`: how it changes in a series, None for the usual way; `first` and `last`: what is known of it at
    the first and at the last time.

    `limits` marks default bounds, and is how far they may be widened; None for bounds that the user set.

    The rest are hints for a search: whether the parameter is `searched` or starts from `start`, the `group`
    of parameters that move together, how many `levels` to try (None: by the width of the bounds), and whether
    these go by `decades`.
    """

    name: str
    key: str
    unit: str
    start: float
    lower: float
    upper: float
    prior: Prior | None = None
    limits: tuple[float, float] | None = None
    varies: str | None = None
    first: Normal | float | None = None
    last: Normal | float | None = None
    natural: tuple[bool, bool] = (False, False)
    periodic: bool = False
    resolution: float | None = None
    searched: bool = True
    group: str = ""
    levels: int | None = None
    decades: bool = False

    def on_ends(self, values: Any) -> tuple[Any, Any]:
        """Test if values (...) lie on the lower and on the upper bound."""
        margin = ON_BOUND * (self.upper - self.lower)
        return values - self.lower <= margin, self.upper - values <= margin

    def on_bound(self, values: Any) -> Any:
        """Test if values (...) rest on a bound."""
        lower, upper = self.on_ends(values)
        return (lower | upper) & (not self.periodic)

    def on_natural_bound(self, values: Any) -> Any:
        """Test if values (...) lie on a bound that physics sets, an absence or a whole. A thickness of 0 is
        none of them: no layer."""
        none = self.natural[0] and self.lower == 0 and self.key != "thickness"
        whole = self.natural[1] and self.upper == 1
        on_whole = values >= 1 - ON_BOUND * (1 - self.lower)
        return (none & (values <= ON_BOUND * self.upper)) | (whole & on_whole)

    def resolutions_at(self, units: np.ndarray) -> np.ndarray:
        """Distances from points of the unit interval within which minima are one."""
        if self.resolution is None:
            return np.full(np.shape(units), _SHARE)
        span = self.upper - self.lower
        return np.asarray(np.maximum(self.resolution, _RELATIVE * np.abs(self.lower + units * span)) / span)
