"""Log posterior of a problem at many points of the unit cube at once, systematic effects integrated out."""

import hashlib
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.fitting.coordinates import Box
from pellicle.fitting.discrepancy import Evidence
from pellicle.fitting.evaluation import Static, explained
from pellicle.fitting.problem import Explained, Problem
from pellicle.programs.cache import kept
from pellicle.signals.base import Signal


class Systematics(NamedTuple):
    """Effects on all views, taken at the best minimum.

    Of the deviance of each view only a share (`shares`, (views,)) is evidence where residuals are larger than
    noise. `changes` of each view (effects, data values) are those of its weighted data by one standard
    uncertainty. `columns` (effects, data values and nuisances), times its weighted residuals and those of the
    priors of its nuisances, added over the views, are what the effects explain: the sum of their squares is
    no misfit.
    """

    changes: tuple[Any, ...]
    columns: tuple[Any, ...]
    shares: Any

    def deviance(self, views: Sequence[Explained]) -> Any:
        """−2 ln likelihood with the effects integrated out over their normal priors, up to a constant.

        **Source:** C. Bishop, 2006, Pattern Recognition and Machine Learning, eq. 2.115, with the inverse of
        I + E Eᵀ by M. Woodbury, 1950.
        """
        pairs = list(zip(self.columns, views, strict=True))
        explained = jnp.zeros(len(self.columns[0]))
        for changes, (own, view) in zip(self.changes, pairs, strict=True):
            points = changes.shape[1]
            priors = own.shape[1] - points
            explained += own[:, :points] @ view.residual[:points]
            explained += own[:, points:] @ view.residual[len(view.residual) - priors :]
        total = sum(share * view.deviance for share, view in zip(self.shares, views, strict=True))
        return total - jnp.sum(jnp.square(explained))


def without_effects(problem: Problem) -> Systematics:
    """No systematic effects: the likelihood is that of the noise."""
    none = tuple(np.zeros((0, view.rows * view.channels)) for view in problem.views)
    return Systematics(none, none, np.ones(len(problem.views)))


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
    for i, (own, share, width) in enumerate(zip(evidence, shares, channels, strict=True)):
        rows, measured = own.residual.shape
        changes = np.zeros((len(order), rows, width))
        for effect in own.effects:
            at = order[effect.name, None if effect.shared else i]
            changes[at, :, :measured] = effect.change * own.weights
        linear = np.zeros((rows, width, own.jacobian.shape[2] - known))
        linear[:, :measured] = own.jacobian[:, :, known:] * own.weights[:, :, None]
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
    columns = tuple(np.linalg.solve(factor, own) for own in columns)
    return Systematics(tuple(every), columns, np.array(shares))


LogDensity = Callable[[np.ndarray], np.ndarray]
"""ln posterior (points,), up to a constant, at points (points, parameters) of the unit cube."""


class Density(NamedTuple):
    """ln posterior of each point, up to a constant; −∞ outside the bounds."""

    log: jax.Array


@kept
def density(static: Static, arrays: tuple[Any, ...], box: Box, effects: Systematics, units: Any) -> Density:
    """ln posterior at `units` (points, parameters): the likelihood of every view, nuisances and systematic
    effects integrated out, times the priors. A prior is one on the parameter in its own unit."""
    coordinates, _ = static

    def one(unit):
        views, values = explained(static, arrays, box, unit)
        prior = box.log_prior(values) + coordinates.log_area(box, unit)
        log = -0.5 * effects.deviance(views) + prior
        return jnp.where(jnp.all((unit >= 0) & (unit <= 1)) & jnp.isfinite(log), log, -jnp.inf)

    return Density(jax.vmap(one)(units))


def log_density(problem: Problem, effects: Systematics | None = None) -> LogDensity:
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


class Target:
    """ln posterior as a function of NumPy arrays (walkers, parameters); −∞ outside the unit cube.

    Batches are padded to `lanes` points, so that all of them share one program.
    """

    def __init__(self, log_density: LogDensity, lanes: int):
        self.log_density, self.lanes = log_density, lanes

    def __call__(self, units: np.ndarray) -> np.ndarray:
        inside = np.clip(units, 0.0, 1.0)  # nothing is simulated where it has no meaning
        batches = [self._batch(inside[i : i + self.lanes]) for i in range(0, len(units), self.lanes)]
        within = np.all((units >= 0) & (units <= 1), axis=1)
        return np.where(within, np.concatenate(batches), -np.inf)

    def _batch(self, units: np.ndarray) -> np.ndarray:
        padded = np.concatenate([units, np.repeat(units[-1:], self.lanes - len(units), axis=0)])
        return self.log_density(padded)[: len(units)]
