"""Many least-squares problems of one kind, solved side by side in lanes that are refilled from a queue.

A vmapped solver runs until its slowest lane has settled; in searches with false minima half of that work and
more is spent on lanes that have ended. Here a lane that has ended takes the next start in the same compiled
loop. Until that loop is compiled, the same steps are made by NumPy, around a program of the residuals alone.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.fitting.levenberg_marquardt import Evaluated, State, advance, begin, ended, normal_equations

_LEAST, _SETTLING = 4, 0.1
"""Evaluations before a lane is given up, and the share of the promise before to which that of a step falls in
the neighbourhood of a minimum: on a plateau it is small, too, but does not fall."""


class Solutions(NamedTuple):
    """Minima below the starts, in their order: points, their cost ‖r‖², the auxiliary output of the function
    there, whether the solver settled, and evaluations."""

    y: Any
    cost: Any
    aux: Any
    converged: Any
    steps: Any


def least_squares(
    fn: Callable[[Any, Any], tuple[Any, Any]], starts: Any, args: Any, count: Any, **options: Any
) -> Solutions:
    """Minimise ‖fn(y, args)[0]‖², where `fn` returns residuals and an auxiliary output: see `minimise`."""
    shapes: Any = jax.eval_shape(lambda: fn(starts[0], jax.tree.map(lambda leaf: leaf[0], args)))
    return minimise(partial(normal_equations, fn), starts, args, count, shapes[1], **options)


def minimise(
    equations: Callable[[Any, Any], Evaluated],
    starts: Any,
    args: Any,
    count: Any,
    aux: Any,
    *,
    lanes: int,
    steps: Any = 100,
    rtol: Any = 1e-8,
    atol: Any = 0.0,
    coarse: Any = 0.0,
) -> Solutions:
    """Minimise a sum of squares for y in the unit box from each of the first `count` starts.

    `equations(y, args)` returns it with its normal equations and an auxiliary output like `aux`, as
    `normal_equations` does. `starts` (starts, parameters) and the leaves of `args` (starts, ...) have a row
    for each start. A lane ends where it has settled by `rtol` and `atol`, after `steps` evaluations, or where
    an undamped step promises less than the share `coarse` of its distance to the best cost of all: it cannot
    become the best.
    """
    size, bounds = len(starts), (jnp.zeros_like(starts[0]), jnp.ones_like(starts[0]))

    def begun(y):
        return begin(y, bounds, jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), aux))

    def advanced(y, state, which):
        own = jax.tree.map(lambda leaf: leaf[jnp.minimum(which, size - 1)], args)
        y, state = advance(equations(state.y_eval, own), y, bounds, state)
        found = ended(y, state, rtol, atol)
        return y, state, found.ended, ~(found.diverged | found.lost)

    def proceed(carry):
        y, state, which, used, following, results = carry
        before = state.promise
        y, state, done, success = jax.vmap(advanced)(y, state, which)
        active, used = which < count, used + 1
        best = jnp.minimum(jnp.min(results.cost), jnp.min(jnp.where(active, state.cost, jnp.inf)))
        hopeless = _hopeless(state, before, used, best, coarse)
        over = active & (done | hopeless | (used >= steps))
        at = jnp.where(over, which, size)  # out of range: dropped
        new = Solutions(y, state.cost, state.aux, hopeless | (done & success), used)
        results = jax.tree.map(lambda old, row: old.at[at].set(row, mode="drop"), results, new)
        # lanes that have ended take the next starts of the queue
        which = jnp.where(over, following + jnp.cumsum(over) - 1, which)
        start = starts[jnp.minimum(which, size - 1)]
        y, state = jax.tree.map(
            lambda new, old: jnp.where(over.reshape(-1, *[1] * (old.ndim - 1)), new, old),
            (start, jax.vmap(begun)(start)),
            (y, state),
        )
        return y, state, which, jnp.where(over, 0, used), following + jnp.sum(over), results

    first = jnp.arange(lanes)
    start = starts[jnp.minimum(first, size - 1)]
    state = jax.vmap(begun)(start)
    empty = Solutions(
        jnp.array(starts),
        jnp.full(size, jnp.inf, starts.dtype),
        jax.tree.map(lambda leaf: jnp.zeros((size, *leaf.shape), leaf.dtype), aux),
        jnp.zeros(size, bool),
        jnp.zeros(size, int),
    )
    carry = start, state, first, jnp.zeros(lanes, int), jnp.asarray(lanes), empty
    return jax.lax.while_loop(lambda carry: jnp.any(carry[2] < count), proceed, carry)[-1]


def minimise_by_numpy(
    equations: Callable[[np.ndarray, np.ndarray], Evaluated],
    starts: np.ndarray,
    *,
    steps: int = 100,
    rtol: float = 1e-8,
    atol: float = 0.0,
    coarse: float = 0.0,
) -> Solutions:
    """`minimise` with steps of NumPy: `equations(y, which)` evaluates points y (some, parameters) of the
    starts `which` (some,), with one auxiliary number of each."""
    count, bounds, used = len(starts), (0.0, 1.0), 0
    results = Solutions(
        np.array(starts),
        np.full(count, np.inf),
        np.full(count, np.nan),
        np.zeros(count, bool),
        np.zeros(count, int),
    )
    y, which = np.array(starts), np.arange(count)
    with np.errstate(all="ignore"):  # of points without a number
        state = begin(y, bounds, np.zeros(count))
        while len(which):
            before, used = state.promise, used + 1
            y, state = advance(equations(state.y_eval, which), y, bounds, state)
            found = ended(y, state, rtol, atol)
            hopeless = _hopeless(state, before, used, min(results.cost.min(), state.cost.min()), coarse)
            over = found.ended | hopeless | (used >= steps)
            success = hopeless | (found.ended & ~(found.diverged | found.lost))
            new = y, state.cost, state.aux, success, np.full(len(y), used)
            for column, rows in zip(results, new, strict=True):
                column[which[over]] = rows[over]
            y, which, state = y[~over], which[~over], State(*(x[~over] for x in state))
    return results


def _hopeless(state: State, before: Any, used: Any, best: Any, coarse: Any) -> Any:
    """Starts that cannot become the best: an undamped step promises less than the share `coarse` of the
    distance to the best cost, and the promise falls."""
    settling = state.promise <= _SETTLING * before
    return (used >= _LEAST) & settling & (state.promise <= coarse * (state.cost - best))
