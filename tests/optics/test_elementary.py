"""Sine and cosine by polynomials, their squares, and exponentials, against more digits."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

from pellicle.optics import special


@mpmath.workdps(30)
@pytest.mark.parametrize(("dtype", "worst"), [(np.float64, 2.3e-16), (np.float32, 9.5e-8)])
def test_sincos_to_1e5_radians(dtype, worst):
    spread = np.random.default_rng(1).uniform(-1, 1, 1500) * np.logspace(-6, 5, 1500)
    quarters = np.arange(-8, 9) * np.pi / 4  # where the branches of the reduction meet
    x = np.concatenate([spread, quarters, [0.0, 1e5, -1e5]]).astype(dtype)
    sine, cosine = (np.asarray(column) for column in jax.jit(special.sincos)(x))
    assert sine.dtype == cosine.dtype == dtype
    for at, s, c in zip(x, sine, cosine, strict=True):
        exact = mpmath.mpf(float(at))
        assert abs(mpmath.sin(exact) - float(s)) <= worst
        assert abs(mpmath.cos(exact) - float(c)) <= worst


def test_slope_of_sincos():
    x = np.linspace(-50, 50, 401)
    _, (ds, dc) = jax.jvp(special.sincos, (x,), (np.ones_like(x),))
    np.testing.assert_allclose(ds, np.cos(x), atol=1e-13)
    np.testing.assert_allclose(dc, -np.sin(x), atol=1e-13)


@mpmath.workdps(40)
@pytest.mark.parametrize(("dtype", "worst"), [(np.float64, 4.5e-16), (np.float32, 2.5e-7)])
def test_squares_to_the_last_digits_near_their_zeros_too(dtype, worst):
    """Relative errors in x up to a quarter turn; farther out those of sine and cosine themselves."""
    near = np.concatenate([np.logspace(-15, np.log10(np.pi / 4), 300), -np.linspace(0.01, 1.5, 200)])
    far = np.random.default_rng(2).uniform(-1e5, 1e5, 500)
    for x, relative in ((near.astype(dtype), True), (far.astype(dtype), False)):
        squares = [np.asarray(y) for y in jax.jit(special.sincos_squares)(x)]
        for at, *pair in zip(x, *squares, strict=True):
            exact = mpmath.mpf(float(at))
            for value, true in zip(pair, (mpmath.sin(exact) ** 2, mpmath.cos(exact) ** 2), strict=True):
                assert abs(float(value) - true) <= worst * (true if relative else 1)


@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 2e-16), (np.float32, 1.2e-7)])
def test_exponentials(dtype, tolerance):
    """Both within a rounding of the library's in more digits, until underflow is near."""
    lowest = -670.0 if dtype is np.float64 else -70.0
    steps = np.concatenate([np.linspace(lowest, 0.0, 20001), -np.logspace(-30, 0, 301), [-0.0]])
    x = steps.astype(dtype)
    exact = x.astype(np.longdouble)
    both, less = (np.asarray(y) for y in special.exp_and_expm1(jnp.asarray(x)))
    assert both.dtype == less.dtype == dtype
    assert np.max(np.abs(both / np.exp(exact) - 1)) < tolerance
    some = exact != 0
    assert np.max(np.abs(less[some] / np.expm1(exact[some]) - 1)) < tolerance
    assert np.all(less[~some] == 0)
    none, all_of_it = special.exp_and_expm1(jnp.asarray([-1e5, -np.inf, np.nan], dtype))
    np.testing.assert_array_equal(none, np.array([0, 0, np.nan], dtype))
    np.testing.assert_array_equal(all_of_it, np.array([-1, -1, np.nan], dtype))
