"""Log posterior of a problem at points of the unit cube, and its minima as a mixture of t distributions.

Systematic effects are integrated out. Walkers start in the mixture, and may jump within it.
`sandwich_stretch` gives draws the covariance of a fit whose residuals stand for an uneven noise. A likelihood
of one noise for all points has the width of its curvature. The draws around each minimum are stretched so
that their covariance becomes that of the sandwich estimator: the open-faced sandwich adjustment of B. Shaby,
J. Comput. Graph. Stat. 23, 853 (2014).
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.fitting.coordinates import Box
from pellicle.fitting.covariance import Errors, scaled
from pellicle.fitting.evaluation import Static, explained
from pellicle.fitting.linear_system import Evidence
from pellicle.fitting.problem import Explained, Problem
from pellicle.fitting.reweighting import RankedMinima
from pellicle.optics.pair import namespace
from pellicle.programs.cache import in_chunks, kept
from pellicle.signals.base import Signal


class Systematics(NamedTuple):
    """Effects on all views, taken at one minimum.

    Of the deviance of each view only a share (`shares`, (views,)) is evidence where residuals are larger than
    noise. `changes` of each view (effects, data values) are those of its weighted data by one standard
    uncertainty. `columns` (effects, data values and nuisances), times its weighted residuals and those of the
    priors of its nuisances, added over the views, are what the effects explain: the sum of their squares is
    no misfit. `volume` is the logarithm of the determinant of I + E Eᵀ.
    """

    changes: tuple[Any, ...]
    columns: tuple[Any, ...]
    shares: Any
    volume: Any = 0.0

    def deviance(self, views: Sequence[Explained]) -> Any:
        """−2 ln likelihood with the effects integrated out over their normal priors, up to a constant.

        **Source:** C. Bishop, 2006, Pattern Recognition and Machine Learning, eq. 2.115, with the inverse of
        I + E Eᵀ by M. Woodbury, 1950.
        """
        pairs = list(zip(self.columns, views, strict=True))
        explained = jnp.zeros(len(self.columns[0]))
        for changes, (columns, view) in zip(self.changes, pairs, strict=True):
            points = changes.shape[1]
            priors = columns.shape[1] - points
            explained += columns[:, :points] @ view.residual[:points]
            explained += columns[:, points:] @ view.residual[len(view.residual) - priors :]
        total = sum(share * view.deviance for share, view in zip(self.shares, views, strict=True))
        return total - jnp.sum(jnp.square(explained)) + self.volume


class Nearest(NamedTuple):
    """Systematic effects at several minima: `centre` (minima, parameters) in the unit cube of the affine
    problem, and `each`, with the minima first in all its arrays."""

    each: Systematics
    centre: Any

    def at(self, unit: Any) -> Systematics:
        """The effects at the minimum that is nearest to a point (parameters,)."""
        xp = namespace(self.centre, unit)
        which = xp.argmin(xp.sum(xp.square(self.centre - unit), axis=1))
        return jax.tree_util.tree_map(lambda x: xp.asarray(x)[which], self.each)


def nearest(every: Sequence[Systematics], centre: np.ndarray) -> Nearest:
    """The effects at minima `centre` (minima, parameters); those of no minimum are zero there."""
    most = max(len(own.changes[0]) for own in every)

    def stacked(*arrays: np.ndarray) -> np.ndarray:
        return np.stack([np.pad(x, [(0, most - len(x)), (0, 0)]) if x.ndim == 2 else x for x in arrays])

    return Nearest(jax.tree_util.tree_map(stacked, *every), centre)


def without_effects(problem: Problem) -> Nearest:
    """No systematic effects: the likelihood is that of the noise."""
    none = tuple(np.zeros((0, view.rows * view.channels)) for view in problem.views)
    own = Systematics(none, none, np.ones(len(problem.views)), np.zeros(()))
    return nearest([own], np.zeros((1, len(problem.parameters))))


def systematics(
    evidence: Sequence[Evidence], shares: Sequence[float], channels: Sequence[int], known: int
) -> Systematics:
    """Effects on a ranked problem of so many `known` parameters, from the evidence of its best minimum.

    `shares` of the deviance of each view are evidence; `channels` are the data values of each of its rows. An
    effect of the sample is one and the same in all views.
    """
    order: dict[tuple[str, int | None], int] = {}
    for i, view in enumerate(evidence):
        for effect in view.effects:
            order.setdefault((effect.name, None if effect.shared else i), len(order))
    every, columns, information = [], [], np.eye(len(order))
    for i, (view, share, width) in enumerate(zip(evidence, shares, channels, strict=True)):
        rows, measured = view.residual.shape
        changes = np.zeros((len(order), rows, width))
        for effect in view.effects:
            row = order[effect.name, None if effect.shared else i]
            changes[row, :, :measured] = effect.change * view.weights
        linear = np.zeros((rows, width, view.jacobian.shape[2] - known))
        linear[:, :measured] = view.jacobian[:, :, known:] * view.weights[:, :, None]
        flat = changes.reshape(len(order), rows * width)
        # less what scale and offset, under their priors of unit width, follow: only so the effects explain no
        # more than there is where the signal, and with it what the scale follows, is another
        nuisances = linear.reshape(rows * width, -1)
        nuisances = nuisances[:, np.any(nuisances != 0, axis=0)]  # without those of other views
        normal = nuisances.T @ nuisances + np.eye(nuisances.shape[1])
        followed = np.linalg.solve(normal, nuisances.T @ flat.T)
        rest = np.hstack([flat - (nuisances @ followed).T, followed.T])
        information += share * rest @ rest.T
        every.append(flat)
        columns.append(share * rest)
    factor = np.linalg.cholesky(information)
    columns = tuple(np.linalg.solve(factor, linear) for linear in columns)
    volume = 2 * np.sum(np.log(np.diag(factor)))
    return Systematics(tuple(every), columns, np.array(shares), np.array(volume))


LogDensity = Callable[[np.ndarray], np.ndarray]
"""ln posterior (points,), up to a constant, at points (points, parameters) of the unit cube."""


class Density(NamedTuple):
    """ln posterior of each point, up to a constant; −∞ outside the bounds."""

    log: jax.Array


@kept
def density(static: Static, arrays: tuple[Any, ...], box: Box, effects: Nearest, units: Any) -> Density:
    """ln posterior at `units` (points, parameters): the likelihood of every view, nuisances and systematic
    effects integrated out, times the priors. A prior is one on the parameter in its own unit."""
    coordinates, _ = static

    def one(unit):
        views, values = explained(static, arrays, box, unit)
        prior = box.log_prior(values) + coordinates.log_area(box, unit)
        log = -0.5 * effects.at(unit).deviance(views) + prior
        return jnp.where(jnp.all((unit >= 0) & (unit <= 1)) & jnp.isfinite(log), log, -jnp.inf)

    return Density(jax.vmap(one)(units))


def log_density(problem: Problem, effects: Nearest | None = None) -> LogDensity:
    """ln posterior of a ranked, affine problem; without `effects` that of the noise alone."""
    static = problem.static
    arrays, box, known = jax.device_put((problem.arrays, problem.box, effects or without_effects(problem)))
    return lambda units: np.asarray(density(static, arrays, box, known, units).log)


def fingerprint(parts: Sequence[tuple[Any, ...]], *settings: Any) -> str:
    """SHA-256 hash of everything that a posterior depends on, to match a chain with its problem.

    `parts` are data and scenes with bounds and priors, as pytrees of numbers, strings and kinds of signals.
    """
    digest = hashlib.sha256(",".join(map(repr, settings)).encode())
    for part in parts:
        leaves, structure = jax.tree_util.tree_flatten(tuple(part))
        digest.update(str(structure).encode())
        for leaf in leaves:
            # the bytes of an object are its address, which differs between runs
            named = isinstance(leaf, str | Signal)
            digest.update(repr(leaf).encode() if named else np.asarray(leaf).tobytes())
    return digest.hexdigest()


class Target(NamedTuple):
    """ln posterior as a function of NumPy arrays (walkers, parameters); −∞ outside the unit cube.

    Batches are padded to `lanes` points, so that all of them share one program.
    """

    log_density: LogDensity
    lanes: int

    def __call__(self, units: np.ndarray) -> np.ndarray:
        inside = np.clip(units, 0.0, 1.0)  # nothing is simulated where it has no meaning
        within = np.all((units >= 0) & (units <= 1), axis=1)
        return np.where(within, in_chunks(self.log_density, inside, self.lanes), -np.inf)


FREEDOM = 5.0
"""Degrees of freedom of the t distributions: their tails are heavier than those of what is sampled."""
MATTERS = 0.01
"""A minimum with a smaller share of the posterior is not missed."""
_LEAST = 1e-3
"""Every minimum found is given this share, in case its quadratic estimate is wrong."""
_HOPELESS = 60.0
"""Minima with a χ² further above the best hold nothing, whatever their width."""
_STEPS = 5
"""Most steps from a minimum of the noise's likelihood to that of the posterior."""
_SAME = 0.1
"""Standard deviations within which two minima are one."""


