"""exp and expm1 against the library's in more digits."""

import jax.numpy as jnp
import numpy as np
import pytest

from pellicle.optics.elementary import exp_and_expm1


@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 2e-16), (np.float32, 1.2e-7)])
def test_exponentials(dtype, tolerance):
    """Both within a rounding of the library's in more digits, until underflow is near."""
    lowest = -670.0 if dtype is np.float64 else -70.0
    steps = np.concatenate([np.linspace(lowest, 0.0, 20001), -np.logspace(-30, 0, 301), [-0.0]])
    x = steps.astype(dtype)
    exact = x.astype(np.longdouble)
    both, less = (np.asarray(y) for y in exp_and_expm1(jnp.asarray(x)))
    assert both.dtype == less.dtype == dtype
    assert np.max(np.abs(both / np.exp(exact) - 1)) < tolerance
    some = exact != 0
    assert np.max(np.abs(less[some] / np.expm1(exact[some]) - 1)) < tolerance
    assert np.all(less[~some] == 0)
    none, all_of_it = exp_and_expm1(jnp.asarray([-1e5, -np.inf, np.nan], dtype))
    np.testing.assert_array_equal(none, np.array([0, 0, np.nan], dtype))
    np.testing.assert_array_equal(all_of_it, np.array([-1, -1, np.nan], dtype))
