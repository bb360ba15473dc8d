"""State-space smoother of parameters that change in time: values, rates, and their errors from all times.

Each time has a quadratic approximation of its misfit. A parameter that varies slowly is a Wiener process,
integrated once or twice: its smoothed path is a cubic or a quintic spline. Which of them, and how stiff, the
marginal likelihood of the data decides. One that varies freely has a value at each time of its own. What all
times share is solved beside them. Time and memory are proportional to the number of times.

**Source:** Särkkä 2013, Bayesian Filtering and Smoothing, algorithm 4.3 and eq. 12.11 (filter, marginal
likelihood); Bierman 1973, Automatica 9, 503 (smoother by the adjoint); Wahba 1978, J. R. Stat. Soc. B 40, 364
(integrated Wiener processes and splines); de Jong 1991, Ann. Stat. 19, 1073 (parameters beside the states).
"""

from __future__ import annotations

from math import factorial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.scene.free import FREELY, SHARED, SLOWLY

_PRIOR = 1.0
"""Prior standard deviation of a parameter in the unit of its bounds, around their middle."""
_DERIVATIVES = (2, 3)
"""Numbers of states of a slowly varying parameter that are tried: its value, rate, and acceleration."""
_ENOUGH = 2000
"""Times that show the stiffness; of a longer series evenly spaced ones are taken."""
_STIFFNESS = np.arange(-12.0, 15.0, 1.5)
"""Logarithms of the process noise that start the search for the best one, for a range and a duration of 1."""


class Quadratics(NamedTuple):
    """Misfits of all times around points, −2 ln likelihood = c − 2 vᵀu + uᵀΛu for u in the unit cube.

    `vector` v (times, parameters) and `information` Λ (times, parameters, parameters); `pushes` (times,
    parameters, effects) are changes of v by systematic effects that all times have in common.
    """

    vector: np.ndarray
    information: np.ndarray
    pushes: np.ndarray


class Smoothed(NamedTuple):
    """Parameters at all times in the unit cube, and rates of those that vary slowly.

    `mean` and `variance` (times, parameters); `rate` and `rate_variance` (times, parameters), per unit of
    time, NaN for the others; the variances are those of the noise, and `changes` and `rate_changes` (times,
    parameters, effects) those by each effect; `derivatives`: states of each of these, and `stiffness` (slow,)
    the logarithms of their process noise; `deviance`: −2 ln of the marginal likelihood, up to a constant.
    """

    mean: np.ndarray
    variance: np.ndarray
    rate: np.ndarray
    rate_variance: np.ndarray
    changes: np.ndarray
    rate_changes: np.ndarray
    derivatives: int
    stiffness: np.ndarray
    deviance: float = np.nan

    @property
    def systematic(self) -> np.ndarray:
        """Variances (times, parameters) by all effects together."""
        return np.sum(self.changes**2, axis=2)

    @property
    def rate_systematic(self) -> np.ndarray:
        """Variances (times, parameters) of rates by all effects together."""
        return np.sum(self.rate_changes**2, axis=2)


class _Chain(NamedTuple):
    """Transitions between times: matrices and square roots of the noise (times, states, states), and shifts
    (times, states)."""

    transition: Any
    noise: Any
    shift: Any


