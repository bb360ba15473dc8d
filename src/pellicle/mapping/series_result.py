"""Result of a series: thickness and rate of a film against time, with errors, statuses and sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pellicle.fitting.batch.data import BY_NEIGHBOURS, CODES, NO_DATA, STATUSES
from pellicle.fitting.parameter import Parameter
from pellicle.fitting.result import Status
from pellicle.mapping.growth import TIME
from pellicle.mapping.map_result import Map
from pellicle.mapping.order_path import OrderPath
from pellicle.mapping.state_space import Smoothed
from pellicle.mapping.store import variable_name
from pellicle.scene.free import MONOTONIC, SHARED, SLOWLY

if TYPE_CHECKING:
    from xarray import Dataset

SURE = 12.0
"""Least Δχ² of the best path through another minimum for an order that continuity decides."""
UNEXPLAINED = CODES[str(Status.MISFIT)], CODES[str(Status.NOT_CONVERGED)]
"""Codes of spectra that the scene does not explain."""
ERRORS = "", "_stderr", "_stderr_noise"
"""Ends of the names of a value and its errors."""


def status_counts(codes: np.ndarray) -> dict[str, int]:
    """Count the codes (...,) of each status that occurs."""
    counts = np.bincount(codes.ravel(), minlength=len(STATUSES))
    return {word: int(counts[code]) for word, code in CODES.items() if counts[code]}


def decided_share(status: Mapping[str, int]) -> float:
    """Share of the counts with data that have one answer, of their own or by continuity."""
    known = sum(status.values()) - status.get(NO_DATA, 0)
    return (status.get(str(Status.CONVERGED), 0) + status.get(BY_NEIGHBOURS, 0)) / max(known, 1)


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
        return status_counts(self.dataset["status"].values)

    @property
    def decided(self) -> float:
        """Share of the times with data that have one answer, of their own or by continuity."""
        return decided_share(self.status)

    def __getitem__(self, name: str) -> Any:
        return self.dataset[variable_name(name)]

    def __repr__(self) -> str:
        low, high = self.times[[0, -1]]
        unit = self.dataset[TIME].attrs.get("units", "")
        decided = f"{100 * self.decided:.3g} % decided"
        return f"series of {len(self.times)} times from {low:g} to {high:g} {unit}, {decided}"


class Joined(NamedTuple):
    """The answer of all times that have data: the path of orders, the smoothed parameters, their kinds of
    change, the positions of these times, times at which a film that turns abruptly fits, too, and variables
    beside the parameters, as `xarray.Dataset.assign` takes them."""

    path: OrderPath
    smoothed: Smoothed
    kinds: tuple[str, ...]
    used: np.ndarray
    turns: Sequence[float] = ()
    beside: Mapping[str, tuple[Any, ...]] = MappingProxyType({})


def series_of(
    made: Map,
    dataset: Dataset,
    parameters: tuple[Parameter, ...],
    times: tuple[np.ndarray, str, str],
    joined: Joined,
) -> Series:
    """Return the result in the parameters' own units.

    **Arguments:** the map of the spectra and its loaded `dataset`; `parameters` of the fits; `times` since
    the first one, their unit and its date, if known; the answer of all times.
    """
    import xarray

    (time, unit, start), path, used = times, joined.path, joined.used
    variables: dict[str, Any] = {}
    for i, parameter in enumerate(parameters):
        variables |= _variables(dataset, parameter, i, joined, unit)
    flags = {"flag_values": list(range(len(STATUSES))), "flag_meanings": " ".join(STATUSES)}
    rival = {"long_name": "delta chi2 of the best path through another minimum", "units": "1"}
    variables["rival_delta_chi2"] = TIME, path.rival, rival
    variables = {
        name: (dims, _along(x, used, len(time)) if dims else x, about)
        for name, (dims, x, about) in variables.items()
    }
    variables["status"] = TIME, _status(dataset, path, used), flags
    variables["chi2_reduced"] = TIME, np.asarray(dataset["chi2_reduced"], float), {"units": "1"}
    about = {"units": unit, "long_name": "time since the first"} | ({"start": start} if start else {})
    axis = {TIME: (TIME, time, about)}
    result = xarray.Dataset(variables, axis)
    # where the order is open a path may jump, and the film need not
    sure = path.breaks & (path.rival > SURE) & (np.roll(path.rival, 1) > SURE)
    breaks = tuple(float(x) for x in time[used][sure])
    return Series(result, breaks, _warnings(time, unit, joined, breaks, result), made)


def _variables(
    dataset: Dataset, parameter: Parameter, i: int, joined: Joined, unit: str
) -> dict[str, tuple[Any, Any, dict[str, str]]]:
    """Value, errors and rate of the i-th parameter: axes, values at the times with data, attributes."""
    smoothed, kinds = joined.smoothed, joined.kinds
    name, own_unit, span = (
        variable_name(parameter.name),
        parameter.unit or "1",
        parameter.upper - parameter.lower,
    )
    value = parameter.lower + span * smoothed.mean[:, i]
    noise, systematic = (span * np.sqrt(x[:, i]) for x in (smoothed.variance, smoothed.systematic))
    about = {"long_name": parameter.name, "units": own_unit}
    if kinds[i] == SHARED:
        numbers = value[-1], np.hypot(noise[-1], systematic[-1]), noise[-1]
        return {f"{name}{key}": ((), x, about) for key, x in zip(ERRORS, numbers, strict=True)}
    columns = value, np.hypot(noise, systematic), noise
    found: dict[str, Any] = {f"{name}{key}": (TIME, x, about) for key, x in zip(ERRORS, columns, strict=True)}
    if kinds[i] in (SLOWLY, MONOTONIC):
        rate, error = span * smoothed.rate[:, i], span * np.sqrt(smoothed.rate_variance[:, i])
        common = span * np.sqrt(smoothed.rate_systematic[:, i])
        about = {"long_name": f"rate of change of {parameter.name}", "units": f"{own_unit}/{unit}"}
        before = "" if sum(kind in (SLOWLY, MONOTONIC) for kind in kinds) == 1 else f"{name}_"
        columns = rate, np.hypot(error, common), error
        found |= {f"{before}rate{key}": (TIME, x, about) for key, x in zip(ERRORS, columns, strict=True)}
    return found


def _along(values: np.ndarray, used: np.ndarray, count: int) -> np.ndarray:
    result = np.full(count, np.nan)
    result[used] = values
    return result


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
    time: np.ndarray, unit: str, joined: Joined, breaks: tuple[float, ...], result: Dataset
) -> tuple[str, ...]:
    used, sentences = joined.used, []
    if breaks:
        where = ", ".join(f"{x:g}" for x in breaks[:6]) + (" and others" if len(breaks) > 6 else "")
        sentences.append(f"the film changes abruptly before {where} {unit}: each part is fitted as a series")
    usual = float(np.median(np.diff(time)))
    gaps = [(time[a], time[b]) for a, b in pairwise(used) if time[b] - time[a] > 5 * usual]
    sentences += [f"no data between {a:g} and {b:g} {unit}" for a, b in gaps[:6]]
    codes = result["status"].values
    out = np.setdiff1d(np.flatnonzero(np.isin(codes, UNEXPLAINED)), used)
    if out.size:
        where = ", ".join(f"{x:g}" for x in time[out[:6]]) + (" and others" if out.size > 6 else "")
        sentences.append(f"the scene does not explain the spectra at {where} {unit}: they are left out")
    if share := np.mean(codes[used] == CODES[str(Status.AMBIGUOUS)]):
        sentences.append(
            f"the order of {100 * share:.3g} % of the times is not decided, not even by continuity"
        )
    if joined.turns:
        where = ", ".join(f"{x:.4g}" for x in joined.turns[:6])
        sentences.append(
            f"a film that turns abruptly at an extremum of the light, as at {where} {unit}, fits as well:"
            ' `last`, varies = "monotonic" or another wavelength decides'
        )
    if share := np.mean(codes[used] == CODES[str(Status.MISFIT)]):
        sentences.append(f"the model does not follow the data at {100 * share:.3g} % of the times")
    return tuple(sentences)
