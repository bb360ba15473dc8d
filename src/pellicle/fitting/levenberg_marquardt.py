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

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.fitting.positive_definite import solve_positive
from pellicle.optics.pair import namespace

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


class State(NamedTuple):
    """The quadratic model at the accepted point, and the next trial point, arrays (..., ) of NumPy or JAX.

    - `first`: nothing was evaluated yet; `y_eval` (..., parameters): the trial point.
    - `cost`: the square ‖r‖² at the accepted point, not halved; `gradient` (..., parameters), Jᵀr; `hessian`
      (..., parameters, parameters), JᵀJ; `curvature`, the estimate of Σ rᵢ ∇²rᵢ; `top`, the largest diagonal
      of JᵀJ so far, as in MINPACK.
    - `damping`, and by what it grows where a step fails.
    - `predicted` (..., 2): the fall of the cost at the trial point, by JᵀJ alone and corrected; `corrected`,
      where the correction predicts better.
    - `promise`: the fall that an undamped step inside the box would bring; `fruitless`: steps since the cost
      fell by more than rounding errors.
    - `aux`: auxiliary output of the function at the accepted point.
    """

    first: Any
    y_eval: Any
    cost: Any
    gradient: Any
    hessian: Any
    curvature: Any
    top: Any
    damping: Any
    growth: Any
    predicted: Any
    corrected: Any
    promise: Any
    fruitless: Any
    aux: Any


class Evaluated(NamedTuple):
    """Normal equations at a point: ‖r‖² (...), Jᵀr (..., parameters), JᵀJ (..., parameters, parameters), and
    the auxiliary output."""

    cost: Any
    gradient: Any
    hessian: Any
    aux: Any


class QuadraticModel(NamedTuple):
    """A sum of squares around a point (..., parameters): Jᵀr, JᵀJ and its correction, and the box."""

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
        xp = namespace(matrix)
        added = xp.where(free, damping, 1)[..., None] * np.eye(self.y.shape[-1], dtype=matrix.dtype)
        system = xp.where(free[..., None] & free[..., None, :], matrix, 0) + added
        b = xp.where(free, -(self.gradient + _times(matrix, fixed)), fixed)
        return solve_positive(system, b, 50 * float(np.finfo(matrix.dtype).eps))

    def inside(self, step):
        return namespace(step).clip(self.y + step, self.lower, self.upper) - self.y

    def promise(self, step):
        """Fall of the cost by an undamped step.

        Where the data see next to nothing the step is huge, and only what the box leaves of it counts: by the
        lengths of the columns its sum bounds the fall.
        """
        xp = namespace(step)
        bound = xp.sum(xp.abs(self.inside(step)) * xp.sqrt(_diagonal(self.hessian)), axis=-1) ** 2
        return xp.minimum(-xp.sum(self.gradient * step, axis=-1), bound)

    def propose(self, damping, corrected):
        """The next trial point, the fall of the cost predicted for it, and that by an undamped step."""
        xp, squares = namespace(self.gradient), _diagonal(self.hessian)
        held_low = (self.y <= self.lower) & (self.gradient >= 0)
        held_high = (self.y >= self.upper) & (self.gradient <= 0)
        free = ~(held_low | held_high) & (squares > 0)
        full, damping = self.hessian + self.curvature, damping[..., None] * self.top
        rounding = 10 * self.y.shape[-1] * float(np.finfo(squares.dtype).eps) * squares
        # all systems in one piece of the program: damped and undamped, corrected and by Gauss-Newton
        matrices, dampings = xp.stack([full, self.hessian] * 2), xp.stack([damping] * 2 + [rounding] * 2)
        steps, positive = self.step(matrices, dampings, free, 0 * self.y)
        corrected = positive[0] & corrected
        matrix = xp.where(corrected[..., None, None], full, self.hessian)
        step = xp.where(corrected[..., None], steps[0], steps[1])
        if self.y.shape[-1] > 1:
            # parameters that would leave the box go to its wall, and the others as they then should
            within = self.inside(step)
            cut = free & (within != step)
            if xp is jnp or cut.any():
                step, _ = self.step(matrix, damping, free & ~cut, xp.where(cut, within, 0))
        step = self.inside(step)
        falls = [-xp.sum((2 * self.gradient + _times(m, step)) * step, axis=-1) for m in (self.hessian, full)]
        second, promise = self.promise(steps[2:])
        promise = xp.where(positive[2], xp.maximum(second, _UNCERTAIN * promise), promise)
        trial = xp.clip(self.y + step, self.lower, self.upper)
        return trial, xp.stack(falls, axis=-1), xp.maximum(promise, 0)


def _times(matrix: Any, x: Any) -> Any:
    """Products (..., n) of matrices (..., n, n) and vectors (..., n)."""
    return (matrix @ x[..., None])[..., 0]


def _diagonal(matrix: Any) -> Any:
    return namespace(matrix).diagonal(matrix, axis1=-2, axis2=-1)


def normal_equations(fn, y, args) -> Evaluated:
    """Normal equations of the residuals of `fn`, and its auxiliary output, at one point (parameters,)."""
    residual, push, aux = jax.linearize(lambda y: fn(y, args), y, has_aux=True)
    # else XLA computes what the columns share once for each of them
    residual, push = jax.lax.optimization_barrier((residual, push))
    slopes = jax.vmap(push)(jnp.eye(y.size, dtype=y.dtype))
    rows = [leaf.ravel() for leaf in jax.tree.leaves(residual)]
    columns = [leaf.reshape(y.size, -1) for leaf in jax.tree.leaves(slopes)]
    cost = sum(r @ r for r in rows)
    gradient = sum(c @ r for c, r in zip(columns, rows, strict=True))
    return Evaluated(cost, gradient, sum(c @ c.T for c in columns), aux)