@dataclass(frozen=True)
class Modes:
    """Minima in the unit cube, best first, by their normal approximation.

    `centre` (modes, parameters); `factor` the Cholesky factors of their covariances, (modes, parameters,
    parameters); `share` (modes,) of the posterior, by that approximation.
    """

    centre: np.ndarray
    factor: np.ndarray
    share: np.ndarray

    @property
    def matter(self) -> np.ndarray:
        """Mask of the modes that hold a relevant share of the posterior, (modes,)."""
        return self.share >= MATTERS

    def draw(self, count: int, random: np.random.RandomState) -> np.ndarray:
        """Points (count, parameters), some of them outside the unit cube."""
        mode = random.choice(len(self.share), count, p=self._drawn)
        return self._around(mode, random)

    def start(self, count: int, random: np.random.RandomState) -> np.ndarray:
        """Starting points inside the unit cube, every minimum that matters among them."""
        first = np.flatnonzero(self.matter)[: count // 2]
        mode = np.concatenate([first, random.choice(len(self.share), count - len(first), p=self._drawn)])
        units = self._around(mode, random)
        for _ in range(100):
            outside = np.any((units < 0) | (units > 1), axis=1)
            if not outside.any():
                return units
            units[outside] = self._around(mode[outside], random)
        return np.clip(units, 1e-9, 1 - 1e-9)

    def log_density(self, units: np.ndarray) -> np.ndarray:
        """ln of the mixture's density at (points, parameters), up to a constant."""
        log = self._each(units) + np.log(self._drawn)
        top = log.max(axis=1, keepdims=True)
        return top[:, 0] + np.log(np.exp(log - top).sum(axis=1))

    def nearest(self, units: np.ndarray) -> np.ndarray:
        """The mode that each point (points, parameters) belongs to: the one of the highest density there."""
        return np.argmax(self._each(units) + np.log(self._drawn), axis=1)

    @property
    def _drawn(self) -> np.ndarray:
        share = np.maximum(self.share, _LEAST)
        return share / share.sum()

    def _around(self, mode: np.ndarray, random: np.random.RandomState) -> np.ndarray:
        size = self.centre.shape[1]
        normal = random.standard_normal((len(mode), size))
        stretch = np.sqrt(FREEDOM / random.chisquare(FREEDOM, len(mode)))
        return self.centre[mode] + stretch[:, None] * np.einsum("mij,mj->mi", self.factor[mode], normal)

    def _each(self, units: np.ndarray) -> np.ndarray:
        """ln density of every t distribution, (points, modes)."""
        size = self.centre.shape[1]
        away = units[:, None, :] - self.centre
        normal = np.linalg.solve(self.factor, away[..., None])[..., 0]
        square = np.sum(normal**2, axis=-1)
        return -0.5 * (FREEDOM + size) * np.log1p(square / FREEDOM) - _log_volume(self.factor)


def _log_volume(factor: np.ndarray) -> np.ndarray:
    return np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)


