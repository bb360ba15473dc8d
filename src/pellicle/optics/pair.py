"""Complex numbers as pairs of real arrays, with arithmetic over real, complex and paired numbers.

XLA's complex arithmetic on a CPU takes three times as long as the same formula on separate real arrays.
So formulas are written once, with the functions below, which accept a real array, a complex array or a
`Pair`, and return the narrowest type that represents the result. A part of a `Pair` that is `None` is
absent: it is known to be zero when the program is traced, and nothing is computed for it.

`namespace` chooses between NumPy and JAX. Refractive indices of known media are computed once, by NumPy,
which compiles nothing: JAX takes 30 to 90 ms to trace and load even a program of a few operations. So are
scenes that are simulated a few times (`forward_model.elementary_signal`). Within traced programs the same
formulas use JAX.
"""

from collections.abc import Callable
from functools import update_wrapper
from typing import TYPE_CHECKING, Any, Protocol, TypeGuard

import jax
import jax.numpy as jnp
import numpy as np


def namespace(*arrays: Any) -> Any:
    """Return `numpy` where an array is NumPy's and none is JAX's, else `jax.numpy`. Accepts pytrees."""
    if len(arrays) == 1 and type(arrays[0]) is np.ndarray:
        return np
    leaves = jax.tree_util.tree_leaves(arrays)
    if any(isinstance(leaf, jax.Array) for leaf in leaves):
        return jnp
    return np if any(isinstance(leaf, np.ndarray | np.generic) for leaf in leaves) else jnp


class custom_jvp:
    """`jax.custom_jvp`, which calls the function itself with NumPy arrays."""

    def __init__(self, function: Callable[..., Any], nondiff_argnums: tuple[int, ...] = ()):
        self.function, self.traced = function, jax.custom_jvp(function, nondiff_argnums=nondiff_argnums)
        self.defjvp = self.traced.defjvp
        update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        return (self.function if namespace(*arguments) is np else self.traced)(*arguments)


def fori_loop(lower: int, upper: int, step: Callable[[Any, Any], Any], state: Any) -> Any:
    """`jax.lax.fori_loop`, or a loop in Python where the state is NumPy's."""
    if namespace(state) is not np:
        return jax.lax.fori_loop(lower, upper, step, state)
    for i in range(lower, upper):
        state = step(i, state)
    return state


def while_loop(test: Callable[[Any], Any], step: Callable[[Any], Any], state: Any) -> Any:
    """`jax.lax.while_loop`, or a loop in Python where the state is NumPy's."""
    if namespace(state) is not np:
        return jax.lax.while_loop(test, step, state)
    while test(state):
        state = step(state)
    return state


def cond(test: Any, yes: Callable[[Any], Any], no: Callable[[Any], Any], state: Any) -> Any:
    """`jax.lax.cond`, or a branch of Python where the test is NumPy's."""
    if namespace(test) is not np:
        return jax.lax.cond(test, yes, no, state)
    return (yes if test else no)(state)


def map_rows(function: Callable[[Any], Any], rows: Any) -> Any:
    """`jax.lax.map`, or a loop in Python over NumPy's rows; results are stacked."""
    if namespace(rows) is not np:
        return jax.lax.map(function, rows)
    count = len(jax.tree_util.tree_leaves(rows)[0])
    each = [function(jax.tree_util.tree_map(lambda x, i=i: x[i], rows)) for i in range(count)]
    return jax.tree_util.tree_map(lambda *own: np.stack(own), *each)


def scan(step: Callable[[Any, Any], Any], state: Any, rows: Any) -> tuple[Any, Any]:
    """`jax.lax.scan`, or a loop in Python over NumPy's rows, of a step without outputs of its own."""
    if namespace(state, rows) is not np:
        return jax.lax.scan(step, state, rows)
    for i in range(len(jax.tree_util.tree_leaves(rows)[0])):
        state, _ = step(state, jax.tree_util.tree_map(lambda x, i=i: x[i], rows))
    return state, None


