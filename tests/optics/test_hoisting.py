"""Coefficients keep their values and are stored once, slopes of functions of a point are computed once."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pellicle.optics.hoisting import hoist, pointwise, stored, stored_by_cpu
from pellicle.optics.pair import Pair


def test_hoisting_changes_no_value_and_no_slope():
    z = Pair(np.array([0.0, -0.0, 1e-300, 0.1, -7.0, np.inf, np.nan]), None)
    result = hoist(z, np.zeros((8, 7)))
    assert result.im is None
    np.testing.assert_array_equal(result.re, z.re)
    np.testing.assert_array_equal(np.signbit(result.re), np.signbit(z.re))
    slope = jax.jvp(lambda x: hoist(x, np.zeros((8, 2))), (np.ones(2),), (np.full(2, 3.0),))[1]
    np.testing.assert_array_equal(slope, 3.0)


def power(x):
    for _ in range(20):
        x = x * x + 1.0
    return x


def on_a_grid(keep):
    return lambda column, x: keep(power(x), column * x) * column


def in_two_results(keep):
    def results(column, x):
        kept = keep(power(x))
        return kept + x, kept * x

    return results


COLUMN, ROW = np.ones((200, 1)), np.ones((1, 50))


def compiled(use, keep):
    return jax.jit(use(keep)).lower(COLUMN, ROW).compile()


def inlined(value, *_):
    return value


def test_hoisted_values_are_computed_once():
    """Only a value that is computed outside the loop of its uses takes memory of its own."""
    plain, kept = (compiled(on_a_grid, keep).memory_analysis() for keep in (inlined, hoist))
    assert plain.temp_size_in_bytes < ROW.nbytes <= kept.temp_size_in_bytes


def test_stored_values_are_computed_once():
    """The code of 20 squares stands once, not in the loop of each result."""
    plain, kept = (compiled(in_two_results, keep).as_text().count("multiply(") for keep in (inlined, stored))
    assert (plain, kept) == (41, 21)


def test_a_gpu_stores_nothing_that_is_cheap(monkeypatch):
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    numbers = [jnp.ones(3)]
    assert stored_by_cpu(numbers) is numbers


def test_values_used_at_few_points_are_not_hoisted():
    x = np.ones(50)
    assert hoist(x, np.ones((7, 50))) is x


def test_storing_changes_no_value_and_no_slope():
    def function(x, y):
        a, b, c = stored((x, Pair(y, None), 2.0))
        assert b.im is None
        return a * b.re * c

    x, y = np.arange(3.0), np.arange(5.0, 8.0)
    value, slope = jax.jit(lambda x: jax.jvp(lambda x: function(x, y), (x,), (np.ones(3),)))(x)
    np.testing.assert_array_equal(value, 2 * x * y)
    np.testing.assert_array_equal(slope, 2 * y)


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
