"""Box-bounded Levenberg-Marquardt, built from Optimistix's own parts.

Optimistix's least-squares solvers know no bounds. Here its loop, its accept-or-reject search, its
results and its `vmap` stay; added are a descent that freezes what sits on a bound and is pushed
outward, trial points clipped to the box, and a stop on the *projected* Gauss-Newton step,
‖J δ‖ ≤ atol + rtol ‖r‖, which is 0 at a constrained minimum and free of the parameters' scale.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, final

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import ScalarLike

from pellicle.fitting.positive_definite import solve_positive


class _State(eqx.Module):
    """The quadratic model at the accepted point, in columns scaled to unit length."""

    y: Any
    gradient: Any  # Jᵀr / scale
    hessian: Any  # JᵀJ / scaleᵢ scaleⱼ
    scale: Any  # column norms of J
    top: Any  # largest so far, as in MINPACK: a parameter that loses its effect cannot run away
    lower: Any
    upper: Any

    def free(self):
        """False where a parameter sits on a bound and the gradient pushes it outward."""
        held_low = (self.y <= self.lower) & (self.gradient >= 0)
        held_high = (self.y >= self.upper) & (self.gradient <= 0)
        return ~(held_low | held_high)

    def solve(self, damping):
        """Damped step of the free parameters in scaled units; 0 for the held ones."""
        free = self.free()
        matrix = jnp.where(free[:, None] & free[None, :], self.hessian, 0)
        matrix = matrix + jnp.diag(jnp.where(free, damping, 1).astype(self.y.dtype))
        return -solve_positive(matrix, jnp.where(free, self.gradient, 0))


@final
class ProjectedDampedNewtonDescent(optx.AbstractDescent):
    """Marquardt-damped step of the parameters that may move."""

    def init(self, y, f_info_struct):
        zero = jnp.zeros_like(y)
        return _State(y, zero, jnp.outer(zero, zero), zero + 1, zero, zero - jnp.inf, zero + jnp.inf)

    def query(self, y, f_info, state):
        jacobian = f_info.jac.as_matrix()
        scale = jnp.sqrt(jnp.sum(jacobian**2, 0))
        top = jnp.maximum(scale, state.top)
        scale = jnp.where(scale > 0, scale, jnp.where(top > 0, top, 1))
        jacobian = jacobian / scale
        return _State(
            y,
            jacobian.T @ f_info.residual,
            jacobian.T @ jacobian,
            scale,
            jnp.where(top > 0, top, 1),
            state.lower,
            state.upper,
        )

    def step(self, step_size, state):
        return state.solve((state.top / state.scale) ** 2 / step_size) / state.scale, optx.RESULTS.successful


@final
class Trust(optx.ClassicalTrustRegion):
    """Optimistix's trust region in y's own dtype, starting near Gauss-Newton, bounded above, and
    never accepting an increase (a clipped step may predict one)."""

    high_cutoff: ScalarLike = 0.5
    low_cutoff: ScalarLike = 1e-4
    high_constant: ScalarLike = 8.0
    low_constant: ScalarLike = 0.15
    start: float = 1e3
    limit: float = 1e9

    def init(self, y, f_info_struct):
        state = super().init(y, f_info_struct)
        return eqx.tree_at(lambda s: s.step_size, state, jnp.asarray(self.start, y.dtype))

    def predict_reduction(self, y_diff, f_info):
        return jnp.minimum(super().predict_reduction(y_diff, f_info), 0)

    def step(self, first_step, y, y_eval, f_info, f_eval_info, state):
        _, accept, result, state = super().step(first_step, y, y_eval, f_info, f_eval_info, state)
        state = eqx.tree_at(lambda s: s.step_size, state, jnp.minimum(state.step_size, self.limit))
        return state.step_size, accept, result, state


@final
class BoundedLevenbergMarquardt(optx.AbstractGaussNewton):
    """`optx.least_squares(fn, BoundedLevenbergMarquardt(rtol, atol), y0, options={"lower":, "upper":})`.

    `y0` and the bounds are one-dimensional arrays (or scalar bounds). Runs under jit and vmap, in
    float32 and float64. Do not differentiate through it: Optimistix's implicit rule assumes a
    vanishing gradient, which is wrong at an active bound.
    """

    rtol: float
    atol: float
    norm: Callable = optx.two_norm
    descent: optx.AbstractDescent = ProjectedDampedNewtonDescent()
    search: optx.AbstractSearch = Trust()
    verbose: Callable = lambda **_: None

    def init(self, fn, y, args, options, f_struct, aux_struct, tags):
        state = super().init(fn, y, args, {}, f_struct, aux_struct, tags)
        bounds = [
            jnp.broadcast_to(jnp.asarray(options.get(side, fallback), y.dtype), y.shape)
            for side, fallback in (("lower", -jnp.inf), ("upper", jnp.inf))
        ]
        where = lambda s: (s.descent_state.lower, s.descent_state.upper, s.y_eval)  # noqa: E731
        return eqx.tree_at(where, state, (*bounds, jnp.clip(y, *bounds)))

    def step(self, fn, y, args, options, state, tags):
        y, state, aux = super().step(fn, y, args, {}, state, tags)
        inside = jnp.clip(state.y_eval, state.descent_state.lower, state.descent_state.upper)
        return y, eqx.tree_at(lambda s: s.y_eval, state, inside), aux

    def terminate(self, fn, y, args, options, state, tags):
        model, eps = state.descent_state, jnp.finfo(state.y_eval.dtype).eps
        size = self.norm(state.f_info.residual)
        gauss_newton = model.solve(10 * model.y.size * eps)
        promised = jnp.sqrt(jnp.maximum(-gauss_newton @ model.gradient, 0))  # ‖J δ‖
        rounding = eps * jnp.max(model.scale * jnp.abs(model.y))
        enough = self.atol + self.rtol * size + rounding
        # where the data see next to nothing the step is huge, and only what the box leaves of it counts;
        # as the scaled columns have unit length, its sum bounds ‖J δ‖
        inside = jnp.clip(model.y + gauss_newton / model.scale, model.lower, model.upper) - model.y
        done = (promised <= enough) | (jnp.sum(jnp.abs(inside) * model.scale) <= enough)
        stuck = ~done & jnp.all(jnp.abs(state.y_eval - model.y) <= eps * jnp.abs(model.y))
        results = optx.RESULTS
        result = results.where(
            stuck & (promised > jnp.sqrt(self.rtol) * size), results.nonlinear_divergence, state.result
        )
        result = results.where(jnp.isfinite(size), result, results.nonfinite)
        going = state.first_step
        return ~going & (done | stuck), results.where(going, results.successful, result)


def _dense(residual: Callable) -> Callable:
    """Residuals whose linearisation is one dense Jacobian matrix.

    Optimistix keeps a linearised function in its loop and chooses between the old and the new one; left
    to itself that is every intermediate of the model, and choosing between hundreds of arrays was most
    of what there was to compile.
    """
    held = jax.custom_jvp(residual)

    @held.defjvp
    def _slope(primals, tangents):
        (y,), (change,) = primals, tangents
        left, along = jax.linearize(residual, y)
        return left, jax.vmap(along, out_axes=1)(jnp.eye(y.size, dtype=y.dtype)) @ change

    return held


def least_squares(residual: Callable, start, *, rtol: float = 1e-8, steps: int = 100):
    """Minimise ‖residual(y)‖² for y in the unit box from `start`; returns (y, converged)."""
    held = _dense(residual)
    solution = optx.least_squares(
        lambda y, _: held(y),
        BoundedLevenbergMarquardt(rtol=rtol, atol=0.0),
        start,
        options={"lower": 0.0, "upper": 1.0},
        max_steps=steps,
        throw=False,
    )
    return solution.value, solution.result == optx.RESULTS.successful