def smooth(
    time: np.ndarray,
    quadratics: Quadratics,
    kinds: tuple[str, ...],
    breaks: np.ndarray,
    fastest: float,
    like: Smoothed | None = None,
    kinks: np.ndarray | None = None,
) -> Smoothed:
    """Smooth the parameters of a series by all its times.

    **Arguments:** `time` (times,), increasing; `quadratics` of the misfits; one of `VARIES` for each
    parameter; `breaks` (times,), True where the slowly varying parameters start anew; `fastest`, the standard
    deviation of a rate then, in the range of a parameter per median step; `like`, an earlier result whose
    stiffness is kept; `kinks` (times,), variances of a change of the rate in the step before each time, in
    the unit of `fastest`, where that is abrupt.
    """
    shared = np.array([kind == SHARED for kind in kinds])
    own = tuple(kind for kind in kinds if kind != SHARED)
    slow = np.flatnonzero([kind == SLOWLY for kind in own])
    unit = float(np.median(np.diff(time)))
    kinks = np.zeros(len(time)) if kinks is None else kinks
    series = _Times(np.diff(time, prepend=time[0]) / unit, breaks, kinks, quadratics, own, shared, fastest)
    with jax.enable_x64(True):
        if like is None:
            states, best = _best(series)
        else:
            states, best = like.derivatives, like.stiffness
        arrays = series.arrays(states)
        found = _smoothed(series.chain(best, states), *arrays)
        states_mean, spread, answer, certainty, deviance = map(np.asarray, found)
    # where the data have no noise, a variance of zero may round below it
    spread, count = np.maximum(spread, 0.0), len(own)
    means, rates = np.full((2, len(time), len(kinds), answer.shape[1]), np.nan)
    variance, rate_variance = np.full((2, len(time), len(kinds)), np.nan)
    means[:, shared], means[:, ~shared] = answer, states_mean[:, :count]
    variance[:, shared], variance[:, ~shared] = certainty, spread[:, :count]
    at, first = np.flatnonzero(~shared)[slow], count + (states - 1) * np.arange(len(slow))
    rates[:, at], rate_variance[:, at] = states_mean[:, first] / unit, spread[:, first] / unit**2
    of_means, of_rates = (means[..., 0], variance), (rates[..., 0], rate_variance)
    changes = means[..., 1:], rates[..., 1:]
    return Smoothed(*of_means, *of_rates, *changes, states, best, float(deviance))


def _best(series: _Times) -> tuple[int, np.ndarray]:
    """The states and stiffness of the highest marginal likelihood, of some of the times of a long series."""
    some, slow = series.without_effects().thinned(), series.kinds.count(SLOWLY)
    if not slow:
        return _DERIVATIVES[0], np.zeros(0)
    return min((_stiffness(some, states, slow) for states in _DERIVATIVES), key=lambda fit: fit[0])[1:]


def _stiffness(series: _Times, states: int, slow: int) -> tuple[float, int, np.ndarray]:
    """The marginal deviance at its least, the number of states, and the logarithms of the process noise."""
    arrays = series.arrays(states)

    def deviance(noise: np.ndarray) -> float:
        value = float(_deviance(series.chain(noise, states), *arrays))
        return value if np.isfinite(value) else np.inf

    every = _STIFFNESS - (2 * states - 1) * np.log10(np.sum(series.steps))
    start = np.full(slow, every[int(np.argmin([deviance(np.full(slow, value)) for value in every]))])
    simplex = start + np.vstack([np.zeros(slow), 0.7 * np.eye(slow)])
    options = {"initial_simplex": simplex, "xatol": 0.02, "fatol": 0.02, "maxfev": 60 * slow}
    from scipy.optimize import minimize  # slow to import

    best = minimize(deviance, start, method="Nelder-Mead", options=options).x
    best = np.clip(best, every[0] - 4, every[-1] + 4)
    return deviance(best), states, best


