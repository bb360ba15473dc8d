"""Covariance of a fit from its Jacobian, also where the data do not see a direction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pellicle.fitting.problem import Problem

UNSEEN = 0.5
"""A standard error above this share of a parameter's range: the data add nothing to the bounds."""


def correlation(covariance: np.ndarray) -> np.ndarray:
    """The correlation matrix of a covariance; zero for a parameter without one."""
    deviation = np.sqrt(np.diag(covariance))
    sd = np.where(deviation > 0, deviation, 1.0)
    return covariance / np.outer(sd, sd)


@dataclass(frozen=True)
class Errors:
    """Covariance of parameters, then of nuisances, in their own units; `names` in the same order."""

    names: tuple[str, ...]
    covariance: np.ndarray

    @property
    def stderr(self) -> np.ndarray:
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> np.ndarray:
        return correlation(self.covariance)


class Scaled(NamedTuple):
    """The weighted Jacobian of all data and priors, each column in the `unit` of its parameter.

    `jacobian` (points and priors, parameters and nuisances): parameters by the unit interval of their
    coordinate, nuisances by the standard deviation of their prior; the last rows are those of the priors.
    `stretch` takes steps in these units to steps in the parameters' own units. `pull` is the distance from
    the means of the priors (parameters and nuisances,), in their standard deviations.
    """

    jacobian: np.ndarray
    stretch: np.ndarray
    names: tuple[str, ...]
    pull: np.ndarray | float = 0.0

    def blocks(self, sizes: Sequence[int], variance: Sequence[float]) -> list[np.ndarray]:
        """Rows of each view, of so many data values, by the σ of its weights: without its `variance`."""
        rows = np.split(self.jacobian, np.cumsum(sizes))[: len(sizes)]
        return [block * np.sqrt(widened) for block, widened in zip(rows, variance, strict=True)]

    def by_range(self, ranges: np.ndarray) -> np.ndarray:
        """The Jacobian with its columns in steps of `ranges` (columns,) of the parameters' own units."""
        return self.jacobian @ np.linalg.pinv(self.stretch) * ranges


def scaled(problem: Problem, unit: np.ndarray, at: Sequence[Any], variance: Sequence[float]) -> Scaled:
    """The Jacobian at a point (parameters,) of the unit cube, where `at` are the views' local models.

    `variance` of each view multiplies σ²: noise, and correlation, as the residuals show them.
    """
    nuisances = [view.nuisances(local) for view, local in zip(problem.views, at, strict=True)]
    every = [c for own in nuisances for c in own]
    slope = problem.coordinates.slope(problem.box, unit)
    count = len(unit)
    blocks, first = [], count
    for view, local, own, widened in zip(problem.views, at, nuisances, variance, strict=True):
        part = view.jacobian(local) / np.sqrt(widened)
        block = np.zeros((len(part), count + len(every)))
        block[:, :count] = part[:, : len(view.takes)] @ slope[list(view.takes)]
        block[:, first : first + len(own)] = part[:, len(view.takes) :]
        first += len(own)
        blocks.append(block)
    priors = np.zeros((count + len(every),) * 2)
    priors[:count, :count] = problem.box.prior_weight[:, None] * slope
    priors[count:, count:] = np.eye(len(every))
    stretch = np.zeros_like(priors)
    stretch[:count, :count] = slope
    stretch[count:, count:] = np.diag([c.prior_sd for c in every])
    names = (*(p.name for p in problem.parameters), *(c.name for c in every))
    pull = [*np.asarray(problem.box.prior_rows(problem.values(unit))), *(c.pull for c in every)]
    return Scaled(np.vstack([*blocks, priors]), stretch, names, np.array(pull, float))


def errors(scaled: Scaled) -> Errors:
    """Covariance by a singular value decomposition of the scaled Jacobian.

    Nothing is inverted that is not there: a direction that the data do not see keeps its huge variance (a
    pseudo-inverse would call it 0, and an opaque gold film known to ± 0.00 nm).
    """
    _, values, rows = np.linalg.svd(scaled.jacobian, full_matrices=False)
    points = len(scaled.jacobian) - len(scaled.names)
    floor = np.finfo(float).eps * points * max(values.max(initial=0.0), 1e-100)
    spread = scaled.stretch @ (rows.T / np.maximum(values, floor))
    return Errors(scaled.names, spread @ spread.T)
