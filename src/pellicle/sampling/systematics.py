"""Systematic effects in a posterior: changes of the data that its likelihood integrates out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from pellicle.fitting.discrepancy import Discrepancy, Evidence
from pellicle.fitting.problem import Explained, Problem


class Systematics(NamedTuple):
    """Effects on all views, taken at the best minimum.

    Of the deviance of each view only a share (`shares`, (views,)) is evidence where residuals are larger than
    noise. `columns` of each view (effects, data values), times its weighted residuals and added over the
    views, are what the effects explain: the sum of their squares is no misfit.
    """

    columns: tuple[Any, ...]
    shares: Any

    def deviance(self, views: Sequence[Explained]) -> Any:
        """−2 ln likelihood with the effects integrated out over their normal priors, up to a constant.

        **Source:** C. Bishop, 2006, Pattern Recognition and Machine Learning, eq. 2.115, with the inverse of
        I + E Eᵀ by M. Woodbury, 1950.
        """
        pairs = list(zip(self.columns, views, strict=True))
        explained = sum(own @ view.residual[: own.shape[1]] for own, view in pairs)
        total = sum(share * view.deviance for share, view in zip(self.shares, views, strict=True))
        return total - jnp.sum(jnp.square(explained))


def without_effects(problem: Problem) -> Systematics:
    """No systematic effects: the likelihood is that of the noise."""
    none = np.zeros((0, 0))
    return Systematics((none,) * len(problem.views), np.ones(len(problem.views)))


def systematics(problem: Problem, evidence: Sequence[Evidence], discrepancy: Discrepancy) -> Systematics:
    """Effects on a ranked problem, from the evidence of its best minimum.

    An effect of the sample is one and the same in all views.
    """
    known, order = len(problem.parameters), {}
    for i, view in enumerate(evidence):
        for effect in view.effects:
            order.setdefault((effect.name, None if effect.shared else i), len(order))
    shares, columns = discrepancy.evidence_shares, []
    information = np.eye(len(order))
    for i, (view, own, share) in enumerate(zip(problem.views, evidence, shares, strict=True)):
        rows, channels = own.residual.shape
        changes = np.zeros((len(order), rows, view.channels))
        for effect in own.effects:
            at = order[effect.name, None if effect.shared else i]
            changes[at, :, :channels] = effect.change * own.weights
        linear = np.zeros((rows, view.channels, own.jacobian.shape[2] - known))
        linear[:, :channels] = own.jacobian[:, :, known:] * own.weights[:, :, None]
        flat = changes.reshape(len(order), rows * view.channels)
        # the residuals are those with scale and offset at their best, under their priors of unit width
        nuisances = linear.reshape(rows * view.channels, -1)
        across = nuisances.T @ flat.T
        normal = nuisances.T @ nuisances + np.eye(nuisances.shape[1])
        information += share * (flat @ flat.T - across.T @ np.linalg.solve(normal, across))
        columns.append(share * flat)
    factor = np.linalg.cholesky(information)
    return Systematics(tuple(np.linalg.solve(factor, own) for own in columns), np.array(shares))
