"""Series: one fit of a film that changes, from a map of its spectra against time.

Each spectrum is fitted alone first, with its rivals, as a pixel of a map. Continuity then chooses the order
of interference, and a state-space smoother joins the spectra: linearised around the values at each time,
again after each pass.
"""

from __future__ import annotations

from dataclasses import dataclass
from inspect import signature
from itertools import pairwise
from logging import getLogger
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import numpy as np

from pellicle.data.cube import Cube
from pellicle.data.read_cube import read_cube, series_files
from pellicle.errors import UsageError
from pellicle.fitting.batch import polish
from pellicle.fitting.batch.data import BY_NEIGHBOURS, CODES, NO_DATA, STATUSES, batch_data
from pellicle.fitting.parameter import Parameter
from pellicle.fitting.result import Status
from pellicle.mapping.growth import TIME, elapsed
from pellicle.mapping.map_result import Map
from pellicle.mapping.order_path import OrderPath, order_path
from pellicle.mapping.pixels import PixelModel, prepare
from pellicle.mapping.run import map_cube
from pellicle.mapping.state_space import Quadratics, Smoothed, smooth
from pellicle.mapping.store import variable_name
from pellicle.scene.film import Scene
from pellicle.scene.free import FREELY, SHARED, SLOWLY
from pellicle.scene.instrument import Drift

if TYPE_CHECKING:
    from xarray import Dataset

log = getLogger(__name__)

SURE = 12.0
"""Least Δχ² of the best path through another minimum for an order that continuity decides."""
_PASSES, _SETTLED = 8, 0.05
"""Most passes of the smoother, and the change of all values, in standard errors, that ends them."""
_BLOCK = 4096
"""Times that are linearised at once."""


@dataclass(frozen=True, eq=False, repr=False)
class Series:
    """Thickness and rate of a film against time.

    - `dataset`: along `time` each parameter that varies, `_stderr`, `_stderr_noise`; of the one that varies
      slowly `rate` and `rate_stderr`, with its name before where there are several; without an axis the
      parameters that all times share; `status` in codes of `STATUSES`, and `rival_delta_chi2` of the best
      path through another minimum.
    - `breaks`: times before which the film changed abruptly.
    - `warnings`: sentences.
    - `map`: of the spectra, each fitted alone.
    """

    dataset: Dataset
    breaks: tuple[float, ...]
    warnings: tuple[str, ...]
    map: Map

    @property
    def times(self) -> np.ndarray:
        """Times since the first one (times,), in the unit of the `dataset`."""
        return np.asarray(self.dataset[TIME].values, float)

    @property
    def status(self) -> dict[str, int]:
        """Number of times of each status that occurs."""
        counts = np.bincount(self.dataset["status"].values, minlength=len(STATUSES))
        return {word: int(counts[code]) for word, code in CODES.items() if counts[code]}

    @property
    def decided(self) -> float:
        """Share of the times with data that have one answer, of their own or by continuity."""
        status = self.status
        known = sum(status.values()) - status.get(NO_DATA, 0)
        return (status.get(str(Status.CONVERGED), 0) + status.get(BY_NEIGHBOURS, 0)) / max(known, 1)

    def __getitem__(self, name: str) -> Any:
        return self.dataset[variable_name(name)]

    def __repr__(self) -> str:
        low, high = self.times[[0, -1]]
        unit = self.dataset[TIME].attrs.get("units", "")
        decided = f"{100 * self.decided:.3g} % decided"
        return f"series of {len(self.times)} times from {low:g} to {high:g} {unit}, {decided}"


class _State(NamedTuple):
    """The answer of all times that have data: the path of orders, and the smoothed parameters."""

    path: OrderPath
    smoothed: Smoothed
    used: np.ndarray  # positions of the times with data


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
    return smoothed_series(cube, scene, map_cube(cube, scene, **options))


def smoothed_series(cube: Cube, scene: Scene, made: Map) -> Series:
    """Join the fits of a map of one spectrum at each time.

    A thickness varies slowly, and all times share the other parameters, where their `varies` is None.

    **Raises:** UsageError for fewer than three times with data, and where nothing varies.
    """
    dataset = made.dataset.load()
    time, unit = elapsed(dataset[TIME], None)
    model = prepare(cube, scene)
    kinds = _kinds(model.parameters)
    with jax.enable_x64(True):
        state = _joined(model, cube, dataset, time, kinds)
    return _series(model, dataset, time, unit, kinds, state, made)


def _check_times(cube: Cube) -> None:
    """Raise UsageError for times that are absent, go back or stand twice."""
    if TIME not in cube.coords:
        raise UsageError(
            f"{cube.path or 'data'}: has no coordinate `time`: assign the times, with their `units`"
        )
    time = np.asarray(cube.coords[TIME])
    if time.size < 3:
        raise UsageError(
            f"{cube.path or 'series'}: has {time.size} times, and a series needs three times at least"
        )
    back = np.flatnonzero(time[1:] <= time[:-1])
    if back.size:
        i = int(back[0])
        word = "stands twice" if time[i + 1] == time[i] else "comes after a later one"
        raise UsageError(
            f"{cube.path or 'series'}: time {i + 2} of {len(time)} {word}: sort the spectra, one of each time"
        )


