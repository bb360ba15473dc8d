"""Pair against numpy's complex numbers, and the roots, sines and cosines that formulas are made of."""

import operator

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pellicle.optics import pair as number
from pellicle.optics.pair import Pair

finite = st.floats(-1e3, 1e3, allow_subnormal=False)
# away from 0, where a quotient's relative error has no meaning
complexes = st.builds(complex, finite, finite).filter(lambda z: abs(z) > 1e-3)
OPERATIONS = [operator.add, operator.sub, operator.mul, operator.truediv]


def pair(z):
    return Pair(np.float64(z.real), np.float64(z.imag))


def value(z):
    return complex(number.real(z), number.imag(z))


@pytest.mark.parametrize("operation", OPERATIONS)
@given(a=complexes, b=complexes)
def test_arithmetic_is_that_of_complex_numbers(operation, a, b):
    real = b.real if abs(b.real) > 1e-3 else 1.0
    size = abs(operation(abs(a), -abs(b))) if operation is operator.sub else operation(abs(a), abs(b))
    for left, right, truth in (
        (pair(a), pair(b), operation(a, b)),
        (pair(a), real, operation(a, real)),
        (a.real, pair(b), operation(a.real, b)),
        (np.array(a.real), pair(b), operation(a.real, b)),
    ):
        assert abs(value(operation(left, right)) - truth) <= 1e-15 * (size + abs(truth))


@pytest.mark.parametrize(
    ("z", "im_is_absent"),
    [
        (Pair(1.0, None) + Pair(2.0, None), True),
        (Pair(1.0, None) * 3.0, True),
        (Pair(None, 2.0) * Pair(None, 3.0), True),
        (Pair(1.0, 2.0) * 3.0, False),
        (number.times_i(Pair(None, 2.0)), True),
        (number.times_i(2.0), False),
        (number.conj(2.0), True),
        (number.narrow(1.0, None), True),
        (number.where(True, 1.0, 2.0), True),
        (number.where(True, Pair(1.0, None), Pair(2.0, None)), True),
    ],
)
def test_an_absent_imaginary_part_stays_absent(z, im_is_absent):
    assert number.is_real(z) is im_is_absent


def test_an_absent_real_part_stays_absent():
    assert number.parts(number.times_i(2.0)) == (None, 2.0)
    assert number.parts(Pair(None, 2.0) * 3.0) == (None, 6.0)
    assert number.parts(-Pair(None, 2.0)) == (None, -2.0)
    assert number.parts(number.conj(Pair(None, 2.0))) == (None, -2.0)


def test_nothing_is_computed_for_an_absent_part():
    def count(z):
        return len(jax.make_jaxpr(lambda: number.parts(z * z + z))().eqns)

    one = jnp.float64(2.0)
    assert count(Pair(one, None)) < count(Pair(one, one))


@given(z=complexes)
def test_functions_agree_over_the_number_types(z):
    for same in (pair(z), np.complex128(z)):
        assert value(number.conj(same)) == z.conjugate()
        assert value(number.times_i(same)) == pytest.approx(1j * z)
        assert number.abs2(same) == pytest.approx(abs(z) ** 2)
        assert complex(number.to_complex(same)) == z
        assert value(number.to_pair(same)) == z
        assert value(number.where(np.array(False), 1.0 + 0.0 * same, same)) == z


def test_to_complex_follows_the_precision():
    assert number.to_complex(Pair(np.float32(1), np.float32(2))).dtype == np.complex64
    assert number.to_complex(np.float64(1)).dtype == np.complex128
    assert number.to_complex(Pair(np.ones(3), 0.5)).shape == (3,)


@given(z=complexes)
def test_sqrt_decays_away_from_its_source(z):
    for same in (pair(z), np.complex128(z)):
        root = value(number.sqrt(same))
        assert root.imag >= 0
        assert root * root == pytest.approx(z, rel=1e-14)


def test_sqrt_of_a_faint_imaginary_part():
    """A square would lose 1e-300; and a negative zero must not turn the wave round."""
    root = value(number.sqrt(pair(4 + 1e-300j)))
    assert root == 2 + 2.5e-301j
    for im in (0.0, -0.0):
        assert value(number.sqrt(Pair(np.float64(-4.0), np.float64(im)))) == 2j
        assert value(number.sqrt(Pair(np.float64(4.0), np.float64(im)))) == 2


@given(z=complexes)
def test_slope_of_sqrt(z):
    for same, direction in ((pair(z), pair(1 + 2j)), (np.complex128(z), np.complex128(1 + 2j))):
        root, slope = jax.jvp(number.sqrt, (same,), (direction,))
        assert value(slope) == pytest.approx(0.5 * (1 + 2j) / value(root), rel=1e-13)


def test_slope_of_sqrt_at_zero_is_zero():
    for zero, one in ((0.0, 1.0), (Pair(0.0, 0.0), Pair(1.0, 1.0)), (0j, 1 + 1j)):
        root, slope = jax.jvp(number.sqrt, (zero,), (one,))
        assert value(root) == value(slope) == 0
