"""Accuracy against time for a film: methods of simulation, solvers, and methods of computing intervals."""

import importlib
import importlib.util
import math
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from pellicle.accuracy.case import case, check_tolerance
from pellicle.accuracy.film_methods import compare_methods
from pellicle.accuracy.registry import (
    Comparison,
    Cost,
    DataSet,
    Method,
    data_sets,
    deviance,
    deviance_and_slope,
    deviances,
    measure_on_data,
    residual,
)
from pellicle.fitting.conclusion import neighbourhood
from pellicle.fitting.film.search import search
from pellicle.fitting.minima import solve
from pellicle.fitting.problem import Form
from pellicle.fitting.profile_likelihood import interval
from pellicle.fitting.progress import Progress, quiet
from pellicle.fitting.reweighting import RankedMinima, linearised, rank
from pellicle.fitting.status import RIVAL
from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves
from pellicle.simulation.spectra import default_wavelengths

NOMINAL = 0.95
_WIDE = 1.959964
"""Half width of the central 95 % of a normal distribution, in standard deviations."""

Interval = tuple[np.ndarray, np.ndarray]
"""Lower and upper ends for each parameter, in the unit cube of the bounds."""


def _covariance(fit: RankedMinima) -> Interval:
    problem, best = fit.problem, fit.minima.units[0]
    _, errors = linearised(fit)
    sd = errors.stderr[: len(best)] / (problem.box.upper - problem.box.lower)
    return best - _WIDE * sd, best + _WIDE * sd


def _profile(fit: RankedMinima) -> Interval:
    box = fit.problem.box
    count = len(fit.problem.parameters)
    _, errors = linearised(fit)
    around = neighbourhood(fit, errors.covariance, np.zeros((0, count)))
    ends = np.array([interval(around, i) for i in range(count)])
    lower, upper = (ends.T - box.lower) / (box.upper - box.lower)
    return lower, upper


INTERVAL_METHODS = (
    Method("covariance", "curvature, bounds, other minima", _covariance),
    Method("profile", "other minima", _profile),
)
"""Methods of computing intervals without samples, in the order of their cost."""


def compare_intervals(
    data: Sequence[DataSet],
    progress: Progress,
    methods: Sequence[Method] = INTERVAL_METHODS,
    time_limit: float = math.inf,
) -> Comparison:
    """Compute intervals for every data set by every method; see `measure_on_data`."""

    def prepare(one: DataSet) -> tuple[RankedMinima, Callable[[Interval], tuple[np.ndarray, np.ndarray]]]:
        def score(ends: Interval) -> tuple[np.ndarray, np.ndarray]:
            """Masks of the true values that the intervals contain, and their widths."""
            lower, upper = ends
            inside = (lower <= one.truth) & (one.truth <= upper)
            return inside, np.minimum(upper, 1.0) - np.maximum(lower, 0.0)

        return rank(one.problem, search(one.problem, quiet)).counted, score

    def summary(scores: list[tuple[np.ndarray, np.ndarray]]) -> tuple[float, dict[str, Any]]:
        inside, widths = (np.concatenate(x) for x in zip(*scores, strict=True))
        coverage, doubt = float(np.mean(inside)), math.sqrt(NOMINAL * (1 - NOMINAL) / len(inside))
        details = {"coverage": coverage, "doubt": doubt, "width": float(np.median(widths))}
        return abs(coverage - NOMINAL), details

    comparison = Comparison("interval", requested=len(data))
    return measure_on_data(comparison, methods, data, prepare, summary, progress, time_limit)


STEPS = 100
"""Most steps of a solver of another package."""
CANDIDATES, SURVIVORS = 256, (64, 16, 4)
"""Successive halving: random starts, and how many of them continue after every few steps, the last ones to
convergence."""
FEW_STEPS = 4