def begin(y: Any, bounds: Bounds, aux: Any) -> State:
    """The state before the first evaluation, at y (..., parameters); `aux` are arrays like the function's own
    output."""
    xp = namespace(y)
    zero = xp.zeros(y.shape[:-1], y.dtype)
    square = xp.zeros((*y.shape, y.shape[-1]), y.dtype)
    return State(
        first=zero == 0,
        y_eval=xp.clip(y, *bounds),
        cost=zero + np.inf,
        gradient=0 * y,
        hessian=square,
        curvature=square,
        top=0 * y,
        damping=zero,
        growth=zero,
        predicted=xp.stack([zero, zero], axis=-1),
        corrected=zero > 0,
        promise=zero + np.inf,
        fruitless=xp.zeros(zero.shape, int),
        aux=aux,
    )


def advance(
    evaluated: Evaluated, y: Any, bounds: Bounds, state: State, secant: Any = True
) -> tuple[Any, State]:
    """The accepted point and the next state, where the trial point was `evaluated`; by Gauss-Newton alone
    where `secant` is false."""
    xp = namespace(y)
    cost, gradient, hessian, aux = evaluated
    cost = xp.where(xp.isfinite(cost), cost, np.inf)
    # within rounding errors of the cost, the gradient says which point is nearer to the minimum
    flatter = _steepness(gradient, hessian) < _steepness(state.gradient, state.hessian)
    level = cost <= (1 + float(np.finfo(y.dtype).eps) ** _ROUNDING) * state.cost
    accept = state.first | (cost < state.cost) | (level & flatter)

    def chosen(new, old):
        return xp.where(accept.reshape(accept.shape + (1,) * (new.ndim - accept.ndim)), new, old)

    hessian = chosen(hessian, state.hessian)
    curvature = _with_secant(state, state.y_eval - y, gradient, hessian, secant)
    fall = state.cost - cost
    off = xp.abs(state.predicted - fall[..., None])
    corrected = xp.where(xp.isfinite(fall), off[..., 1] <= off[..., 0], state.corrected)
    predicted = xp.where(state.corrected, state.predicted[..., 1], state.predicted[..., 0])
    gain = fall / xp.maximum(predicted, np.finfo(y.dtype).tiny)
    damping = state.damping * xp.where(accept, xp.clip(1 - (2 * gain - 1) ** 3, 0.1, 2), state.growth)
    damping = xp.where(state.first, np.asarray(_START, y.dtype), damping)
    top = xp.maximum(state.top, _diagonal(hessian))
    y, gradient = chosen(state.y_eval, y), chosen(gradient, state.gradient)
    model = QuadraticModel(y, gradient, hessian, curvature, top, *bounds)
    trial, predicted, promise = model.propose(damping, corrected)
    risen = fall <= float(np.finfo(y.dtype).eps) ** _ROUNDING * state.cost
    return y, State(
        first=xp.zeros_like(state.first),
        y_eval=trial,
        cost=chosen(cost, state.cost),
        gradient=gradient,
        hessian=hessian,
        curvature=curvature,
        top=top,
        damping=damping,
        growth=xp.where(accept, np.asarray(2, y.dtype), 2 * state.growth),
        predicted=predicted,
        corrected=corrected,
        promise=promise,
        fruitless=xp.where(risen, state.fruitless + 1, 0),
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
    xp, eps = namespace(y), float(np.finfo(y.dtype).eps)
    size, promise = xp.sqrt(state.cost), xp.sqrt(state.promise)
    rounding = eps * xp.max(xp.sqrt(_diagonal(state.hessian)) * xp.abs(y), axis=-1)
    done = promise <= atol + rtol * size + rounding
    done = done | ((state.fruitless >= _FRUITLESS) & (state.promise <= eps**_ROUNDING * state.cost))
    stuck = ~done & xp.all(xp.abs(state.y_eval - y) <= eps * xp.abs(y), axis=-1)
    lost = ~xp.isfinite(size)
    return Ended(done | stuck | lost, stuck & (promise > rtol**0.5 * size), lost)


def _steepness(gradient: Any, hessian: Any) -> Any:
    """Σ gᵢ²/Hᵢᵢ: the fall of the cost by steps along one parameter each."""
    xp, squares = namespace(gradient), _diagonal(hessian)
    return xp.sum(xp.where(squares > 0, gradient**2 / xp.where(squares > 0, squares, 1), 0), axis=-1)


def _with_secant(state: State, step: Any, gradient: Any, hessian: Any, wanted: Any) -> Any:
    """The curvature, corrected by what the model did not know of the secant of the gradient along a step."""
    xp = namespace(step)
    missing = gradient - state.gradient - _times(hessian + state.curvature, step)
    along = xp.sum(missing * step, axis=-1)
    size = xp.sqrt(xp.sum(missing**2, axis=-1)) * xp.sqrt(xp.sum(step**2, axis=-1))
    defined = wanted & ~state.first & (xp.abs(along) > _RANK_ONE * size)
    update = missing[..., :, None] * missing[..., None, :] / xp.where(defined, along, 1)[..., None, None]
    taken = defined & xp.all(xp.isfinite(update), axis=(-2, -1))
    return state.curvature + xp.where(taken[..., None, None], update, 0)
