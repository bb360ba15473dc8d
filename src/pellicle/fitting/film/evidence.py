"""Residuals of spectra and what may explain them: the input of a discrepancy."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pellicle.fitting.covariance import Scaled
from pellicle.fitting.discrepancy import Evidence
from pellicle.fitting.film.colour_measurements import colours_evidence
from pellicle.fitting.film.colour_view import ColoursView
from pellicle.fitting.film.systematic_effects import systematic_effects
from pellicle.fitting.film.targets import Target
from pellicle.fitting.film.view import SpectrumView
from pellicle.fitting.noise import DRIFT_CORRELATION, short_range_noise
from pellicle.fitting.reweighting import RankedMinima

LEAST_NOISE = 1e-9
"""Least noise, as a share of the signal's level: rounding in simulated data."""
SCATTER_OF_NOISE = 2.9
"""Relative standard error of σ² from the differences of neighbours, times the root of the points: that of the
median absolute value of second differences of normal noise (simulated: 2.8 to 3.1 at 50 to 1000 points)."""


def evidence(spectra: Sequence[Target], ranked: RankedMinima, jacobian: Scaled) -> list[Evidence]:
    """Evidence of each spectrum, and of colours, at the best of the ranked minima.

    `jacobian` is the scaled one there.
    """
    views, fits, result = ranked.problem.views, ranked.fits, []
    blocks = jacobian.blocks([view.points for view in views], [fit.variance for fit in fits])
    for spectrum, view, fit, block in zip(spectra, views, fits, blocks, strict=True):
        values = ranked.problem.seen_by(view, ranked.values)
        if isinstance(view, ColoursView):
            result.append(colours_evidence(view, values, fit.at, spectrum.scene, block))
            continue
        keep, shape = view.measured_channels, (view.rows, view.channels, -1)
        weight = np.asarray(view.data.weight)[: view.points]
        columns = (block / weight[:, None]).reshape(shape)[:, :keep]
        residual = np.asarray(view.data.values) - np.asarray(fit.at.model)
        residual = residual[: view.points].reshape(view.rows, view.channels)[:, :keep]
        sigma = (1 / weight).reshape(view.rows, view.channels)[:, :keep]
        counted = np.sqrt(view.data.independent_fraction) / sigma
        noises, sweeps, least = np.empty(keep), view.sweeps, LEAST_NOISE * float(view.data.level)
        for group in view.noise_groups:
            own = [channel for channel in group.channels if channel < keep]
            noise = float(short_range_noise(residual[:, own], sweeps, least))
            if not group.known:
                # the weights have the rms of all residuals: noise is no larger than that
                noise = min(noise, float(np.median(sigma[:, own])))
                sigma[:, own] = noise
            elif not view.noise.drifting:
                noise = max(noise, float(np.median(sigma[:, own])))
            noises[own] = noise
        effects = systematic_effects(view, values, fit.at, spectrum.scene)
        # all channels in units of the noise of the first
        unit = noises[0] / noises
        result.append(
            Evidence(
                residual * unit,
                columns * unit[:, None],
                sigma * unit,
                float(noises[0]),
                counted / unit,
                [replace(e, change=e.change * unit) for e in effects] if np.any(unit != 1) else effects,
                view.correlation_length,
                DRIFT_CORRELATION if view.noise.drifting else 1.0,
                0.0 if view.noise.known else SCATTER_OF_NOISE / math.sqrt(view.rows),
                _signals(view) if view.signal.degrees and view.signal.parts else (),
            )
        )
    return result


def _signals(view: SpectrumView) -> tuple[tuple[int, ...], ...]:
    """The measured channels of each ratio."""
    keep = view.measured_channels
    return tuple(tuple(c for c in group.channels if c < keep) for group in view.noise_groups)
