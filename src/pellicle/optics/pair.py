"""Numbers whose real and imaginary parts are separate arrays.

XLA's complex arithmetic on a CPU costs three times the same maths on separate real arrays. So
formulas are written once, over the functions below, which take a real array, a complex array or a
`Pair`, and give back the narrowest of these that holds the answer. A part of a `Pair` that is
`None` is absent: known to be zero when the program is traced, so nothing is computed for it.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import jax
import jax.numpy as jnp

Number: TypeAlias = Any
"""A real array, a complex array or a `Pair`."""


@jax.tree_util.register_pytree_node_class
class Pair:
    """A complex number as two real arrays, either of which may be None (absent)."""

    __array_ufunc__ = None  # numpy arrays leave the operation to us
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


def _plus(a, b):
    return b if a is None else a if b is None else a + b


def _times(a, b):
    return None if a is None or b is None else a * b


def _minus(a):
    return None if a is None else -a


def _some(a):
    return 0.0 if a is None else a


def parts(z: Number) -> tuple[Any, Any]:
    """Real and imaginary part; None where a part is absent."""
    if isinstance(z, Pair):
        return z.re, z.im
    if jnp.iscomplexobj(z):
        return jnp.real(z), jnp.imag(z)
    return z, None


def narrow(re: Any, im: Any) -> Number:
    """A real array if the imaginary part is absent, else a Pair."""
    return re if im is None else Pair(re, im)


def real(z: Number):
    """The real part; 0 where it is absent."""
    return _some(parts(z)[0])


def imag(z: Number):
    """The imaginary part; 0 where it is absent."""
    return _some(parts(z)[1])


def is_real(z: Number) -> bool:
    """True where the number's type says that it has no imaginary part."""
    return z.im is None if isinstance(z, Pair) else not jnp.iscomplexobj(z)


def conj(z: Number) -> Number:
    """The conjugate, of the same type."""
    if isinstance(z, Pair):
        return Pair(z.re, _minus(z.im))
    return jnp.conj(z) if jnp.iscomplexobj(z) else z


def abs2(z: Number):
    """|z|²."""
    re, im = parts(z)
    return _some(_plus(_times(re, re), _times(im, im)))


def times_i(z: Number) -> Number:
    """i z; the parts of a Pair change places, so that an absent one stays absent."""
    if not isinstance(z, Pair) and jnp.iscomplexobj(z):
        return 1j * z
    re, im = parts(z)
    return narrow(_minus(im), re)


def to_pair(z: Number) -> Number:
    """A complex array as a Pair; anything else unchanged."""
    return Pair(jnp.real(z), jnp.imag(z)) if not isinstance(z, Pair) and jnp.iscomplexobj(z) else z


def to_complex(z: Number):
    """Any number as one complex array, for the public border."""
    re, im = parts(z)
    dtype = jnp.promote_types(jnp.result_type(_some(re), _some(im)), jnp.float32)
    re, im = jnp.broadcast_arrays(jnp.asarray(_some(re)), jnp.asarray(_some(im)))
    return jax.lax.complex(re.astype(dtype), im.astype(dtype))


def where(test, yes: Number, no: Number) -> Number:
    """`jnp.where`, part by part; a part absent on both sides stays absent."""
    if not isinstance(yes, Pair) and not isinstance(no, Pair):
        return jnp.where(test, yes, no)
    (a, b), (c, d) = parts(yes), parts(no)

    def pick(p, q):
        return None if p is None and q is None else jnp.where(test, _some(p), _some(q))

    return narrow(pick(a, c), pick(b, d))


@jax.custom_jvp
def sqrt(z: Number) -> Number:
    """Square root with a nonnegative imaginary part: waves decay away from their source.

    A real array is a promise that it is never negative. At zero, where the true slope is
    infinite, the derivative returned is zero.
    """
    if not isinstance(z, Pair):
        root = jnp.sqrt(z)
        return jnp.where(jnp.imag(root) < 0, -root, root) if jnp.iscomplexobj(z) else root
    re, im = real(z), imag(z)
    # hypot keeps 1e-300 from vanishing in a square
    size = jnp.hypot(re, im)
    big = jnp.sqrt(0.5 * (size + jnp.abs(re)))
    small = 0.5 * jnp.abs(im) / jnp.where(big == 0, 1.0, big)
    across = re >= 0
    root_re = jnp.where(across, big, small)
    return Pair(jnp.where(im < 0, -root_re, root_re), jnp.where(across, small, big))


@sqrt.defjvp
def _sqrt_slope(primal, tangent):
    root = sqrt(primal[0])
    at_zero = abs2(root) == 0
    safe = where(at_zero, 1.0 + 0.0 * root, root)
    return root, where(at_zero, 0.0 * tangent[0], tangent[0] * (0.5 / safe))
