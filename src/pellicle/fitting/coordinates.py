"""Coordinates of a search: the unit cube, and the parameters' own units.

Most parameters go evenly between their bounds; those that span decades go by their logarithm. The
deviation of a normal is searched as (x, y) in a disc, because at zero its azimuth is undefined. Samples in
one plane depend on y² alone, the tilt out of that plane: y itself has no slope at 0, where a solver would
stop on the saddle between the two signs and underestimate the error of what is correlated with y².
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.optics.pair import namespace
from pellicle.scene.priors import LogUniform, Prior

Array: TypeAlias = jax.Array | np.ndarray

LEAST_SQUARE = 1e-6
"""Least y² in the disc: a fiftieth of a degree off the plane, where y² → y still has a slope."""


class Box(NamedTuple):
    """Bounds of the coordinates, and priors on the parameters in their own units, each (parameters,).

    Normal and half-normal priors have a mean and a weight; `logarithmic` is 1 for a log-uniform prior, which
    posteriors use and fits do not. `reach` is the largest deviation of a tilt in degrees.
    """

    lower: Array
    upper: Array
    prior_mean: Array
    prior_weight: Array  # 1/sd, 0 for none
    logarithmic: Array
    reach: Array | np.floating = np.float64(0.0)

    def of_first(self, size: int) -> "Box":
        """The box of the first `size` parameters."""
        return self._of_each(lambda side: side[..., :size])

    def extended(self, size: int) -> "Box":
        """The box with fixed parameters at the end, without priors, for `size` of them."""
        return self._of_each(lambda side: widened(side, size))

    def _of_each(self, change: Callable[[Any], Any]) -> "Box":
        return self._replace(**{name: change(getattr(self, name)) for name in self._fields[:5]})

    def prior_rows(self, values: Any) -> Any:
        """Weighted distances of the values from the means of their priors, (parameters,)."""
        return (values - self.prior_mean) * self.prior_weight

    def log_prior(self, values: Any) -> Any:
        """ln of the priors at values of the parameters, up to a constant."""
        logarithm = jnp.log(jnp.where(self.logarithmic > 0, values, 1.0))
        return -0.5 * jnp.sum(self.prior_rows(values) ** 2) - jnp.sum(self.logarithmic * logarithm)


def widened(rows: Any, size: int) -> np.ndarray:
    """Rows (..., n) with zeros at the end, (..., size)."""
    more = [(0, 0)] * (np.ndim(rows) - 1)
    return np.pad(rows, [*more, (0, size - np.shape(rows)[-1])])


def box(lower: np.ndarray, upper: np.ndarray, priors: Sequence[Prior | None], reach: float = 0.0) -> Box:
    """The box between bounds (parameters,), with the prior of each parameter."""
    rows = [prior.mean_and_weight if prior else (0.0, 0.0) for prior in priors]
    mean, weight = np.reshape(rows, (-1, 2)).T
    logarithmic = np.array([float(isinstance(prior, LogUniform)) for prior in priors])
    return Box(lower, upper, mean, weight, logarithmic, np.float64(reach))


class Coordinates(NamedTuple):
    """Map from the unit cube to values: static and hashable, a part of a program's key."""

    log: tuple[bool, ...] = ()  # coordinates that are logarithms, none where empty
    tilt: tuple[int, int] | None = None  # positions of deviation and azimuth where they are x and y of a disc
    folded: bool = False  # y² in the place of y

    def values(self, box: Box, unit: Any) -> Any:
        """The parameters in their own units at `unit` (..., parameters)."""
        x = box.lower + unit * (box.upper - box.lower)
        xp = namespace(x)
        if any(self.log):
            log = np.array(self.log)
            x = xp.where(log, xp.exp(xp.where(log, x, 0.0)), x)
        if self.tilt is None:
            return x
        a, b = self.tilt
        y = xp.sqrt(x[..., b]) if self.folded else x[..., b]
        # the square onto the disc, smoothly and edge to edge: see `log_area`
        u, v = x[..., a] * xp.sqrt(1 - 0.5 * y**2), y * xp.sqrt(1 - 0.5 * x[..., a] ** 2)
        # its azimuth has a slope everywhere but at the centre
        u = xp.where(u * u + v * v < 1e-20, 1e-10, u)
        radius, azimuth = box.reach * xp.sqrt(u * u + v * v), xp.rad2deg(xp.arctan2(v, u))
        if xp is jnp:
            return x.at[..., a].set(radius).at[..., b].set(azimuth)
        x[..., a], x[..., b] = radius, azimuth
        return x

    def slope(self, box: Box, unit: np.ndarray) -> np.ndarray:
        """∂ values / ∂ unit at one point, (parameters, parameters)."""
        if self.tilt is None:
            growth = np.where(self.log, self.values(box, unit), 1.0) if self.log else 1.0
            return np.diag((box.upper - box.lower) * growth)
        return np.asarray(_slope(self, box, unit))

    def log_area(self, box: Box, unit: Any) -> Any:
        """ln of the area of the disc of tilts that a step in the unit cube covers, up to a constant; not
        folded."""
        if self.tilt is None:
            return 0.0
        x, y = (box.lower[at] + unit[at] * (box.upper[at] - box.lower[at]) for at in self.tilt)
        sides = jnp.sqrt((1 - 0.5 * y**2) * (1 - 0.5 * x**2))
        return jnp.log(sides - (0.5 * x * y) ** 2 / sides)


@partial(jax.jit, static_argnums=0)
def _slope(coordinates: Coordinates, box: Box, unit: Any) -> Any:
    return jax.jacfwd(lambda unit: coordinates.values(box, unit))(unit)
