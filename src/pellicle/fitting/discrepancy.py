"""Discrepancy between a model and data: what systematic effects and correlated residuals add to the errors.

A scene leaves out what it does not know: wavelengths a little off, an index that is not quite the table's.
Each such effect has a standard uncertainty; its change of the signal is a further column of the linearised
fit, with a normal prior. Generalised least squares with these columns, and with the noise enlarged to what
remains (R. Birge, 1932, Phys. Rev. 40, 207) times its correlation length, give the parameters that the data
would have with the effects allowed for, and their covariance. The fit keeps its own values: their error
includes the distance to those.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pellicle.fitting.covariance import Errors, Scaled
from pellicle.fitting.robust_losses import spread

HALF_NORMAL = math.sqrt(3)
"""Root mean square of σ² where σ has a half-normal prior, in units of the square of its scale: 3^½."""
_ROUNDS = 4
OUTLIER = 4.0
"""Residuals beyond this many standard deviations of their bulk count less (Huber's loss)."""
_APART = 10.0
"""Ratio of the residuals of one channel to those of all beyond which the whole channel is wrong."""
_SMOOTH = 2.5
"""Ratio to the noise of neighbouring points above which its residuals are no noise, as in `misfit`."""
_SCATTER = 2.0
"""Standard deviations within which the size and correlation of residuals are those of noise."""
_WINDOW = 5.0
"""Points over which the correlation of noise is summed (A. Sokal, 1997: see `noise.integrated_time`)."""
_CHANCE_QUANTILE = 3.0902
"""Normal quantile of the probability, 1e-3, of effects as large together as those that are implausible."""


@dataclass(frozen=True, eq=False)
class Effect:
    """A systematic effect: its standard uncertainty, and the change of the data values by it.

    `change` is (rows, channels), in the unit of the data. With `power` 2 the signal depends on the square of
    the size, as on a width: `change` is that by `HALF_NORMAL` times the square of `size`. Such effects, and
    those with `positive`, cannot be below zero. Effects of the sample are `shared` by all its data.
    `material` marks the index of a medium, which another material changes by far more than its uncertainty.
    """

    name: str
    size: float
    unit: str
    change: np.ndarray
    power: int = 1
    positive: bool = False
    shared: bool = True
    material: bool = False

    def amount(self, coefficient: float) -> float:
        """The size of the effect at a coefficient of its change."""
        if self.power == 1:
            return self.size * coefficient
        return self.size * math.copysign(math.sqrt(HALF_NORMAL * abs(coefficient)), coefficient)


class Evidence(NamedTuple):
    """Residuals of one view at the best fit, and what may explain them.

    `residual` (rows, channels), the changes of the `effects` and `jacobian` (rows, channels, columns) are in
    the unit of the data. The columns are the problem's parameters and nuisances, in the steps of `Scaled`.
    `sigma` (rows, channels) is the σ of the points, `noise` what neighbouring points show of it; `weights`
    (rows, channels) are those of the residuals in the likelihood of the fit. `correlation` returns the number
    of points that count as one; `least` is the least factor on σ² that stands for it. `uncertain` is the
    relative standard error of σ² where it is estimated. `signals` are the channels of each signal that is
    judged by itself, empty where all are one.
    """

    residual: np.ndarray
    jacobian: np.ndarray
    sigma: np.ndarray
    noise: float
    weights: np.ndarray
    effects: Sequence[Effect]
    correlation: Callable[[np.ndarray], float]
    least: float = 1.0
    uncertain: float = 0.0
    signals: tuple[tuple[int, ...], ...] = ()


class Remaining(NamedTuple):
    """Residuals of one view that no effect explains.

    `typical` is their size in the unit of the data, of most points, and `ratio` that to the noise of
    neighbouring points; `weighted` is their root mean square in units of the σ of the points. `variance` is
    the factor on σ² that stands for them and for their correlation.
    """

    ratio: Any
    typical: Any
    weighted: Any
    variance: Any


class Contribution(NamedTuple):
    """One effect of a discrepancy.

    `changes` are those of the fitted parameters by one standard uncertainty. `amount` is the size at which
    the effect explains the residuals best, with the others at their own. `explains` is the share of the sum
    of squares that the effect alone takes from the residuals, whatever its size, `alone` the size that it
    then has, and `shift` what that adds to the parameters.
    """

    effect: Effect
    changes: np.ndarray
    amount: float
    explains: float
    alone: float
    shift: np.ndarray


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """Errors with the effects allowed for.

    `errors` are those of parameters and nuisances about the values that the effects would give, which are
    `shift` away from those of the fit. `implausible` is true where the effects would have to be larger
    together than they are. `evidence_shares` are the shares of a difference in χ² of each view, as the fit
    counts points, that are left when residuals count as what they are; `evidence_share` is their mean.
    """

    errors: Errors
    shift: np.ndarray
    remaining: tuple[Remaining, ...]
    contributions: tuple[Contribution, ...]
    implausible: bool
    evidence_shares: tuple[float, ...]
    evidence_share: float

    @property
    def variance(self) -> np.ndarray:
        """Mean square error of the fit's own parameters and nuisances."""
        return np.diag(self.errors.covariance) + self.shift**2


def discrepancy(evidence: Sequence[Evidence], scaled: Scaled, unit: np.ndarray) -> Discrepancy:
    """The discrepancy of a fit at `unit` (parameters,) of the unit cube, which no parameter leaves.

    `scaled` has the units of the columns and their priors.
    """
    system = _System(evidence, scaled, unit)
    state = _balanced(system, evidence)
    covariance = system.covariance(state.reduced)
    known, stretch, solution = len(scaled.names), scaled.stretch, system.solved(state.reduced)
    remaining = []
    for view, own, size in zip(evidence, system.residuals(solution), state.variance, strict=True):
        # a signal of its own, such as one ratio, is not diluted by others that the scene has right
        each = [own[:, list(group)] for group in view.signals] or [own]
        sigmas = [view.sigma[:, list(group)] for group in view.signals] or [view.sigma]
        typical = max(float(bulk(x * sigma, view.noise)) for x, sigma in zip(each, sigmas, strict=True))
        weighted = max(math.sqrt(np.mean((_weights(x) * x) ** 2)) for x in each)
        remaining.append(Remaining(typical / view.noise, typical, weighted, size))
    sizes, shares = solution[known:], _evidence_shares(evidence, state.variance)
    # the σ of a drifting lamp would hide what an effect explains
    judged = [view._replace(sigma=np.full(view.sigma.shape, view.noise), least=1.0) for view in evidence]
    other = _System(judged, scaled, unit)
    by_noise = _balanced(other, judged)

    def row(which: int, effect: Effect, size: float) -> Contribution:
        changes = stretch @ system.response(which, state.reduced)
        return Contribution(effect, changes, effect.amount(size), *other.alone(which, by_noise.reduced))

    return Discrepancy(
        errors=Errors(scaled.names, stretch @ covariance[:known, :known] @ stretch.T),
        shift=stretch @ solution[:known],
        remaining=tuple(remaining),
        contributions=tuple(
            row(i, effect, size)
            for i, (effect, size) in enumerate(zip(system.effects, sizes.tolist(), strict=True))
        ),
        implausible=bool(len(sizes) and np.sum(sizes**2) > improbable(len(sizes))),
        evidence_shares=shares,
        evidence_share=float(np.average(shares, weights=[view.residual.size for view in evidence])),
    )


class _Reduced(NamedTuple):
    """Weighted rows and data of all views as a triangle of the same sums of squares, of as few rows as
    columns."""

    rows: np.ndarray
    data: np.ndarray


class _Balance(NamedTuple):
    """Factors on the σ² of each view, square roots of the weights of its points, and the rows with them."""

    variance: list[float]
    robust: list[np.ndarray]
    reduced: _Reduced


def _balanced(system: _System, evidence: Sequence[Evidence]) -> _Balance:
    """Factors and weights that stand for the residuals which they leave."""
    variance = [max(1.0, view.least) for view in evidence]
    robust = [np.ones(view.residual.shape) for view in evidence]
    reduced = system.reduced(variance, robust)
    for _ in range(_ROUNDS):
        rest = system.residuals(system.solved(reduced))
        robust = [_weights(view) for view in rest]
        used = system.used(reduced, variance, robust)
        variance = [_variance(*row) for row in zip(evidence, rest, robust, used, strict=True)]
        reduced = system.reduced(variance, robust)
    return _Balance(variance, robust, reduced)


def bulk(residual: np.ndarray, noise: Any) -> Any:
    """Size (...) of most residuals (..., rows, channels), or of a channel that is wrong as a whole.

    A third of all residuals are those of C alone where 180 - Δ stands for Δ: they are no outliers. `noise`
    (...) is the root mean square of that of the channels.
    """
    size, channels = spread(residual, (-2, -1)), residual.shape[-1]
    if channels == 1:
        return size
    each = spread(residual, -2)
    least = np.maximum(_APART * size, _SMOOTH * math.sqrt(channels) * np.asarray(noise))[..., None]
    return np.maximum(size, np.max(np.where(each > least, each, 0.0), axis=-1))


def _evidence_shares(evidence: Sequence[Evidence], variance: Sequence[float]) -> tuple[float, ...]:
    """Variance of a point by which the fit counted it, over that which stands for it now; at most 1."""
    now = [own * np.median(view.sigma) ** 2 for view, own in zip(evidence, variance, strict=True)]
    counted = [np.median(1 / view.weights) ** 2 for view in evidence]
    return tuple(float(min(1.0, one / own)) for one, own in zip(counted, now, strict=True))


def huber_roots(residual: np.ndarray, size: Any) -> np.ndarray:
    """Square roots of Huber's weights of residuals (..., rows, channels), of a bulk of this `size` (...)."""
    far = (OUTLIER * np.maximum(size, 1.0))[..., None, None]
    return np.sqrt(np.minimum(1.0, far / np.maximum(np.abs(residual), 1e-300)))


def _weights(residual: np.ndarray) -> np.ndarray:
    """Square roots of Huber's weights."""
    return huber_roots(residual, spread(residual))


def _variance(view: Evidence, residual: np.ndarray, weight: np.ndarray, used: float) -> float:
    """Factor on σ² of one view for what remains."""
    return float(reduced_variance(weight * residual, used, view.correlation, view.least, view.uncertain))


def reduced_variance(
    rest: np.ndarray, used: Any, correlation: Callable[[np.ndarray], Any], least: float, uncertain: float
) -> Any:
    """Factor on σ² (...) for the size and correlation of what remains (..., rows, channels), where that is no
    noise by chance; `used` degrees of freedom are those of the fit."""
    freedom = np.maximum(rest.shape[-2] * rest.shape[-1] - used, 1.0)
    reduced = np.sum(rest**2, axis=(-2, -1)) / freedom
    # only what remains is correlated: of a σ that allows for a lamp it may be a tenth
    factor = np.maximum(reduced * correlation(rest), np.maximum(1.0, reduced) * least)
    of_length = np.sqrt(2 * (2 * _WINDOW + 1) / freedom)  # standard error of the correlation length: ibid.
    by_chance = 1 + _SCATTER * np.sqrt(2 / freedom + of_length**2 + uncertain**2)
    return np.where(factor > by_chance, factor, 1.0)


class _System:
    """The linearised fit with its effects: columns of parameters, nuisances and effects, rows of all views
    and of the priors, in units of the noise."""

    def __init__(self, evidence: Sequence[Evidence], scaled: Scaled, unit: np.ndarray):
        self.names = dict.fromkeys(
            (effect.name, None if effect.shared else i)
            for i, view in enumerate(evidence)
            for effect in view.effects
        )
        order = {name: len(scaled.names) + i for i, name in enumerate(self.names)}
        self.effects: list[Effect] = [None] * len(order)  # type: ignore[list-item]
        self.known, self.stretch = len(scaled.names), scaled.stretch
        # a drift stays where the fit has it: its prior would pull it as soon as residuals count less
        self.pull = np.where(np.arange(self.known) < len(unit), scaled.pull, 0.0)
        self.blocks, self.data, self.shapes = [], [], []
        for i, view in enumerate(evidence):
            block = np.zeros((view.residual.size, self.known + len(order)))
            inverse = 1 / view.sigma.ravel()
            block[:, : self.known] = view.jacobian.reshape(-1, self.known) * inverse[:, None]
            for effect in view.effects:
                column = order[effect.name, None if effect.shared else i]
                block[:, column] = effect.change.ravel() * inverse
                self.effects[column - self.known] = effect
            self.blocks.append(block)
            self.data.append(view.residual.ravel() * inverse)
            self.shapes.append(view.residual.shape)
        self.priors = np.zeros((self.known + len(order),) * 2)
        rows = scaled.jacobian[-self.known :]
        self.priors[: self.known, : self.known] = rows
        self.priors[self.known :, self.known :] = np.eye(len(order))
        self.lower, self.upper = np.full((2, len(self.priors)), [[-np.inf], [np.inf]])
        self.lower[: len(unit)], self.upper[: len(unit)] = -unit, 1 - unit
        for i, effect in enumerate(self.effects):
            if effect.positive or effect.power == 2:
                self.lower[self.known + i] = 0.0

    def reduced(self, variance: Sequence[float], robust: Sequence[np.ndarray]) -> _Reduced:
        """Rows and data with these factors on σ² and weights."""
        scale = [weight.ravel() / math.sqrt(own) for weight, own in zip(robust, variance, strict=True)]
        pairs = zip(self.blocks, self.data, scale, strict=True)
        every = np.vstack([np.column_stack([block, data]) * own[:, None] for block, data, own in pairs])
        triangle: Any = np.linalg.qr(every, mode="r")
        return _Reduced(triangle[:, :-1], triangle[:, -1])

    def solved(self, reduced: _Reduced) -> np.ndarray:
        """Least-squares coefficients, those of positive effects not below zero."""
        prior_data = np.zeros(len(self.priors))
        prior_data[: self.known] -= self.pull
        return _least_squares(*reduced, self.priors, (self.lower, self.upper), prior_data)

    def residuals(self, solution: np.ndarray) -> list[np.ndarray]:
        """Residuals of each view after a solution, in units of its noise."""
        pairs = zip(self.blocks, self.data, self.shapes, strict=True)
        return [(data - block @ solution).reshape(shape) for block, data, shape in pairs]

    def covariance(self, reduced: _Reduced) -> np.ndarray:
        """Covariance of all coefficients, by singular values: see `covariance.errors`."""
        _, values, directions = np.linalg.svd(np.vstack([reduced.rows, self.priors]), full_matrices=False)
        points = sum(len(data) for data in self.data)
        floor = np.finfo(float).eps * points * max(values.max(initial=0.0), 1e-100)
        half = directions.T / np.maximum(values, floor)
        return half @ half.T

    def used(self, reduced: _Reduced, variance: Sequence[float], robust: Sequence[np.ndarray]) -> list[float]:
        """Degrees of freedom that the coefficients take from each view: the trace of its hat matrix."""
        covariance = self.covariance(reduced)
        return [
            float(np.sum((block @ covariance) * block * (weight.ravel() ** 2)[:, None])) / own
            for block, weight, own in zip(self.blocks, robust, variance, strict=True)
        ]

    def response(self, which: int, reduced: _Reduced) -> np.ndarray:
        """Change of the parameters by one standard uncertainty of an effect that nobody allows for."""
        own, rows = np.arange(self.known), reduced.rows
        return _least_squares(rows[:, own], -rows[:, self.known + which], self.priors[np.ix_(own, own)])

    def alone(self, which: int, reduced: _Reduced) -> tuple[float, float, np.ndarray]:
        """Share of the residuals that one effect explains without the others, its size, and the shift of the
        parameters by it."""
        rows, data = reduced
        own, both = np.arange(self.known), np.append(np.arange(self.known), self.known + which)
        prior_data = np.append(np.zeros(self.known) - self.pull, 0.0)
        best = _least_squares(rows[:, own], data, self.priors[np.ix_(own, own)], None, prior_data[:-1])
        before = float(np.sum((data - rows[:, own] @ best) ** 2))
        free = self.priors[np.ix_(both, both)].copy()
        free[-1, -1] = 1e-6  # whatever its size
        bounds = self.lower[both], self.upper[both]
        solution = _least_squares(rows[:, both], data, free, bounds, prior_data)
        after = float(np.sum((data - rows[:, both] @ solution) ** 2))
        size = self.effects[which].amount(float(solution[-1]))
        return 1 - after / max(before, 1e-300), size, self.stretch @ (solution[:-1] - best)


def _least_squares(
    rows: np.ndarray,
    data: np.ndarray,
    priors: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray] | None = None,
    prior_data: np.ndarray | None = None,
) -> np.ndarray:
    """Coefficients of least squares with prior rows, zeros or `prior_data`; those that would leave their
    bounds stay on them.

    None of these is let go again, which a solver such as SciPy's would do: it takes 0.25 s to import.
    """
    matrix = np.vstack([rows, priors])
    right = np.concatenate([data, np.zeros(len(priors)) if prior_data is None else prior_data])
    solution: np.ndarray = np.linalg.lstsq(matrix, right, rcond=None)[0]
    if bounds is None:
        return solution
    free = np.ones(len(solution), bool)
    while np.any(outside := free & ((solution < bounds[0]) | (solution > bounds[1]))):
        free &= ~outside
        solution = np.clip(solution, *bounds)
        rest = right - matrix[:, ~free] @ solution[~free]
        solution[free] = np.linalg.lstsq(matrix[:, free], rest, rcond=None)[0]
    return solution


def improbable(count: int) -> float:
    """χ² of `count` degrees of freedom that is exceeded with a probability of 1e-3 (E. Wilson and M.
    Hilferty, 1931, Proc. Natl. Acad. Sci. 17, 684)."""
    spread_of_cube_root = 2 / (9 * max(count, 1))
    return count * (1 - spread_of_cube_root + _CHANCE_QUANTILE * math.sqrt(spread_of_cube_root)) ** 3