def mixture(centre: np.ndarray, chi2: np.ndarray, covariance: np.ndarray) -> Modes:
    """Minima `centre` (minima, parameters) of −2 ln posterior, `chi2`, each with its covariance (minima,
    parameters, parameters); all in the unit cube."""
    kept = chi2 - chi2.min() < _HOPELESS
    factor = np.linalg.cholesky(covariance[kept])
    log = -0.5 * (chi2[kept] - chi2.min()) + _log_volume(factor)
    share = np.exp(log - log.max())
    return Modes(centre[kept], factor, share / share.sum())


def confined(jacobian: np.ndarray, size: int) -> np.ndarray:
    """The covariance of the first `size` parameters, in the unit cube, by the Jacobian in units of the noise;
    the others are integrated out.

    The variance of the uniform prior, 1/12, bounds it where the data see nothing.
    """
    uniform = np.where(np.arange(jacobian.shape[1]) < size, 12.0, 0.0)
    return np.linalg.inv(jacobian.T @ jacobian + np.diag(uniform))[:size, :size]


class _Expansion(NamedTuple):
    """Linearisation of a posterior at one point: the Jacobian in units of the noise with columns of nuisances
    and effects, the residuals of its rows, and −2 ln posterior up to a constant."""

    jacobian: np.ndarray
    residual: np.ndarray
    chi2: float


