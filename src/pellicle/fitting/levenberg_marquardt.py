"""Box-bounded Levenberg-Marquardt with second-order correction.

Optimistix's least-squares solvers know no bounds, and Gauss-Newton steps crawl towards minima with large
residuals: those of a wrong order of interference take a hundred steps. Here the Gauss-Newton matrix JᵀJ is
corrected by a symmetric rank-one estimate of the curvature of the residuals (J. Dennis, D. Gay and
R. Welsch, 1981, ACM Trans. Math. Softw. 7, 348; SR1: J. Nocedal and S. Wright, Numerical Optimization,
section 6.2), what sits on a bound and is pushed outward is held there, and trial points stay in the box. The
damping follows H. Nielsen (1999, IMM-REP-1999-05). The state has the size of the parameters, not of the
data, so that many lanes are cheap to carry (`fitting.lanes`).
"""

from typing import Any, NamedTuple, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from pellicle.fitting.positive_definite import solve_positive

Bounds: TypeAlias = tuple[Any, Any]
"""Lower and upper bounds, arrays like the parameters."""

_START = 1e-3
"""First damping, in units of the largest curvature so far: near Gauss-Newton."""
_UNCERTAIN = 1e-3
"""Share of Gauss-Newton's promise that counts where the corrected matrix promises less: a secant may err."""
_ROUNDING = 0.75
"""Power of the machine's precision: relative rounding error of the cost where residuals are differences of
values many times their noise."""
_FRUITLESS = 5
"""Steps that change nothing after which such a point has settled."""
_RANK_ONE = 1e-8
"""Least cosine between step and secant error for which a rank-one correction is defined."""


class State(eqx.Module):
    """The quadratic model at the accepted point, and the next trial point."""

    first: Bool[Array, ""]
    y_eval: Float[Array, " parameters"]
    cost: Float[Array, ""]  # ‖r‖², not halved
    gradient: Float[Array, " parameters"]  # Jᵀr
    hessian: Float[Array, "parameters parameters"]  # JᵀJ
    curvature: Float[Array, "parameters parameters"]  # estimate of Σ rᵢ ∇²rᵢ
    top: Float[Array, " parameters"]  # largest diagonal of JᵀJ so far, as in MINPACK
    damping: Float[Array, ""]
    growth: Float[Array, ""]
    predicted: Float[Array, "2"]  # fall of the cost at the trial point, by JᵀJ alone and corrected
    corrected: Bool[Array, ""]  # the correction predicts better
    promise: Float[Array, ""]  # fall that an undamped step inside the box would bring
    fruitless: Int[Array, ""]  # steps since the cost fell by more than rounding errors
    aux: Any


class QuadraticModel(NamedTuple):
    """A sum of squares around one point: Jᵀr, JᵀJ and its correction, and the box."""

    y: Any
    gradient: Any
    hessian: Any
    curvature: Any
    top: Any
    lower: Any
    upper: Any

    def step(self, matrix, damping, free, fixed):
        """Step of the `free` parameters where the others move by `fixed`; False where the matrix of
        the free ones is not positive definite."""
        system = jnp.where(free[:, None] & free, matrix, 0) + jnp.diag(jnp.where(free, damping, 1))
        b = jnp.where(free, -(self.gradient + matrix @ fixed), fixed)
        return solve_positive(system, b, 50 * float(jnp.finfo(matrix.dtype).eps))

    def inside(self, step):
        return jnp.clip(self.y + step, self.lower, self.upper) - self.y

    def promise(self, step):
        """Fall of the cost by an undamped step.

        Where the data see next to nothing the step is huge, and only what the box leaves of it counts: by the
        lengths of the columns its sum bounds the fall.
        """
        bound = jnp.sum(jnp.abs(self.inside(step)) * jnp.sqrt(jnp.diagonal(self.hessian))) ** 2
        return jnp.minimum(-self.gradient @ step, bound)

    def propose(self, damping, corrected):
        """The next trial point, the fall of the cost predicted for it, and that by an undamped step."""
        held_low = (self.y <= self.lower) & (self.gradient >= 0)
        held_high = (self.y >= self.upper) & (self.gradient <= 0)
        squares = jnp.diagonal(self.hessian)
        free = ~(held_low | held_high) & (squares > 0)
        none, full, damping = 0 * self.y, self.hessian + self.curvature, damping * self.top
        rounding = 10 * self.y.size * jnp.finfo(self.y.dtype).eps * squares
        # all systems in one piece of the program: damped and undamped, corrected and by Gauss-Newton
        steps, positive = jax.vmap(self.step, (0, 0, None, None))(
            jnp.stack([full, self.hessian] * 2), jnp.stack([damping, damping, rounding, rounding]), free, none
        )
        corrected = positive[0] & corrected
        matrix, step = jnp.where(corrected, full, self.hessian), jnp.where(corrected, steps[0], steps[1])
        if self.y.size > 1:
            # parameters that would leave the box go to its wall, and the others as they then should
            within = self.inside(step)
            cut = free & (within != step)
            step, _ = self.step(matrix, damping, free & ~cut, jnp.where(cut, within, 0))
        step = self.inside(step)
        predicted = jnp.stack([-(2 * self.gradient + m @ step) @ step for m in (self.hessian, full)])
        second, promise = jax.vmap(self.promise)(steps[2:])
        promise = jnp.where(positive[2], jnp.maximum(second, _UNCERTAIN * promise), promise)
        return jnp.clip(self.y + step, self.lower, self.upper), predicted, jnp.maximum(promise, 0)


