"""Series: one fit of a film that changes, from a map of its spectra against time.

Each spectrum is fitted alone first, with its rivals, as a pixel of a map. Continuity then chooses the order
of interference, and a state-space smoother joins the spectra: linearised around the values at each time,
again after each pass.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from inspect import signature
from logging import getLogger
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from pellicle.data.cube import Cube
from pellicle.data.read_cube import read_cube, series_files
from pellicle.errors import UsageError
from pellicle.fitting.batch import polish
from pellicle.fitting.batch.data import CODES
from pellicle.fitting.parameter import Parameter
from pellicle.fitting.result import Status
from pellicle.mapping.growth import TIME, elapsed, first_date
from pellicle.mapping.lamp import lamp_curve_of
from pellicle.mapping.lamp_states import LampStates, lamp_states
from pellicle.mapping.map_result import Map
from pellicle.mapping.order_path import order_path
from pellicle.mapping.pixels import PixelModel, prepare
from pellicle.mapping.run import map_cube
from pellicle.mapping.series_residuals import residuals
from pellicle.mapping.series_result import SURE, UNEXPLAINED, Joined, Series, series_of
from pellicle.mapping.series_spectra import Spectra
from pellicle.mapping.state_space import Quadratics, Smoothed, smooth
from pellicle.mapping.store import variable_name
from pellicle.mapping.trace import is_trace, trace_of, undecided
from pellicle.scene.film import Scene
from pellicle.scene.free import FREELY, MONOTONIC, SHARED, SLOWLY
from pellicle.scene.instrument import Drift

if TYPE_CHECKING:
    from xarray import Dataset

log = getLogger(__name__)

Join = Callable[[PixelModel, Cube, "Dataset", np.ndarray, tuple[str, ...]], Joined]
"""Fit of all times together: of the model, the cube, the map's variables, the times and kinds of change."""

_PASSES, _SETTLED = 8, 0.05
"""Most passes of the smoother, and the change of all values, in standard errors, that ends them."""
_ORDERS = 12
"""Minima of each spectrum that continuity chooses from."""
_FEW, _WORSE = 0.2, 5.0
"""Largest share of the spectra that is left out because the scene does not explain them, and how many times
the usual rms of residuals theirs must be: with noise of 1 % one of 80 good spectra is a misfit by chance."""
_DRIFT = 1.0
"""Standard deviation of how much of its size a systematic effect drifts from the middle of the series to an
end: with 0.5 an index that drifts by 0.003 left 6 % of the true rates outside two errors."""


def fit_series(data: Any, scene: Scene, **options: Any) -> Series:
    """Fit a series; arguments as of `pellicle.series`."""
    of_reading = set(options) & {*signature(read_cube).parameters}
    reading: dict[str, Any] = {name: options.pop(name) for name in of_reading}
    if isinstance(scene.instrument.scale, Drift):  # values may have any level
        reading = {"calibrated": False} | reading
    cube = read_cube(series_files(data), **reading)
    if cube.dims != (TIME,):
        raise UsageError(
            f"{cube.path or 'data'}: a series has spectra along `time` only, and this has the axes"
            f" {', '.join(cube.dims)}: choose one position, or use pellicle map"
        )
    _check_times(cube)
    if is_trace(cube):
        trace = trace_of(cube, scene)
        model = prepare(trace.example, trace.scene)
        made = map_cube(trace.cube, trace.scene, fit=undecided, model=model, **options)
        return smoothed_series(trace.cube, model, made, trace.joined)
    if (lamp := options.pop("lamp_curve", None)) is not None:
        cube = lamp_curve_of(lamp, cube, scene).correct(cube)
    model = prepare(cube, scene, _ORDERS)
    _kinds_of_spectra(model.parameters)  # before the work is done
    return smoothed_series(cube, model, map_cube(cube, scene, model=model, **options))


def smoothed_series(cube: Cube, model: PixelModel, made: Map, join: Join | None = None) -> Series:
    """Join the fits of a map of one spectrum at each time, by the model that made it, as `join` does it.

    A thickness varies slowly, and all times share the other parameters, where their `varies` is None.

    **Raises:** UsageError for fewer than three times with data, and where nothing varies.
    """
    dataset = made.dataset.load()
    times = *elapsed(dataset[TIME], None), first_date(dataset[TIME])
    time = times[0]
    kinds = (_kinds if join else _kinds_of_spectra)(model.parameters)
    with jax.enable_x64(True):
        joined = (join or _joined)(model, cube, dataset, time, kinds)
        spectra = Spectra(model, cube, joined.used)
        left = dict(joined.beside)
        if join is None:
            left |= residuals(spectra, time, joined.smoothed.mean[:, : len(kinds)])
    found = series_of(made, dataset, model.parameters, times, joined)
    return replace(found, dataset=found.dataset.assign(left))


