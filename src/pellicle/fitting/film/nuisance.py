"""Scale and offset: linear nuisances, solved exactly inside each evaluation (variable projection).

The data are modelled as y = g(λ) f(λ) + o(λ), with f the simulated signal and g and o numbers or
Chebyshev series in wavelength with Gaussian priors. Their least-squares values follow from a small
linear system; what they cost in evidence is a log-determinant (marginal likelihood of a linear
Gaussian model: Bishop 2006, section 3.5). Physical signs are imposed: g ≥ 0 and o ≥ 0.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import ScalarLike

from pellicle.fitting.coordinates import Array
from pellicle.fitting.normal_equations import times
from pellicle.fitting.positive_definite import nonnegative
from pellicle.optics.pair import namespace, stop_gradient
from pellicle.scene.free import remembered
from pellicle.scene.instrument import Drift, Instrument

_LOOSE = 10.0
"""Prior standard deviation of a single free number, in units of its expected size: next to no prior."""
_SLACK = 1e-6
"""Tolerance below zero of a scale or an offset that is not held there, in units of its size."""


class Data(NamedTuple):
    """A spectrum as the fit sees it, padded to a round length with points of zero weight.

    Those of many spectra have leading axes; they may share the positions.
    """

    values: Array
    weight: Array  # 1/σ, 0 for padding
    position: Array  # wavelength mapped to −1..1
    independent_fraction: Array | np.floating  # effective points per point: correlated errors count less
    level: Array | np.floating  # median of the values: the size an offset is measured in
    frame: Array | None = None  # of N, C, S at each point, where Ψ and Δ have errors of their own


@dataclass(frozen=True)
class Coefficient:
    """One coefficient of the scale or the offset, in physical units; of many spectra arrays (...)."""

    name: str
    value: Any
    basis: np.ndarray  # what it multiplies at each point
    prior_sd: Any
    on_signal: bool
    not_negative: bool  # one number that cannot be below zero

    @property
    def pull(self) -> Any:
        """Distance (...) from the mean of its prior, in standard deviations of that."""
        # the mean of a plain scale is the scale itself
        plain = self.on_signal and bool(np.all(self.basis == 1))
        return 0.0 if plain else self.value / self.prior_sd


class Solved(NamedTuple):
    """The nuisances solved for one simulated signal."""

    model: Array  # g f + o at every point
    residual: Array  # weighted, tempered, with a row for each prior
    gain: Array  # g at every point
    offset: Array  # o at every point
    deviance: Array  # −2 ln of the marginal likelihood, up to a constant


def chebyshev(position, degree: int) -> list:
    """T₀ ... T_degree at `position` in −1..1."""
    terms = [namespace(position).ones_like(position), position]
    while len(terms) <= degree:
        terms.append(2 * position * terms[-1] - terms[-2])
    return terms[: degree + 1]


def solve(signal, data: Data, instrument: Instrument) -> Solved:
    """The best scale and offset for a simulated signal, and the deviance.

    Signals (..., points) of NumPy or of JAX may have leading axes.
    """
    xp = namespace(signal)
    weight = data.weight * xp.sqrt(data.independent_fraction)
    gains, shifts = (
        _series(instrument.scale, scale_prior, data),
        _series(instrument.offset, offset_prior, data),
    )
    first = len(gains.mean)
    one = xp.ones_like(signal)
    known = gains.known * signal + shifts.known * one
    rest = data.values - known
    if not first and not len(shifts.mean):
        residual = weight * rest
        return Solved(known, residual, gains.known * one, shifts.known * one, (residual**2).sum(axis=-1))
    # sums over the points are products with terms and pairs of them that all candidates share
    square = weight * weight
    on_signal = square * signal
    gram = _in_blocks(
        _sums(on_signal * signal, gains.terms, gains.terms),
        _sums(on_signal, gains.terms, shifts.terms),
        _sums(square * one, shifts.terms, shifts.terms),
    )
    projected = xp.concatenate([(on_signal * rest) @ gains.terms.T, (square * rest) @ shifts.terms.T], -1)
    # the plain scale, which a single free number would have
    plain = xp.sum(on_signal * data.values, axis=-1) / (xp.sum(on_signal * signal, axis=-1) + 1e-30)
    sizes = xp.stack(xp.broadcast_arrays(plain, data.level), axis=-1)
    unit = sizes.repeat(np.array([first, len(shifts.mean)]), axis=-1)
    mean, sd = np.concatenate([gains.mean, shifts.mean]), np.concatenate([gains.sd, shifts.sd])
    coefficients, log_determinant = _project(
        gram * unit[..., None] * unit[..., None, :], projected * unit, mean, sd, (first, len(shifts.mean))
    )
    in_units = coefficients * unit
    gain = gains.known + in_units[..., :first] @ gains.terms
    shift = shifts.known + in_units[..., first:] @ shifts.terms
    model = gain * signal + shift
    residual = xp.concatenate([weight * (data.values - model), (coefficients - mean) / sd], axis=-1)
    return Solved(model, residual, gain, shift, log_determinant + xp.sum(residual**2, axis=-1))


def _sums(weight, left, right):
    """Σ weight · left · right over the points (..., points), for all terms (terms, points) of both sides."""
    pairs = (left[:, None] * right).reshape(-1, left.shape[-1])
    return (weight @ pairs.T).reshape(*weight.shape[:-1], len(left), len(right))


def _in_blocks(upper, across, lower):
    """The symmetric matrix (..., n, n) of two blocks on its diagonal and that to the right of the first."""
    xp = namespace(across)
    rows = xp.concatenate([upper, across], -1), xp.concatenate([across.swapaxes(-1, -2), lower], -1)
    return xp.concatenate(rows, -2)


class _Series(NamedTuple):
    """Functions of wavelength with a normal prior on their coefficients, and the number that is `known`."""

    terms: Array  # (terms, points)
    mean: np.ndarray
    sd: np.ndarray
    known: ScalarLike


def _series(
    number: ScalarLike | Drift, prior: Callable[[Drift], tuple[np.ndarray, np.ndarray]], data: Data
) -> _Series:
    """A nuisance as Chebyshev terms, or as a known number without terms."""
    if not isinstance(number, Drift):
        return _Series(np.zeros((0, np.shape(data.position)[-1])), np.zeros(0), np.zeros(0), number)
    terms = namespace(data.position).stack(chebyshev(data.position, number.degree))
    return _Series(terms, *prior(number), 0.0)


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
    """Scale and offset as Chebyshev coefficients in wavelength, from their curves (..., points) at the first
    `points`.

    Priors of the gain are in units of its own mean, those of the offset in units of the signal's level. The
    `suffix` ends the names of one spectrum among several.
    """
    result: list[Coefficient] = []
    position = np.asarray(data.position)[..., :points]
    for name, drift, prior, curve in (
        ("scale", instrument.scale, scale_prior, gain),
        ("offset", instrument.offset, offset_prior, offset),
    ):
        if not isinstance(drift, Drift):
            continue
        _, sd = prior(drift)
        degree = len(sd) - 1
        basis, inverse = _basis(position, degree)
        numbers = times(inverse, np.asarray(curve)[..., :points])
        size = np.abs(numbers[..., 0]) if name == "scale" else data.level
        not_negative = name == "offset" and degree == 0
        for j, own_sd in enumerate(sd):
            full = f"instrument.{name}" + (f"_{j}" if j else "") + suffix
            about = name == "scale", not_negative
            result.append(Coefficient(full, numbers[..., j], basis[..., j], own_sd * size, *about))
    return result


@remembered
def _basis(position: np.ndarray, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Chebyshev polynomials (..., points, degree + 1), and the inverse that takes a curve to its
    coefficients."""
    basis = np.polynomial.chebyshev.chebvander(position, degree)
    return basis, np.linalg.pinv(basis)


