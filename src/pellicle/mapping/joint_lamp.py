"""Lamp curve of a camera, fitted jointly with the films of many pixels.

Each round fits the pixels, linearises each around its answer, and solves for log g with the parameters of all
pixels eliminated (Schur complement). Pixels of different thickness have their fringes at different
wavelengths, and g is what stays. Each pixel has a slow scale of its own in these fits, so a gradient of the
light over the image (vignetting) does no harm; the map follows it by a free scale.

**Source:** Golub and Pereyra 2003, Inverse Problems 19, R1 (separable least squares); Triggs et al. 2000,
Bundle adjustment: a modern synthesis, LNCS 1883, section 6 (Schur complement of the parameters of each view).
"""

from __future__ import annotations

import math
from dataclasses import replace
from logging import getLogger
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np

from pellicle.data.cube import Cube
from pellicle.errors import DataError, UsageError
from pellicle.fitting.status import RIVAL
from pellicle.mapping.pixel_data import pixel_data
from pellicle.mapping.pixel_minima import PixelMinima
from pellicle.mapping.pixel_search import minima
from pellicle.mapping.pixels import prepare
from pellicle.scene.film import Scene
from pellicle.scene.instrument import SLOW_SCALE, Drift

log = getLogger(__name__)

PIXELS = 1000
"""Pixels of a cube from which a joint lamp curve is fitted."""
_FEWEST = 30
"""Fewest of them with a usable fit."""
_SEPARATE = 0.01
"""Least share of the information on any shape of g that the films of the pixels may leave: with 0.01 its
error is ten times that of known films. Fringes whose phases spread by 0.1 radian leave about this."""
_ROUNDS, _SETTLED = 12, 0.2
"""Rounds at most, and the change of log g, in its standard errors, below which it has settled."""


class JointGain(NamedTuple):
    """Gain and its standard error (bands,), pixels from which it is, least share of information left on any
    shape of it, and whether its level is determined."""

    gain: np.ndarray
    stderr: np.ndarray
    pixels: int
    separation: float
    level: bool


class _Step(NamedTuple):
    """Change of log g (bands,) and its variance by one linear step; least share of information left."""

    change: np.ndarray
    variance: np.ndarray
    separation: float


def joint_gain(cube: Cube, scene: Scene, pixels: int) -> JointGain:
    """Fit the gain together with the films of a sample of pixels.

    Raises UsageError where the films are too much alike, DataError for too few usable pixels.
    """
    scale: Any = scene.instrument.scale
    own_scale = isinstance(scale, Drift)
    if not own_scale or scale.degree == 0:
        scene = eqx.tree_at(lambda s: s.instrument, scene, replace(scene.instrument, scale=SLOW_SCALE))
    sample = _sample(cube, pixels)
    bands = cube.wavelength.size
    angles = 1 if cube.angle is None else cube.angle.size
    log_gain, step, used = np.zeros(bands), None, 0
    if not cube.calibrated:  # counts follow the lamp first of all, and a slow scale follows only what is slow
        log_gain = _smooth(np.log(np.maximum(np.nanmean(sample["values"], axis=0), 1e-12)), angles)
    table = None
    with jax.enable_x64(True):
        for _ in range(_ROUNDS):
            gain = np.repeat(np.exp(log_gain), angles)
            block = {name: values / gain for name, values in sample.items()}
            if table is None:
                table = prepare(_in_memory(cube, block), scene)
            data = pixel_data(block, table.problem.views[0].noise)
            found = minima(table.search, data)
            weight = data.weight if "sigma" in block else (data.weight > 0).astype(float)
            good = _usable(found, weight, data.values)
            used = int(good.sum())
            if used < _FEWEST:
                raise DataError(
                    f"{cube.path or 'cube'}: {used} of {len(good)} pixels of the sample have a fit that can"
                    f" be used, and {_FEWEST} are needed: give a region of known reflectance"
                )
            step = _step(found, weight, data.values, good, table.search.view.data.position, angles, scene)
            if step.separation < _SEPARATE:
                raise UsageError(
                    "the films of the pixels are too much alike to be told from the lamp curve: the free"
                    f" parameters take all but {100 * step.separation:.2g} % of what the pixels say on some"
                    " shape of it; give a region of known reflectance"
                )
            log_gain = log_gain + step.change
            if own_scale:
                log_gain = log_gain - log_gain.mean()
            moved = step.change - (step.change.mean() if own_scale else 0.0)
            log.info("lamp curve: %d pixels, largest change %.2g", used, np.abs(moved).max())
            if np.all(np.abs(moved) < _SETTLED * np.sqrt(step.variance)):
                break
    assert step is not None
    gain = np.exp(log_gain).astype(np.float32).astype(float)  # the same in a later run, up to rounding
    return JointGain(gain, gain * np.sqrt(step.variance), used, step.separation, not own_scale)


