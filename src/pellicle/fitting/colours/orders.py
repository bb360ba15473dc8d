"""Probability of each minimum of a fit: orders of interference that the data do not tell apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pellicle.fitting.covariance import errors, scaled
from pellicle.fitting.discrepancy import Discrepancy
from pellicle.fitting.result import Rival
from pellicle.fitting.reweighting import RankedMinima


def probabilities(ranked: RankedMinima, discrepancy: Discrepancy) -> np.ndarray:
    """Share of the posterior of each ranked minimum, (minima,), by its normal approximation.

    ∝ exp(−Δχ²/2) |C|^½, with C the covariance of the parameters there and Δχ² as the `discrepancy` lets it
    count (D. MacKay, 2003, Information Theory, Inference and Learning Algorithms, eq. 27.5).
    """
    problem, minima = ranked.problem, ranked.minima
    count, variance = len(problem.parameters), [fit.variance for fit in ranked.fits]
    span = np.asarray(problem.box.upper) - np.asarray(problem.box.lower)
    log = -0.5 * discrepancy.evidence_share * (minima.deviance - minima.deviance[0])
    for i, unit in enumerate(minima.units):
        values = np.asarray(problem.values(unit))
        at = [view.local(problem.seen_by(view, values)) for view in problem.views]
        covariance = errors(scaled(problem, unit, at, variance)).covariance[:count, :count]
        # a parameter that the data do not see is known to its bounds
        inside = np.linalg.inv(covariance) + np.diag(12 / span**2)
        log[i] -= 0.5 * np.linalg.slogdet(inside)[1]
    share = np.exp(log - log.max())
    return share / share.sum()


def with_probabilities(rivals: tuple[Rival, ...], share: np.ndarray) -> tuple[Rival, ...]:
    """The rivals, which are the minima after the first, each with its share; the most probable first."""
    pairs = zip(rivals, share[1:].tolist(), strict=False)
    known = [replace(rival, probability=own) for rival, own in pairs]
    return tuple(sorted(known, key=lambda rival: -(rival.probability or 0.0)))