class _Times(NamedTuple):
    """A series: `steps` before each time in units of the median one, breaks, kinks, misfits, how the
    parameters that are not `shared` vary, and the prior of rates."""

    steps: np.ndarray
    breaks: np.ndarray
    kinks: np.ndarray
    quadratics: Quadratics
    kinds: tuple[str, ...]
    shared: np.ndarray
    fastest: float

    def without_effects(self) -> _Times:
        """The series without pushes."""
        return self._replace(quadratics=self.quadratics._replace(pushes=self.quadratics.pushes[..., :0]))

    def thinned(self) -> _Times:
        """A series of at most `_ENOUGH` times."""
        first = np.arange(0, len(self.steps), -(-len(self.steps) // _ENOUGH))
        steps = np.diff(np.cumsum(self.steps)[first], prepend=0.0)
        breaks, kinks = np.logical_or.reduceat(self.breaks, first), np.add.reduceat(self.kinks, first)
        quadratics = Quadratics(*(x[first] for x in self.quadratics))
        return self._replace(steps=steps, breaks=breaks, kinks=kinks, quadratics=quadratics)

    def arrays(self, states: int) -> tuple[Any, ...]:
        """The misfits as functions of the states at given shared parameters: v, −Λ of both, and pushes
        (times, states, 1 + shared + effects), Λ (times, states, states), and the sums of those of the shared
        parameters (shared, 1 + shared + effects)."""
        own, shared, (vector, information, pushes) = ~self.shared, self.shared, self.quadratics
        count, size = int(own.sum()), int(own.sum()) + (states - 1) * self.kinds.count(SLOWLY)
        beside = np.concatenate([vector[:, :, None], -information[:, :, shared], pushes], axis=2)
        columns = np.zeros((len(vector), size, beside.shape[2]))
        columns[:, :count] = beside[:, own]
        square = np.zeros((len(vector), size, size))
        square[:, :count, :count] = information[:, own][:, :, own]
        rest = -beside[:, shared].sum(axis=0)
        # the prior of the shared parameters
        rest[:, 0] -= 0.5 / _PRIOR**2
        rest[:, 1 : 1 + len(rest)] += np.eye(len(rest)) / _PRIOR**2
        return jnp.asarray(columns), jnp.asarray(square), jnp.asarray(rest)

    def chain(self, noise: np.ndarray, states: int) -> _Chain:
        """Transitions to each time from the one before; the first, and those after breaks, from the prior."""
        steps, count = self.steps, len(self.kinds)
        begins = np.arange(len(steps)) == 0
        size = count + (states - 1) * self.kinds.count(SLOWLY)
        transition, root = np.zeros((2, len(steps), size, size))
        shift, slow = np.zeros((len(steps), size)), 0
        for i, kind in enumerate(self.kinds):
            anew = np.ones(len(steps), bool) if kind == FREELY else begins | self.breaks
            if kind == SLOWLY:
                at = [i, *range(count + slow * (states - 1), count + (slow + 1) * (states - 1))]
                move, spread = _wiener(steps, states, 10.0 ** noise[slow])
                bent = np.flatnonzero(self.kinks)
                spread[bent, :2] = 0.0
                spread[bent, :2, :2] = (
                    _wiener(steps[bent], 2, 1.0)[1] * np.sqrt(self.kinks[bent] / steps[bent])[:, None, None]
                )
                move[anew], spread[anew] = 0.0, self.fastest * np.eye(states)
                transition[np.ix_(range(len(steps)), at, at)] = move
                root[np.ix_(range(len(steps)), at, at)] = spread
                slow += 1
            transition[anew, i], shift[anew, i], root[anew, i, i] = 0.0, 0.5, _PRIOR
        return _Chain(*map(jnp.asarray, (transition, root, shift)))


def _wiener(steps: np.ndarray, states: int, power: float) -> tuple[np.ndarray, np.ndarray]:
    """Transitions and square roots of covariances (times, states, states) of a Wiener process integrated
    states − 1 times."""
    order = np.arange(states)
    further = order[None, :] - order[:, None]
    factorials = np.array([factorial(max(i, 0)) for i in range(states)], float)
    move = np.where(further >= 0, steps[:, None, None] ** np.maximum(further, 0), 0.0)
    move = move / factorials[np.maximum(further, 0)]
    degree = 2 * states - 1 - order[None, :] - order[:, None]
    left = factorials[states - 1 - order]
    unit = np.linalg.cholesky(1.0 / (degree * left[None, :] * left[:, None]))  # of a step of 1
    return move, np.sqrt(power) * steps[:, None, None] ** (states - 0.5 - order[:, None]) * unit


def _forward(chain: _Chain, vectors: Any, information: Any) -> Any:
    """Means and square roots of the covariances of the filter, those predicted, and the marginal misfit.

    Means have a column for each shared parameter and effect, what it adds, and the misfit is a quadratic form
    of these.
    Square roots S of covariances P = S Sᵀ stay positive where P itself, whose variances span twenty decades,
    would lose its sign.
    """

    def step(carry, now):
        mean, root = carry
        transition, noise, shift, vector, information = now
        predicted = (transition @ mean).at[:, 0].add(shift)
        # the triangular square root of the sum of squares
        before = jnp.linalg.qr(jnp.concatenate([transition @ root, noise], axis=1).T, mode="r").T
        # (P⁻¹ + Λ)⁻¹ = S (1 + SᵀΛS)⁻¹ Sᵀ
        factor = jnp.linalg.cholesky(jnp.eye(len(mean)) + before.T @ information @ before)
        after = jax.scipy.linalg.solve_triangular(factor, before.T, lower=True).T
        residual = vector - information @ predicted
        short = after.T @ residual
        logarithm = 2 * jnp.sum(jnp.log(jnp.diagonal(factor)))
        cross = vector.T @ predicted
        misfit = predicted.T @ information @ predicted - cross - cross.T - short.T @ short
        new = predicted + after @ short, after
        return new, (*new, predicted, misfit, logarithm)

    _, states, columns = vectors.shape
    start = jnp.zeros((states, columns)), jnp.zeros((states, states))
    return jax.lax.scan(step, start, (*chain, vectors, information))[1]


def _shared(misfit: Any, rest: Any) -> tuple[Any, Any, Any]:
    """Best shared parameters and their changes by the effects (shared, 1 + effects), a square root of their
    covariance, and the marginal deviance there."""
    count, form = len(rest), jnp.sum(misfit, axis=0)
    if not count:
        return jnp.zeros((0, len(form))), jnp.zeros((0, 0)), form[0, 0]
    rows = form[1 : 1 + count] + rest
    factor = jnp.linalg.cholesky(rows[:, 1 : 1 + count])
    inverse = jax.scipy.linalg.solve_triangular(factor, jnp.eye(count), lower=True)
    short = inverse @ jnp.concatenate([rows[:, :1], rows[:, 1 + count :]], axis=1)
    log_determinant = 2 * jnp.sum(jnp.log(jnp.diagonal(factor)))
    return -inverse.T @ short, inverse.T, form[0, 0] - short[:, 0] @ short[:, 0] + log_determinant


@jax.jit
def _deviance(chain: _Chain, vectors: Any, information: Any, rest: Any) -> Any:
    """−2 ln of the marginal likelihood of all times, up to a constant."""
    *_, misfit, logarithm = _forward(chain, vectors, information)
    return _shared(misfit, rest)[2] + jnp.sum(logarithm)


@jax.jit
def _smoothed(chain: _Chain, vectors: Any, information: Any, rest: Any) -> tuple[Any, ...]:
    """Means (times, states, 1 + effects), with changes by the effects, and variances (times, states) of all
    times by all times, by the adjoint of the filter, which inverts no covariance; the same of the shared
    parameters (shared, 1 + effects) and (shared,); the marginal deviance."""
    mean, root, predicted, misfit, logarithm = _forward(chain, vectors, information)
    answer, spread, deviance = _shared(misfit, rest)
    count, effects = len(rest), vectors.shape[2] - 1 - len(rest)
    each = jnp.eye(1 + effects)
    weights = jnp.concatenate([each[:1], answer, each[1:]])

    def step(carry, now):
        pull, weight = carry
        mean, root, transition, predicted, vector, information = now
        covariance, unit = root @ root.T, jnp.eye(len(mean))
        every = mean - covariance @ pull
        left = unit - root.T @ weight @ root
        of_shared = every[:, 1 : 1 + count] @ spread
        variance = jnp.sum((root @ left) * root, axis=1) + jnp.sum(of_shared**2, axis=1)
        kept = unit - covariance @ information
        residual = vector - information @ predicted
        pull = kept.T @ pull - (residual - information @ (covariance @ residual))
        weight = kept.T @ weight @ kept + information @ kept
        weight = transition.T @ (0.5 * (weight + weight.T)) @ transition
        return (transition.T @ pull, weight), (every @ weights, variance)

    _, states, columns = vectors.shape
    nothing = jnp.zeros((states, columns)), jnp.zeros((states, states))
    every = mean, root, chain.transition, predicted, vectors, information
    _, (means, variances) = jax.lax.scan(step, nothing, every, reverse=True)
    return means, variances, answer, jnp.sum(spread**2, axis=1), deviance + jnp.sum(logarithm)