def _check_times(cube: Cube) -> None:
    """Raise UsageError for times that are absent, have no unit, go back or stand twice."""
    if TIME not in cube.coords:
        raise UsageError(
            f"{cube.path or 'data'}: has no coordinate `time`: assign the times, with their `units`"
        )
    time = np.asarray(cube.coords[TIME])
    if time.dtype.kind not in "mM" and not cube.units.get(TIME):
        raise UsageError(
            f"{cube.path or 'data'}: its times are numbers without a unit: give the coordinate `time` the"
            ' attribute `units`, such as "s"'
        )
    if time.size < 3:
        raise UsageError(
            f"{cube.path or 'series'}: a series needs three times at least, and this has {time.size}"
        )
    back = np.flatnonzero(time[1:] <= time[:-1])
    if back.size:
        i = int(back[0])
        word = "stands twice" if time[i + 1] == time[i] else "comes after a later one"
        raise UsageError(
            f"{cube.path or 'series'}: time {i + 2} of {len(time)} {word}: sort the spectra, one of each time"
        )


def _kinds(parameters: tuple[Parameter, ...]) -> tuple[str, ...]:
    """Kinds of change of the parameters. Raises UsageError where none changes."""
    kinds = tuple(p.varies or (SLOWLY if p.key == "thickness" else SHARED) for p in parameters)
    if not {SLOWLY, MONOTONIC, FREELY} & {*kinds}:
        raise UsageError("nothing varies in this series: free a thickness")
    return kinds


def _kinds_of_spectra(parameters: tuple[Parameter, ...]) -> tuple[str, ...]:
    """Kinds of change of the parameters of spectra. Raises UsageError for a monotonic one."""
    kinds = _kinds(parameters)
    if MONOTONIC in kinds:
        raise UsageError('varies = "monotonic" is of the thickness of a trace: write "slowly" for spectra')
    return kinds


def _joined(
    model: PixelModel, cube: Cube, dataset: Dataset, time: np.ndarray, kinds: tuple[str, ...]
) -> Joined:
    """Choose the orders, then smooth, linearise again, and so on until nothing moves."""
    depth = model.problem.thickness_axis
    if depth is None:
        raise UsageError("a series needs a free thickness")
    names = [variable_name(p.name) for p in model.parameters]
    minima = np.stack([np.asarray(dataset[f"order_{name}"], float) for name in names], axis=-1)
    noise = np.stack([np.asarray(dataset[f"{name}_stderr_noise"], float) for name in names], axis=-1)
    delta = np.asarray(dataset["order_delta_chi2"], float)
    delta = np.where(np.isfinite(minima[..., depth]) & np.isfinite(delta), delta, np.inf)
    used = _explained(np.flatnonzero(np.isfinite(delta).any(axis=1)), dataset)
    if used.size < 3:
        raise UsageError(f"a series needs spectra at three times at least, and {used.size} have data")
    time, minima, noise, spectra = time[used], minima[used], noise[used], Spectra(model, cube, used)
    limits = np.asarray(dataset["status"])[used] == CODES[str(Status.NOT_IDENTIFIABLE)]
    systematic = _systematic(dataset, names[depth], used)
    known = _known_error(noise[:, depth], np.maximum(minima[:, 0, depth], systematic), limits)
    path = order_path(time, minima[..., depth], delta[used], known, systematic)
    lower, upper = (np.array([getattr(p, side) for p in model.parameters]) for side in ("lower", "upper"))
    units = (minima - lower) / (upper - lower)
    factor = _noise_factor(spectra.quadratic(units[:, 0]), noise / (upper - lower))
    units = _start(units[np.arange(used.size), path.chosen], path.rival, kinds)
    along = np.diff(time) / np.median(np.diff(time))
    fastest = 10 * float(np.max(np.abs(np.diff(units[:, depth]) / along))) + 1e-3
    lamp = lamp_states(model, spectra, units)
    about = time, (*kinds, *lamp.kinds), path.breaks, fastest
    smoothed, quadratics = _settled(spectra, about, units, factor, lamp)
    at = np.clip(smoothed.mean[:, : len(kinds)], 0.0, 1.0)
    changes = spectra.responses(at) / (upper - lower)
    # together as large as the error of each time alone, which the data may have limited
    size = np.sqrt(np.sum(changes[..., depth] ** 2, axis=1))
    share = systematic / (upper - lower)[depth] / np.where(size > 0, size, np.inf)
    if lamp.names:
        pushes = lamp.pushes(spectra, at, share * factor)
    else:
        pushes = np.einsum("tij,tkj->tik", quadratics.information, changes * share[:, None, None])
    drift = _DRIFT * np.interp(time, time[[0, -1]], [-1, 1])[:, None, None]
    lasting = np.sqrt(1 - _DRIFT**2 / 3)  # together they keep the mean variance
    pushes = np.concatenate([lasting * pushes, drift * pushes], axis=2)
    smoothed = smooth(time, quadratics._replace(pushes=pushes), *about[1:], smoothed)
    return Joined(path, smoothed, kinds, used, beside=lamp.variables(smoothed, used, len(dataset[TIME])))


