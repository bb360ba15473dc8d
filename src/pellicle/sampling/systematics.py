"""Systematic effects in a posterior: changes of the data that its likelihood integrates out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from pellicle.fitting.discrepancy import Discrepancy, Evidence
from pellicle.fitting.problem import Problem


class Systematics(NamedTuple):
    """Effects of one view, taken at the best minimum.

    `columns` (effects, data values) are the changes of its weighted residuals by one standard uncertainty,
    less what scale and offset follow. Only a `share` of the deviance is evidence where residuals are larger
    than noise.
    """

    columns: Any
    share: Any

    def deviance(self, residual: Any, deviance: Any) -> Any:
        """−2 ln likelihood with the effects integrated out over their normal priors (C. Bishop, 2006, Pattern
        Recognition and Machine Learning, eq. 2.115), up to a constant."""
        if not len(self.columns):
            return self.share * deviance
        projected = self.columns @ residual[: self.columns.shape[1]]
        matrix = jnp.eye(len(self.columns)) / self.share + self.columns @ self.columns.T
        return self.share * (deviance - projected @ jnp.linalg.solve(matrix, projected))


def systematics(
    problem: Problem, evidence: Sequence[Evidence], discrepancy: Discrepancy
) -> tuple[Systematics, ...]:
    """Effects of each view of a ranked problem, from the evidence of its best minimum."""
    result, known = [], len(problem.parameters)
    for view, own in zip(problem.views, evidence, strict=True):
        rows, channels = own.residual.shape
        columns = np.zeros((len(own.effects), rows, view.channels))
        for column, effect in zip(columns, own.effects, strict=True):
            column[:, :channels] = effect.change * own.weights
        linear = np.zeros((rows, view.channels, own.jacobian.shape[2] - known))
        linear[:, :channels] = own.jacobian[:, :, known:] * own.weights[:, :, None]
        flat, nuisances = columns.reshape(len(columns), -1), linear.reshape(rows * view.channels, -1)
        normal = nuisances.T @ nuisances + np.eye(nuisances.shape[1])
        followed = nuisances @ np.linalg.solve(normal, nuisances.T @ flat.T)
        result.append(Systematics(flat - followed.T, np.float64(discrepancy.evidence_share)))
    return tuple(result)
