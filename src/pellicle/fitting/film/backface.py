"""Comparison of a fit with and without the back face of a plate."""

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pellicle.fitting.film.colour_measurements import MeasuredColours
from pellicle.fitting.film.problem import Target, make
from pellicle.fitting.film.view import Local, SpectrumView
from pellicle.fitting.minima import minima
from pellicle.fitting.problem import Problem
from pellicle.fitting.reweighting import RankedMinima
from pellicle.scene.free import free_leaves

_STRUCTURE = 0.5
"""Share of the residuals' sum of squares that a share of the light explains at least, to be named."""


class Comparison(NamedTuple):
    """rms of the spectra that depend on a back face, with it and without: fractions, or degrees of Ψ where
    all are ellipsometry."""

    rms: float
    without: float
    collected: float | None = None
    """Share of the light from the back face that the residuals ask for, None where they do not."""
    explains: float = 0.0


def comparison(spectra: Sequence[Target], ranked: RankedMinima) -> Comparison | None:
    """Fit quality with substrates as half spaces, from the same minima.

    None where no plate has a back face, or where it has free parameters: without it they would have
    no meaning.
    """
    views = ranked.problem.views
    spectral = [i for i, view in enumerate(views) if isinstance(view, SpectrumView)]
    dependent = [i for i in spectral if views[i].plan.on("back-face")]
    dependent = [i for i in dependent if not views[i].signal.ellipsometric] or dependent
    backs = [spectra[i].scene.substrate for i in dependent]
    if not dependent or any(
        free_leaves((plate.back, plate.plate_mm, plate.back_collected)) for plate in backs
    ):
        return None
    targets = []
    for spectrum, view in zip(spectra, views, strict=True):
        substrate = dataclasses.replace(
            spectrum.scene.substrate, back=None, back_collected=None, back_reflections=None
        )
        scene = dataclasses.replace(spectrum.scene, substrate=substrate)
        if isinstance(spectrum, MeasuredColours):
            targets.append(spectrum._replace(scene=scene))
            continue
        # with its final weights
        sigma = 1 / view.data.weight[: view.points].reshape(view.rows, view.channels)
        fraction = float(view.data.independent_fraction)
        targets.append(spectrum._replace(scene=scene, sigma=sigma, independent_fraction=fraction))
    without = make(*targets)
    values = without.values(minima(without, ranked.minima.units).units[0])
    bare = [without.views[i] for i in dependent]
    rms = (
        _rms([views[i] for i in dependent], [ranked.fits[i].at for i in dependent]),
        _rms(bare, [view.local(without.seen_by(view, values)) for view in bare]),
    )
    # a transmittance depends so little on the share that a scale imitates it
    dependent = [i for i in dependent if views[i].plan.signal != "T"]
    if not dependent or any(plate.back_collected is not None for plate in backs):
        return Comparison(*rms)
    share, explains = _collected(without, ranked, dependent)
    # no light from the back face may explain them as well
    if share is None or rms[0] * math.sqrt(1 - explains) > rms[1] / 1.05:
        return Comparison(*rms)
    return Comparison(*rms, share, explains)


def _collected(
    without: Problem, ranked: RankedMinima, dependent: Sequence[int]
) -> tuple[float | None, float]:
    """Share of the light from the back faces that explains the residuals best, and how much of them.

    To first order: a combination of the slopes in all parameters and of the signal that the back faces add.
    """
    views, residuals, columns = ranked.problem.views, [], []
    count, values = len(ranked.problem.parameters), ranked.values
    slopes = [view.jacobian(fit.at) for view, fit in zip(views, ranked.fits, strict=True)]
    nuisances = [own.shape[1] - len(view.takes) for view, own in zip(views, slopes, strict=True)]
    first = count
    for i, (view, fit, own) in enumerate(zip(views, ranked.fits, slopes, strict=True)):
        row = np.zeros((len(own), count + sum(nuisances) + 1))
        row[:, list(view.takes)] = own[:, : len(view.takes)]
        row[:, first : first + nuisances[i]] = own[:, len(view.takes) :]
        first += nuisances[i]
        if i in dependent:
            half_space = without.views[i].local(without.seen_by(without.views[i], values))
            lost = (np.asarray(half_space.signal) - fit.at.signal) * fit.at.gain * view.data.weight
            row[:, -1] = lost[: view.points]
        residuals.append(view.residuals(fit.at).ravel())
        columns.append(row)
    residual, design = np.concatenate(residuals), np.concatenate(columns)
    size = np.linalg.norm(design, axis=0)
    design = design / np.where(size > 0, size, 1.0)
    shares = np.linalg.lstsq(design, residual, rcond=1e-10)[0]
    explains = 1 - np.sum((residual - design @ shares) ** 2) / np.sum(residual**2)
    share = 1 - shares[-1] / size[-1] if size[-1] > 0 else 1.0
    return (float(share), float(explains)) if explains > _STRUCTURE and 0.05 < share < 0.9 else (None, 0.0)


def _rms(views: Sequence[SpectrumView], at: Sequence[Local]) -> float:
    squares = [view.rms(local.model) ** 2 for view, local in zip(views, at, strict=True)]
    return float(np.sqrt(np.average(squares, weights=[view.points for view in views])))


def sentence(comparison: Comparison | None) -> str:
    """A sentence for the verdict, empty where nothing was compared."""
    if comparison is None:
        return ""
    rms, without, collected, explains = comparison
    part = ""
    if collected is not None:
        part = (
            f" A back face of which about {100 * collected:.0f} % is collected would explain"
            f" {100 * explains:.0f} % of the residuals: free that share by `back_collected=Free(0, 1)`."
        )
    sizes = f"rms {rms:.4f} with it, {without:.4f} without.{part}"
    if without > 1.05 * rms:
        return f" The back face matters: {sizes}"
    if rms > 1.05 * without:
        return f" Including the back face worsens the fit: {sizes}"
    return f" The back face makes no difference here: {sizes}"
