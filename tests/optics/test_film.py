"""Elements of the characteristic matrix, and the closed form of a film, for every number type."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from pellicle.optics import characteristic, film, response
from pellicle.optics.pair import Pair

from ..differences import jacobian


def exact(Q, k):
    """Return c, f and their derivatives in Q, without a scale."""
    Q, k = mpmath.mpc(Q), mpmath.mpf(k)
    if abs(k * k * Q) < 1e-16:
        return 1, k, -k * k / 2, -(k**3) / 6
    root = mpmath.sqrt(Q)
    c, f = mpmath.cos(k * root), mpmath.sin(k * root) / root
    return c, f, -k * f / 2, (k * c - f) / (2 * Q)


@jax.jit
def pair_jvp(re, im, k):
    one, none = jnp.ones_like(re), jnp.zeros_like(re)
    return jax.jvp(characteristic.matrix_elements, (Pair(re, im), k), (Pair(one, none), none))


@jax.jit
def complex_jvp(re, im, k):
    Q = jax.lax.complex(re, im)
    return jax.jvp(characteristic.matrix_elements, (Q, k), (jnp.ones_like(Q), jnp.zeros_like(k)))


@jax.jit
def real_jvp(re, k):
    return jax.jvp(characteristic.matrix_elements, (re, k), (jnp.ones_like(re), jnp.zeros_like(k)))


def as_complex(z):
    return complex(z.re, z.im) if isinstance(z, Pair) else complex(z)


@mpmath.workdps(40)
def check_elements(Q, k, computed):
    """Check values, derivatives in Q and |scale|², by the convention for the scale.

    It is e^{ikq}, and 1 where a real wave propagates. Its derivative counts as zero there, and where
    |k²Q| < 0.01.
    """
    (c, f, scale_square, _), (dc, df, dscale, _) = computed
    root, k = mpmath.sqrt(mpmath.mpc(Q)), mpmath.mpf(k)
    real_wave = np.iscomplexobj(c) is False and not isinstance(c, Pair) and Q >= 0
    scale = 1 if real_wave else mpmath.exp(1j * k * root)
    assert float(scale_square) == pytest.approx(float(abs(scale) ** 2), rel=1e-13, abs=1e-300)
    cosine, sine, dcosine, dsine = exact(Q, k)
    constant_scale = real_wave or abs(k * root) ** 2 < 0.01
    dlog_scale = 0 if constant_scale else 1j * k / (2 * root)
    assert float(dscale) == pytest.approx(float(2 * mpmath.re(dlog_scale) * abs(scale) ** 2), rel=1e-12)
    # relative to the largest possible value: near a zero of the sine only the absolute error is small
    size = 1 + float(abs(k * root))
    # ∂f/∂Q = (k c − f)/2Q cancels to a share of |k²Q| beyond the Taylor series, which ends at 0.01
    cancellation = max(1.0, 0.03 / max(float(abs(k * root) ** 2), 0.01))
    pairs = [
        (c, cosine, 1),
        (f, sine, k),
        (dc, dcosine + dlog_scale * cosine, k * k),
        (df, dsine + dlog_scale * sine, cancellation * k**3),
    ]
    for value, truth, bound in pairs:
        assert abs(as_complex(value) - complex(scale * truth)) <= 8e-15 * size * bound + 1e-300


def away_from_the_switch(Q, k):
    """True where rounding cannot decide if the scale counts as constant."""
    return abs(abs(k * k * Q) - 0.01) > 1e-12


parts_of_q = st.floats(-30, 30, allow_subnormal=False)
# below 1e-30 k√Q underflows, and the compared values with it
k0d = st.one_of(st.just(0.0), st.floats(1e-30, 10))


@given(re=parts_of_q, im=st.floats(0, 30, allow_subnormal=False), k=k0d)
def test_matrix_elements_and_their_slopes(re, im, k):
    assume(away_from_the_switch(complex(re, im), k))
    for jvp in (pair_jvp, complex_jvp):
        check_elements(complex(re, im), k, jvp(np.float64(re), np.float64(im), np.float64(k)))


@given(re=parts_of_q, k=k0d)
def test_matrix_elements_of_a_real_square(re, k):
    assume(away_from_the_switch(re, k))
    check_elements(re, k, real_jvp(np.float64(re), np.float64(k)))


@pytest.mark.parametrize("phase", [0.05, 0.0999, 0.1001, 0.12, 0.17, 0.2])
@pytest.mark.parametrize("turn", [0.0, 0.5, 1.0])
def test_the_taylor_branch_has_the_scale(phase, turn):
    """Thin absorbing films: the slope near w = 0 must be scaled like c and f, which it once was not."""
    Q = 4 * np.exp(1j * np.pi * turn)
    k = np.float64(phase / 2)
    check_elements(complex(Q.real, abs(Q.imag)), k, pair_jvp(Q.real, abs(Q.imag), k))


def test_matrix_elements_at_zero():
    """Exactly critical (Q = 0) and no thickness (k = 0): c = 1, f = k, and finite slopes."""
    for Q, k in ((0.0, 2.0), (2.0, 0.0), (0.0, 0.0)):
        check_elements(Q, k, pair_jvp(np.float64(Q), np.float64(0), np.float64(k)))
        check_elements(Q, k, real_jvp(np.float64(Q), np.float64(k)))


@jax.jit
@jax.jacfwd
@jax.jacfwd
def second_derivatives(at):
    c, f, _, _ = characteristic.matrix_elements(*at)
    return jnp.stack([c, f])


@pytest.mark.parametrize(
    ("Q", "k", "of_c", "of_f"),
    [
        # second derivatives in Q, in Q and k, in k: from the power series of c and f in k²Q
        (0.0, 2.0, (2.0**4 / 12, -2.0, 0.0), (2.0**5 / 60, -(2.0**2) / 2, 0.0)),
        (2.0, 0.0, (0.0, 0.0, -2.0), (0.0, 0.0, 0.0)),
        # opaque: c = ½ and f = 1/(2√−Q)
        (-1e4, 100.0, (0.0, 0.0, 0.0), (3 / 8 * 1e-10, 0.0, 0.0)),
    ],
)
def test_second_derivatives_at_singular_points(Q, k, of_c, of_f):
    second = second_derivatives(np.array([Q, k]))
    for result, expected in zip(second, (of_c, of_f), strict=True):
        np.testing.assert_allclose(result[[0, 0, 1], [0, 1, 1]], expected, rtol=1e-13, atol=1e-18)
        np.testing.assert_allclose(result[0, 1], result[1, 0], rtol=1e-13, atol=1e-18)


def test_second_derivatives_are_those_of_the_first():
    """A film near w = 0, one of some fringes, one opaque, one evanescent: constant and varying scales."""

    def reflected(row):
        n, k, depth = row
        s, _ = film.film(1.5, Pair(n, k), 1.52, depth, 0.8)
        return jnp.stack([response.reflectance(s), response.transmittance(s)])

    slope = jax.jit(jax.vmap(jax.jacfwd(reflected)))
    rows = np.array([[1.3, 0.02, 0.05], [2.1, 0.05, 6.0], [2.0, 1.0, 9.0], [0.7, 0.0, 1.2]])
    second = jax.jit(jax.vmap(jax.jacfwd(jax.jacfwd(reflected))))(rows)
    for row, found in zip(rows, second, strict=True):
        expected = jacobian(lambda x: slope(x[None])[0], row, 1e-5)
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-8)


def test_propagating_elements_equal_the_general_ones():
    Q, k = np.linspace(0.1, 6, 50), np.linspace(0, 40, 50)

    def both(fn):
        return jax.jvp(lambda Q, k: fn(Q, k), (Q, k), (np.ones_like(Q), np.full_like(k, 0.3)))

    ways = map(both, (characteristic.propagating_elements, characteristic.matrix_elements))
    for one, two in zip(*map(jax.tree.leaves, ways), strict=True):
        np.testing.assert_allclose(one, two, rtol=1e-13, atol=1e-12)