def _kinds(parameters: tuple[Parameter, ...]) -> tuple[str, ...]:
    """How the parameters vary. Raises UsageError where none does."""
    kinds = tuple(p.varies or (SLOWLY if p.key == "thickness" else SHARED) for p in parameters)
    if SLOWLY not in kinds and FREELY not in kinds:
        raise UsageError("nothing varies in this series: free a thickness")
    return kinds


def _joined(
    model: PixelModel, cube: Cube, dataset: Dataset, time: np.ndarray, kinds: tuple[str, ...]
) -> _State:
    """Choose the orders, then smooth, linearise again, and so on until nothing moves."""
    names = [variable_name(p.name) for p in model.parameters]
    depth = model.problem.thickness_axis
    if depth is None:
        raise UsageError("a series needs a free thickness")
    minima = np.stack([np.asarray(dataset[f"order_{name}"], float) for name in names], axis=-1)
    delta = np.asarray(dataset["order_delta_chi2"], float)
    noise = np.stack([np.asarray(dataset[f"{name}_stderr_noise"], float) for name in names], axis=-1)
    delta = np.where(np.isfinite(minima[..., depth]) & np.isfinite(delta), delta, np.inf)
    used = np.flatnonzero(np.isfinite(delta).any(axis=1))
    if used.size < 3:
        raise UsageError(f"a series needs spectra at three times at least, and {used.size} have data")
    known = noise[used, depth]
    known = np.where(np.isfinite(known), known, np.median(known[np.isfinite(known)]))
    # a limit has no linear error
    limits = np.isin(np.asarray(dataset["status"])[used], [CODES[str(Status.NOT_IDENTIFIABLE)]])
    known = np.where(limits, np.maximum(known, minima[used, 0, depth]), known)
    path = order_path(time[used], minima[used][..., depth], delta[used], known)
    lower, upper = (np.array([getattr(p, side) for p in model.parameters]) for side in ("lower", "upper"))
    units = (minima[used, path.chosen] - lower) / (upper - lower)
    shared = np.array([kind == SHARED for kind in kinds])
    sure = path.rival > SURE if np.any(path.rival > SURE) else np.ones(len(used), bool)
    units[:, shared] = np.median(units[sure][:, shared], axis=0)
    factor = _noise_factor(
        _quadratic(model, cube, used, minima[used, 0], lower, upper), noise[used], upper - lower
    )
    along = np.diff(time[used]) / np.median(np.diff(time[used]))
    fastest = 10 * float(np.max(np.abs(np.diff(units[:, depth]) / along))) + 1e-3
    smoothed = None
    for number in range(_PASSES):
        curved = _quadratic(
            model, cube, used, np.clip(units, 0.0, 1.0), np.zeros(len(lower)), np.ones(len(lower))
        )
        information = curved.hessian * factor[:, None, None]
        vector = (
            np.einsum("tij,tj->ti", information, np.clip(units, 0.0, 1.0)) - curved.gradient * factor[:, None]
        )
        smoothed = smooth(
            time[used],
            Quadratics(vector, information),
            kinds,
            path.breaks,
            fastest,
            smoothed if number > 1 else None,
        )
        moved = np.abs(smoothed.mean - units) / np.sqrt(np.maximum(smoothed.variance, 1e-30))
        units = smoothed.mean
        log.info(
            "pass %d of the smoother: values moved by up to %.2g standard errors", number + 1, moved.max()
        )
        if moved.max() < _SETTLED:
            break
    assert smoothed is not None
    return _State(path, smoothed, used)