def inverse_root(x: Any) -> Any:
    """Return 1/√x of a real array."""
    return 1 / np.sqrt(x) if namespace(x) is np else jax.lax.rsqrt(x)


def stop_gradient(x: Any) -> Any:
    """`jax.lax.stop_gradient`; NumPy's arrays have none."""
    return x if namespace(x) is np else jax.lax.stop_gradient(x)


if TYPE_CHECKING:

    class Number(Protocol):
        """A real array, a complex array or a `Pair`; numbers of Python and tracers count as arrays."""

        def __neg__(self) -> Any: ...
        def __add__(self, other: Any, /) -> Any: ...
        def __radd__(self, other: Any, /) -> Any: ...
        def __sub__(self, other: Any, /) -> Any: ...
        def __rsub__(self, other: Any, /) -> Any: ...
        def __mul__(self, other: Any, /) -> Any: ...
        def __rmul__(self, other: Any, /) -> Any: ...
        def __truediv__(self, other: Any, /) -> Any: ...
        def __rtruediv__(self, other: Any, /) -> Any: ...

else:
    Number = Any  # a check of each tracer as it runs would be slow


@jax.tree_util.register_pytree_node_class
class Pair:
    """A complex number as two real arrays, either of which may be None (absent)."""

    __array_ufunc__ = None  # NumPy arrays defer to the operators below
    __array_priority__ = 1000

    def __init__(self, re: Any, im: Any):
        self.re, self.im = re, im

    def tree_flatten(self):
        return (self.re, self.im), None

    @classmethod
    def tree_unflatten(cls, _, leaves):
        return cls(*leaves)

    def __repr__(self):
        return f"Pair({self.re}, {self.im})"

    def __complex__(self):
        return complex(0.0 if self.re is None else self.re, 0.0 if self.im is None else self.im)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        del copy
        re, im = (0.0 if part is None else np.asarray(part) for part in (self.re, self.im))
        return np.asarray(re + 1j * im, dtype=dtype)

    def __neg__(self):
        return Pair(_minus(self.re), _minus(self.im))

    def __add__(self, other):
        re, im = parts(other)
        return narrow(_plus(self.re, re), _plus(self.im, im))

    __radd__ = __add__

    def __sub__(self, other):
        return self + -other

    def __rsub__(self, other):
        return -self + other

    def __mul__(self, other):
        re, im = parts(other)
        return narrow(
            _plus(_times(self.re, re), _minus(_times(self.im, im))),
            _plus(_times(self.re, im), _times(self.im, re)),
        )

    __rmul__ = __mul__

    def __truediv__(self, other):
        if parts(other)[1] is None:
            return self * (1 / other)
        return self * conj(other) * (1 / abs2(other))

    def __rtruediv__(self, other):
        return conj(self) * (other / abs2(self))


def _plus(a: Any, b: Any) -> Any:
    return b if a is None else a if b is None else a + b


def _times(a: Any, b: Any) -> Any:
    return None if a is None or b is None else a * b


def _minus(a: Any) -> Any:
    return None if a is None else -a


def _or_zero(a: Any) -> Any:
    return 0.0 if a is None else a


def _is_complex(z: Number) -> TypeGuard[jax.Array]:
    return jnp.iscomplexobj(z)


def parts(z: Number) -> tuple[Any, Any]:
    """Return the real and imaginary part; None where a part is absent."""
    if isinstance(z, Pair):
        return z.re, z.im
    return (z.real, z.imag) if _is_complex(z) else (z, None)


def narrow(re: Any, im: Any) -> Number:
    """Return a real array if the imaginary part is absent, else a `Pair`."""
    return re if im is None else Pair(re, im)


def real(z: Number) -> Any:
    """Return the real part; 0 where it is absent."""
    return _or_zero(parts(z)[0])


def imag(z: Number) -> Any:
    """Return the imaginary part; 0 where it is absent."""
    return _or_zero(parts(z)[1])


