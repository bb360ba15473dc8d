"""Functions that act at each wavelength: their derivatives, and that slopes are computed once."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pellicle.optics.hoisting import pointwise
from pellicle.optics.pair import Pair

AT = np.linspace(1.0, 2.0, 5)


def plain(numbers):
    index, phase, angle = numbers
    return jnp.stack([jnp.sin(index.re * phase) * jnp.exp(-index.im), phase / index.re + jnp.cos(angle)])


def numbers(values):
    """An index (n + ik), a phase and an angle at each point, from three parameters."""
    return Pair(values[0] + 0.1 * AT, values[1] * AT), values[2] / AT, 0.3


def by_hand(values):
    return plain(numbers(values))


def by_slopes(values):
    return pointwise(plain, numbers(values))


VALUES = np.array([1.5, 0.2, 4.0])


@pytest.mark.slow
@pytest.mark.parametrize(
    "derivative",
    [
        lambda f: f,
        jax.jacfwd,
        jax.jacrev,
        lambda f: jax.jacfwd(jax.jacfwd(f)),
        lambda f: jax.jacrev(jax.jacfwd(f)),
    ],
)
def test_derivatives_are_those_of_the_function(derivative):
    expected = derivative(by_hand)(VALUES)
    np.testing.assert_allclose(jax.jit(derivative(by_slopes))(VALUES), expected, rtol=1e-13, atol=1e-14)
    rows = jax.jit(jax.vmap(derivative(by_slopes)))(np.stack([VALUES, VALUES + 0.1]))
    np.testing.assert_allclose(rows[0], expected, rtol=1e-13, atol=1e-14)


def test_what_does_not_vary_has_no_slope():
    """A parameter of the phase alone: the sine is differentiated once, for all tangents together."""
    calls = []

    def counted(numbers):
        calls.append(1)
        return plain(numbers)

    def signal(thickness):
        index, _, angle = numbers(VALUES)
        return pointwise(counted, (index, thickness[0] / AT + thickness[1], angle))

    jax.jacfwd(signal)(np.array([4.0, 0.5]))
    assert len(calls) == 1
