"""Lamp curve of a camera, fitted jointly with the films of many pixels.

Each round fits the pixels, linearises each around its answer, and solves for log g with the parameters of all
pixels eliminated (Schur complement). Pixels of different thickness have their fringes at different
wavelengths, and g is what stays. The first rounds give each pixel a slow scale of its own, which follows
most of the lamp; the others have the scale of the scene. A gradient of the light over the image (vignetting)
needs a free one.

**Source:** Golub and Pereyra 2003, Inverse Problems 19, R1 (separable least squares); Triggs et al. 2000,
Bundle adjustment: a modern synthesis, LNCS 1883, section 6 (Schur complement of the parameters of each view).
"""

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
from pellicle.mapping.pixels.data import PixelMinima, pixel_data
from pellicle.mapping.pixels.fit import prepare
from pellicle.mapping.pixels.search import minima
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
_FIRST, _ROUNDS, _SETTLED = 3, 12, 0.2
"""Rounds with a slow scale, rounds at most after them, and the change of log g, in its standard errors, below
which it has settled."""


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
    slow = own_scale and scale.degree > 0
    first = eqx.tree_at(lambda s: s.instrument, scene, replace(scene.instrument, scale=SLOW_SCALE))
    rounds = [*([] if slow else [first] * _FIRST), *[scene] * _ROUNDS]
    sample = _sample(cube, pixels)
    bands = cube.wavelength.size
    angles = 1 if cube.angle is None else cube.angle.size
    log_gain, step, used = np.zeros(bands), None, 0
    if not cube.calibrated:  # counts follow the lamp first of all, and a slow scale follows only what is slow
        log_gain = _smooth(np.log(np.maximum(np.nanmean(sample["values"], axis=0), 1e-12)), angles)
    search, last = None, None
    with jax.enable_x64(True):
        for trial in rounds:
            gain = np.repeat(np.exp(log_gain), angles)
            block = {name: values / gain for name, values in sample.items()}
            if search is None or trial is not last:
                search, last = prepare(_in_memory(cube, block), trial).search, trial
            data = pixel_data(block, search.problem.views[0].noise)
            answers = minima(search, data)
            weight = data.weight if "sigma" in block else (data.weight > 0).astype(float)
            good = _usable(answers, weight, data.values)
            used = int(good.sum())
            if used < _FEWEST:
                raise DataError(
                    f"{cube.path or 'cube'}: {used} of {len(good)} pixels of the sample have a fit that can"
                    f" be used, and {_FEWEST} are needed: give a region of known reflectance"
                )
            step = _step(answers, weight, data.values, good, search.view.data.position, angles, trial)
            if trial is scene and step.separation < _SEPARATE:
                raise UsageError(
                    "the films of the pixels are too much alike to be told from the lamp curve: the free"
                    f" parameters take all but {100 * step.separation:.2g} % of what the pixels say on some"
                    " shape of it; give a region of known reflectance"
                )
            change = step.change - (step.change.mean() if own_scale else 0.0)
            log_gain = log_gain + change
            log.info("lamp curve: %d pixels, largest change %.2g", used, np.abs(change).max())
            if trial is scene and np.all(np.abs(change) < _SETTLED * np.sqrt(step.variance)):
                break
    assert step is not None
    gain = np.exp(log_gain).astype(np.float32).astype(float)  # the same in a later run, up to rounding
    return JointGain(gain, gain * np.sqrt(step.variance), used, step.separation, not own_scale)


def _sample(cube: Cube, pixels: int) -> dict[str, np.ndarray]:
    """Pixels all over a cube, about so many, as arrays (pixels, points) by name."""
    steps = [1] * len(cube.shape)
    while (
        math.prod(counts := [math.ceil(n / step) for n, step in zip(cube.shape, steps, strict=True)]) > pixels
    ):
        steps[int(np.argmax(counts))] += 1
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


