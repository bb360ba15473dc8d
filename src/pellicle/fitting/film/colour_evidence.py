"""Residuals of colours and what may explain them: the input of a discrepancy."""

from __future__ import annotations

import numpy as np

from pellicle.fitting.discrepancy import Effect, Evidence
from pellicle.fitting.film.colour_view import ColoursView, Local
from pellicle.fitting.film.systematic_effects import named_for, simulated_effects
from pellicle.fitting.misfit import Accuracy
from pellicle.scene.film import Scene
from pellicle.scene.instrument import Drift

LARGEST = 0.03
"""Difference of a channel, in units of its range, that no calibrated camera makes: a ΔE*ab of about 3."""


def colours_evidence(
    view: ColoursView, values: np.ndarray, at: Local, scene: Scene, block: np.ndarray
) -> Evidence:
    """Evidence of colours at `values` (the parameters of the view,), in units of their σ.

    `block` are their rows of the scaled Jacobian, by the σ of their weights.
    """
    weight = np.asarray(view.data.weight)
    columns = block.reshape(view.rows, 3, -1) / weight[:, :, None]
    residual, one = view.residuals(at) / weight, np.ones(weight.shape)
    effects = [
        row.effect(_change(view, at, (weights @ own).reshape(-1, 3)) / weight)
        for row, weights, own in simulated_effects(view, values, scene)
    ]
    effects = named_for([*effects, *_of_exposure(view, at, scene, weight)], view.name)
    counted = weight * np.sqrt(view.independent_fraction)
    return Evidence(residual, columns, one, 1.0, counted, effects, view.correlation_length)


def accuracy(view: ColoursView, sigma: float) -> Accuracy:
    """The residuals, in units of the median `sigma` of the data, that no camera makes."""
    span = 100.0 if view.encoding.mix[0, 1] else 1.0  # L*, a*, b*
    return Accuracy(largest=LARGEST * span / sigma)


def _change(view: ColoursView, at: Local, colours: np.ndarray) -> np.ndarray:
    """A change of the sensor's colours (colours, 3) as the residuals have it."""
    return view.weighted(at, colours @ view.response(at).T)


def _of_exposure(view: ColoursView, at: Local, scene: Scene, weight: np.ndarray) -> list[Effect]:
    """Errors of a known exposure and of a known white balance."""
    size, modes = scene.uncertainty.scale, view.modes
    rows = {"scale": np.ones(3), "balance of red and blue": np.array([1.0, 0.0, -1.0])}
    if any(name.startswith("white_balance") for name in modes):
        rows = {}
    elif isinstance(scene.instrument.scale, Drift):
        del rows["scale"]
    model = np.asarray(at.model)
    return [
        Effect(name, size, "", view.weighted(at, size * model * factor) / weight, shared=False)
        for name, factor in rows.items()
        if size
    ]
