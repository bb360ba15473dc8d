"""Uniaxial layers of any orientation, in closed form.

With ε = ε_o + (ε_e − ε_o) c cᵀ and the direction cosines c of the axis, Δ is that of an isotropic medium
and a matrix of rank one, Δ = Δ_o + γ b ℓᵀ, where ℓᵀψ is the field along the axis up to a factor. By Duhamel's
formula

    exp(−ikΔ) = exp(−ikΔ_o) − iγ [X″ b ℓᵀ − i X′ (b rᵀ + d ℓᵀ) − X d rᵀ],    rᵀ = ℓᵀΔ_o,  d = Δ_o b

X(k) is the response of (D² + Q)((D + iμ)² + W) to an impulse. It is an entire function of Q = ε_o − a² and of
the extraordinary roots μ ± √W. No eigenvectors appear, and γX is regular where n_o = n_e. Where the
wave runs along the axis, the elimination that gives X is singular; differences of exponentials replace it.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp

from pellicle.optics.anisotropy import Uniaxial, birefringence
from pellicle.optics.berreman.matrices import (
    Fields,
    Propagation,
    elements_and_exponents,
    exp,
    full,
    stacked,
    unstacked,
)
from pellicle.optics.characteristic import nonzero_root
from pellicle.optics.hoisting import stored
from pellicle.optics.interface import normal_square
from pellicle.optics.pair import (
    Number,
    Pair,
    abs2,
    cond,
    imag,
    namespace,
    real,
    stop_gradient,
    times_i,
    where,
)

ALONG_AXIS = 0.03
"""Relative size of the determinant below which differences of exponentials replace the elimination."""


class Terms(NamedTuple):
    """Numbers of a uniaxial medium at a transverse index, as in the formula of the module."""

    epsilon: Number  # ε_o
    Q: Number  # squared normal index of the ordinary wave
    mu: Number
    W: Number  # the extraordinary wave has the normal index μ ± √W
    gamma: Number
    eta: Number  # ℓᵀb
    zeta: Number  # ℓᵀΔ_o b
    across: Number  # −a c_z
    tilt: Number  # −a c_z/ε_o


def terms(medium: Uniaxial, a: Any, direction: Any = 1.0) -> Terms:
    """Return the numbers of a medium; a `direction` of −1 is for the opposite transverse index."""
    x, y, z = medium.axis
    index = getattr(a, "index", a)
    epsilon = medium.ordinary * medium.ordinary
    difference = birefringence(medium)
    Q = normal_square(medium.ordinary, a)
    gamma = difference * epsilon / (epsilon + difference * (z * z))
    across = -index * z * direction
    tilt = across / epsilon
    eta = 2 * x * tilt
    zeta = (across * across + Q * (x * x)) / epsilon + y * y
    mu = 0.5 * gamma * eta
    return Terms(epsilon, Q, mu, mu * mu + Q + gamma * zeta, gamma, eta, zeta, across, tilt)


def downward_roots(medium: Uniaxial, a: Any) -> tuple[Number, Number]:
    """Return the normal indices of the ordinary and the extraordinary wave that travel downwards."""
    t = terms(medium, a)
    return nonzero_root(full(t.Q)), t.mu + nonzero_root(full(t.W))


def dichroism(medium: Uniaxial, a: Any) -> Any:
    """Return by how much the extinctions Im q of the ordinary and the extraordinary wave differ.

    The larger difference of the two directions.
    """
    t = terms(medium, a)
    q, w, drift = imag(nonzero_root(full(t.Q))), imag(nonzero_root(full(t.W))), imag(t.mu)
    return stop_gradient(abs(w - q) + abs(drift))


def propagation(medium: Uniaxial, a: Any, k: Any, direction: Any = 1.0) -> Propagation:
    """Return the propagation through a layer of k = k₀d.

    **Arguments:** `a`: transverse index, times `direction`. A direction of −1 gives exp(+ikΔ) in place of
    exp(−ikΔ), up to the signs of Hy and −Hx: the fields at the lower face from those at the upper one.
    """
    t = stored(terms(medium, a, direction))
    x, y, _ = medium.axis
    (c, f, exponent), (c_e, f_e, exponent_e) = elements_and_exponents((t.Q, t.W), k)
    drift = times_i(k * t.mu)
    xp = namespace(exponent, drift)
    growth = stop_gradient(xp.maximum(-real(exponent), -real(exponent_e) - real(drift)))
    factor, factor_e = stored((exp(-exponent - growth), exp(-exponent_e - drift - growth)))
    c, f, c_e, f_e = stored((c * factor, f * factor, c_e * factor_e, f_e * factor_e))

    # γX and γX′ from two linear equations; they do not divide by γ
    sines, cosines = f - f_e, c - c_e - times_i(t.mu) * f_e
    determinant = t.zeta * t.zeta - t.eta * t.eta * t.Q
    size = abs2(t.zeta) + abs2(t.eta) * xp.sqrt(abs2(t.Q) + jnp.finfo(growth.dtype).tiny)
    near = stop_gradient(abs2(determinant) <= (ALONG_AXIS * size) ** 2)
    inverse = stored(1 / where(near, 1.0 + 0.0 * determinant, determinant))
    X = (t.zeta * sines - times_i(t.eta) * cosines) * inverse
    Y = (t.zeta * cosines + times_i(t.eta) * t.Q * sines) * inverse
    shape = jnp.broadcast_shapes(jnp.shape(near), jnp.shape(real(X)))
    X, Y, near = _broadcast(X, shape), _broadcast(Y, shape), xp.broadcast_to(near, shape)

    def by_differences(_: Any) -> tuple[Number, Number]:
        new_X, new_Y = (_broadcast(new, shape) for new in _differences(t, k, growth))
        return where(near, new_X, X), where(near, new_Y, Y)

    X, Y = cond(xp.any(near), by_differences, lambda _: (X, Y), None)
    X, Y, V = stored((X, Y, t.gamma * f_e - t.Q * X))

    isotropic = times_i(-f)
    ordinary_p = isotropic * (t.Q / t.epsilon), isotropic * t.epsilon
    ordinary_s = isotropic, isotropic * t.Q
    lower = x * (t.Q / t.epsilon)

    def apply(fields: Fields) -> Fields:
        Ex, Hy, Ey, Hx = fields
        along, slope = stored((x * Ex + t.tilt * Hy + y * Ey, t.across * Ex + lower * Hy + y * Hx))
        into_b, into_d = stored((times_i(-(V * along)) - Y * slope, times_i(X * slope) - Y * along))
        return (
            c * Ex + ordinary_p[0] * Hy + t.tilt * into_b + lower * into_d,
            c * Hy + ordinary_p[1] * Ex + x * into_b + t.across * into_d,
            c * Ey + ordinary_s[0] * Hx + y * into_d,
            c * Hx + ordinary_s[1] * Ey + y * into_b,
        )

    return Propagation(apply, growth)


def _broadcast(number: Number, shape: Any) -> Pair:
    xp = namespace(number)
    return Pair(xp.broadcast_to(real(number), shape), xp.broadcast_to(imag(number), shape))


def _differences(t: Terms, k: Any, growth: Any) -> tuple[Number, Number]:
    """Return γX and γX′ times exp(−growth) as sums of sin u/u, with roots that are not near zero."""
    q, w, mu = nonzero_root(full(t.Q)), nonzero_root(full(t.W)), full(t.mu)
    one = stacked(q, q, -q, -q, like=growth)
    other = stacked(mu + w, mu - w, mu + w, mu - w, like=growth)
    one, other = stored((one, other))
    first, second, third, fourth = unstacked(_exponential_difference(one, other, k, growth), 4)
    X = (first - second - third + fourth) * (-0.25 * t.gamma / (q * w))
    return X, times_i((first - second + third - fourth) * (0.25 * t.gamma / w))


def _exponential_difference(one: Number, other: Number, k: Any, growth: Any) -> Number:
    """Return (e^{−ik·one} − e^{−ik·other})/(i (other − one)) times exp(−growth)."""
    difference = other - one
    half = 0.5 * k * difference
    near = stop_gradient(abs2(half) < 1.0)
    small, far = where(near, half, 0.0 * half), where(near, 1.0 + 0.0 * difference, difference)
    square, series = stored(small * small), Pair(1.0, 0.0)
    for n in range(9, 0, -1):
        series = 1 - square * series * (1 / (2 * n * (2 * n + 1)))
    exponents = times_i(-k * stacked(0.5 * (one + other), one, other)) - growth
    middle, of_one, of_other = unstacked(stored(exp(stored(exponents))), 3)
    close, apart = middle * series * k, (of_one - of_other) / times_i(far)
    return stored(where(near, close, apart))
