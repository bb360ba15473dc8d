"""What the posterior says that each point of the data should have been."""

from __future__ import annotations

from typing import NamedTuple

import jax
import numpy as np

from pellicle.fitting.evaluation import curves
from pellicle.fitting.parts import psi_delta
from pellicle.fitting.problem import Problem, View

DRAWS = 256
"""Curves behind a band: 2.5 % of them are six."""


class Prediction(NamedTuple):
    """Curves of one spectrum for draws from the posterior, (draws, points), and the same with noise.

    For ellipsometry they are Ψ, and `delta` and `delta_noisy` Δ, in degrees.
    """

    model: np.ndarray
    noisy: np.ndarray
    delta: np.ndarray | None = None
    delta_noisy: np.ndarray | None = None


def predictions(problem: Problem, units: np.ndarray, seed: int = 0) -> tuple[Prediction, ...]:
    """One for each spectrum, from draws (steps, walkers, parameters) in the unit cube."""
    random = np.random.default_rng(seed)
    flat = units.reshape(-1, units.shape[-1])
    chosen = flat[random.integers(len(flat), size=DRAWS)]
    with jax.enable_x64(True):
        return tuple(_of(view, chosen[:, list(view.takes)], random) for view in problem.views)


def _of(view: View, units: np.ndarray, random: np.random.Generator) -> Prediction:
    model = np.asarray(curves(*view.program, units).model)[:, : view.points]
    sigma = 1 / np.asarray(view.data.weight)[: view.points]
    noisy = model + sigma * random.standard_normal(model.shape)
    if view.channels == 1:
        return Prediction(model, noisy)
    (psi, delta), (psi_noisy, delta_noisy) = (psi_delta(view.in_columns(x)) for x in (model, noisy))
    return Prediction(psi, psi_noisy, delta, delta_noisy)
