"""The inverse rungs: ways to find a scene's free parameters from a spectrum."""

from __future__ import annotations

import importlib
import importlib.util
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.accuracy.simulated_data import Trial, descend, misfit, misfit_and_slope, residual
from pellicle.fitting.minima import LANES, solve
from pellicle.fitting.problem import Form
from pellicle.fitting.progress import quiet
from pellicle.fitting.spectra.search import search

STEPS = 100
"""Most steps of a solver that is not ours."""
CANDIDATES, SURVIVORS = 256, (64, 16, 4)
"""Successive halving: after every few steps of all that are left, so many go on; the last to their end."""


@dataclass(frozen=True)
class Solver:
    """One way to a data set's parameters. `find` gives the best point of the unit cube; `missing` names
    the package that is not installed, None where nothing is missing."""

    name: str
    leaves_out: str
    find: Callable[[Trial], np.ndarray]
    missing: str | None = None


def _best(units: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    return units[np.argsort(np.where(np.isfinite(values), values, np.inf), kind="stable")[:count]]


def _in_lanes(program: Callable[[np.ndarray], Any], starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and misfits of a program that takes one start or `LANES` of them, and no other number."""
    size = 1 if len(starts) == 1 else LANES
    padded = np.concatenate([starts, np.repeat(starts[-1:], -len(starts) % size, axis=0)])
    found = [jax.device_get(program(padded[i : i + size])[:2]) for i in range(0, len(padded), size)]
    units, values = (np.concatenate(column)[: len(starts)] for column in zip(*found, strict=True))
    return units, values


def _from(trial: Trial, starts: np.ndarray) -> np.ndarray:
    polished = solve(trial.problem, starts, lanes=1 if len(starts) == 1 else LANES)
    return _best(polished.units, polished.deviance, 1)[0]


def _start_once(trial: Trial) -> np.ndarray:
    return _from(trial, trial.start[None])


def from_truth(trial: Trial) -> np.ndarray:
    """The minimum in whose valley the truth lies: no solver of a real data set can start there."""
    return _from(trial, trial.truth[None])


def _scan(trial: Trial) -> np.ndarray:
    return search(trial.problem, quiet).units[0]


def _random(trial: Trial, count: int) -> np.ndarray:
    return np.random.default_rng(count).uniform(size=(count, len(trial.start)))


def _multistart(count: int, trial: Trial) -> np.ndarray:
    return _from(trial, _random(trial, count))


def _halving(trial: Trial) -> np.ndarray:
    units = _random(trial, CANDIDATES)
    for count in SURVIVORS:
        units = _best(*_in_lanes(partial(descend, *trial.program), units), count)
    return _from(trial, units)


def _scipy_lbfgsb(trial: Trial) -> np.ndarray:
    from scipy.optimize import minimize

    def both(unit):
        value, slope = jax.device_get(misfit_and_slope(*trial.program, jnp.asarray(unit)))
        return float(value), np.asarray(slope, dtype=float)

    bounds = [(0.0, 1.0)] * len(trial.start)
    return minimize(both, trial.start, jac=True, method="L-BFGS-B", bounds=bounds).x


@partial(jax.jit, static_argnums=0)
def _jaxopt_run(form: Form, arrays: Any, box: Any, unit: Any) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # jaxopt says on import that nobody maintains it
        jaxopt: Any = importlib.import_module("jaxopt")  # optional
    solver = jaxopt.LBFGSB(fun=lambda u: misfit(form, arrays, box, u), maxiter=STEPS, tol=1e-8)
    return solver.run(unit, bounds=(jnp.zeros_like(unit), jnp.ones_like(unit))).params


def _jaxopt_lbfgsb(trial: Trial) -> np.ndarray:
    return np.asarray(_jaxopt_run(*trial.program, jnp.asarray(trial.start)))


@partial(jax.jit, static_argnums=0)
def _optimistix_run(form: Form, arrays: Any, box: Any, unit: Any) -> Any:
    import optimistix as optx

    solver = optx.LevenbergMarquardt(rtol=1e-8, atol=1e-8)
    return optx.least_squares(
        lambda u, _: residual(form, arrays, box, u), solver, unit, max_steps=STEPS, throw=False
    ).value


def _optimistix_lm(trial: Trial) -> np.ndarray:
    return np.asarray(_optimistix_run(*trial.program, jnp.asarray(trial.start)))


def _absent(package: str) -> str | None:
    return None if importlib.util.find_spec(package) else package


SOLVERS = (
    Solver("LM, start once", "the search: one descent from the recipe's start", _start_once),
    Solver("scan + LM", "nothing: what pellicle fit does", _scan),
    Solver("successive halving", "the scan: most of 256 random starts, soon", _halving),
    Solver("multistart, 16", "the scan: 16 random starts", partial(_multistart, 16)),
    Solver("multistart, 64", "the scan: 64 random starts", partial(_multistart, 64)),
    Solver("L-BFGS-B, scipy", "the search, and the residuals' Jacobian", _scipy_lbfgsb, _absent("scipy")),
    Solver("L-BFGS-B, jaxopt", "the search, and the residuals' Jacobian", _jaxopt_lbfgsb, _absent("jaxopt")),
    Solver("LM, Optimistix's own", "the search, and the bounds", _optimistix_lm),
)
"""Every inverse rung there is, in the order of the table."""
