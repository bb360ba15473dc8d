"""Probability of each minimum of a fit: orders of interference that the data do not tell apart."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pellicle.fitting.covariance import errors, scaled
from pellicle.fitting.discrepancy import Discrepancy
from pellicle.fitting.result import Rival
from pellicle.fitting.reweighting import RankedMinima


class Orders(NamedTuple):
    """Share of the posterior of each minimum, (minima,), and the standard errors of the parameters there,
    (minima, parameters)."""

    probability: np.ndarray
    stderr: np.ndarray


def orders(ranked: RankedMinima, discrepancy: Discrepancy) -> Orders:
    """Weigh the ranked minima by their normal approximations.

    The share is ∝ exp(−Δχ²/2) |C|^½, with C the covariance of the parameters there and Δχ² as the
    `discrepancy` lets it count (D. MacKay, 2003, Information Theory, Inference and Learning Algorithms, eq.
    27.5).
    """
    problem, minima = ranked.problem, ranked.minima
    count, variance = len(problem.parameters), [fit.variance for fit in ranked.fits]
    span = np.asarray(problem.box.upper) - np.asarray(problem.box.lower)
    log = -0.5 * discrepancy.evidence_share * (minima.deviance - minima.deviance[0])
    stderr = np.empty((len(log), count))
    for i, unit in enumerate(minima.units):
        values = np.asarray(problem.values(unit))
        at = [view.local(problem.seen_by(view, values)) for view in problem.views]
        information = np.linalg.inv(errors(scaled(problem, unit, at, variance)).covariance[:count, :count])
        # a parameter that the data do not see is known to its bounds
        information += np.diag(12 / span**2)
        stderr[i] = np.sqrt(np.diag(np.linalg.inv(information)))
        log[i] -= 0.5 * np.linalg.slogdet(information)[1]
    share = np.exp(log - log.max())
    return Orders(share / share.sum(), stderr)


def with_orders(rivals: tuple[Rival, ...], found: Orders) -> tuple[Rival, ...]:
    """The rivals, which are the minima after the first, with their shares and errors; the most probable
    first."""
    rows = zip(rivals, found.probability[1:].tolist(), found.stderr[1:].tolist(), strict=False)
    known = [
        replace(rival, probability=share, stderr=dict(zip(rival.parameters, own, strict=True)))
        for rival, share, own in rows
    ]
    return tuple(sorted(known, key=lambda rival: -(rival.probability or 0.0)))
