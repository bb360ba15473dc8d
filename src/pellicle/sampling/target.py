"""The logarithm of a posterior as the sampler calls it."""

from __future__ import annotations

import numpy as np

from pellicle.sampling.density import LogDensity


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
