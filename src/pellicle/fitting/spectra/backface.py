"""Comparison of a fit with and without the back face of a plate."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pellicle.fitting.colours.targets import MeasuredColours
from pellicle.fitting.minima import minima
from pellicle.fitting.reweighting import RankedMinima
from pellicle.fitting.spectra.problem import make
from pellicle.fitting.spectra.targets import Target
from pellicle.fitting.spectra.view import Local, SpectrumView
from pellicle.scene.free import free_leaves


class Comparison(NamedTuple):
    """rms of the spectra that depend on a back face, with it and without: fractions, or degrees of Ψ where
    all are ellipsometry."""

    rms: float
    without: float


def comparison(spectra: Sequence[Target], ranked: RankedMinima) -> Comparison | None:
    """Fit quality with substrates as half spaces, from the same minima.

    None where no plate has a back face, or where it has free parameters: without it they would have
    no meaning.
    """
    views = ranked.problem.views
    spectral = [i for i, view in enumerate(views) if isinstance(view, SpectrumView)]
    dependent = [i for i in spectral if views[i].plan.on("back-face")]
    dependent = [i for i in dependent if views[i].of_power] or dependent
    backs = [spectra[i].scene.substrate for i in dependent]
    if not dependent or any(free_leaves((plate.back, plate.plate_mm)) for plate in backs):
        return None
    targets = []
    for spectrum, view in zip(spectra, views, strict=True):
        substrate = dataclasses.replace(spectrum.scene.substrate, back=None)
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
    return Comparison(
        _rms([views[i] for i in dependent], [ranked.fits[i].at for i in dependent]),
        _rms(bare, [view.local(without.seen_by(view, values)) for view in bare]),
    )


def _rms(views: Sequence[SpectrumView], at: Sequence[Local]) -> float:
    squares = [view.rms(local.model) ** 2 for view, local in zip(views, at, strict=True)]
    return float(np.sqrt(np.average(squares, weights=[view.points for view in views])))


def sentence(comparison: Comparison | None) -> str:
    """A sentence for the verdict, empty where nothing was compared."""
    if comparison is None:
        return ""
    rms, without = comparison
    if without > 1.05 * rms:
        return f" The back face matters: rms {rms:.4f} with it, {without:.4f} without."
    if rms > 1.05 * without:
        return f" Including the back face worsens the fit: rms {rms:.4f} with it, {without:.4f} without."
    return f" The back face makes no difference here: rms {rms:.4f} with it, {without:.4f} without."
