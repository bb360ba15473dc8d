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
from pellicle.fitting.levenberg_marquardt import QuadraticModel, normal_equations
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


class Stepped(NamedTuple):
    """Points (starts, parameters) after the steps, with what a last one predicts there: the deviance, and
    its part that goes with the weights. `promise` is the fall that is still to come, about, `damping` that of
    the next step."""

    units: Any
    deviance: Any
    misfit: Any
    promise: Any
    damping: Any


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


def _quadratic(unit: Any, gradient: Any, hessian: Any) -> QuadraticModel:
    """The Gauss-Newton model around a point of the unit cube."""
    top, ends = jnp.diagonal(hessian), (jnp.zeros_like(unit), jnp.ones_like(unit))
    return QuadraticModel(unit, gradient, hessian, 0 * hessian, top, *ends)


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
def stepped(static: Static, common: Common, rows: BatchData, units: Any, damping: Any) -> Stepped:
    """`EVALUATIONS` bounded Gauss-Newton steps from points `units` (starts, parameters).

    A step that does not lower the misfit is taken back and repeated with more damping.
    """

    def one(row, unit, damping):
        def fn(unit, _):
            return _residual(static, common, row, unit)

        def advance(carry, _):
            state, trial, damping, promise = carry
            cost, gradient, hessian, aux = normal_equations(fn, trial, None)
            cost = jnp.where(jnp.isfinite(cost), cost, jnp.inf)
            accept = cost <= state[3]
            new = trial, gradient, hessian, cost, aux
            state = jax.tree.map(lambda a, b: jnp.where(accept, a, b), new, state)
            damping = jnp.where(accept, damping / 10, jnp.maximum(10 * damping, 1e-3))
            trial, predicted, left = _quadratic(*state[:3]).propose(damping, jnp.array(False))
            return (state, trial, damping, jnp.stack([promise[1], left])), predicted[0]

        size = unit.size
        nothing = unit, 0 * unit, jnp.zeros((size, size)), jnp.inf, (jnp.inf, jnp.inf)
        start = nothing, unit, damping, jnp.full(2, jnp.inf)
        (state, trial, damping, promise), predicted = jax.lax.scan(advance, start, None, EVALUATIONS)
        fall, (before, last) = jnp.maximum(predicted[-1], 0.0), promise
        # Gauss-Newton's promises fall by a constant factor from step to step
        ratio = jnp.where(before > 0, last / before, 0.0)
        deviance, misfit = state[4]
        return Stepped(trial, deviance - fall, misfit - fall, last * jnp.minimum(ratio, 1.0), damping)

    return jax.vmap(one)(rows, units, damping)


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


def in_rows(program: Any, static: Static, common: Common, rows: BatchData, *points: np.ndarray) -> Any:
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
    deviance, misfit = np.full(count, np.inf), np.full(count, np.inf)
    promise, damping = np.full(count, np.inf), np.zeros(count)
    left = np.arange(count)
    for _ in range(rounds):
        if not len(left):
            break
        own = data.of(spectra[left])
        polished = in_rows(stepped, static, common, own, units[left], damping[left])
        units[left], deviance[left], misfit[left] = polished.units, polished.deviance, polished.misfit
        promise[left], damping[left] = polished.promise, polished.damping
        enough = tolerance[left]
        if coarse is not None:
            enough = np.maximum(enough, COARSE * (polished.deviance - coarse[left]))
        left = left[promise[left] > enough]
    return units, deviance, misfit, promise