def _project(gram, projected, mean: np.ndarray, sd: np.ndarray, counts: tuple[int, int]):
    """Coefficients under their prior, so many of the scale and of the offset, and the deviance's
    log-determinant.

    Both curves are nowhere negative. The determinant is that of all coefficients, whether or not a curve is
    held at zero somewhere: the volume that this cuts off is left out.
    """
    matrix, target = gram + np.diag(1 / sd**2), projected + mean / sd**2
    degrees = tuple(count - 1 for count in counts if count)
    inverse, start = nonnegative_curves(stop_gradient(matrix), stop_gradient(target), degrees, _SLACK)
    # adds nothing but a rounding error, and carries the implicit derivative A⁻¹(db − dA x)
    target = target - stop_gradient(target) - times(matrix - stop_gradient(matrix), start)
    coefficients = start + times(inverse, target)
    _, log_determinant = namespace(matrix).linalg.slogdet(matrix)
    return coefficients, log_determinant + 2 * float(np.sum(np.log(sd)))


_POSITIONS = 7
_RIDGE = 1e-9
"""Added to the dual problem, as a share of its diagonal: it has more forces than coefficients."""


def nonnegative_curves(matrix, b, degrees: tuple[int, ...], slack: float):
    """Minimise ½ xᵀ `matrix` x − bᵀ x for Chebyshev coefficients x of curves that are not negative.

    A curve that bends is held at `_POSITIONS` positions from end to end. So no curve that is nowhere negative
    is excluded; between two positions a parabola may be below zero by an eighth of its coefficient of T₂.

    **Arguments:** `matrix` (..., n, n), positive definite; `b` (..., n); `degrees` of the curves, which have
    n coefficients together; `slack`, by which a curve may be negative before it is held. Arrays of NumPy or
    of JAX.

    **Returns:** the derivative of x by b (..., n, n), and x (..., n).

    **Source:** J. Nocedal and S. Wright, Numerical optimization (2006), section 16.4 (the dual problem).
    """
    # values of the curves at their positions, (positions, coefficients), as multiples of the coefficients
    own_rows, first, count = [], 0, sum(degree + 1 for degree in degrees)
    for degree in degrees:
        at = np.cos(np.linspace(0.0, np.pi, degree + 1 if degree < 2 else _POSITIONS))
        own = np.polynomial.chebyshev.chebvander(at, degree)
        own_rows.append(np.pad(own, ((0, 0), (first, count - first - degree - 1))))
        first += degree + 1
    rows = np.vstack(own_rows)
    xp = namespace(matrix)
    inverse, unbounded = nonnegative(matrix, b, np.zeros(b.shape[-1], bool), slack)
    across, values = rows @ inverse, times(rows, unbounded)
    gram = across @ rows.T
    gram = gram + _RIDGE * np.eye(len(rows)) * gram
    held = values < -slack
    missing = xp.where(held, -values, -xp.maximum(values, 0.0))
    reduced, force = nonnegative(gram, missing, np.ones(len(rows), bool), 0.0, held)
    back = across.swapaxes(-1, -2)
    return inverse - back @ reduced @ across, unbounded + times(back, force)
