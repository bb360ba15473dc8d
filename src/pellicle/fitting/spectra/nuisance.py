"""Scale and offset: linear nuisances, solved exactly inside each evaluation (variable projection).

The data are modelled as y = g(λ) f(λ) + o(λ), with f the simulated signal and g and o numbers or
Chebyshev series in wavelength with Gaussian priors. Their least-squares values follow from a small
linear system; what they cost in evidence is a log-determinant (marginal likelihood of a linear
Gaussian model: Bishop 2006, section 3.5). Physical signs: o ≥ 0 is imposed, g > 0 is required.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from math import comb
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import cho_factor, cho_solve
from jaxtyping import ScalarLike

from pellicle.fitting.coordinates import Array
from pellicle.optics.layout import stack_rows
from pellicle.scene.instrument import Drift, Instrument

_LOOSE = 10.0
"""Prior standard deviation of a single free number, in units of its expected size: next to no prior."""
_STIFF = 1e8
"""Weight that holds an offset at zero where it would turn negative."""
_SLACK = 1e-6
"""Tolerance below zero, in units of the signal's level, of an offset fixed at zero."""


class Data(NamedTuple):
    """A spectrum as the fit sees it, padded to a round length with points of zero weight."""

    values: Array
    weight: Array  # 1/σ, 0 for padding
    position: Array  # wavelength mapped to −1..1
    independent_fraction: Array | np.floating  # effective points per point: correlated errors count less
    level: Array | np.floating  # median of the values: the size an offset is measured in
    frame: Array | None = None  # of N, C, S at each point, where Ψ and Δ have errors of their own


@dataclass(frozen=True)
class Coefficient:
    """One coefficient of the scale or the offset, in physical units."""

    name: str
    value: float
    basis: np.ndarray  # what it multiplies at each point
    prior_sd: float
    on_signal: bool
    not_negative: bool  # one number that cannot be below zero


class Solved(NamedTuple):
    """The nuisances solved for one simulated signal."""

    model: Array  # g f + o at every point
    residual: Array  # weighted, tempered, with a row for each prior
    gain: Array  # g at every point
    offset: Array  # o at every point
    deviance: Array  # −2 ln of the marginal likelihood, up to a constant


def chebyshev(position, degree: int) -> list:
    """T₀ ... T_degree at `position` in −1..1."""
    terms = [jnp.ones_like(position), position]
    while len(terms) <= degree:
        terms.append(2 * position * terms[-1] - terms[-2])
    return terms[: degree + 1]


def solve(signal, data: Data, instrument: Instrument) -> Solved:
    """The best scale and offset for a simulated signal, and the deviance."""
    weight = data.weight * jnp.sqrt(data.independent_fraction)
    square, one = weight * weight, jnp.ones_like(signal)
    # the plain scale, which a single free number would have
    plain = jnp.sum(square * data.values * signal) / (jnp.sum(square * signal * signal) + 1e-30)
    gains = _series(instrument.scale, scale_prior, plain, data)
    shifts = _series(instrument.offset, offset_prior, data.level, data)
    known = gains.known * signal + shifts.known * one
    columns = [*(g * signal for g in gains.basis), *shifts.basis]
    if not columns:
        residual = weight * (data.values - known)
        return Solved(known, residual, gains.known * one, shifts.known * one, jnp.sum(residual**2))
    columns, first = stack_rows(columns), len(gains.basis)
    mean, sd = np.concatenate([gains.mean, shifts.mean]), np.concatenate([gains.sd, shifts.sd])
    weighted = columns * weight, weight * (data.values - known)
    coefficients, log_determinant = _project(*weighted, mean, sd, len(shifts.basis))
    model = known + coefficients @ columns
    residual = jnp.concatenate([weight * (data.values - model), (coefficients - mean) / sd])
    gain = coefficients[:first] @ jnp.stack(gains.basis) if gains.basis else gains.known * one
    shift = coefficients[first:] @ jnp.stack(shifts.basis) if shifts.basis else shifts.known * one
    negative = jnp.where(jnp.min(jnp.where(weight > 0, gain, jnp.inf)) > 0, 0.0, 1e9)
    return Solved(model, residual, gain, shift, log_determinant + jnp.sum(residual**2) + negative)


class _Series(NamedTuple):
    """Functions of wavelength with a normal prior on their coefficients, and the number that is `known`."""

    basis: list
    mean: np.ndarray
    sd: np.ndarray
    known: ScalarLike


def _series(
    number: ScalarLike | Drift, prior: Callable[[Drift], tuple[np.ndarray, np.ndarray]], unit: Any, data: Data
) -> _Series:
    """A nuisance as Chebyshev terms times `unit`, or as a known number without terms."""
    if not isinstance(number, Drift):
        return _Series([], np.zeros(0), np.zeros(0), number)
    return _Series([unit * t for t in chebyshev(data.position, number.degree)], *prior(number), 0.0)


