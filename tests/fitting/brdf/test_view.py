"""What is compared of a BRDF, by name, with its inverse and its slope."""

import jax.numpy as jnp
import numpy as np
import pytest

from pellicle.fitting.brdf.view import INVERSES, RESIDUALS, slope

RHO, COSINE, FLOOR = np.array([0.0, 0.3, 40.0]), np.array([1.0, 0.5, 0.2]), 1e-3
EXPECTED = {
    "linear": RHO,
    "cosine": RHO * COSINE,
    "log": np.log(1 + RHO * COSINE),
    "cube-root": (RHO + FLOOR) ** (1 / 3),
}


@pytest.mark.parametrize("name", RESIDUALS)
def test_residuals_by_name(name):
    transform = RESIDUALS[name]
    np.testing.assert_allclose(transform(RHO, COSINE, FLOOR), EXPECTED[name], rtol=1e-12)
    np.testing.assert_allclose(INVERSES[name](EXPECTED[name], COSINE, FLOOR), RHO, atol=1e-12)
    step = 1e-6
    up, down = (transform(RHO + sign * step, COSINE, FLOOR) for sign in (1, -1))
    np.testing.assert_allclose(
        slope(transform, jnp.asarray(RHO), COSINE, FLOOR), (up - down) / (2 * step), rtol=1e-5
    )