def normal_equations(fn, y, args):
    """Residuals' square ‖r‖², Jᵀr and JᵀJ, and the auxiliary output of `fn`."""
    residual, push, aux = jax.linearize(lambda y: fn(y, args), y, has_aux=True)
    # else XLA computes what the columns share once for each of them
    residual, push = jax.lax.optimization_barrier((residual, push))
    slopes = jax.vmap(push)(jnp.eye(y.size, dtype=y.dtype))
    rows = [leaf.ravel() for leaf in jax.tree.leaves(residual)]
    columns = [leaf.reshape(y.size, -1) for leaf in jax.tree.leaves(slopes)]
    cost = sum(r @ r for r in rows)
    gradient = sum(c @ r for c, r in zip(columns, rows, strict=True))
    return cost, gradient, sum(c @ c.T for c in columns), aux


def begin(y: Any, bounds: Bounds, aux: Any) -> State:
    """The state before the first evaluation, at y (parameters,); `aux` is like the function's own output."""
    zero = jnp.zeros((), y.dtype)
    square = jnp.zeros((y.size,) * 2, y.dtype)
    return State(
        first=jnp.array(True),
        y_eval=jnp.clip(y, *bounds),
        cost=zero + jnp.inf,
        gradient=0 * y,
        hessian=square,
        curvature=square,
        top=0 * y,
        damping=zero,
        growth=zero,
        predicted=jnp.zeros(2, y.dtype),
        corrected=jnp.array(False),
        promise=zero + jnp.inf,
        fruitless=jnp.array(0),
        aux=jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), aux),
    )


def advance(equations: Any, y: Any, args: Any, bounds: Bounds, state: State) -> tuple[Any, State]:
    """The accepted point and the state after an evaluation of `equations(y, args)`, as `normal_equations`."""
    cost, gradient, hessian, aux = equations(state.y_eval, args)
    cost = jnp.where(jnp.isfinite(cost), cost, jnp.inf)
    accept = state.first | (cost < state.cost)

    def chosen(new, old):
        return jnp.where(accept, new, old)

    hessian = chosen(hessian, state.hessian)
    curvature = _with_secant(state, state.y_eval - y, gradient, hessian)
    fall = state.cost - cost
    by_first, by_second = jnp.abs(state.predicted - fall)
    corrected = jnp.where(jnp.isfinite(fall), by_second <= by_first, state.corrected)
    gain = fall / jnp.maximum(state.predicted[state.corrected.astype(int)], jnp.finfo(y.dtype).tiny)
    damping = state.damping * jnp.where(accept, jnp.clip(1 - (2 * gain - 1) ** 3, 0.1, 2), state.growth)
    top = jnp.maximum(state.top, jnp.diagonal(hessian))
    y = chosen(state.y_eval, y)
    gradient = chosen(gradient, state.gradient)
    damping = jnp.where(state.first, jnp.asarray(_START, y.dtype), damping)
    model = QuadraticModel(y, gradient, hessian, curvature, top, *bounds)
    trial, predicted, promise = model.propose(damping, corrected)
    return y, State(
        first=jnp.array(False),
        y_eval=trial,
        cost=chosen(cost, state.cost),
        gradient=gradient,
        hessian=hessian,
        curvature=curvature,
        top=top,
        damping=damping,
        growth=jnp.where(accept, 2, 2 * state.growth).astype(y.dtype),
        predicted=predicted,
        corrected=corrected,
        promise=promise,
        fruitless=jnp.where(fall > jnp.finfo(y.dtype).eps ** _ROUNDING * state.cost, 0, state.fruitless + 1),
        aux=jax.tree.map(chosen, aux, state.aux),
    )


class Ended(NamedTuple):
    """True where the solver stops; where it is stuck far from a minimum; where the cost is not finite."""

    ended: Any
    diverged: Any
    lost: Any


def ended(y: Any, state: State, rtol: Any, atol: Any) -> Ended:
    """Test a state after its first evaluation, at y.

    A point has settled where an undamped step inside the box promises to change ‖r‖ by at most atol +
    rtol ‖r‖: this is 0 at a constrained minimum and free of the parameters' scale.
    """
    eps = jnp.finfo(y.dtype).eps
    size, promise = jnp.sqrt(state.cost), jnp.sqrt(state.promise)
    rounding = eps * jnp.max(jnp.sqrt(jnp.diagonal(state.hessian)) * jnp.abs(y))
    done = promise <= atol + rtol * size + rounding
    done = done | ((state.fruitless >= _FRUITLESS) & (state.promise <= eps**_ROUNDING * state.cost))
    stuck = ~done & jnp.all(jnp.abs(state.y_eval - y) <= eps * jnp.abs(y))
    lost = ~jnp.isfinite(size)
    return Ended(done | stuck | lost, stuck & (promise > jnp.sqrt(jnp.asarray(rtol)) * size), lost)


def _with_secant(state: State, step: Array, gradient: Any, hessian: Any) -> Array:
    """The curvature, corrected by what the model did not know of the secant of the gradient along a step."""
    missing = gradient - state.gradient - (hessian + state.curvature) @ step
    along = missing @ step
    defined = ~state.first & (jnp.abs(along) > _RANK_ONE * jnp.linalg.norm(missing) * jnp.linalg.norm(step))
    update = jnp.outer(missing, missing) / jnp.where(defined, along, 1)
    return jnp.where(defined & jnp.all(jnp.isfinite(update)), state.curvature + update, state.curvature)
