"""What a wave loses on its way, and how far that is from nothing, both to the last digit."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp


def exponentials(x):
    """exp(x) and exp(x) − 1 for x ≤ 0, at the cost of one: eˣ = 2ⁿ eʳ with |r| ≤ ½ ln 2, eʳ by its series.

    Relative errors below 2e-16 in float64 and 1.2e-7 in float32, more only next to underflow, where eˣ is
    1e-290 (1e-30) or less. The power of two is written into the exponent's bits: no derivative of its own.
    """
    double = x.dtype == jnp.float64
    number, whole = x.dtype.type, jnp.int64 if double else jnp.int32
    bias, bits, terms = (1023, 52, 13) if double else (127, 23, 7)
    log2 = (0.693145751953125, 1.42860682030941723212e-6) if double else (0.693359375, -2.12194440e-4)
    n = jnp.round(x * number(1.4426950408889634))
    r = x - n * number(log2[0]) - n * number(log2[1])
    square = r * r  # even and odd terms apart: two short chains in place of a long one
    even, odd = number(1 / math.factorial(terms - 1)), number(1 / math.factorial(terms))
    for j in range(terms - 2, 2, -2):
        even = even * square + number(1 / math.factorial(j - 1))
        odd = odd * square + number(1 / math.factorial(j))
    series = r + square * (even + r * odd)
    # a number so large that its last bits count ones: n stands in them as an integer
    integer = jax.lax.bitcast_convert_type(n + number(1.5 * 2**bits), whole)
    power = jax.lax.bitcast_convert_type((integer + bias) << bits, x.dtype)
    gone = n <= -bias
    return jnp.where(gone, 0, power * series + power), jnp.where(gone, -1, power * series + (power - 1))
