"""Lamp curve of a camera: one gain g(λ) that all pixels of a cube have in common, and its correction.

From a region of known reflectance g is the mean of measured over simulated values. Without one it is fitted
jointly with the films of many pixels. Each round fits the pixels, linearises each around its answer, and
solves for log g with the parameters of all pixels eliminated (Schur complement). Pixels of different
thickness have their fringes at different wavelengths, and g is what stays. The first rounds give each pixel a
slow scale of its own, which follows most of the lamp; the others have the scale of the scene. A gradient of
the light over the image (vignetting) needs a free one.

**Source:** Golub and Pereyra 2003, Inverse Problems 19, R1 (separable least squares); Triggs et al. 2000,
Bundle adjustment: a modern synthesis, LNCS 1883, section 6 (Schur complement of the parameters of each view).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from logging import getLogger
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np

from pellicle.data.cube import Cube
from pellicle.data.photographs import parse_regions
from pellicle.errors import DataError, UsageError
from pellicle.fitting.batch.data import BatchMinima, batch_data
from pellicle.fitting.batch.search import minima
from pellicle.fitting.status import RIVAL
from pellicle.mapping.pixels import prepare
from pellicle.scene.film import Light, Scene
from pellicle.scene.free import free_leaves
from pellicle.scene.instrument import SLOW_SCALE, Drift, Instrument
from pellicle.scene.layers import Layer
from pellicle.signals.registry import kind
from pellicle.simulation.spectra import simulate_signal

log = getLogger(__name__)

_PIXELS = 1000
"""Pixels of a cube from which a joint lamp curve is fitted."""
_FEWEST = 30
"""Fewest of them with a usable fit."""
_SEPARATE = 0.01
"""Least share of the information on any shape of g that the films of the pixels may leave: with 0.01 its
error is ten times that of known films. Fringes whose phases spread by 0.1 radian leave about this."""
_FIRST, _ROUNDS, _SETTLED = 3, 12, 0.2
"""Rounds with a slow scale, rounds at most after them, and the change of log g, in its standard errors, below
which it has settled."""
_DARK = 1e-3
"""Least simulated reflectance of a reference, as a share of its largest."""


@dataclass(frozen=True, eq=False, repr=False)
class LampCurve:
    """Gain of lamp and camera at each wavelength (nm), (bands,), with its standard error by the noise.

    Measured values are `gain` times those of the scene. `separation` is the least share of the information on
    any shape of the gain that the free parameters of the pixels leave, 1 for a region of known reflectance.
    `level` is False where the mean of log g is not determined and set to 0: the scale of the scene is free.
    """

    wavelength: np.ndarray
    gain: np.ndarray
    stderr: np.ndarray
    pixels: int
    separation: float = 1.0
    level: bool = True
    source: str = "joint"

    def __str__(self) -> str:
        low, high = self.gain.min(), self.gain.max()
        error = 100 * float(np.median(self.stderr / self.gain))
        how = "fitted together with the films of" if self.source == "joint" else f"of region {self.source},"
        level = "" if self.level else ", up to a constant factor"
        return (
            f"lamp curve {how} {self.pixels} pixels: gain {low:.4g} to {high:.4g}{level}, standard error"
            f" {error:.2g} %"
        )

    __repr__ = __str__

    def correct(self, cube: Cube) -> Cube:
        """The cube divided by the gain, block by block as it is read."""
        return cube.divided(self.gain, str(self))


def lamp_curve(
    cube: Cube,
    scene: Scene,
    region: str | Sequence[int] | None = None,
    *,
    reference: Scene | None = None,
) -> LampCurve:
    """Estimate the lamp curve that all pixels of a cube have in common.

    **Arguments:**

    - `cube` of R or T; `scene` of its pixels, as for a map.
    - `region`: "x,y,width,height" of a part of the image whose scene is known, in pixels from the upper left
      corner: that of `reference`, by default the substrate of `scene` without layers. None for a joint fit of
      the lamp and of the films of a thousand pixels.

    **Returns:** `LampCurve`; `correct` divides a cube by it.

    A gradient of the light over the image is no lamp curve: a free scale of each pixel allows for it. What
    the scene has wrong for all pixels alike, such as an index, becomes part of a joint curve.

    **Raises:** UsageError for ellipsometry, which has no lamp curve, for a region outside the image or of a
    scene with free parameters, and where the pixels differ too little to tell their films from the lamp;
    DataError where too few pixels have data.

    **Source:** of the module.
    """
    if kind(cube.signal).ellipsometric:
        raise UsageError("ellipsometry compares polarisations of the same light and has no lamp curve")
    if region is None:
        return _joint(cube, scene)
    bare = Scene(Layer(1.0, 0.0), scene.substrate, scene.ambient, scene.light, scene.instrument)
    return _of_region(cube, bare if reference is None else reference, region)


def lamp_curve_of(
    wanted: str | Sequence[int] | LampCurve, cube: Cube, scene: Scene, reference: Scene | None = None
) -> LampCurve:
    """The lamp curve of an argument of a map: a curve, "joint", or a region. Raises as `lamp_curve`."""
    if isinstance(wanted, LampCurve):
        if len(wanted.gain) != cube.wavelength.size:
            raise UsageError(
                f"`lamp_curve` has {len(wanted.gain)} bands, and the cube has {cube.wavelength.size}"
            )
        return wanted
    if wanted == "joint" and reference is not None:
        raise UsageError("`lamp_reference` is of a region: give it as `lamp_curve`, x,y,width,height")
    return lamp_curve(cube, scene, None if wanted == "joint" else wanted, reference=reference)


def _of_region(cube: Cube, reference: Scene, region: str | Sequence[int]) -> LampCurve:
    """Mean of measured over simulated values of a region, and its standard error."""
    [box, *others] = parse_regions(region, "lamp_curve")
    if others or cube.dims[-2:] != ("y", "x"):
        raise UsageError("`lamp_curve` must be joint or one rectangle x,y,width,height of an image")
    height, width = cube.shape[-2:]
    if min(box.x, box.y) < 0 or box.x + box.width > width or box.y + box.height > height:
        raise UsageError(f"`lamp_curve` {box} leaves the image of {width} by {height} pixels; shrink it")
    known = eqx.tree_at(lambda s: s.instrument, reference, Instrument())
    if free_leaves(known):
        raise UsageError("`lamp_reference` must be known: fix the free parameters of its scene")
    wavelength, angle = cube.wavelength, known.light.angle
    if cube.angle is not None:
        wavelength, angle = np.repeat(wavelength, cube.angle.size), np.tile(cube.angle, wavelength.size)
    light = Light(None, angle, cube.signal, cube.polarisation, known.light.azimuth)
    known = eqx.tree_at(lambda s: s.light, known, light, is_leaf=lambda x: x is None)
    simulated = simulate_signal(known, wavelength).clean
    rows = (slice(None),) * (len(cube.dims) - 2)
    values = cube.pixels((*rows, slice(box.y, box.y + box.height), slice(box.x, box.x + box.width)))["values"]
    bands = cube.wavelength.size
    usable = np.abs(simulated) > _DARK * np.abs(simulated).max()
    ratio = np.where(usable, values / np.where(usable, simulated, 1.0), np.nan)
    ratio = np.moveaxis(ratio.reshape(len(ratio), bands, -1), 1, 0).reshape(bands, -1)
    count = np.isfinite(ratio).sum(axis=1)
    if count.min() < 4:
        nm = cube.wavelength[np.argmin(count)]
        raise DataError(
            f"{cube.path or 'cube'}: region {box} has fewer than four measured values at {nm:g} nm"
        )
    gain = np.nanmean(ratio, axis=1)
    stderr = np.nanstd(ratio, axis=1, ddof=1) / np.sqrt(count)
    if gain.min() <= 0:
        nm = cube.wavelength[np.argmin(gain)]
        raise DataError(f"{cube.path or 'cube'}: region {box} is dark at {nm:g} nm; choose a brighter one")
    return LampCurve(cube.wavelength, gain, stderr, len(values), source=str(box))


class _Step(NamedTuple):
    """Change of log g (bands,) and its variance by one linear step; least share of information left."""

    change: np.ndarray
    variance: np.ndarray
    separation: float


def _joint(cube: Cube, scene: Scene) -> LampCurve:
    """Fit the gain together with the films of a sample of pixels.

    Raises UsageError where the films are too much alike, DataError for too few usable pixels.
    """
    scale: Any = scene.instrument.scale
    own_scale = isinstance(scale, Drift)
    first = eqx.tree_at(lambda s: s.instrument, scene, replace(scene.instrument, scale=SLOW_SCALE))
    rounds = [*[first] * (0 if own_scale and scale.degree else _FIRST), *[scene] * _ROUNDS]
    sample = _sample(cube)
    bands = cube.wavelength.size
    angles = 1 if cube.angle is None else cube.angle.size
    log_gain, step, good = np.zeros(bands), None, np.zeros(0, bool)
    if not cube.calibrated:  # counts follow the lamp first of all, and a slow scale follows only what is slow
        curve = np.log(np.maximum(np.nanmean(sample["values"], axis=0), 1e-12)).reshape(-1, angles)
        position = np.linspace(-1, 1, bands)
        smooth = np.polynomial.Chebyshev.fit(position, curve.mean(axis=1), 4, [-1, 1])
        log_gain = smooth(position)
    search, last = None, None
    with jax.enable_x64(True):
        for trial in rounds:
            gain = np.repeat(np.exp(log_gain), angles)
            block = {name: values / gain for name, values in sample.items()}
            if search is None or trial is not last:
                shape = (-1, bands, *([] if cube.angle is None else [angles]))
                sites = {name: values.reshape(shape) for name, values in block.items()}
                in_memory = replace(cube, arrays=sites, dims=("site",), coords={}, mask=None)
                search, last = prepare(in_memory, trial).search, trial
            data = batch_data(block, search.problem.views[0].noise)
            answers = minima(search, data)
            weight = data.weight if "sigma" in block else (data.weight > 0).astype(float)
            good = _usable(answers, weight, data.values, cube.path or "cube")
            step = _step(answers, weight, data.values, good, search.view.data.position, angles, trial)
            if trial is scene and step.separation < _SEPARATE:
                raise UsageError(
                    "the films of the pixels are too much alike to be told from the lamp curve: the free"
                    f" parameters take all but {100 * step.separation:.2g} % of what the pixels say on some"
                    " shape of it; give a region of known reflectance"
                )
            change = step.change - (step.change.mean() if own_scale else 0.0)
            log_gain = log_gain + change
            log.info("lamp curve: %d pixels, largest change %.2g", good.sum(), np.abs(change).max())
            if trial is scene and np.all(np.abs(change) < _SETTLED * np.sqrt(step.variance)):
                break
    assert step is not None, "there is a round"
    gain = np.exp(log_gain).astype(np.float32).astype(float)  # the same in a later run, up to rounding
    stderr = gain * np.sqrt(step.variance)
    return LampCurve(cube.wavelength, gain, stderr, int(good.sum()), step.separation, not own_scale)


def _sample(cube: Cube) -> dict[str, np.ndarray]:
    """Pixels all over a cube, about so many, as arrays (pixels, points) by name."""
    steps = [1] * len(cube.shape)
    while math.prod(counts := [math.ceil(n / steps[axis]) for axis, n in enumerate(cube.shape)]) > _PIXELS:
        steps[int(np.argmax(counts))] += 1
    block = cube.pixels(tuple(slice(step // 2, None, step) for step in steps))
    known = np.isfinite(block["values"]).all(axis=1)
    if np.count_nonzero(known) < _FEWEST:
        raise DataError(f"{cube.path or 'cube'}: too few pixels are complete for a joint lamp curve")
    return {name: values[known] for name, values in block.items()}


def _usable(answers: BatchMinima, weight: np.ndarray, values: np.ndarray, path: str) -> np.ndarray:
    """Pixels whose fit has settled and is as close as the others', and as far as possible without a rival.

    Raises DataError for too few of them.
    """
    square = np.mean((weight * (values - answers.model)) ** 2, axis=1)
    good = answers.converged[:, 0] & np.isfinite(square)
    if good.any():
        good &= square <= 9 * np.median(square[good])
    variance = answers.misfit[:, 0] / values.shape[1]
    with np.errstate(invalid="ignore"):
        lead = (answers.deviance[:, 1] - answers.deviance[:, 0]) / variance
    clear = good & ~(lead < RIVAL)
    # while the curve is far off, all pixels may have rivals: wrong orders hardly agree on a curve
    good = clear if clear.sum() >= max(_FEWEST, 0.2 * good.sum()) else good
    if good.sum() < _FEWEST:
        raise DataError(
            f"{path}: {good.sum()} of {len(good)} pixels of the sample have a fit that can be used, and"
            f" {_FEWEST} are needed: give a region of known reflectance"
        )
    return good


def _step(
    answers: BatchMinima,
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