def _explained(used: np.ndarray, dataset: Dataset) -> np.ndarray:
    """The times `used`, without those of a few spectra that the scene does not explain, as of a closed
    shutter: they would bend the film at all times near them."""
    rms, wrong = (np.asarray(dataset[name])[used] for name in ("rms", "status"))
    wrong = np.isin(wrong, UNEXPLAINED)
    if wrong.all():
        return used
    wrong &= rms > _WORSE * np.median(rms[~wrong])
    return used[~wrong] if wrong.mean() <= _FEW else used


def _settled(
    spectra: Spectra,
    about: tuple[np.ndarray, tuple[str, ...], np.ndarray, float],
    units: np.ndarray,
    factor: np.ndarray,
    lamp: LampStates,
) -> tuple[Smoothed, Quadratics]:
    """Smooth and linearise from `units` (times, parameters) until nothing moves; the misfits times `factor`.

    `about` are times, kinds of change of parameters and states of the lamp, breaks and the fastest rate.
    """
    time, kinds, breaks, fastest = about
    smoothed, none, own = None, np.zeros((len(units), len(kinds), 0)), units.shape[1]
    quadratics = Quadratics(none, none, none)
    for number in range(_PASSES):
        at = np.clip(units, 0.0, 1.0)
        curved, states = lamp.beside(spectra, at, spectra.quadratic(at))
        at = np.concatenate([at, states], axis=1)
        information = curved.hessian * factor[:, None, None]
        vector = np.einsum("tij,tj->ti", information, at) - curved.gradient * factor[:, None]
        quadratics = Quadratics(vector, information, none)
        like = smoothed if number > 1 else None  # the stiffness is that of the second pass
        smoothed = smooth(time, quadratics, kinds, breaks, fastest, like)
        mean, variance = smoothed.mean[:, :own], smoothed.variance[:, :own]
        moved, units = np.max(np.abs(mean - units) / np.sqrt(np.maximum(variance, 1e-30))), mean
        log.info("pass %d of the smoother: values moved by up to %.2g standard errors", number + 1, moved)
        if moved < _SETTLED:
            break
    assert smoothed is not None
    return smoothed, quadratics


def _known_error(noise: np.ndarray, thickness: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """Errors (times,) of thicknesses by the noise; where there is only a limit, at least the thickness."""
    finite = np.isfinite(noise)
    known = np.where(finite, noise, np.median(noise[finite]) if finite.any() else thickness)
    return np.where(limits, np.maximum(known, thickness), known)


def _start(units: np.ndarray, rival: np.ndarray, kinds: tuple[str, ...]) -> np.ndarray:
    """Values (times, parameters) of the path, those of shared parameters by the times of a sure order."""
    shared, sure = np.array([kind == SHARED for kind in kinds]), rival > SURE
    units[:, shared] = np.median(units[sure if sure.any() else ...][:, shared], axis=0)
    return units


def _noise_factor(curved: polish.Curved, noise: np.ndarray) -> np.ndarray:
    """Factors (times,) of the misfits that give the errors by the noise, in the unit cube, of each fit alone:
    they hold its size, where no σ is given, and its correlation."""
    size = np.sqrt(np.maximum(np.einsum("tii->ti", curved.hessian), 1e-100))
    scaled = curved.hessian / (size[:, :, None] * size[:, None, :]) + 1e-12 * np.eye(size.shape[1])
    variance = np.einsum("tii->ti", np.linalg.inv(scaled)) / size**2
    known = np.isfinite(noise) & (noise > 0)
    ratio = np.ma.median(
        np.ma.array(variance / np.where(known, noise, 1.0) ** 2, mask=~known), axis=1
    ).filled(0.0)
    good = np.isfinite(ratio) & (ratio > 0)
    return np.where(good, ratio, np.median(ratio[good]) if good.any() else 1.0)


def _systematic(dataset: Dataset, name: str, used: np.ndarray) -> np.ndarray:
    """Errors (times,) that all times have in common: of an index, of the angle."""
    stderr, noise = (np.asarray(dataset[f"{name}{key}"], float)[used] for key in ("_stderr", "_stderr_noise"))
    with np.errstate(invalid="ignore"):
        square = np.where(np.isfinite(stderr), stderr**2 - noise**2, np.nan)
    known = np.isfinite(square)
    if not known.any():
        return np.zeros(len(used))
    at = np.arange(len(used))
    return np.sqrt(np.maximum(np.interp(at, at[known], square[known]), 0.0))
