"""Spectra and colours of a sample and their scenes as a least-squares problem."""

from typing import NamedTuple

import numpy as np

from pellicle.effects.differences import largest_index
from pellicle.effects.film_plan import plan
from pellicle.fitting.coordinates import box
from pellicle.fitting.film.colour_measurements import MeasuredColours, colours_view
from pellicle.fitting.film.nuisance import Data
from pellicle.fitting.film.parameters import anonymous, bounds, shared
from pellicle.fitting.film.sweeps import sweeps_of
from pellicle.fitting.film.targets import Measured, Target
from pellicle.fitting.film.view import ROUND, SpectrumView
from pellicle.fitting.problem import Problem
from pellicle.forward_model.film_signal import tabulated
from pellicle.forward_model.plan import Plan
from pellicle.scene.film import Scene, coherent_layers, with_wavelength
from pellicle.scene.free import constant, remembered

_KEPT_EFFECTS = ("precision", "dispersion")
"""Effects that a tolerance does not remove: a fit stops by differences below single precision, and its media
are evaluated once in any case."""


def shortest_wavelength(problem: Problem) -> float:
    """The shortest wavelength (nm) inside a layer that any spectrum and the bounds allow."""
    return min(v.scene.light.wavelength.min() / v.largest_index for v in problem.views)


class Structure(NamedTuple):
    """Structure of a view that scene and grid alone determine: the same for every spectrum.

    `scene` has padded wavelengths, sampled media and anonymous parameters; `largest_index` is that of its
    coherent layers over the bounds.
    """

    plan: Plan
    scene: Scene
    largest_index: float
    sweeps: list[np.ndarray]


@remembered
def structure(scene: Scene, tolerance: float) -> Structure:
    """The structure of a spectrum that `scene` explains, at the wavelengths of its light."""
    light = scene.light
    parts = sweeps_of(light, len(light.wavelength))
    extra = -len(light.wavelength) % ROUND
    wavelength = _pad(light.wavelength, extra)
    turns = (_pad(x, extra) if np.ndim(x) else x for x in (light.angle, light.azimuth))
    scene = with_wavelength(scene, wavelength, *turns)
    chosen = plan(scene, tolerance, _KEPT_EFFECTS)
    scene = tabulated(scene, chosen.on("coherence") or scene.instrument.wavelength_shift is not None)
    steepest = max((largest_index(x.material, wavelength) for x in coherent_layers(scene)), default=1.0)
    return Structure(chosen, constant(anonymous(scene)), steepest, parts)


def make(*spectra: Target, tolerance: float = 0.0) -> Problem:
    """The problem of explaining these spectra and colours of one sample.

    The models may be off by up to `tolerance`. Raises ValueError where a material has no data at a
    wavelength.
    """
    free, positions = shared(tuple(m.name for m in spectra), *(m.scene for m in spectra))
    views = tuple(
        colours_view(spectrum, takes, tolerance, _KEPT_EFFECTS)
        if isinstance(spectrum, MeasuredColours)
        else _view(spectrum, takes, tolerance)
        for spectrum, takes in zip(spectra, positions, strict=True)
    )
    return Problem(views, free, box(*bounds(free), [p.prior for p in free]))


def _view(spectrum: Measured, takes: tuple[int, ...], tolerance: float) -> SpectrumView:
    chosen, scene, steepest, parts = structure(spectrum.scene, tolerance)
    points, wavelength = len(spectrum.wavelength), scene.light.wavelength
    channels, extra = spectrum.values.size // points, len(wavelength) - points
    values = _pad(spectrum.values, extra)
    span = max(wavelength.max() - wavelength.min(), 1e-9)  # one wavelength at many angles has none
    sigma = np.reshape(spectrum.sigma, (-1, 1)) if np.ndim(spectrum.sigma) < 2 else spectrum.sigma
    weight = np.concatenate([1 / np.broadcast_to(sigma, (points, channels)), np.zeros((extra, channels))])
    data = Data(
        values=values.reshape(-1),
        weight=weight.reshape(-1),
        position=np.repeat(2 * (wavelength - wavelength.min()) / span - 1, channels),
        independent_fraction=np.float64(spectrum.independent_fraction),
        level=np.float64(max(float(np.median(np.abs(spectrum.values))), 1e-12)),
        frame=None if spectrum.frame is None else _pad(spectrum.frame, extra),
    )
    return SpectrumView(
        spectrum.name,
        chosen,
        scene,
        data,
        takes,
        spectrum.noise,
        points * channels,
        channels,
        steepest,
        spectrum.signal,
        parts,
    )


def _pad(x: np.ndarray, extra: int) -> np.ndarray:
    return np.concatenate([x, np.repeat(x[-1:], extra, axis=0)])
