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

from pellicle.optics.layout import stack_rows
from pellicle.scene.instrument import Drift, Instrument

_LOOSE = 10.0
"""Prior standard deviation of a single free number, in units of its expected size: next to no prior."""
_STIFF = 1e8
"""Weight that holds an offset at zero where it would turn negative."""
_SLACK = 1e-6
"""How far below zero, in units of the signal's level, an offset held at zero may come out."""


class Data(NamedTuple):
    """A spectrum as the fit sees it, padded to a round length with points of zero weight."""

    values: Any
    weight: Any  # 1/σ, 0 for padding
    position: Any  # wavelength mapped to −1..1
    independent_fraction: Any  # effective points per point: correlated errors count less
    level: Any  # median of the values: the size an offset is measured in
    frame: Any = None  # of N, C, S at each point, where Ψ and Δ have errors of their own


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

    model: Any  # g f + o at every point
    residual: Any  # weighted, tempered, with a row for each prior
    gain: Any  # g at every point
    offset: Any  # o at every point
    deviance: Any  # −2 ln of the marginal likelihood, up to a constant


def chebyshev(position, degree: int) -> list:
    """T₀ ... T_degree at `position` in −1..1."""
    terms = [jnp.ones_like(position), position]
    while len(terms) <= degree:
        terms.append(2 * position * terms[-1] - terms[-2])
    return terms[: degree + 1]


def solve(signal, data: Data, instrument: Instrument) -> Solved:
    """The best scale and offset for a simulated signal, and the deviance."""
    weight = data.weight * jnp.sqrt(data.independent_fraction)
    gains, scale = _split(instrument.scale, lambda drift: _gains(signal, weight, data, drift))
    shifts, offset = _split(instrument.offset, lambda drift: _shifts(data, drift))
    one = jnp.ones_like(signal)
    known = scale * signal + offset * one
    columns = [g * signal for g in gains.basis] if gains else []
    columns = stack_rows([*columns, *(shifts.basis if shifts else [])]) if gains or shifts else None
    if columns is None:
        residual = weight * (data.values - known)
        return Solved(known, residual, scale * one, offset * one, jnp.sum(residual**2))
    prior = _join(gains, shifts)
    coefficients, deviance = _project(columns * weight, weight * (data.values - known), prior, shifts)
    first = len(gains.basis) if gains else 0
    model = known + coefficients @ columns
    residual = jnp.concatenate([weight * (data.values - model), (coefficients - prior.mean) / prior.sd])
    gain = coefficients[:first] @ jnp.stack(gains.basis) if gains else scale * one
    shift = coefficients[first:] @ jnp.stack(shifts.basis) if shifts else offset * one
    deviance = deviance + jnp.sum(residual**2) + _penalty(gain, weight)
    return Solved(model, residual, gain, shift, deviance)


class _Series(NamedTuple):
    """Functions of wavelength with a normal prior on their coefficients."""

    basis: list
    mean: np.ndarray
    sd: np.ndarray


def _split(given: ScalarLike | Drift, series: Callable[[Drift], _Series]) -> tuple[_Series | None, Any]:
    """A nuisance as a series to solve for and 0, or as no series and a known number."""
    return (series(given), 0.0) if isinstance(given, Drift) else (None, given)


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


def _gains(signal, weight, data: Data, drift: Drift) -> _Series:
    """Chebyshev terms in units of the plain scale, which a single free number would have."""
    square = weight * weight
    plain = jnp.sum(square * data.values * signal) / (jnp.sum(square * signal * signal) + 1e-30)
    return _Series([plain * t for t in chebyshev(data.position, drift.degree)], *scale_prior(drift))


def _shifts(data: Data, drift: Drift) -> _Series:
    """Chebyshev terms in units of the signal's level."""
    return _Series([data.level * t for t in chebyshev(data.position, drift.degree)], *offset_prior(drift))


def _join(*series: _Series | None) -> _Series:
    present = [s for s in series if s]
    return _Series([], np.concatenate([s.mean for s in present]), np.concatenate([s.sd for s in present]))


def _project(rows, values, prior: _Series, shifts: _Series | None):
    """Coefficients of the weighted rows under their prior, and the deviance's log-determinant."""
    precision = np.diag(1 / prior.sd**2)
    matrix = rows @ rows.T + precision
    target = rows @ values + precision @ prior.mean
    stiffness = _stiffness(*jax.lax.stop_gradient((matrix, target)), shifts)
    factor = cho_factor(jax.lax.stop_gradient(matrix) + stiffness)
    coefficients = cho_solve(factor, jax.lax.stop_gradient(target))
    # adds nothing, but carries the implicit derivative A⁻¹(db − dA x): no factorisation is differentiated
    coefficients = coefficients + cho_solve(factor, target - (matrix + stiffness) @ coefficients)
    _, log_determinant = jnp.linalg.slogdet(matrix)
    return coefficients, log_determinant + 2 * float(np.sum(np.log(prior.sd)))


def _stiffness(matrix, target, shifts: _Series | None):
    """Matrix to add so that the offset's solution is nowhere negative.

    The offset is zero nonnegative through its Bernstein coefficients (enough, and for so low a degree
    little more than needed). There are few of them, so every set that could be zero is tried and the
    best feasible one is the exact solution of this convex problem: it moves continuously with the
    data, as a solver needs. Which set it is counts as a constant.
    """
    if shifts is None:
        return jnp.zeros_like(matrix)
    count = len(shifts.basis)
    bernstein = _to_bernstein(count)
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


def _to_bernstein(count: int) -> np.ndarray:
    """Matrix from Chebyshev coefficients on −1..1 to Bernstein coefficients of the same degree."""
    degree, points = count - 1, np.linspace(0.0, 1.0, count)
    values = np.array(
        [[comb(degree, i) * t**i * (1 - t) ** (degree - i) for i in range(count)] for t in points]
    )
    return np.linalg.solve(values, np.polynomial.chebyshev.chebvander(2 * points - 1, degree))


def _penalty(gain, weight):
    """Penalty that rules out a gain below zero."""
    return jnp.where(jnp.min(jnp.where(weight > 0, gain, jnp.inf)) > 0, 0.0, 1e9)
