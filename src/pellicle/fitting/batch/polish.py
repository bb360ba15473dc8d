"""Gauss-Newton steps of many spectra side by side, with the exact model of their scene."""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.fitting.batch.data import BatchData
from pellicle.fitting.coordinates import Box, Coordinates
from pellicle.fitting.film import nuisance
from pellicle.fitting.film.nuisance import Data
from pellicle.fitting.film.view import SpectrumForm
from pellicle.fitting.levenberg_marquardt import (
    Bounds,
    QuadraticModel,
    State,
    advance,
    begin,
    normal_equations,
)
from pellicle.optics.hoisting import compute_once
from pellicle.programs.cache import in_chunks, kept
from pellicle.scene.film import Scene
from pellicle.scene.free import insert

ROWS, FEW = 256, 4
"""Starts, or spectra, of one call: all calls share a program. The second is for single spectra."""
EVALUATIONS = 2
"""Evaluations of one call: for most starts of a scan, two bring the solver so near that the next, which is
done in any case for the model and its slopes, ends it."""
COARSE = 1e-3
"""Fall of the deviance that may be left in a rival, as a share of its distance to the best."""

Static = tuple[SpectrumForm, Coordinates, int]
"""The static part of a program, and the most rows of one call."""


class Common(NamedTuple):
    """Arrays that all spectra share: the scene, data whose values are not used, and the box."""

    scene: Scene
    data: Data
    box: Box


class Explained(NamedTuple):
    """Deviances of points (spectra, points)."""

    deviance: Any


class Curved(NamedTuple):
    """Misfits around points: slope and Gauss-Newton curvature of half the deviance in the unit cube, arrays
    (spectra, parameters) and (spectra, parameters, parameters)."""

    gradient: Any
    hessian: Any


class Best(NamedTuple):
    """The best minimum of each spectrum after one more step, as in `Stepped`; the model (spectra, points)
    there and its slopes by the parameters in their own units."""

    units: Any
    deviance: Any
    misfit: Any
    promise: Any
    model: Any
    gain: Any
    offset: Any
    signal: Any
    slope: Any


def _of(common: Common, row: BatchData) -> Data:
    own = common.data._replace(values=row.values, weight=row.weight, level=row.level)
    return own._replace(frame=row.frame)


def _residual(static: Static, common: Common, row: BatchData, unit: Any) -> tuple[Any, Any]:
    """Weighted residuals at a point of the unit cube; deviance and misfit."""
    form, coordinates, _ = static
    data = _of(common, row)
    values = coordinates.values(common.box, unit)
    explained = form.explain((common.scene, data), list(values))
    prior = common.box.prior_rows(values)
    misfit = jnp.sum(explained.residual[: data.values.size] ** 2)
    return (explained.residual, prior), (explained.deviance + jnp.sum(prior**2), misfit)


def _ends(units: Any) -> Bounds:
    """Bounds of points of the unit cube."""
    return 0 * units, 0 * units + 1


def _quadratic(unit: Any, gradient: Any, hessian: Any) -> QuadraticModel:
    """The Gauss-Newton model around a point of the unit cube."""
    return QuadraticModel(unit, gradient, hessian, 0 * hessian, jnp.diagonal(hessian), *_ends(unit))


@kept
def explained(static: Static, common: Common, rows: BatchData, units: Any) -> Explained:
    """Deviance of points `units` (spectra, points, parameters)."""

    def one(row, unit):
        return _residual(static, common, row, unit)[1][0]

    return Explained(jax.vmap(jax.vmap(one, (None, 0)))(rows, units))


@kept
def curved(static: Static, common: Common, rows: BatchData, units: Any) -> Curved:
    """Slope and curvature of the misfits at points `units` (spectra, parameters)."""

    def one(row, unit):
        _, gradient, hessian, _ = normal_equations(
            lambda unit, _: _residual(static, common, row, unit), unit, None
        )
        return Curved(gradient, hessian)

    return jax.vmap(one)(rows, units)