def is_real(z: Number | tuple[Number, ...]) -> bool:
    """True if the type of the number, or of all numbers of a tuple, excludes an imaginary part."""
    if isinstance(z, tuple):
        return all(map(is_real, z))
    return z.im is None if isinstance(z, Pair) else not jnp.iscomplexobj(z)


def conj(z: Number) -> Number:
    """Return the complex conjugate, of the same type."""
    if isinstance(z, Pair):
        return Pair(z.re, _minus(z.im))
    return z.conjugate() if _is_complex(z) else z


def abs2(z: Number) -> Any:
    """Return |z|²."""
    re, im = parts(z)
    return _or_zero(_plus(_times(re, re), _times(im, im)))


def times_i(z: Number) -> Number:
    """Return i z; an absent part of a `Pair` stays absent."""
    if not isinstance(z, Pair) and _is_complex(z):
        return 1j * z
    re, im = parts(z)
    return narrow(_minus(im), re)


def to_pair(z: Number) -> Number:
    """Convert a complex array to a `Pair`; return anything else unchanged."""
    return Pair(z.real, z.imag) if not isinstance(z, Pair) and _is_complex(z) else z


def to_complex(z: Number) -> Any:
    """Convert any number to one complex array, as public functions return it."""
    re, im = parts(z)
    if namespace(re, im) is np:
        return np.asarray(_or_zero(re) + 1j * _or_zero(im))
    dtype = jnp.promote_types(jnp.result_type(_or_zero(re), _or_zero(im)), jnp.float32)
    re, im = jnp.broadcast_arrays(jnp.asarray(_or_zero(re)), jnp.asarray(_or_zero(im)))
    return jax.lax.complex(re.astype(dtype), im.astype(dtype))


def joined(z: Any) -> Any:
    """Convert a `Pair` of NumPy's arrays, which compute faster with complex ones; keep anything else."""
    return to_complex(z) if isinstance(z, Pair) and namespace(z) is np else z


def where(test: Any, yes: Number, no: Number) -> Number:
    """Apply `where` part by part; a part that is absent on both sides stays absent."""
    xp = namespace(test, yes, no)
    if not isinstance(yes, Pair) and not isinstance(no, Pair):
        return xp.where(test, yes, no)
    (a, b), (c, d) = parts(yes), parts(no)

    def pick(p, q):
        return None if p is None and q is None else xp.where(test, _or_zero(p), _or_zero(q))

    return narrow(pick(a, c), pick(b, d))


@custom_jvp
def sqrt(z: Number) -> Number:
    """Return the square root with a nonnegative imaginary part: waves decay away from their source.

    A real array is a promise that no element is negative. At zero, where the true slope is infinite, the
    derivative returned is zero.
    """
    xp = namespace(z)
    if not isinstance(z, Pair):
        if jnp.iscomplexobj(z) and xp is not np:  # XLA's complex root has five times as many operations
            return to_complex(sqrt(to_pair(z)))
        root = xp.sqrt(z)
        return xp.where(root.imag < 0, -root, root) if jnp.iscomplexobj(z) else root
    re, im = real(z), imag(z)
    # hypot keeps 1e-300 from vanishing in a square
    size = xp.hypot(re, im)
    big = xp.sqrt(0.5 * (size + xp.abs(re)))
    small = 0.5 * xp.abs(im) / xp.where(big == 0, 1.0, big)
    across = re >= 0
    root_re = xp.where(across, big, small)
    return Pair(xp.where(im < 0, -root_re, root_re), xp.where(across, small, big))


@sqrt.defjvp
def _sqrt_slope(primal: Any, tangent: Any) -> tuple[Number, Number]:
    root = sqrt(primal[0])
    at_zero = abs2(root) == 0
    safe = where(at_zero, 1.0 + 0.0 * root, root)
    return root, where(at_zero, 0.0 * tangent[0], tangent[0] * (0.5 / safe))
