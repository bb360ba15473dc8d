"""Fits of the spectra of many pixels by one scene."""

import itertools
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np

from pellicle.data.cube import Cube
from pellicle.data.spectrum import Spectrum
from pellicle.errors import DataError
from pellicle.fitting.batch.candidates import BatchSearch, prepared
from pellicle.fitting.batch.data import ORDERS, BatchFits, batch_data
from pellicle.fitting.batch.errors import BatchErrors
from pellicle.fitting.batch.polish import ROWS
from pellicle.fitting.batch.search import minima
from pellicle.fitting.film.fit import check_free
from pellicle.fitting.film.problem import make, measured
from pellicle.fitting.parameter import Parameter
from pellicle.fitting.problem import Problem
from pellicle.scene.film import Scene
from pellicle.signals.limits import DELTA, HIGHEST, PSI

_SAMPLE = 9
"""Pixels that show how large the values and their errors are."""
_FEWEST, _MOST, _SHARE = 3, 0.6, 0.1
"""Pixels that show which bands are off, the share of them that must agree, and the largest share of bands
that is no misfit of the scene."""


@dataclass(frozen=True)
class PixelModel:
    """The common part of the fits of all pixels: scene, problem, search of minima and their errors.

    `example` is a spectrum as of one pixel, whose numbers do not matter but for their size.
    """

    scene: Scene
    problem: Problem
    example: Spectrum
    search: BatchSearch
    errors: BatchErrors

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Free parameters, in the order of all arrays of parameters."""
        return self.problem.parameters


def prepare(cube: Cube, scene: Scene, orders: int = ORDERS, rows: int = ROWS) -> PixelModel:
    """Prepare the fits of the pixels of a cube: media, effects, bounds and the table of the search.

    `orders` is the number of minima of each pixel that are kept, `rows` the most spectra of one call of a
    program, which takes as long for fewer.

    **Raises:** as `pellicle.fit` does; DataError where no pixel has data.
    """
    sample = _sample(cube)
    example = _example(cube, sample)
    with jax.enable_x64(True):
        target = measured(example, scene)
        check_free(target.scene)
        problem = make(target)
        search = prepared(problem, batch_data(sample, problem.views[0].noise), orders, rows)
        errors = BatchErrors(problem, target, cube.calibrated, search)
    return PixelModel(scene, problem, example, search, errors)


def _sample(cube: Cube) -> dict[str, np.ndarray]:
    """A few pixels all over a cube, the one with most values first, as arrays (pixels, points) by name."""
    each = [np.unique([n // 2, n // 5, n - 1 - n // 5]) for n in cube.shape]
    where = [tuple(slice(i, i + 1) for i in at) for at in itertools.product(*each)]
    # where none of them has data, row by row
    rows = ((slice(i, i + 1), *(slice(None) for _ in cube.shape[1:])) for i in range(cube.shape[0]))
    for chosen in itertools.chain([where[:_SAMPLE]], ([row] for row in rows)):
        blocks = [cube.pixels(own) for own in chosen]
        sample = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
        known = np.sum(np.all([np.isfinite(x) for x in sample.values()], axis=0), axis=1)
        order = np.argsort(-known, kind="stable")[: np.sum(known > 0)][:_SAMPLE]
        if len(order):
            return {name: values[order] for name, values in sample.items()}
    raise DataError(f"{cube.path or 'cube'}: no pixel has data")


def _example(cube: Cube, sample: dict[str, np.ndarray]) -> Spectrum:
    """The first sampled spectrum that is none of a dead pixel; where noise makes all of them impossible, the
    first within the limits of its signal."""
    limits = {"values": PSI, "delta": DELTA} if "delta" in sample else {"values": (0.0, HIGHEST)}
    first = {name: _complete(rows[0]) for name, rows in sample.items()}
    within = first | {name: np.clip(first[name], *ends) for name, ends in limits.items()}
    others = ({name: _complete(rows[i]) for name, rows in sample.items()} for i in range(1, _SAMPLE))
    for pixel in (first, *itertools.islice(others, len(sample["values"]) - 1)):
        try:
            return spectrum(cube, pixel)
        except DataError:
            continue
    return spectrum(cube, within)


def bands_off(model: PixelModel, cube: Cube) -> list[str]:
    """A sentence on the few bands that are off to one side at most pixels of a sample, with the remedy."""
    with jax.enable_x64(True):
        data = batch_data(_sample(cube), model.problem.views[0].noise)
        far = model.errors.far(data, minima(model.search, data))
    sides = np.maximum(np.sum(far > 0, axis=0), np.sum(far < 0, axis=0))
    known = np.sum(np.isfinite(far), axis=0)
    off = (known >= _FEWEST) & (sides > _MOST * known)
    bands = cube.wavelength[off.reshape(cube.wavelength.size, -1).any(axis=1)]
    if not 0 < bands.size <= _SHARE * cube.wavelength.size:
        return []
    names = ",".join(f"{nm:.6g}" for nm in bands)
    return [
        f"bands at {names} nm are off to one side at most of {len(far)} pixels tried, by more than noise and"
        f" usual errors: if the instrument is wrong there, leave them out with --without-bands {names}"
    ]


def _complete(values: np.ndarray) -> np.ndarray:
    """The values of a pixel with those that are missing by linear interpolation."""
    known, at = np.isfinite(values), np.arange(values.size)
    return np.interp(at, at[known], values[known])


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


def fit_pixels(model: PixelModel, cube: Cube, where: tuple[slice, ...]) -> BatchFits:
    """Fit a block of pixels of a cube."""
    block = cube.pixels(where)
    with jax.enable_x64(True):
        data = batch_data(block, model.problem.views[0].noise)
        return model.errors.fits(data, minima(model.search, data))
