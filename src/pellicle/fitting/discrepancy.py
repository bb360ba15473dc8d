"""Discrepancy between a model and data: what systematic effects and correlated residuals add to the errors.

A scene leaves out what it does not know: wavelengths a little off, an index that is not quite the table's.
Each such effect has a standard uncertainty; its change of the signal is a further column of the linearised
fit, with a normal prior. Generalised least squares with these columns, and with the noise enlarged to what
remains (R. Birge, 1932, Phys. Rev. 40, 207) times its correlation length, give the parameters that the data
would have with the effects allowed for, and their covariance. The fit keeps its own values: their error
includes the distance to those.

`discrepancy` takes one fit, or arrays with leading axes (...) for many fits of the same kind.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pellicle.fitting.covariance import Errors, Scaled
from pellicle.fitting.linear_system import Balance, Effect, Evidence, System, ViewBalance, huber_roots
from pellicle.fitting.normal_equations import times
from pellicle.fitting.robust_losses import median, spread

DOUBTFUL = 1.5
"""Ratio of unexplained residuals to noise above which an index far from the given one is looked for."""
_APART = 10.0
"""Ratio of the residuals of one channel to those of all beyond which the whole channel is wrong."""
_SMOOTH = 2.5
"""Ratio to the noise of neighbouring points above which its residuals are no noise, as in `misfit`."""
_CHANCE_QUANTILE = 3.0902
"""Normal quantile of the probability, 1e-3, of effects as large together as those that are implausible."""


class Remaining(NamedTuple):
    """Residuals of one view that no effect explains.

    `typical` is their size in the unit of the data, of most points, and `ratio` that to the noise of
    neighbouring points; `rms` is their root mean square in the unit of the data, outliers aside, and
    `weighted` in units of the σ of the points. `variance` is the factor on σ² that stands for them and for
    their correlation. `far` (..., rows, channels) are the signs of those that count less, else 0.
    """

    ratio: Any
    typical: Any
    rms: Any
    weighted: Any
    variance: Any
    far: Any = 0


class Contribution(NamedTuple):
    """One effect of a discrepancy.

    `changes` (..., parameters and nuisances) are those of the fitted parameters by one standard uncertainty.
    `amount` (...) is the size at which the effect explains the residuals best, with the others at their own.
    `explains` is the share of the sum of squares that the effect alone takes from the residuals, whatever its
    size, `alone` the size that it then has, and `shift` what that adds to the parameters. `carries` (...,
    parameters and nuisances) is what their variances would lose if the effect were known.
    """

    effect: Effect
    changes: np.ndarray
    amount: Any
    explains: Any
    alone: Any
    shift: np.ndarray
    carries: Any = 0.0


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """Errors with the effects allowed for.

    `errors` are those of parameters and nuisances about the values that the effects would give, which are
    `shift` (..., parameters and nuisances) away from those of the fit. `implausible` (...) is true where the
    effects would have to be larger together than they are. `explained` (...) is the factor by which they may
    lower a deviance. `raised` (..., rows, channels) of each view multiplies the weights of the fit, so that
    they become those of what remains.
    """

    errors: Errors
    shift: np.ndarray
    remaining: tuple[Remaining, ...]
    contributions: tuple[Contribution, ...]
    implausible: Any
    explained: Any
    raised: tuple[np.ndarray, ...]

    @property
    def total(self) -> np.ndarray:
        """Root mean square errors of the fit's own parameters and nuisances."""
        return np.sqrt(self.variance)

    @property
    def variance(self) -> np.ndarray:
        """Mean square error of the fit's own parameters and nuisances."""
        return self.errors.variance + self.shift**2

    @property
    def evidence_shares(self) -> list[Any]:
        """Shares (...) of a difference in χ² of each view, as the fit counts points, that are left when
        residuals count as what they are."""
        return [np.minimum(1.0, median(raised, (-2, -1)) ** 2) for raised in self.raised]

    @property
    def evidence_share(self) -> Any:
        """Mean (...) of these shares over the data values."""
        weights = [math.prod(raised.shape[-2:]) for raised in self.raised]
        return np.average(self.evidence_shares, axis=0, weights=weights)


