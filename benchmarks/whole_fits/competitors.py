"""The other programs: least squares of SciPy and lmfit from several starts, and differential evolution."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import lmfit
import numpy as np
from scipy.optimize import differential_evolution, least_squares

from whole_fits.problem import Problem

Array = np.ndarray


class Competitor(NamedTuple):
    """A program; `find(problem, effort, seed)` returns its answer in the unit cube.

    `efforts` are numbers of starts, or of the population for each parameter, as `unit` says.
    """

    name: str
    unit: str
    efforts: tuple[int, ...]
    find: Callable[[Problem, int, int], Array]


def polished(problem: Problem, start: Array) -> Array:
    """Minimum that SciPy's least squares reaches from a start, with a Jacobian by differences."""
    return least_squares(lambda u: problem.residuals(u[None])[0], start, bounds=(0.0, 1.0)).x


def _scipy(problem: Problem, effort: int, seed: int) -> Array:
    return _best(problem, [polished(problem, start) for start in problem.starts(effort)])


def _random_starts(problem: Problem, effort: int, seed: int) -> Array:
    starts = np.random.default_rng(seed).uniform(size=(effort, len(problem.lower)))
    return _best(problem, [polished(problem, start) for start in starts])


def _lmfit(problem: Problem, effort: int, seed: int) -> Array:
    names = [f"x{i}" for i in range(len(problem.lower))]  # lmfit wants identifiers

    def residual(parameters: lmfit.Parameters) -> Array:
        return problem.residuals(np.array([[parameters[name].value for name in names]]))[0]

    found = []
    for start in problem.starts(effort):
        parameters = lmfit.Parameters()
        inside = np.clip(start, 1e-3, 1 - 1e-3)  # at a bound lmfit's parameter has no slope
        for name, value in zip(names, inside, strict=True):
            parameters.add(name, value=value, min=0.0, max=1.0)
        answer = lmfit.minimize(residual, parameters, method="leastsq")
        found.append(np.array([answer.params[name].value for name in names]))
    return _best(problem, found)


def _differential_evolution(problem: Problem, effort: int, seed: int) -> Array:
    def chi2(units: Array) -> Array:  # (parameters, candidates), or one candidate in the polish
        return problem.chi2(units.T) if units.ndim > 1 else problem.chi2(units[None])[0]

    return differential_evolution(
        chi2,
        [(0.0, 1.0)] * len(problem.lower),
        popsize=effort,
        rng=seed,
        vectorized=True,
        updating="deferred",
        polish=True,
    ).x


def _best(problem: Problem, found: list[Array]) -> Array:
    return found[int(np.argmin(problem.chi2(np.array(found))))]


SCANNED = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
COMPETITORS = (
    Competitor("SciPy, scan", "of a scan", SCANNED, _scipy),
    Competitor("lmfit, scan", "of a scan", SCANNED, _lmfit),
    Competitor("SciPy, 16 minima", "of a scan", (16,), _scipy),  # for the rivals that pl.fit lists
    Competitor("SciPy, random", "random", (8, 16, 32, 64), _random_starts),
    Competitor("SciPy, evolution", "a parameter", (5, 10, 15, 30, 60), _differential_evolution),
)