@partial(kept, calls="many")
def stepped(static: Static, common: Common, rows: BatchData, state: State, secant: Any) -> State:
    """The solver after `EVALUATIONS` more steps of each start, which correct Gauss-Newton's matrix where
    `secant` (starts,).

    The auxiliary output is the point itself, with its deviance and misfit before it: `_begun`. The promise
    returned is that of the step after the next.
    """

    def one(row, state, secant):
        def fn(unit, _):
            residuals, sums = _residual(static, common, row, unit)
            return residuals, jnp.concatenate([jnp.stack(sums), unit])

        def step(state, _):
            unit = state.aux[2:]
            evaluated = normal_equations(fn, state.y_eval, None)
            return advance(evaluated, unit, _ends(unit), state, secant)[1], state.promise

        state, promises = jax.lax.scan(step, state, None, EVALUATIONS)
        # promises fall by about a constant factor from step to step
        ratio = jnp.where(promises[-1] > 0, state.promise / promises[-1], 0.0)
        return state._replace(promise=state.promise * jnp.minimum(ratio, 1.0))

    return jax.vmap(one)(rows, state, secant)


@partial(kept, calls="many")
def at_best(static: Static, common: Common, rows: BatchData, units: Any) -> Best:
    """One step of spectra from points `units` (spectra, parameters) next to their minima, and the model
    there.

    The step is so small that the curves are those of the points before it.
    """
    form, coordinates, _ = static

    def one(row, unit):
        data = _of(common, row)

        def fn(unit):
            values = coordinates.values(common.box, unit)
            signal = compute_once(form.simulate(insert(common.scene, list(values)), data))
            nuisances = nuisance.solve(signal, data, common.scene.instrument)
            prior = common.box.prior_rows(values)
            return (signal, nuisances.residual, prior), (nuisances, prior)

        (signal, *residuals), push, (nuisances, prior) = jax.linearize(fn, unit, has_aux=True)
        signal, residuals, push, nuisances = jax.lax.optimization_barrier(
            (signal, residuals, push, nuisances)
        )
        slope, *steep = jax.vmap(push)(jnp.eye(unit.size))
        residual, steep = jnp.concatenate(residuals), jnp.concatenate(steep, axis=1)
        model = _quadratic(unit, steep @ residual, steep @ steep.T)
        moved, (fall, _), promise = model.propose(jnp.zeros(()), jnp.array(False))
        fall = jnp.maximum(fall, 0.0)
        misfit = jnp.sum(nuisances.residual[: data.values.size] ** 2) - fall
        span = common.box.upper - common.box.lower
        deviance = nuisances.deviance + jnp.sum(prior**2) - fall
        curves = nuisances.model, nuisances.gain, nuisances.offset
        return Best(moved, deviance, misfit, promise, *curves, signal, slope.T / span)

    return jax.vmap(one)(rows, units)


def in_rows(program: Any, static: Static, common: Common, rows: BatchData, *points: Any) -> Any:
    """Outputs of a `program` of starts, at most as many at a time as `static` says; `rows` are the data of
    each."""
    return in_chunks(lambda own: program(static, common, *own), (rows, *points), static[-1])


def settle(
    static: Static,
    common: Common,
    data: BatchData,
    spectra: np.ndarray,
    units: np.ndarray,
    *,
    rounds: int,
    tolerance: np.ndarray,
    coarse: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Local minima below starts (starts, parameters) of `spectra` (starts,): points, deviance, misfit, and
    the fall of the deviance that is still to come, about.

    **Arguments:** `rounds` of `EVALUATIONS` at most; `tolerance` (starts,) of the deviance. With `coarse`
    (starts,) a start also ends where the fall to come is less than `COARSE` of its distance to that deviance.
    """
    units, count = np.array(units), len(units)
    deviance, misfit, promise = (np.full(count, np.inf) for _ in range(3))
    left, state = np.arange(count), _begun(units)
    for _ in range(rounds):
        if not len(left):
            break
        secant = np.full(len(left), coarse is None)
        state = in_rows(stepped, static, common, data.of(spectra[left]), state, secant)
        fall = np.maximum(np.where(state.corrected, *state.predicted.T[::-1]), 0.0)
        enough = tolerance[left]
        if coarse is not None:
            enough = np.maximum(enough, COARSE * (state.aux[:, 0] - fall - coarse[left]))
        on = state.promise > enough
        # a step of one that has not settled may lead anywhere
        units[left] = np.where(on[:, None], state.aux[:, 2:], state.y_eval)
        deviance[left], misfit[left] = state.aux.T[:2] - np.where(on, 0.0, fall)
        promise[left] = state.promise
        left, state = left[on], State(*(x[on] for x in state))
    return units, deviance, misfit, promise


def _begun(units: np.ndarray) -> State:
    """The solver before it has evaluated points (starts, parameters)."""
    return begin(units, _ends(units), np.concatenate([np.full((len(units), 2), np.inf), units], axis=1))
