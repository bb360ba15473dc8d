"""Spectra and colours of a sample and their scenes as a least-squares problem."""

from __future__ import annotations

import numpy as np

from pellicle.effects.bounds import largest_index
from pellicle.effects.film_plan import plan
from pellicle.fitting.coordinates import box
from pellicle.fitting.film.colour_targets import MeasuredColours, colours_view
from pellicle.fitting.film.nuisance import Data
from pellicle.fitting.film.parameters import anonymous, bounds, shared
from pellicle.fitting.film.targets import Target
from pellicle.fitting.film.view import ROUND, SpectrumView
from pellicle.fitting.problem import Problem
from pellicle.forward_model.film_signal import tabulated
from pellicle.scene.film import coherent_layers, with_wavelength

_KEPT_EFFECTS = ("precision", "dispersion")
"""Effects that a tolerance does not remove: a fit stops by differences below single precision, and its media
are evaluated once in any case."""


def shortest_wavelength(problem: Problem) -> float:
    """The shortest wavelength (nm) inside a layer that any spectrum and the bounds allow."""
    return min(v.scene.light.wavelength.min() / v.largest_index for v in problem.views)


def make(*spectra: Target, tolerance: float = 0.0) -> Problem:
    """The problem of explaining these spectra and colours of one sample.

    The models may be off by up to `tolerance`. Raises ValueError where a material has no data at a
    wavelength.
    """
    free, positions = shared([m.scene for m in spectra], [m.name for m in spectra])
    views = []
    for spectrum, takes in zip(spectra, positions, strict=True):
        if isinstance(spectrum, MeasuredColours):
            views.append(colours_view(spectrum, takes, tolerance, _KEPT_EFFECTS))
            continue
        scene, wavelength, values = spectrum.scene, spectrum.wavelength, spectrum.values
        points, channels = len(wavelength), values.size // len(wavelength)
        extra = -points % ROUND
        wavelength, values = _pad(wavelength, extra), _pad(values, extra)
        turns = scene.light.angle, scene.light.azimuth
        scene = with_wavelength(scene, wavelength, *(_pad(x, extra) if np.ndim(x) else x for x in turns))
        chosen = plan(scene, tolerance, _KEPT_EFFECTS)
        span = max(wavelength.max() - wavelength.min(), 1e-9)  # one wavelength at many angles has none
        sigma = np.reshape(spectrum.sigma, (-1, 1)) if np.ndim(spectrum.sigma) < 2 else spectrum.sigma
        weight = np.concatenate([1 / np.broadcast_to(sigma, (points, channels)), np.zeros((extra, channels))])
        data = Data(
            values=values.reshape(-1),
            weight=weight.reshape(-1),
            position=np.repeat(2 * (wavelength - wavelength.min()) / span - 1, channels),
            independent_fraction=np.float64(spectrum.independent_fraction),
            level=np.float64(max(float(np.median(np.abs(values[:points]))), 1e-12)),
            frame=None if spectrum.frame is None else _pad(spectrum.frame, extra),
        )
        scene = tabulated(scene, chosen.on("coherence") or scene.instrument.wavelength_shift is not None)
        steepest = max((largest_index(x.material, wavelength) for x in coherent_layers(scene)), default=1.0)
        numbers = points * channels, steepest
        views.append(
            SpectrumView(
                spectrum.name,
                chosen,
                anonymous(scene),
                data,
                takes,
                spectrum.noise,
                *numbers,
                spectrum.depolarisation,
                spectrum.elements,
                spectrum.ratios,
            )
        )
    return Problem(tuple(views), free, box(*bounds(free), [p.prior for p in free]))


def _pad(x: np.ndarray, extra: int) -> np.ndarray:
    return np.concatenate([x, np.repeat(x[-1:], extra, axis=0)])
