"""The misfit around a fit's best point, whatever was fitted: what profiles of it need to know."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from pellicle.fitting.spectra.problem import Problem, View, thin
from pellicle.fitting.spectra.reweighting import RankedMinima, SpectrumFit
from pellicle.fitting.spectra.search import SCAN_POINTS, held, quiet, scanned, solver


class Valley(NamedTuple):
    """Parameters (parameters,) in their own units, and χ² above some constant, which counts points as the
    covariance does.

    `best` is in the unit cube between `lower` and `upper`; `covariance` (parameters, parameters);
    `natural` says of each lower and each upper bound whether it is physics'. `misfit` gives χ² at points
    (points, parameters) of the cube, `held(which, values, starts)` the least χ² with one parameter held at
    each value and the others polished from `starts` (values, starts, parameters). `others` (points,
    parameters) are further minima from which a profile may be reached.
    """

    best: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    covariance: np.ndarray
    natural: tuple[tuple[bool, bool], ...]
    misfit: Callable[[np.ndarray], np.ndarray]
    held: Callable[[int, np.ndarray, np.ndarray], np.ndarray]
    others: np.ndarray = np.zeros((0, 0))

    @property
    def values(self) -> np.ndarray:
        """The best values."""
        return self.lower + self.best * (self.upper - self.lower)

    @property
    def stderr(self) -> np.ndarray:
        return np.sqrt(np.diag(self.covariance))


def valley(weighed: RankedMinima, covariance: np.ndarray) -> Valley:
    """That of spectra; `covariance` has the problem's nonlinear parameters first."""
    problem, best = _as_in_covariance(weighed), weighed.minima.units[0]
    few = problem._replace(views=tuple(thin(view, SCAN_POINTS) for view in problem.views))
    bounds, count = (problem.box.lower, problem.box.upper), len(best)
    return Valley(
        best,
        *bounds,
        covariance[:count, :count],
        tuple((p.natural_lower, False) for p in problem.parameters),
        lambda units: scanned(few, units, quiet).sum(-1),
        partial(held, solver(problem), bounds),
    )


def _as_in_covariance(weighed: RankedMinima) -> Problem:
    """The problem with each point counting for as much as it does in the covariance."""
    views = zip(weighed.problem.views, weighed.met, strict=True)
    return weighed.problem._replace(views=tuple(_counted(view, met) for view, met in views))


def _counted(view: View, met: SpectrumFit) -> View:
    return view._replace(data=view.data._replace(independent_fraction=np.float64(1 / met.variance)))