def _usable(answers: PixelMinima, weight: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Pixels whose fit has settled and is as close as the others', and as far as possible without a rival."""
    square = np.mean((weight * (values - answers.model)) ** 2, axis=1)
    good = answers.converged[:, 0] & np.isfinite(square)
    if good.any():
        good &= square <= 9 * np.median(square[good])
    variance = answers.misfit[:, 0] / values.shape[1]
    with np.errstate(invalid="ignore"):
        lead = (answers.deviance[:, 1] - answers.deviance[:, 0]) / variance
    clear = good & ~(lead < RIVAL)
    # while the curve is far off, all pixels may have rivals: wrong orders hardly agree on a curve
    return clear if clear.sum() >= max(_FEWEST, 0.2 * good.sum()) else good


def _step(
    answers: PixelMinima,
    weight: np.ndarray,
    values: np.ndarray,
    good: np.ndarray,
    position: Any,
    angles: int,
    scene: Scene,
) -> _Step:
    """Solve for log g with the parameters of each pixel eliminated, from models around their answers."""
    model, offset = answers.model[good], answers.offset[good]
    weight, residual = weight[good], values[good] - model
    signal, gain = answers.signal[good], answers.gain[good]
    count, points, _ = answers.slope[good].shape
    scale: Any = scene.instrument.scale
    free = scale.degree + 1 if isinstance(scale, Drift) else 0  # terms of the scale
    terms = np.polynomial.chebyshev.chebvander(np.asarray(position)[:points], max(free - 1, 0))[:, :free]
    columns = [signal[..., None] * terms, gain[..., None] * answers.slope[good]]
    drift = scene.instrument.offset
    if isinstance(drift, Drift):
        shifts = np.polynomial.chebyshev.chebvander(np.asarray(position)[:points], drift.degree)
        columns.append(np.broadcast_to(shifts, (count, *shifts.shape)))
    matrix = weight[..., None] * np.concatenate(columns, axis=-1)
    length = np.sqrt((matrix**2).sum(axis=1, keepdims=True))
    length = np.where(length > 0, length, 1.0)
    basis, triangle = np.linalg.qr(matrix / length)
    left = weight * residual
    left = left - np.einsum("npk,nk->np", basis, np.einsum("npk,np->nk", basis, left))
    # weights by what is left, as the noise of a pixel is not always known
    noise = np.sqrt((left**2).sum(axis=1) / max(points - basis.shape[2], 1))[:, None]
    step = _eliminated(weight * (model - offset) / noise, left / noise, basis, angles, free)
    if free > 1:
        # of the pixels' own slow scales, the mean is the lamp's: weights by their errors
        inverse = np.linalg.pinv(triangle)[:, :free] / length[:, 0, :free, None]
        error = np.einsum("pt,ntk->npk", terms, inverse)
        relative = (error**2).sum(axis=2) * noise**2 / gain**2
        mean, variance = _mean_scale(gain, relative, angles)
        step = step._replace(change=step.change + mean, variance=step.variance + variance)
    return step


def _eliminated(steep: np.ndarray, left: np.ndarray, basis: np.ndarray, angles: int, free: int) -> _Step:
    """The Schur complement of the parameters of all pixels, solved for log g.

    **Arguments:** `steep` (pixels, points), ∂ residual / ∂ log g; `left` (pixels, points), residuals without
    what the parameters of the pixel explain; `basis` (pixels, points, parameters), the span of these; `free`,
    terms of the scale of each pixel, which no shape of g may contain.
    """
    count, points = steep.shape
    bands = points // angles
    known = (steep**2).reshape(count, bands, angles).sum(axis=(0, 2))
    shared = (steep[..., None] * basis).reshape(count, bands, angles, -1).sum(axis=2)
    shared = shared.transpose(1, 0, 2).reshape(bands, -1)
    unit = 1 / np.sqrt(known)
    share, shapes = np.linalg.eigh((np.diag(known) - shared @ shared.T) * unit * unit[:, None])
    share, shapes = share[free:], unit[:, None] * shapes[:, free:]
    separation = float(share[0])
    share = np.where(share < _SEPARATE, np.inf, share)  # refused in the end; no large steps before
    change = shapes @ ((shapes.T @ (steep * left).reshape(count, bands, angles).sum(axis=(0, 2))) / share)
    return _Step(change, (shapes**2 / share).sum(axis=1), separation)


def _mean_scale(gain: np.ndarray, relative: np.ndarray, angles: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean over the pixels of log gain (pixels, points) by its relative variance, and the mean's variance."""
    count, points = gain.shape
    curve = np.log(np.maximum(gain, 1e-12)).reshape(count, points // angles, angles).mean(axis=2)
    heavy = 1 / relative.mean(axis=1)
    heavy = heavy[:, None] / heavy.sum()
    mean = (heavy * curve).sum(axis=0)
    away = curve - mean
    away = away - away.mean(axis=1, keepdims=True)
    return mean, (heavy**2 * away**2).sum(axis=0)