def _sample(cube: Cube, pixels: int) -> dict[str, np.ndarray]:
    """Pixels all over a cube, about so many, as arrays (pixels, points) by name."""
    every = max((math.prod(cube.shape) / pixels) ** (1 / len(cube.shape)), 1.0)
    steps = [min(math.ceil(every), max(n // 2, 1)) for n in cube.shape]
    block = cube.pixels(tuple(slice(step // 2, None, step) for step in steps))
    known = np.isfinite(block["values"]).all(axis=1)
    if np.count_nonzero(known) < _FEWEST:
        raise DataError(f"{cube.path or 'cube'}: too few pixels are complete for a joint lamp curve")
    return {name: values[known] for name, values in block.items()}


def _in_memory(cube: Cube, block: dict[str, np.ndarray]) -> Cube:
    """A cube of the sampled pixels as sites."""
    shape = (-1, cube.wavelength.size, *([] if cube.angle is None else [cube.angle.size]))
    arrays = {name: values.reshape(shape) for name, values in block.items()}
    return replace(cube, arrays=arrays, dims=("site",), coords={}, mask=None)


def _smooth(curve: np.ndarray, angles: int) -> np.ndarray:
    """A polynomial of degree 4 through the mean over the angles."""
    mean = curve.reshape(-1, angles).mean(axis=1)
    position = np.linspace(-1, 1, len(mean))
    return np.polynomial.chebyshev.chebval(position, np.polynomial.chebyshev.chebfit(position, mean, 4))


def _usable(found: PixelMinima, weight: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Pixels whose fit has settled and is as close as the others', and as far as possible without a rival."""
    square = np.mean((weight * (values - found.model)) ** 2, axis=1)
    good = found.converged[:, 0] & np.isfinite(square)
    if good.any():
        good &= square <= 9 * np.median(square[good])
    variance = found.misfit[:, 0] / values.shape[1]
    with np.errstate(invalid="ignore"):
        lead = (found.deviance[:, 1] - found.deviance[:, 0]) / variance
    clear = good & ~(lead < RIVAL)
    # while the curve is far off, all pixels may have rivals: wrong orders hardly agree on a curve
    return clear if clear.sum() >= max(_FEWEST, 0.2 * good.sum()) else good


def _step(
    found: PixelMinima,
    weight: np.ndarray,
    values: np.ndarray,
    good: np.ndarray,
    position: Any,
    angles: int,
    scene: Scene,
) -> _Step:
    """Solve for log g with the parameters of each pixel eliminated, from models around their answers."""
    model, offset = found.model[good], found.offset[good]
    weight, residual = weight[good], values[good] - model
    signal, gain = found.signal[good], found.gain[good]
    count, points, _ = found.slope[good].shape
    scale: Any = scene.instrument.scale
    terms = np.polynomial.chebyshev.chebvander(np.asarray(position)[:points], scale.degree)
    columns = [gain[..., None] * found.slope[good], signal[..., None] * terms]
    drift = scene.instrument.offset
    if isinstance(drift, Drift):
        shifts = np.polynomial.chebyshev.chebvander(np.asarray(position)[:points], drift.degree)
        columns.append(np.broadcast_to(shifts, (count, *shifts.shape)))
    matrix = weight[..., None] * np.concatenate(columns, axis=-1)
    length = np.sqrt((matrix**2).sum(axis=1, keepdims=True))
    basis, _ = np.linalg.qr(matrix / np.where(length > 0, length, 1.0))
    left = weight * residual
    left = left - np.einsum("npk,nk->np", basis, np.einsum("npk,np->nk", basis, left))
    # weights by what is left, as the noise of a pixel is not always known
    noise = np.sqrt((left**2).sum(axis=1) / max(points - basis.shape[2], 1))[:, None]
    steep = weight * (model - offset) / noise
    left = left / noise
    bands = points // angles
    own = (steep**2).reshape(count, bands, angles).sum(axis=(0, 2))
    shared = (steep[..., None] * basis).reshape(count, bands, angles, -1).sum(axis=2)
    shared = shared.transpose(1, 0, 2).reshape(bands, -1)
    unit = 1 / np.sqrt(own)
    share, shapes = np.linalg.eigh((np.diag(own) - shared @ shared.T) * unit * unit[:, None])
    slow = terms.shape[1]  # the scales of the pixels themselves, of which the mean is taken below
    share, shapes = share[slow:], unit[:, None] * shapes[:, slow:]
    change = shapes @ ((shapes.T @ (steep * left).reshape(count, bands, angles).sum(axis=(0, 2))) / share)
    curve = np.log(np.maximum(gain, 1e-12)).reshape(count, bands, angles).mean(axis=2)
    level = curve.mean(axis=1, keepdims=True)
    variance = (shapes**2 / share).sum(axis=1) + (curve - level).var(axis=0, ddof=1) / count
    return _Step(change + curve.mean(axis=0), variance, float(share[0]))