def scale_prior(drift: Drift) -> tuple[np.ndarray, np.ndarray]:
    """Means and standard deviations of the gain's coefficients, in units of the plain scale."""
    first = _LOOSE if drift.degree == 0 else 1.0
    shrinking = [drift.width * 0.5**j for j in range(drift.degree)]
    return np.array([1.0] + [0.0] * drift.degree), np.array([first, *shrinking])


def offset_prior(drift: Drift) -> tuple[np.ndarray, np.ndarray]:
    """Means and standard deviations of the offset's coefficients, in units of the signal's level."""
    count = drift.degree + 1
    sd = [_LOOSE] if drift.degree == 0 else [drift.width * 0.5**j for j in range(count)]
    return np.zeros(count), np.array(sd)


def coefficients(
    data: Data, instrument: Instrument, gain: Any, offset: Any, points: int, suffix: str = ""
) -> list[Coefficient]:
    """Scale and offset as Chebyshev coefficients in wavelength, from their curves at the first `points`.

    Priors of the gain are in units of its own mean, those of the offset in units of the signal's level. The
    `suffix` ends the names of one spectrum among several.
    """
    result: list[Coefficient] = []
    position = np.asarray(data.position)[:points]
    for name, drift, prior, curve in (
        ("scale", instrument.scale, scale_prior, gain),
        ("offset", instrument.offset, offset_prior, offset),
    ):
        if not isinstance(drift, Drift):
            continue
        _, sd = prior(drift)
        degree = len(sd) - 1
        numbers = np.polynomial.chebyshev.chebfit(position, np.asarray(curve)[:points], degree)
        basis = np.polynomial.chebyshev.chebvander(position, degree).T
        prior_sd = sd * (abs(numbers[0]) if name == "scale" else float(data.level))
        not_negative = name == "offset" and degree == 0
        for j, (number, column, own_sd) in enumerate(zip(numbers.tolist(), basis, prior_sd, strict=True)):
            full = f"instrument.{name}" + (f"_{j}" if j else "") + suffix
            result.append(Coefficient(full, number, column, own_sd, name == "scale", not_negative))
    return result


def _project(rows, values, mean: np.ndarray, sd: np.ndarray, offsets: int):
    """Coefficients of the weighted rows under their prior, of which the last `offsets` are those of the
    offset, and the deviance's log-determinant."""
    precision = np.diag(1 / sd**2)
    matrix = rows @ rows.T + precision
    target = rows @ values + precision @ mean
    stiffness = _stiffness(*jax.lax.stop_gradient((matrix, target)), offsets)
    factor = cho_factor(jax.lax.stop_gradient(matrix) + stiffness)
    coefficients = cho_solve(factor, jax.lax.stop_gradient(target))
    # adds nothing, but carries the implicit derivative A⁻¹(db − dA x): no factorisation is differentiated
    coefficients = coefficients + cho_solve(factor, target - (matrix + stiffness) @ coefficients)
    _, log_determinant = jnp.linalg.slogdet(matrix)
    return coefficients, log_determinant + 2 * float(np.sum(np.log(sd)))


def _stiffness(matrix, target, count: int):
    """Matrix to add so that the offset's solution is nowhere negative.

    The offset, the last `count` coefficients, is kept nonnegative through its Bernstein coefficients
    (enough, and for so low a degree little more than needed). There are few of them, so every set that could
    be zero is tried and the best feasible one is the exact solution of this convex problem: it moves
    continuously with the data, as a solver needs. Which set it is counts as a constant.
    """
    if not count:
        return jnp.zeros_like(matrix)
    degree, points = count - 1, np.linspace(0.0, 1.0, count)
    values = [[comb(degree, i) * t**i * (1 - t) ** (degree - i) for i in range(count)] for t in points]
    # from Chebyshev coefficients on −1..1 to Bernstein coefficients of the same degree
    bernstein = np.linalg.solve(values, np.polynomial.chebyshev.chebvander(2 * points - 1, degree))
    rows = jnp.zeros((count, matrix.shape[0])).at[:, -count:].set(bernstein)
    zero = np.array(list(itertools.product((0.0, 1.0), repeat=count)))
    stiff = _STIFF * jnp.trace(matrix) * jnp.einsum("si,ip,iq->spq", zero, rows, rows)

    def trial(stiffness):
        coefficients = cho_solve(cho_factor(matrix + stiffness), target)
        feasible = jnp.all(rows @ coefficients >= -_SLACK)
        return jnp.where(
            feasible, coefficients @ (matrix @ coefficients) - 2 * target @ coefficients, jnp.inf
        )

    return stiff[jnp.argmin(jax.vmap(trial)(stiff))]