def _quadratic(
    model: PixelModel, cube: Cube, used: np.ndarray, values: np.ndarray, lower: Any, upper: Any
) -> polish.Curved:
    """Slopes and curvatures of the misfits of all times at their values."""
    units, parts = (values - lower) / (upper - lower), []
    for first in range(0, len(used), _BLOCK):
        which = used[first : first + _BLOCK]
        block = cube.pixels((slice(int(which[0]), int(which[-1]) + 1),))
        data = batch_data(
            {name: rows[which - which[0]] for name, rows in block.items()}, model.problem.views[0].noise
        )
        search = model.search
        parts.append(
            polish.in_rows(polish.curved, search.static, search.common, data, units[first : first + _BLOCK])
        )
    return polish.Curved(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _noise_factor(curved: polish.Curved, noise: np.ndarray, span: np.ndarray) -> np.ndarray:
    """Factors (times,) of the misfits that give the errors by the noise which each fit alone has: they hold
    its size, where no σ is given, and its correlation."""
    size = np.sqrt(np.maximum(np.einsum("tii->ti", curved.hessian), 1e-100))
    scaled = curved.hessian / (size[:, :, None] * size[:, None, :]) + 1e-12 * np.eye(len(span))
    variance = np.einsum("tii->ti", np.linalg.inv(scaled)) / size**2 * span**2
    known = np.isfinite(noise) & (noise > 0)
    ratio = np.ma.median(
        np.ma.array(variance / np.where(known, noise, 1.0) ** 2, mask=~known), axis=1
    ).filled(0.0)
    good = np.isfinite(ratio) & (ratio > 0)
    return np.where(good, ratio, np.median(ratio[good]) if good.any() else 1.0)


def _series(
    model: PixelModel,
    dataset: Dataset,
    time: np.ndarray,
    unit: str,
    kinds: tuple[str, ...],
    state: _State,
    made: Map,
) -> Series:
    """The result: values and errors in the parameters' own units, statuses and sentences."""
    import xarray

    path, smoothed, used = state
    variables: dict[str, Any] = {}
    for i, (parameter, kind) in enumerate(zip(model.parameters, kinds, strict=True)):
        name, span = variable_name(parameter.name), parameter.upper - parameter.lower
        value = parameter.lower + span * smoothed.mean[:, i]
        noise = span * np.sqrt(smoothed.variance[:, i])
        systematic = _systematic(dataset, name, used)
        total = np.hypot(noise, systematic)
        about = {"long_name": parameter.name, "units": parameter.unit or "1"}
        if kind == SHARED:
            columns = {
                "": value[-1],
                "_stderr": np.hypot(noise[-1], np.median(systematic)),
                "_stderr_noise": noise[-1],
            }
            variables |= {f"{name}{key}": ((), x, about) for key, x in columns.items()}
            continue
        columns = {"": value, "_stderr": total, "_stderr_noise": noise}
        variables |= {f"{name}{key}": (TIME, _along(x, used, len(time)), about) for key, x in columns.items()}
        if kind == SLOWLY:
            rate, own = span * smoothed.rate[:, i], span * np.sqrt(smoothed.rate_variance[:, i])
            common = np.abs(rate) * np.median(systematic / np.maximum(np.abs(value), 1e-300))
            about = {
                "long_name": f"rate of change of {parameter.name}",
                "units": f"{parameter.unit or '1'}/{unit}",
            }
            before = "" if kinds.count(SLOWLY) == 1 else f"{name}_"
            columns = {"": rate, "_stderr": np.hypot(own, common), "_stderr_noise": own}
            variables |= {
                f"{before}rate{key}": (TIME, _along(x, used, len(time)), about) for key, x in columns.items()
            }
    flags = {"flag_values": list(range(len(STATUSES))), "flag_meanings": " ".join(STATUSES)}
    variables["status"] = TIME, _status(dataset, path, used), flags
    rival = {"long_name": "delta chi2 of the best path through another minimum", "units": "1"}
    variables["rival_delta_chi2"] = TIME, _along(path.rival, used, len(time)), rival
    variables["chi2_reduced"] = TIME, np.asarray(dataset["chi2_reduced"], float), {"units": "1"}
    result = xarray.Dataset(
        variables, {TIME: (TIME, time, {"units": unit, "long_name": "time since the first"})}
    )
    # where the order is open a path may jump, and the film need not
    sure = path.breaks & (path.rival > SURE) & (np.roll(path.rival, 1) > SURE)
    breaks = tuple(float(x) for x in time[used][sure])
    return Series(result, breaks, _warnings(time, unit, used, breaks, result), made)


def _along(values: np.ndarray, used: np.ndarray, count: int) -> np.ndarray:
    result = np.full(count, np.nan)
    result[used] = values
    return result


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


def _status(dataset: Dataset, path: OrderPath, used: np.ndarray) -> np.ndarray:
    """Codes of the times: their own, but the order of an undecided one may be that of the series."""
    status = np.array(dataset["status"].values, np.uint8)
    converged, ambiguous = CODES[str(Status.CONVERGED)], CODES[str(Status.AMBIGUOUS)]
    own = status[used]
    open_order = np.isin(own, [converged, ambiguous]) & (path.rival <= SURE)
    own[open_order] = ambiguous
    decided = ~open_order & ((own == ambiguous) | ((own == converged) & (path.chosen > 0)))
    own[decided] = CODES[BY_NEIGHBOURS]
    status[used] = own
    return status


def _warnings(
    time: np.ndarray, unit: str, used: np.ndarray, breaks: tuple[float, ...], result: Dataset
) -> tuple[str, ...]:
    sentences = []
    if breaks:
        where = ", ".join(f"{x:g}" for x in breaks[:6]) + (" and others" if len(breaks) > 6 else "")
        sentences.append(f"the film changes abruptly before {where} {unit}: each part is fitted as a series")
    usual = float(np.median(np.diff(time)))
    gaps = [(time[a], time[b]) for a, b in pairwise(used) if time[b] - time[a] > 5 * usual]
    sentences += [f"no data between {a:g} and {b:g} {unit}" for a, b in gaps[:6]]
    codes = result["status"].values
    if share := np.mean(codes[used] == CODES[str(Status.AMBIGUOUS)]):
        sentences.append(
            f"the order of {100 * share:.3g} % of the times is not decided, by continuity neither"
        )
    return tuple(sentences)
