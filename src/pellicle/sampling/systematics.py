"""Systematic effects in a posterior: changes of the data that its likelihood integrates out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from pellicle.fitting.discrepancy import Evidence
from pellicle.fitting.problem import Explained, Problem


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
