"""Fits of the spectra of many pixels by one scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import jax
import numpy as np

from pellicle.data.cube import Cube
from pellicle.data.spectrum import Spectrum
from pellicle.fitting.parameter import Parameter
from pellicle.fitting.problem import Problem
from pellicle.fitting.spectra.fit import fit as fit_spectra
from pellicle.fitting.spectra.fit import measurements
from pellicle.fitting.spectra.problem import make
from pellicle.mapping.pixel_fits import CODES, NO_DATA, PixelFits
from pellicle.mapping.pixel_minima import ORDERS
from pellicle.scene.film import Scene


@dataclass(frozen=True)
class PixelModel:
    """What the pixels of a cube have in common: the scene and its problem.

    `example` is a spectrum as of one pixel, whose numbers do not matter but for their size.
    """

    scene: Scene
    problem: Problem
    example: Spectrum

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Free parameters, in the order of all arrays of parameters."""
        return self.problem.parameters


def prepare(cube: Cube, scene: Scene) -> PixelModel:
    """Prepare the fits of the pixels of a cube: media, effects and bounds.

    **Raises:** as `pellicle.fit` does; DataError where no pixel has data.
    """
    example = spectrum(cube, _example(cube))
    with jax.enable_x64(True):
        problem = make(*measurements(example, scene))
    return PixelModel(scene, problem, example)


def _example(cube: Cube) -> dict[str, np.ndarray]:
    """A pixel in the middle of a cube."""
    where = tuple(slice(n // 2, n // 2 + 1) for n in cube.shape)
    return {name: values[0] for name, values in cube.pixels(where).items()}


def spectrum(cube: Cube, pixel: dict[str, np.ndarray]) -> Spectrum:
    """The spectrum of one pixel of a cube; `pixel` has arrays (points,) by name."""
    wavelength, angle = cube.wavelength, cube.angle
    if angle is not None:
        wavelength, angle = np.repeat(wavelength, angle.size), np.tile(angle, wavelength.size)
    known = np.all([np.isfinite(values) for values in pixel.values()], axis=0)
    arrays: Any = {name: values[known] for name, values in pixel.items() if name != "values"}
    return Spectrum(
        wavelength[known],
        pixel["values"][known],
        cube.signal,
        angle=None if angle is None else angle[known],
        polarisation=cube.polarisation,
        calibrated=cube.calibrated,
        path=cube.path,
        **arrays,
    )


def fit_pixels(model: PixelModel, cube: Cube, where: tuple[slice, ...]) -> PixelFits:
    """Fit a block of pixels of a cube."""
    block = cube.pixels(where)
    count, names = len(block["values"]), [p.name for p in model.parameters]
    numbers = np.full((count, 3, len(names)), np.nan)
    minima, delta = np.full((count, ORDERS, len(names)), np.nan), np.full((count, ORDERS), np.inf)
    quality, status = np.full((count, 2), np.nan), np.full(count, CODES[NO_DATA], np.uint8)
    for i in range(count):
        pixel = {name: values[i] for name, values in block.items()}
        if not np.isfinite(pixel["values"]).any():
            continue
        fit = fit_spectra(spectrum(cube, pixel), model.scene)
        for j, name in enumerate(names):
            own = fit[name]
            numbers[i, :, j] = own.value, own.stderr, own.stderr_noise
        rivals = fit.rivals[: ORDERS - 1]
        minima[i, 0], delta[i, 0] = numbers[i, 0], 0.0
        for j, rival in enumerate(rivals, start=1):
            minima[i, j], delta[i, j] = [rival.parameters[name] for name in names], rival.delta_chi2
        quality[i] = fit.chi2_reduced, fit.rms
        status[i] = CODES[str(fit.status)]
    values, stderr, stderr_noise = np.moveaxis(numbers, 1, 0)
    return PixelFits(values, stderr, stderr_noise, status, minima, delta, quality[:, 0], quality[:, 1])