def _expansion(problem: Problem, nearby: Nearest, unit: np.ndarray) -> _Expansion:
    """Linearisation of an affine problem at a point (parameters,) of the unit cube."""
    effects, values = nearby.at(unit), np.asarray(problem.values(unit))
    parts = [view.local(problem.seen_by(view, values)) for view in problem.views]
    counted = np.array([view.independent_fraction for view in problem.views])
    matrix, _, names, pulls = scaled(problem, unit, parts, (1 / (counted * effects.shares)).tolist())
    pull, pairs = np.asarray(pulls), list(zip(problem.views, parts, counted.tolist(), strict=True))
    rest = [view.residuals(local).ravel() * fraction**0.5 for view, local, fraction in pairs]
    count, width, first, priors = len(effects.changes[0]), len(names), 0, len(unit)
    jacobian = np.zeros((len(matrix) + count, width + count))
    jacobian[: len(matrix), :width] = matrix
    jacobian[len(matrix) :, width:] = np.eye(count)
    residual = np.zeros(len(jacobian))
    residual[len(matrix) - width : len(matrix)] -= pull
    explained = np.zeros(count)
    for changes, columns, share, weighted in zip(*effects[:3], rest, strict=True):
        rows = slice(first, first + len(weighted))
        jacobian[rows, width:], residual[rows] = share**0.5 * changes.T, share**0.5 * weighted
        several = columns.shape[1] - len(weighted)
        explained += columns @ np.concatenate([weighted, pull[priors : priors + several]])
        first, priors = first + len(weighted), priors + several
    chi2 = np.sum(residual**2) - np.sum(explained**2) + effects.volume
    return _Expansion(jacobian, residual, float(chi2))


def modes(ranked: RankedMinima, effects: Nearest | None = None) -> Modes:
    """The minima of a fit in affine coordinates, each with the covariance of its own Jacobian; nuisances and
    systematic effects are integrated out. With effects a minimum moves by steps of least squares."""
    problem = ranked.problem.affine()
    noise = without_effects(problem)
    centres, deviances, covariances = [], [], []
    for own, deviance in zip(ranked.minima.units, ranked.minima.deviance.tolist(), strict=True):
        unit = ranked.problem.in_affine(own)
        here = _expansion(problem, effects or noise, unit)
        if effects:
            deviance += here.chi2 - _expansion(problem, noise, unit).chi2
            start = here.chi2
            for _ in range(_STEPS):
                step = np.linalg.lstsq(here.jacobian, here.residual, rcond=None)[0][: len(unit)]
                trial = np.clip(unit + step, 0.0, 1.0)
                there = _expansion(problem, effects, trial)
                if not there.chi2 < here.chi2:
                    break
                unit, here = trial, there
            deviance += here.chi2 - start
        covariance = confined(here.jacobian, len(unit))
        near = _SAME * np.sqrt(np.diag(covariance))
        if any(np.all(np.abs(unit - other) < near) for other in centres):
            continue  # two minima of the noise's likelihood that the effects make one
        centres.append(unit)
        deviances.append(deviance)
        covariances.append(covariance)
    return mixture(np.array(centres), np.array(deviances), np.array(covariances))


Stretch = Callable[[np.ndarray], np.ndarray]
"""Points (..., parameters) of the unit cube → stretched ones."""


def unchanged(units: np.ndarray) -> np.ndarray:
    """Return the draws as they are."""
    return units


def sandwich_stretch(errors: Errors, slope: np.ndarray, modes: Modes) -> Stretch:
    """Return the stretch of draws from the curvature's covariance of a fit to its own.

    It is that of the best minimum, applied around the minimum to which a draw belongs. Draws beyond a bound
    are reflected at it.

    **Arguments:** `errors` of the best minimum; `slope` (parameters, parameters) of the parameters in their
    own units by the unit cube there; `modes` of the posterior.
    """
    if errors.curvature is None:
        return unchanged
    size = modes.centre.shape[1]  # nuisances, which come last, are integrated out
    to_units = np.linalg.inv(slope)
    own, narrow = (to_units @ c[:size, :size] @ to_units.T for c in (errors.covariance, errors.curvature))
    root = _root(narrow)
    inverse = np.linalg.inv(root)
    # as the errors of a fit, draws are not narrowed: that few residuals are small is no evidence
    matrix = root @ _root(inverse @ own @ inverse, least=1.0) @ inverse

    def stretch(units: np.ndarray) -> np.ndarray:
        flat = units.reshape(-1, units.shape[-1])
        centre = modes.centre[modes.nearest(flat)]
        moved = np.abs(centre + (flat - centre) @ matrix.T)
        return np.clip(1 - np.abs(1 - moved), 0.0, 1.0).reshape(units.shape)

    return stretch


def _root(matrix: np.ndarray, least: float = 0.0) -> np.ndarray:
    """Symmetric square root of a positive definite matrix, of eigenvalues raised to `least`."""
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return (vectors * np.sqrt(np.maximum(values, max(least, 1e-15 * values.max())))) @ vectors.T
