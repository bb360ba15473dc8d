"""`levenberg_marquardt` as a solver of Optimistix, whose import takes a third as long as JAX's."""

from typing import Any, final

import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array

from pellicle.fitting.levenberg_marquardt import advance, begin, ended, normal_equations


@final
class BoundedLevenbergMarquardt(optx.AbstractLeastSquaresSolver):
    """`optx.least_squares(fn, BoundedLevenbergMarquardt(rtol, atol), y0, options={"lower":, "upper":})`.

    `y0` and the bounds are one-dimensional arrays (or scalar bounds); residuals are any pytree. Runs under
    jit and vmap, in float32 and float64. Do not differentiate through it: Optimistix's implicit rule assumes
    a vanishing gradient, which is wrong at an active bound.
    """

    rtol: Any  # a number, also a traced one
    atol: Any
    norm: Any = optx.two_norm

    def init(self, fn, y, args, options, f_struct, aux_struct, tags):
        del fn, args, f_struct, tags
        zeros = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), aux_struct)
        return begin(y, _bounds(options, y), zeros)

    def step(self, fn, y, args, options, state, tags):
        del tags
        y, state = advance(normal_equations(fn, state.y_eval, args), y, _bounds(options, y), state)
        return y, state, state.aux

    def terminate(self, fn, y, args, options, state, tags):
        del fn, args, options, tags
        found, results = ended(y, state, self.rtol, self.atol), optx.RESULTS
        result = results.where(found.diverged, results.nonlinear_divergence, results.successful)
        result = results.where(found.lost, results.nonfinite, result)
        return ~state.first & found.ended, results.where(state.first, results.successful, result)

    def postprocess(self, fn, y, aux, args, options, state, tags, result):
        del fn, args, options, state, tags, result
        return y, aux, {}


def _bounds(options: dict[str, Any], y: Array) -> tuple[Array, Array]:
    """Lower and upper bounds as arrays like y; none where the options have none."""
    sides = options.get("lower", -jnp.inf), options.get("upper", jnp.inf)
    lower, upper = (jnp.broadcast_to(jnp.asarray(side, y.dtype), y.shape) for side in sides)
    return lower, upper
