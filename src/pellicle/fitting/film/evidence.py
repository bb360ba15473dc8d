"""Residuals of spectra and what may explain them: the input of a discrepancy."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from pellicle.fitting.covariance import Scaled
from pellicle.fitting.film.colour_measurements import MeasuredColours, colours_evidence
from pellicle.fitting.film.problem import Target
from pellicle.fitting.film.systematic_effects import systematic_effects
from pellicle.fitting.film.view import Local, SpectrumView
from pellicle.fitting.linear_system import Effect, Evidence
from pellicle.fitting.noise import DRIFT_CORRELATION, short_range_noise
from pellicle.fitting.reweighting import RankedMinima
from pellicle.fitting.robust_losses import median

LEAST_NOISE = 1e-9
"""Least noise, as a share of the signal's level: rounding in simulated data."""
SCATTER_OF_NOISE = 2.9
"""Relative standard error of σ² from the differences of neighbours, times the root of the points: that of the
median absolute value of second differences of normal noise (simulated: 2.8 to 3.1 at 50 to 1000 points)."""


def evidence(
    spectra: Sequence[Target], ranked: RankedMinima, jacobian: Scaled, planned: np.ndarray
) -> list[Evidence]:
    """Evidence of each spectrum, and of colours, at the best of the ranked minima.

    `jacobian` is the scaled one there. Effects are simulated as at `planned` values of the parameters.
    """
    views, fits, result = ranked.problem.views, ranked.fits, []
    blocks = jacobian.blocks([view.points for view in views], [fit.variance for fit in fits])
    for spectrum, view, fit, block in zip(spectra, views, fits, blocks, strict=True):
        values, example = (ranked.problem.seen_by(view, x) for x in (ranked.values, planned))
        if isinstance(spectrum, MeasuredColours):
            result.append(colours_evidence(view, values, fit.at, spectrum, block, example))
        else:
            effects = systematic_effects(view, values, fit.at, spectrum.scene, example)
            result.append(spectrum_evidence(view, fit.at, block, effects))
    return result


def spectrum_evidence(view: SpectrumView, at: Local, block: np.ndarray, effects: list[Effect]) -> Evidence:
    """Evidence of a spectrum, or of many with leading axes (...), with these `effects`.

    `at` is the best local model, `block` (..., data values, parameters and nuisances) the weighted Jacobian.
    """
    keep, lead = view.measured_channels, block.shape[:-2]
    weight = np.asarray(view.data.weight)[..., : view.points]
    inverse = (1 / weight).reshape(*lead, view.rows, view.channels)
    columns = (block / weight[..., None]).reshape(*inverse.shape, -1)[..., :keep, :]
    residual, sigma = (view.residuals(at) * inverse)[..., :keep], inverse[..., :keep]
    counted = np.sqrt(view.data.independent_fraction)[..., None, None] / sigma
    sigma, noises, exact = np.array(sigma), np.empty((*lead, keep)), None
    least, many = np.maximum(LEAST_NOISE * np.asarray(view.data.level), view.rounding), len(lead) > 0

    def short(channels: list[int], which: Any = ...) -> Any:
        return short_range_noise(residual[which][..., channels], view.sweeps, least[which])

    for group in view.noise_groups:
        own = [channel for channel in group.channels if channel < keep]
        typical = median(sigma[..., own], (-2, -1))
        given = group.known and not view.noise.drifting
        if given and many:
            # only where residuals are large does it matter whether their neighbours differ by more than σ
            noise, exact = typical, partial(short, own)
        else:
            noise = short(own)
        if not group.known:
            # the weights have the rms of all residuals: noise is no larger than that
            noise = np.minimum(noise, typical)
            sigma[..., own] *= (noise / typical)[..., None, None]
        elif given:
            noise = np.maximum(noise, typical)
        noises[..., own] = noise[..., None]
    # all channels in units of the noise of the first
    unit = noises[..., :1] / noises
    if np.any(unit != 1):
        effects = [replace(e, change=e.change * unit[..., None, :]) for e in effects]
        columns = columns * unit[..., None, :, None]
        residual, sigma, counted = (x * unit[..., None, :] for x in (residual, sigma, counted / unit**2))
    return Evidence(
        residual,
        columns,
        sigma,
        noises[..., 0],
        counted,
        effects,
        view.correlation_length,
        DRIFT_CORRELATION if view.noise.drifting else 1.0,
        0.0 if view.noise.known else SCATTER_OF_NOISE / math.sqrt(view.rows),
        _signals(view) if view.signal.degrees and view.signal.parts else (),
        unit[..., None, :],
        exact,
    )


def _signals(view: SpectrumView) -> tuple[tuple[int, ...], ...]:
    """The measured channels of each ratio."""
    keep = view.measured_channels
    return tuple(tuple(c for c in group.channels if c < keep) for group in view.noise_groups)
