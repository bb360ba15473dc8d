"""Propagation of the tangential fields through a homogeneous layer.

The fields are ψ = (Ex, Hy, Ey, −Hx) with H in units of E over the impedance of free space and the time factor
exp(−iωt); they obey dψ/dz = i k₀ Δ ψ. Source: D. W. Berreman, J. Opt. Soc. Am. 62, 502 (1972).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp

from pellicle.optics.berreman.matrices import Matrix
from pellicle.optics.characteristic import matrix_elements, scale_exponent
from pellicle.optics.elementary import sincos
from pellicle.optics.pair import Number, Pair, imag, real, where

Fields = tuple[Number, Number, Number, Number]
"""Ex, Hy, Ey and −Hx."""


class Propagation(NamedTuple):
    """exp(−i k₀ d Δ), which takes the fields at the lower face to the upper one, times exp(−growth)."""

    apply: Callable[[Fields], Fields]
    growth: Any  # real: the exponent of the mode that grows most


class Elements(NamedTuple):
    """cos(k√Q) and sin(k√Q)/√Q, both times exp(−growth)."""

    c: Number
    f: Number


def full(number: Number) -> Pair:
    """Return a number as a `Pair` of two arrays, which promises nothing."""
    return Pair(real(number) * jnp.ones(()), imag(number) + 0.0 * real(number))


def exp(z: Pair) -> Pair:
    """Return the exponential of a `Pair`."""
    size, (sine, cosine) = jnp.exp(z.re), sincos(z.im)
    return Pair(size * cosine, size * sine)


def elements_and_exponent(Q: Number, k: Any) -> tuple[Number, Number, Number]:
    """Return c and f times e^x, and x, whose slope is that of the scale: see `matrix_elements`."""
    scaled = matrix_elements(full(Q), k)
    return scaled.c, scaled.f, scale_exponent(full(Q), k)


def select(test: Any, yes: Matrix, no: Matrix) -> Matrix:
    """Apply `where` to each element."""
    return Matrix(*(where(test, x, y) for x, y in zip(yes, no, strict=True)))
