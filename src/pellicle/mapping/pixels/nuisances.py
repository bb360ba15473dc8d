"""Columns of a scale and an offset that drift, for many pixels."""

from __future__ import annotations

import numpy as np

from pellicle.fitting.film.form import Local
from pellicle.fitting.film.nuisance import offset_prior, scale_prior
from pellicle.fitting.film.view import SpectrumView
from pellicle.scene.film import Scene
from pellicle.scene.instrument import Drift


class Nuisances:
    """Scale and offset that drift: Chebyshev terms of each, and the standard deviations of their priors."""

    def __init__(self, view: SpectrumView, scene: Scene):
        position = np.asarray(view.data.position)[: view.points]
        self._points, self._each = view.points, list[tuple[np.ndarray, np.ndarray, bool]]()
        for number, prior, on_signal in (
            (scene.instrument.scale, scale_prior, True),
            (scene.instrument.offset, offset_prior, False),
        ):
            if isinstance(number, Drift):
                basis = np.polynomial.chebyshev.chebvander(position, number.degree)
                self._each.append((basis, prior(number)[1], on_signal))

    @property
    def count(self) -> int:
        """Numbers that are fitted to each pixel."""
        return sum(len(sd) for _, sd, _ in self._each)

    def columns(self, at: Local, level: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Columns (pixels, points, nuisances) in steps of their priors, and those steps."""
        points, flat, steps = self._points, [], []
        for basis, sd, on_signal in self._each:
            curve = (at.gain if on_signal else at.offset)[:, :points]
            numbers = curve @ np.linalg.pinv(basis).T
            own = sd * (np.abs(numbers[:, :1]) if on_signal else level[:, None])
            column = basis * own[:, None]
            flat.append(column * at.signal[:, :points, None] if on_signal else column)
            steps.append(own)
        if not flat:
            return np.zeros((len(level), points, 0)), np.zeros((len(level), 0))
        return np.concatenate(flat, axis=2), np.concatenate(steps, axis=1)