def _best(units: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    return units[np.argsort(np.where(np.isfinite(values), values, np.inf), kind="stable")[:count]]


def _from(data: DataSet, starts: np.ndarray) -> np.ndarray:
    polished = solve(data.problem, starts)
    return _best(polished.units, polished.deviance, 1)[0]


def from_truth(data: DataSet) -> np.ndarray:
    """The local minimum reached from the true values, where no solver of real data can start."""
    return _from(data, data.truth[None])


def _random(data: DataSet, count: int) -> np.ndarray:
    return np.random.default_rng(count).uniform(size=(count, len(data.start)))


def _multistart(count: int, data: DataSet) -> np.ndarray:
    return _from(data, _random(data, count))


def _halving(data: DataSet) -> np.ndarray:
    units = _random(data, CANDIDATES)
    for count in SURVIVORS:
        after = solve(data.problem, units, steps=FEW_STEPS)
        units = _best(after.units, after.deviance, count)
    return _from(data, units)


def _scipy_lbfgsb(data: DataSet) -> np.ndarray:
    from scipy.optimize import minimize

    def both(unit):
        value, slope = jax.device_get(deviance_and_slope(*data.program, jnp.asarray(unit)))
        return float(value), np.asarray(slope, dtype=float)

    bounds = [(0.0, 1.0)] * len(data.start)
    return minimize(both, data.start, jac=True, method="L-BFGS-B", bounds=bounds).x


@partial(jax.jit, static_argnums=0)
def _jaxopt_run(form: Form, arrays: Any, box: Any, unit: Any) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # on import jaxopt warns that it is unmaintained
        jaxopt: Any = importlib.import_module("jaxopt")  # optional
    solver = jaxopt.LBFGSB(fun=lambda u: deviance(form, arrays, box, u), maxiter=STEPS, tol=1e-8)
    return solver.run(unit, bounds=(jnp.zeros_like(unit), jnp.ones_like(unit))).params


@partial(jax.jit, static_argnums=0)
def _optimistix_run(form: Form, arrays: Any, box: Any, unit: Any) -> Any:
    import optimistix as optx

    solver = optx.LevenbergMarquardt(rtol=1e-8, atol=1e-8)
    return optx.least_squares(
        lambda u, _: residual(form, arrays, box, u), solver, unit, max_steps=STEPS, throw=False
    ).value


def _from_start(run: Callable[..., Any], data: DataSet) -> np.ndarray:
    return np.asarray(run(*data.program, jnp.asarray(data.start)))


SOLVERS = (
    Method(
        "LM, start once",
        "the search: one descent from the recipe's start",
        lambda data: _from(data, data.start[None]),
    ),
    Method("scan + LM", "nothing: the search of `pl.fit`", lambda data: search(data.problem, quiet).units[0]),
    Method("successive halving", "the scan: most of 256 random starts, soon", _halving),
    Method("multistart, 16", "the scan: 16 random starts", partial(_multistart, 16)),
    Method("multistart, 64", "the scan: 64 random starts", partial(_multistart, 64)),
    Method("L-BFGS-B, scipy", "the search, and the residuals' Jacobian", _scipy_lbfgsb),
    Method(
        "L-BFGS-B, jaxopt",
        "the search, and the residuals' Jacobian",
        partial(_from_start, _jaxopt_run),
        missing=None if importlib.util.find_spec("jaxopt") else "jaxopt",
    ),
    Method("LM, Optimistix's own", "the search, and the bounds", partial(_from_start, _optimistix_run)),
)
"""Every solver, in the order of the table."""


def _deviance(data: DataSet, unit: np.ndarray) -> float:
    value = float(deviances(*data.program, unit[None])[0])
    return value if np.isfinite(value) else np.inf


def compare_solvers(
    data: Sequence[DataSet],
    noise: float,
    progress: Progress,
    solvers: Sequence[Method] = SOLVERS,
    *,
    time_limit: float = np.inf,
) -> Comparison:
    """Fit every data set with every solver in turn; see `measure_on_data`."""

    def prepare(one: DataSet) -> tuple[DataSet, Callable[[np.ndarray], tuple[float, bool]]]:
        least = _deviance(one, from_truth(one))

        def score(unit: np.ndarray) -> tuple[float, bool]:
            """The largest error of any parameter, and whether the solver missed the minimum."""
            inside = np.clip(np.nan_to_num(unit, nan=0.5), 0.0, 1.0)
            return float(np.max(np.abs(inside - one.truth))), bool(_deviance(one, inside) > least + RIVAL)

        return one, score

    def summary(scores: list[tuple[float, bool]]) -> tuple[float, dict[str, Any]]:
        errors, failures = zip(*scores, strict=True)
        return float(np.mean(errors)), {"median_error": float(np.median(errors)), "failures": sum(failures)}

    comparison = Comparison("inverse", noise=noise, requested=len(data))
    return measure_on_data(comparison, solvers, data, prepare, summary, progress, time_limit)


TOLERANCE, TOLERANCE_IN_DEGREES = 1e-3, 0.1
"""Default tolerance: a fraction, or degrees on the sphere of N, C, S."""


def cost(
    scene: Scene,
    wavelength: ArrayLike | None = None,
    *,
    reference: str = "float64",
    tolerance: float | None = None,
    noise: float | None = None,
    datasets: int = 20,
    time_limit: float = 120.0,
    interval_methods: Sequence[Method] = INTERVAL_METHODS,
    progress: Progress = quiet,
) -> Cost:
    """Measure every method of computing the signal of a scene at `wavelength` (nm), and of fitting it.

    By default the wavelengths are those of the scene's light, or as in `pellicle.simulate`. `reference` is
    "float64" or "mpmath". `tolerance` is in the unit of the signal: a fraction, or degrees on the sphere of
    N, C and S; its default is the `noise`, or else 0.001 (0.1 degrees). `datasets` spectra are simulated with
    that noise, or else noise equal to the tolerance, and fitted by every solver. `time_limit` (s) ends these
    fits, and then their intervals, after as many data sets as it allows.

    **Raises:** UsageError for a tolerance that is not above zero, for a reference that cannot compute the
    scene, and for a scene whose signal is 0 everywhere.
    """
    if wavelength is None:
        wavelength = scene.light.wavelength
    nm = default_wavelengths(scene) if wavelength is None else np.asarray(wavelength, dtype=float)
    default = TOLERANCE_IN_DEGREES if scene.light.kind.degrees else TOLERANCE
    tolerance = (default if noise is None else noise) if tolerance is None else tolerance
    check_tolerance(tolerance)
    with jax.enable_x64(True):
        one = case(scene, nm, tolerance)
        methods = compare_methods(one, reference, progress)
        if methods.interrupted:
            return Cost(methods, no_solvers="interrupted before")
        if datasets == 0:
            return Cost(methods, no_solvers="no data sets were requested")
        if not free_leaves(scene):
            return Cost(methods, no_solvers="nothing is free to fit")
        noise = tolerance if noise is None else noise
        with_instrument = eqx.tree_at(lambda s: s.instrument, one.scene, scene.instrument)
        data = data_sets(one, with_instrument, noise, datasets)
        solvers = compare_solvers(data, noise, progress, time_limit=time_limit)
        if solvers.interrupted:
            return Cost(methods, solvers)
        return Cost(methods, solvers, compare_intervals(data, progress, interval_methods, time_limit))
