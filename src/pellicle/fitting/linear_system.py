"""Linearised fits with systematic effects as further columns: one system of equations for many fits.

Factors on σ² and robust weights are balanced with the residuals that they leave.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from pellicle.fitting.covariance import Scaled
from pellicle.fitting.noise import WINDOW
from pellicle.fitting.normal_equations import Normal, held_within, times
from pellicle.fitting.robust_losses import spread

HALF_NORMAL = math.sqrt(3)
"""Root mean square of σ² where σ has a half-normal prior, in units of the square of its scale: 3^½."""


_ROUNDS, _SETTLED = 4, 1e-9
"""Rounds of the factors on σ² and the robust weights, and the relative change that ends them."""
_WHATEVER = 1e-6
"""Prior of an effect that is looked for whatever its size, in its standard uncertainties."""
OUTLIER = 4.0
"""Residuals beyond this many standard deviations of their bulk count less (Huber's loss)."""


_SCATTER = 2.0
"""Standard deviations within which the size and correlation of residuals are those of noise."""


@dataclass(frozen=True, eq=False)
class Effect:
    """A systematic effect: its standard uncertainty, and the change of the data values by it.

    `change` is (..., rows, channels), in the unit of the data. With `power` 2 the signal depends on the
    square of the size, as on a width: `change` is that by `HALF_NORMAL` times the square of `size`. Such
    effects, and those with `positive`, cannot be below zero. Effects of the sample are `shared` by all its
    data.
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

    def amount(self, coefficient: Any) -> Any:
        """The size of the effect at coefficients (...) of its change."""
        if self.power == 1:
            return self.size * coefficient
        return self.size * np.copysign(np.sqrt(HALF_NORMAL * np.abs(coefficient)), coefficient)

    @property
    def not_negative(self) -> bool:
        return self.positive or self.power == 2


class Evidence(NamedTuple):
    """Residuals of one view at the best fit, and what may explain them.

    `residual` (..., rows, channels), the changes of the `effects` and `jacobian` (..., rows, channels,
    columns) are in the unit of the data. The columns are the problem's parameters and nuisances, in the steps
    of `Scaled`. `sigma` (..., rows, channels) is the σ of the points, `noise` (...) what neighbouring points
    show of it; `weights` (..., rows, channels) are those of the residuals in the likelihood of the fit.
    `correlation` returns the number of points that count as one; `least` is the least factor on σ² that
    stands for it. `uncertain` is the relative standard error of σ² where it is estimated. `signals` are the
    channels of each signal that is judged by itself, empty where all are one. `unit` (rows, channels) has
    multiplied the data; without it those of several scenes compare. With `exact_noise` the noise is at least
    `noise`, and `exact_noise(which)` is that of the fits at some positions.
    """

    residual: np.ndarray
    jacobian: np.ndarray
    sigma: np.ndarray
    noise: Any
    weights: np.ndarray
    effects: Sequence[Effect]
    correlation: Callable[[np.ndarray], Any]
    least: float = 1.0
    uncertain: float = 0.0
    signals: tuple[tuple[int, ...], ...] = ()
    unit: Any = 1.0
    exact_noise: Callable[[np.ndarray], np.ndarray] | None = None

    def of(self, which: np.ndarray) -> Evidence:
        """The evidence of some of many fits, by their positions."""
        exact = self.exact_noise
        return self._replace(
            residual=self.residual[which],
            jacobian=self.jacobian[which],
            sigma=self.sigma[which],
            noise=self.noise[which],
            weights=self.weights[which],
            effects=[replace(effect, change=effect.change[which]) for effect in self.effects],
            unit=self.unit[which],
            exact_noise=None if exact is None else lambda some: exact(which[some]),
        )


def huber_roots(residual: np.ndarray) -> np.ndarray:
    """Square roots of Huber's weights of residuals (fits, rows, channels), in units of their bulk; most fits
    have no residual that counts less."""
    roots = np.ones(residual.shape)
    far = np.flatnonzero(np.max(np.abs(residual), axis=(1, 2)) > OUTLIER)
    if len(far):
        reach = OUTLIER * np.maximum(spread(residual[far], (1, 2)), 1.0)[:, None, None]
        roots[far] = np.sqrt(np.minimum(1.0, reach / np.maximum(np.abs(residual[far]), 1e-300)))
    return roots


def reduced_variance(rest: np.ndarray, used: Any, length: Any, least: float, uncertain: float) -> Any:
    """Factor on σ² (...) for the size of what remains (..., rows, channels) and for its correlation over
    `length` (...) points, where that is no noise by chance. The fit takes `used` degrees of freedom."""
    freedom = np.maximum(rest.shape[-2] * rest.shape[-1] - used, 1.0)
    reduced = np.sum(rest**2, axis=(-2, -1)) / freedom
    # only what remains is correlated: of a σ that allows for a lamp it may be a tenth
    factor = np.maximum(reduced * length, np.maximum(1.0, reduced) * least)
    of_length = np.sqrt(2 * (2 * WINDOW + 1) / freedom)  # standard error of the correlation length: ibid.
    by_chance = 1 + _SCATTER * np.sqrt(2 / freedom + of_length**2 + uncertain**2)
    return np.where(factor > by_chance, factor, 1.0)


class System:
    """Linearised fits with their effects: columns of parameters, nuisances and effects, rows of all views, in
    units of the noise, and of the priors. All arrays have one leading axis, of `fits`. With `hold` no prior
    pulls nuisances from where the fit has them."""

    def __init__(self, evidence: Sequence[Evidence], scaled: Scaled, unit: np.ndarray, *, hold: bool = True):
        self.lead, self.known, self.stretch = np.shape(unit)[:-1], len(scaled.names), scaled.stretch
        self.fits = math.prod(self.lead)
        self.views = [self._flat(view) for view in evidence]
        keys = [
            [(effect.name, None if effect.shared else i) for effect in view.effects]
            for i, view in enumerate(self.views)
        ]
        names = dict.fromkeys(key for own in keys for key in own)
        columns = {name: self.known + i for i, name in enumerate(names)}
        self.positions = [[columns[key] for key in own] for own in keys]
        pairs = zip(self.positions, self.views, strict=True)
        by_column = {at: effect for own, view in pairs for at, effect in zip(own, view.effects, strict=True)}
        self.effects = [by_column[at] for at in columns.values()]
        size, count = self.known + len(names), np.shape(unit)[-1]
        self.priors = scaled.jacobian[..., -self.known :, :].reshape(self.fits, self.known, self.known)
        # a drift stays where the fit has it: its prior would pull it as soon as residuals count less
        pull = np.array(np.broadcast_to(scaled.pull, (*self.lead, self.known))).reshape(self.fits, -1)
        if hold:
            pull[:, count:] = 0.0
        self.pull, transposed = pull, np.swapaxes(self.priors, 1, 2)
        self.precision, self.pulled = np.zeros((self.fits, size, size)), np.zeros((self.fits, size))
        self.precision[:, : self.known, : self.known] = transposed @ self.priors
        self.precision[:, range(self.known, size), range(self.known, size)] = 1.0
        self.pulled[:, : self.known] = -times(transposed, pull)
        self.lower, self.upper = np.full((2, self.fits, size), [[[-np.inf]], [[np.inf]]])
        self.lower[:, :count] = -np.reshape(unit, (self.fits, count))
        self.upper[:, :count] = 1 + self.lower[:, :count]
        self.lower[:, self.known :][:, [effect.not_negative for effect in self.effects]] = 0.0

    def _flat(self, view: Evidence) -> Evidence:
        """The evidence with one leading axis; `rows` flattens the changes of effects."""
        if len(self.lead) == 1:
            return view

        def flat(x: Any, kept: int) -> np.ndarray:
            return np.reshape(x, (self.fits, *np.shape(x)[len(self.lead) :][:kept]))

        arrays = {name: flat(getattr(view, name), 2) for name in ("residual", "sigma", "weights")}
        return view._replace(**arrays, jacobian=flat(view.jacobian, 3), noise=flat(view.noise, 0))

    def prior_rows(self, fit: int) -> tuple[np.ndarray, np.ndarray]:
        """Rows (columns, columns) and data (columns,) of the priors of one fit."""
        rows, data = np.eye(self.lower.shape[1]), np.zeros(self.lower.shape[1])
        rows[: self.known, : self.known], data[: self.known] = self.priors[fit], -self.pull[fit]
        return rows, data

    def led(self, x: np.ndarray) -> Any:
        """An array (fits, ...) with the leading axes of the fits."""
        return x.reshape((*self.lead, *x.shape[1:]))[()]

    def by_noise(self, noises: Sequence[np.ndarray]) -> System:
        """The system with the noise of neighbouring points (fits,) of each view for the σ of its points: that
        of a drifting lamp would hide what an effect explains. Itself where they are the same."""
        pairs = list(zip(self.views, noises, strict=True))
        if all(view.least == 1.0 and np.all(view.sigma == noise[:, None, None]) for view, noise in pairs):
            return self
        result = copy.copy(self)
        result.views = [
            view._replace(sigma=np.broadcast_to(noise[:, None, None], view.sigma.shape), least=1.0)
            for view, noise in pairs
        ]
        return result

    def rows(self, which: int) -> np.ndarray:
        """Rows (fits, columns, data values) of a view, in units of its noise."""
        view, positions = self.views[which], self.positions[which]
        inverse = (1 / view.sigma).reshape(self.fits, -1)
        rows = np.zeros((self.fits, self.lower.shape[1], inverse.shape[1]))
        jacobian = view.jacobian.reshape(*inverse.shape, self.known)
        np.multiply(np.swapaxes(jacobian, 1, 2), inverse[:, None], out=rows[:, : self.known])
        for column, effect in zip(positions, view.effects, strict=True):
            np.multiply(effect.change.reshape(inverse.shape), inverse, out=rows[:, column])
        return rows

    def balances(self) -> list[ViewBalance]:
        """Rows and data of each view, with its own σ."""
        return [ViewBalance(view, self.rows(i)) for i, view in enumerate(self.views)]

    def normal(self, views: Sequence[ViewBalance], todo: np.ndarray | slice = slice(None)) -> Normal:
        """Normal equations of some of the fits."""
        matrix, right = self.precision[todo].copy(), self.pulled[todo].copy()
        for view in views:
            matrix += view.gram[todo] / view.variance[todo][:, None, None]
            right += view.against[todo] / view.variance[todo][:, None]

        def rows(position: int) -> tuple[np.ndarray, np.ndarray]:
            fit = int(np.arange(self.fits)[todo][position])
            pairs = [*(view.weighted(fit) for view in views), self.prior_rows(fit)]
            return np.vstack([row for row, _ in pairs]), np.concatenate([data for _, data in pairs])

        return Normal(matrix, right, rows)


class ViewBalance:
    """Rows and data of one view, factors on its σ² (fits,), square roots of the weights of its points, sums
    of squares with these weights, and the residuals `rest` (fits, rows, channels) in units of the noise."""

    def __init__(self, view: Evidence, rows: np.ndarray):
        self.view, self.rows, fits = view, rows, len(rows)
        self.data = view.residual.reshape(fits, -1) / view.sigma.reshape(fits, -1)
        self.variance = np.full(fits, max(1.0, view.least))
        self.roots = np.ones(self.data.shape)
        self.gram, self.against = rows @ np.swapaxes(rows, 1, 2), times(rows, self.data)
        self.rest = np.empty(view.residual.shape)

    def leave(self, solution: np.ndarray, todo: np.ndarray | slice) -> None:
        """Take the residuals that solutions leave."""
        rest = self.data[todo] - times(np.swapaxes(self.rows[todo], 1, 2), solution[todo])
        self.rest[todo] = rest.reshape(-1, *self.rest.shape[1:])

    def reweigh(self, covariance: np.ndarray, todo: np.ndarray, single: bool) -> np.ndarray:
        """Take factors and weights by the residuals; returns which of the fits `todo` change by that."""
        view, left = self.view, self.rest[todo]
        now = huber_roots(left)
        flat, before = now.reshape(len(todo), -1), self.roots[todo]
        robust = (flat < 1).any(axis=1) | (before < 1).any(axis=1)
        some = todo[robust]
        changed = np.zeros(len(todo), bool)
        if len(some):
            changed[robust] = np.abs(flat[robust] - before[robust]).max(axis=1) > _SETTLED
            self.roots[some] = flat[robust]
            weighted = self.rows[some] * (self.roots[some] ** 2)[:, None]
            self.gram[some] = weighted @ np.swapaxes(self.rows[some], 1, 2)
            self.against[some] = times(weighted, self.data[some])
        used = np.einsum("pij,pij->p", covariance[todo], self.gram[todo]) / self.variance[todo]
        counted = now * left
        length = view.correlation(counted[0] if single else counted)
        factor = reduced_variance(counted, used, length, view.least, view.uncertain)
        changed |= np.abs(factor / self.variance[todo] - 1) > _SETTLED
        self.variance[todo] = factor
        return changed

    def weighted(self, fit: int) -> tuple[np.ndarray, np.ndarray]:
        """Rows (data values, columns) and data of one fit with their weights."""
        scale = self.roots[fit] / math.sqrt(self.variance[fit])
        return (self.rows[fit] * scale).T, self.data[fit] * scale


class Balance:
    """Noise factors and robust weights, iterated until they agree with the residuals that they leave."""

    def __init__(self, system: System):
        self.system = system
        self.views = system.balances()
        every = slice(None)
        self.solution, self.covariance = self._solved(every)
        for view in self.views:
            view.leave(self.solution, every)
        todo = np.arange(system.fits)
        for _ in range(_ROUNDS):
            changed = [view.reweigh(self.covariance, todo, not system.lead) for view in self.views]
            todo = todo[np.any(changed, axis=0)]
            if not len(todo):
                break
            self.solution[todo], self.covariance[todo] = self._solved(todo)
            for view in self.views:
                view.leave(self.solution, todo)

    def _solved(self, todo: np.ndarray | slice) -> tuple[np.ndarray, np.ndarray]:
        """Least-squares coefficients, those of positive effects not below zero, and their covariance."""
        free, covariance = self.system.normal(self.views, todo).solved()
        return held_within(free, covariance, self.system.lower[todo], self.system.upper[todo]), covariance

    def one_by_one(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Explain the residuals by each effect without the others, whatever its size.

        Returns the share of the residuals that it explains and its coefficient, (fits, effects), and the
        shift of the parameters by it, (fits, effects, known), in the steps of their columns.
        """
        system, normal = self.system, self.system.normal(self.views)
        known, (fits, size) = system.known, system.lower.shape
        effects = size - known
        powers = [np.sum((v.data * v.roots) ** 2, axis=1) / v.variance for v in self.views]
        power = np.sum(powers, axis=0)
        gram, right = normal.matrix - system.precision, normal.right - system.pulled

        def left(x: np.ndarray, gram: np.ndarray, right: np.ndarray) -> np.ndarray:
            return np.sum(x * times(gram, x), axis=-1) - 2 * np.sum(x * right, axis=-1)

        bounds = system.lower[:, :known], system.upper[:, :known]
        best = held_within(*normal.of(np.arange(known)).solved(), *bounds)
        before = power + left(best, gram[:, :known, :known], right[:, :known])
        both = np.stack([np.append(np.arange(known), known + i) for i in range(effects)])
        square = both[:, :, None], both[:, None, :]
        matrix = normal.matrix[:, *square]
        matrix[..., -1, -1] += _WHATEVER**2 - 1

        def rows(position: int) -> tuple[np.ndarray, np.ndarray]:
            fit, effect = divmod(position, effects)
            every, data = normal.rows(fit)
            every[effect - effects, known + effect] = _WHATEVER
            return every[:, both[effect]], data

        flat = matrix.reshape(-1, known + 1, known + 1), normal.right[:, both].reshape(-1, known + 1)
        free, covariance = Normal(*flat, rows).solved()
        each = (x[:, both].reshape(free.shape) for x in (system.lower, system.upper))
        moved = held_within(free, covariance, *each).reshape(fits, effects, known + 1)
        after = power[:, None] + left(moved, gram[:, *square], right[:, both])
        # of an effect that only rounding tells from a parameter on a bound the solution may be worse
        moved = np.where(
            (after <= before[:, None])[..., None], moved, np.pad(best, [(0, 0), (0, 1)])[:, None]
        )
        explains = np.maximum(0.0, 1 - after / np.maximum(before, 1e-300)[:, None])
        return explains, moved[..., -1], moved[..., :-1] - best[:, None]
