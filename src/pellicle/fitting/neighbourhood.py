"""The misfit around the best minimum of a fit, in the parameters' own units."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pellicle.fitting.evaluation import total_deviance
from pellicle.fitting.minima import deviance_at, solve
from pellicle.fitting.reweighting import RankedMinima

_SETTLED = 0.03
"""Square root of the change of χ² that does not matter to a limit at a rise of 2.7 and more."""


class Neighbourhood(NamedTuple):
    """χ² around a best point, above some constant; it counts points as the covariance does.

    `best` (parameters,) is in the unit cube between `lower` and `upper`; `covariance` (parameters,
    parameters) in the parameters' own units; `natural` says of each lower and upper bound whether physics
    sets it.
    `misfit` returns χ² at points (points, parameters) of the cube; `profile(which, values, starts)` the least
    χ² with one parameter fixed at each value and the others polished from `starts` (values, starts,
    parameters), and the points (values, parameters) where it is. `others` (points, parameters) are further
    minima from which a profile may be reached.
    """

    best: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    covariance: np.ndarray
    natural: tuple[tuple[bool, bool], ...]
    misfit: Callable[[np.ndarray], np.ndarray]
    profile: Callable[[int, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
    others: np.ndarray = np.zeros((0, 0))

    @property
    def values(self) -> np.ndarray:
        """The best values."""
        return self.lower + self.best * (self.upper - self.lower)

    @property
    def stderr(self) -> np.ndarray:
        return np.sqrt(np.diag(self.covariance))

    def along_axes(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """The misfit beside the parabola of the covariance, `reach` standard errors to both sides on the axis
        of each parameter, with the others where the covariance expects them.

        Returns the standard errors moved, fewer where a bound is nearer, and the rise of χ² as a share of the
        parabola's, each (2, parameters).
        """
        span, stderr = self.upper - self.lower, self.stderr
        along = reach * self.covariance / stderr[:, None] / span
        ends = np.clip(self.best + np.concatenate([along, -along]), 0.0, 1.0)
        misfit = self.misfit(np.concatenate([self.best[None], ends]))
        own = np.array([np.diag(half - self.best) for half in np.split(ends, 2)])
        moved = np.abs(own) * (span / stderr)
        rise = (misfit[1:] - misfit[0]).reshape(own.shape)
        return moved, rise / np.maximum(moved, 1e-100) ** 2


def neighbourhood(ranked: RankedMinima, covariance: np.ndarray, others: np.ndarray) -> Neighbourhood:
    """Neighbourhood of the best of the ranked minima.

    `covariance` has the problem's parameters first; `others` (points, parameters) are further minima, in the
    parameters' own units.
    """
    values = ranked.values
    pairs = zip(ranked.problem.views, ranked.fits, strict=True)
    counted = ranked.problem._replace(views=tuple(view.counting(1 / fit.variance) for view, fit in pairs))
    own = counted.in_own_units(values)
    thinned, box = own.thinned(), own.box
    searched_in_own_units = own.coordinates == ranked.problem.coordinates
    lower, upper = np.asarray(box.lower), np.asarray(box.upper)
    best, *further = np.clip((np.vstack([values, *others]) - lower) / (upper - lower), 0.0, 1.0)

    def profile(which: int, at: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        every = np.repeat(at, starts.shape[1])
        result = solve(own, starts.reshape(len(every), -1), fixed=(which, every), atol=_SETTLED)
        deviance = result.deviance.reshape(len(at), -1)
        chosen = np.arange(len(at)), np.argmin(deviance, axis=1)
        return deviance[chosen], result.units.reshape(starts.shape)[chosen]

    return Neighbourhood(
        best,
        lower,
        upper,
        covariance[: len(best), : len(best)],
        tuple(p.natural for p in ranked.problem.parameters),
        lambda units: deviance_at(own, units) if searched_in_own_units else total_deviance(thinned, units),
        profile,
        np.reshape(further, (-1, len(best))),
    )
