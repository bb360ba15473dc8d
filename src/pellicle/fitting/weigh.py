"""Compare minima on the noise, and on the correlation of errors, that the data themselves show.

Model errors are correlated along a spectrum. Counting every point as independent makes a rival look
impossible when it is not: on 119 real soap-film spectra it costs 15 right answers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import jax
import numpy as np

from pellicle.fitting import noise
from pellicle.fitting.problem import Local, Problem, local
from pellicle.fitting.search import Minima, polished, quiet
from pellicle.fitting.uncertainty import linear_coefficients

_ROUNDS = 3


@dataclass(frozen=True)
class Noise:
    """Where the weights come from: `given` is an absolute σ; `drifting` the model's own error."""

    given: bool
    drifting: bool


@dataclass(frozen=True)
class Weighed:
    """Minima ranked on the effective points, and the model at the best of them.

    `problem` carries the weights that the ranking used; `variance` is what multiplies their σ² in the
    covariance; `length` is how many neighbouring points count as one.
    """

    problem: Problem
    minima: Minima
    at: Local
    variance: float
    length: float
    chi2_reduced: float


def weigh(problem: Problem, minima: Minima, source: Noise) -> Weighed:
    """Estimate σ and the effective points from the best fit's residuals, and rank all minima again.

    A given σ stays. An unknown one becomes the rms of the residuals. Where scale and offset drift,
    the weights stay too: the residuals of so flexible a model understate its error.
    """
    chi2, length = _residual_noise(problem, minima.units[0])
    for _ in range(_ROUNDS):
        best, scan = minima.units[0], minima.scan
        ranked = _reweighted(problem, chi2, length, source)
        minima = replace(polished(ranked, minima.units, quiet), scan=scan)
        if np.allclose(minima.units[0], best, atol=1e-3):
            break
        chi2, length = _residual_noise(problem, minima.units[0])
    ranked = _reweighted(problem, chi2, length, source)
    at = jax.device_get(local(*ranked.program, minima.units[0]))
    reduced = chi2 if source.given or source.drifting else 1.0
    # the ranked weights hold the rms already, so only the correlation is left to count
    variance = 1.0 if source.given else length * (max(chi2, 1e-12) if source.drifting else 1.0)
    return Weighed(ranked, minima, at, variance, length, reduced)


def _residual_noise(problem: Problem, unit: np.ndarray) -> tuple[float, float]:
    """Reduced χ² and correlation length of the residuals at one point of the box."""
    at = jax.device_get(local(*problem.program, unit))
    residual = ((problem.data.values - np.asarray(at.model)) * problem.data.weight)[: problem.points]
    used = len(problem.parameters) + len(linear_coefficients(problem, at))
    # N, C and S lie on a sphere: two of the three are independent
    independent = problem.points if problem.channels == 1 else 2 * problem.rows
    chi2 = float(residual @ residual) / max(independent - used, 1)
    columns = residual.reshape(-1, problem.channels).T
    return chi2, float(np.mean([noise.correlation_length(column) for column in columns]))


def _reweighted(problem: Problem, chi2: float, length: float, source: Noise) -> Problem:
    rescale = 1.0 if source.given or source.drifting else 1 / math.sqrt(max(chi2, 1e-12))
    least = noise.DRIFT_CORRELATION if source.drifting else 1.0
    data = problem.data._replace(
        weight=problem.data.weight * rescale, temper=np.float64(1 / max(length, least))
    )
    return problem._replace(data=data)