def discrepancy(
    evidence: Sequence[Evidence], scaled: Scaled, unit: np.ndarray, *, contributions: bool = True
) -> Discrepancy:
    """The discrepancy of a fit at `unit` (..., parameters) of the unit cube, which no parameter leaves.

    `scaled` has the units of the columns and their priors. Without `contributions` those are left out.
    """
    system = System(evidence, scaled, unit)
    balance, known, led = Balance(system), system.known, system.led
    views = list(zip(system.views, balance.views, strict=True))
    remaining, noises = zip(*(_remaining(*view) for view in views), strict=True)
    sizes = balance.solution[:, known:]
    # terms of a lamp that a spectrum has too few fringes for are zero
    grams = sum(np.einsum("pii->pi", view.gram)[:, known:] for view in balance.views)
    count = np.sum(np.asarray(grams) > 0, axis=1)
    stretch = scaled.stretch
    covariance = stretch @ led(balance.covariance[:, :known, :known]) @ np.swapaxes(stretch, -1, -2)
    drifting = any(view.least != 1.0 for view in system.views)
    by_noise = system.by_noise(noises) if contributions or drifting else system
    plain = balance if by_noise is system else Balance(by_noise)
    # the σ of a drifting lamp is no noise
    pairs = zip(views, zip(by_noise.views, plain.views, strict=True), strict=True)
    counted = [own if own[0].least == 1.0 else short for own, short in pairs]
    effects = system.normal([view for _, view in counted]).matrix[:, known:, known:]
    return Discrepancy(
        errors=Errors(scaled.names, covariance),
        shift=times(stretch, led(balance.solution[:, :known])),
        remaining=tuple(Remaining(*(led(x) for x in left)) for left in remaining),
        contributions=tuple(_contributions(system, balance, plain)) if contributions else (),
        implausible=led((count > 0) & (np.sum(sizes**2, axis=1) > improbable(count))),
        explained=led(np.maximum(np.linalg.norm(effects, axis=(1, 2)), 1.0)),
        raised=tuple(led(_raised(*view)) for view in counted),
    )


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


def improbable(count: Any) -> Any:
    """χ² of `count` (...) degrees of freedom that is exceeded with a probability of 1e-3 (E. Wilson and M.
    Hilferty, 1931, Proc. Natl. Acad. Sci. 17, 684)."""
    spread_of_cube_root = 2 / (9 * np.maximum(count, 1))
    return count * (1 - spread_of_cube_root + _CHANCE_QUANTILE * np.sqrt(spread_of_cube_root)) ** 3


def _remaining(view: Evidence, balance: ViewBalance) -> tuple[Remaining, np.ndarray]:
    """Remaining residuals of a view, with numbers (fits,), and the noise (fits,) of its points."""
    noise, left = np.array(view.noise, float), balance.rest * view.sigma
    # a signal of its own, such as one ratio, is not diluted by others that the scene has right
    signals = [list(group) for group in view.signals] or [slice(None)]
    typical = np.max([bulk(left[..., own], noise) for own in signals], axis=0)
    large = np.flatnonzero(typical > DOUBTFUL * noise)
    if view.exact_noise is not None and len(large):
        noise[large] = np.maximum(noise[large], view.exact_noise(large))
    roots = [(own, huber_roots(balance.rest[..., own])) for own in signals]
    rms, weighted = (
        np.max([np.sqrt(np.mean((root * x[..., own]) ** 2, axis=(1, 2))) for own, root in roots], axis=0)
        for x in (left, balance.rest)
    )
    far = np.sign(balance.rest) * (balance.roots < 1).reshape(balance.rest.shape)
    return Remaining(typical / noise, typical, rms, weighted, balance.variance, far), noise


def _raised(view: Evidence, balance: ViewBalance) -> np.ndarray:
    """Weights (fits, rows, channels) by what remains, over those of the fit."""
    roots = balance.roots.reshape(view.residual.shape) / np.sqrt(balance.variance)[:, None, None]
    return roots / (view.sigma * view.weights)


def _contributions(system: System, balance: Balance, by_noise: Balance) -> Iterator[Contribution]:
    """Each effect of a system, of which `by_noise` is the balance by the noise of neighbouring points."""
    if not system.effects:
        return
    known, normal, stretch = system.known, system.normal(balance.views), system.stretch
    _, covariance = normal.of(np.arange(known)).solved()
    changes = -covariance @ normal.matrix[:, :known, known:]
    together = balance.covariance[:, :known, known:]
    own = np.maximum(np.einsum("pii->pi", balance.covariance)[:, known:], 1e-300)
    explains, alone, shift = by_noise.one_by_one()
    for i, effect in enumerate(system.effects):
        yield Contribution(
            effect,
            times(stretch, system.led(changes[:, :, i])),
            system.led(effect.amount(balance.solution[:, known + i])),
            system.led(explains[:, i]),
            system.led(effect.amount(alone[:, i])),
            times(stretch, system.led(shift[:, i])),
            times(stretch, system.led(together[:, :, i])) ** 2 / system.led(own[:, i])[..., None],
        )
