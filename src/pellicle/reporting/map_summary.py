"""Summary of the map of a cube: numbers and places of the statuses, values, errors, slopes, rates."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.errors import UsageError
from pellicle.fitting.batch.data import BY_NEIGHBOURS, CODES, NO_DATA, STATUSES
from pellicle.fitting.result import Status
from pellicle.mapping.continuity import evidence, row
from pellicle.mapping.growth import RATES, TIME, growth
from pellicle.mapping.map_result import Map, Run
from pellicle.mapping.store import variable_name
from pellicle.reporting.map_places import MapAxes, map_axes, place

if TYPE_CHECKING:
    from xarray import Dataset

DECIDED = (str(Status.CONVERGED), BY_NEIGHBOURS)
"""Statuses of pixels whose numbers can be used within their errors."""
MOST_PIXELS = 2_000_000
"""Pixels beyond which percentiles are those of every second, third, ... pixel of each row and column."""
LEAST_EXPLAINED = 0.5
"""Share of the variance from which a plane is stated."""


@dataclass(frozen=True, eq=False)
class Plane:
    """Least-squares plane through values: slopes by axis, rms beside it, its share of the variance."""

    slopes: Mapping[str, float]
    unit: str
    rms: float
    explains: float


@dataclass(frozen=True, eq=False)
class ParameterSummary:
    """A free parameter at the decided pixels.

    `percentiles` are the 0th, 5th, 50th, 95th and 100th, `mean` and `sd` those of the values; the standard
    errors are medians.
    """

    name: str
    variable: str
    unit: str
    percentiles: np.ndarray
    mean: float
    sd: float
    stderr: float
    stderr_noise: float
    plane: Plane | None

    @property
    def uniformity(self) -> float:
        """Range over twice the mean in percent, as for wafers; undefined of a mean that is not positive."""
        span = self.percentiles[4] - self.percentiles[0]
        return float(50 * span / self.mean) if self.mean > 0 else float("nan")


@dataclass(frozen=True, eq=False)
class MapSummary:
    """Summary of a map: pixels of each status and where they are, and the free parameters.

    `counts` has the statuses that occur, the most frequent first; `places` those of fewer than half of the
    pixels with data, and of pixels without data.
    """

    axes: MapAxes
    counts: Mapping[str, int]
    places: Mapping[str, str]
    parameters: tuple[ParameterSummary, ...]
    sampled: int  # percentiles are those of every n-th pixel
    attributes: Mapping[str, Any]
    plan: tuple[Mapping[str, Any], ...]  # rows of effects, as in the record of a fit
    run: Run | None  # None for a map that was computed earlier
    rates: tuple[RateSummary, ...] = ()  # of a series in time

    @property
    def pixels(self) -> int:
        """Number of pixels, with and without data."""
        return int(np.prod(self.axes.shape))

    @property
    def with_data(self) -> int:
        """Number of pixels with data."""
        return self.pixels - self.counts.get(NO_DATA, 0)

    @property
    def decided(self) -> int:
        """Number of pixels whose numbers can be used."""
        return sum(self.counts.get(word, 0) for word in DECIDED)

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on how the cube was read."""
        notes = self.attributes.get("notes", ())
        return tuple(notes.splitlines()) if isinstance(notes, str) else tuple(notes)


def free_parameters(dataset: Dataset) -> list[str]:
    """Variables of the free parameters of a map, in the order of the fits: those with a standard error."""
    order = [variable_name(str(text).split(" ")[0]) for text in dataset.attrs.get("parameters", ())]
    names = [str(name) for name in dataset.data_vars if not str(name).endswith("_rate")]
    free = [name for name in names if f"{name}_stderr" in dataset.data_vars]
    return sorted(free, key=lambda name: order.index(name) if name in order else len(order))


def parameter_name(dataset: Dataset, variable: str) -> str:
    """Name of a parameter in `pellicle.fit`."""
    return str(dataset[variable].attrs.get("parameter", variable))


def unit_of(dataset: Dataset, variable: str) -> str:
    """Unit of a variable, empty where it has none."""
    unit = str(dataset[variable].attrs.get("units", ""))
    return "" if unit == "1" else unit


def is_decided(codes: np.ndarray) -> np.ndarray:
    """True for codes of statuses whose numbers can be used."""
    return np.isin(codes, [CODES[word] for word in DECIDED])


def dataset_of(made: Dataset | Map) -> Dataset:
    """The dataset of a map."""
    return made.dataset if isinstance(made, Map) else made


def summarise(made: Dataset | Map) -> MapSummary:
    """Summarise a map; large ones are read in parts, and every n-th pixel for percentiles."""
    dataset, run = dataset_of(made), made.run if isinstance(made, Map) else None
    axes, codes = map_axes(dataset), np.asarray(dataset["status"])
    number = np.bincount(codes.ravel(), minlength=len(STATUSES))
    order = sorted(np.flatnonzero(number), key=lambda code: -number[code])
    counts = {STATUSES[code]: int(number[code]) for code in order}
    known = codes != CODES[NO_DATA]
    places = {}
    for word, count in counts.items():
        if word == NO_DATA and known.any():
            places[word] = place(~known, np.ones_like(known), axes)
        elif word != NO_DATA and count < 0.5 * known.sum():
            places[word] = place(codes == CODES[word], known, axes)
    thin = thinned(dataset, axes)
    used = is_decided(np.asarray(thin["status"]))
    shown = map_axes(thin)
    parameters = tuple(_parameter(thin, name, used, shown) for name in free_parameters(dataset))
    rates = summarise_rates(thin)
    about, counted = dict(dataset.attrs), evidence(dataset)
    plan = json.loads(about["plan"]) if about.get("plan") is not None else []
    if counted is not None and all(effect["effect"] != "neighbours" for effect in plan):
        plan.append(asdict(row(counted)))
    return MapSummary(axes, counts, places, parameters, _step(axes), about, tuple(plan), run, rates)


def thinned(dataset: Dataset, axes: MapAxes) -> Dataset:
    """Every n-th pixel of a large map, in each direction; all frames of a series."""
    along = dataset["status"].dims[-2 if axes.kind == "image" else -1 :]
    return dataset.isel({dim: slice(None, None, _step(axes)) for dim in along})


def _step(axes: MapAxes) -> int:
    """Step between the pixels from which percentiles are computed."""
    along = 2 if axes.kind == "image" else 1
    return max(int(np.ceil((np.prod(axes.shape, dtype=float) / MOST_PIXELS) ** (1 / along))), 1)


def _parameter(dataset: Dataset, variable: str, used: np.ndarray, axes: MapAxes) -> ParameterSummary:
    values, unit, medians = np.asarray(dataset[variable], dtype=float), unit_of(dataset, variable), []
    for name in (f"{variable}_stderr", f"{variable}_stderr_noise"):
        errors = np.asarray(dataset[name], dtype=float)[used] if name in dataset else np.full(1, np.nan)
        medians.append(float("nan") if np.all(np.isnan(errors)) else float(np.nanmedian(errors)))
    percentiles, mean, sd, plane = np.full(5, np.nan), float("nan"), float("nan"), None
    if (known := values[used][np.isfinite(values[used])]).size:
        percentiles = np.percentile(known, [0, 5, 50, 95, 100])
        mean, sd = float(known.mean()), float(known.std(ddof=1)) if known.size > 1 else float("nan")
        plane = _plane(values, used, axes, unit)
    name = parameter_name(dataset, variable)
    return ParameterSummary(name, variable, unit, percentiles, mean, sd, *medians, plane=plane)


def _plane(values: np.ndarray, used: np.ndarray, axes: MapAxes, unit: str) -> Plane | None:
    """The plane through the values of one image or of sites, the line through those of a line."""
    if axes.series is not None:
        return None
    directions = [axes.x] if axes.y is None else [axes.x, axes.y]
    if axes.kind == "image":
        assert axes.y is not None
        grid = np.meshgrid(axes.x.values, axes.y.values)
    else:
        grid = [axis.values for axis in directions]
    used = used & np.isfinite(values)
    own, units = values[used], {axis.unit for axis in directions}
    if own.size <= len(directions) + 1 or len(units) > 1:
        return None
    columns = np.stack([np.ones(own.size), *(part[used] - part[used].mean() for part in grid)], axis=1)
    solution, _, rank, _ = np.linalg.lstsq(columns, own, rcond=None)
    variance, rest = np.var(own), own - columns @ solution
    if rank < columns.shape[1] or variance == 0:
        return None
    explains = 1 - np.var(rest) / variance
    if explains < LEAST_EXPLAINED:
        return None
    [length] = units
    per = f"{unit or '1'}/{ {'pixels': 'pixel'}.get(length, length or 'step') }".replace(" ", "")
    slopes = {axis.name: float(s) for axis, s in zip(directions, solution[1:], strict=True)}
    return Plane(slopes, per, float(np.sqrt(np.mean(rest**2))), float(explains))


@dataclass(frozen=True)
class RateSummary:
    """Rate of change of one variable over the pixels: percentiles, median errors, and number of pixels whose
    rate is constant, and of those that a straight line does not fit."""

    variable: str
    unit: str
    percentiles: tuple[float, float, float]  # 5, 50 and 95 %
    stderr: float
    stderr_noise: float
    constant: int
    not_constant: int

    def __str__(self) -> str:
        low, middle, high = self.percentiles
        total = self.constant + self.not_constant
        others = "; a straight line does not fit the others" if self.not_constant else ""
        return (
            f"median {middle:.4g} {self.unit}, 5 to 95 %: {low:.4g} to {high:.4g}; standard error"
            f" {self.stderr:.2g} (median), of the noise {self.stderr_noise:.2g}; constant at"
            f" {self.constant} of {total} pixels{others}"
        )


def summarise_rates(dataset: Dataset) -> tuple[RateSummary, ...]:
    """Summaries of the rates of all thicknesses; none without a series of at least three known times."""
    if TIME not in dataset["status"].dims or dataset.sizes[TIME] < 3:
        return ()
    try:
        made = growth(dataset)
    except UsageError:  # times without unit, or no thickness
        return ()
    rates = []
    for name in (str(key).removesuffix("_rate_status") for key in made if str(key).endswith("_rate_status")):
        status = made[f"{name}_rate_status"].values
        known = status != RATES.index("no-data")
        if not known.any():
            continue
        values, *errors = (
            made[f"{name}_rate{key}"].values[known] for key in ("", "_stderr", "_stderr_noise")
        )
        low, middle, high = np.percentile(values, [5, 50, 95]).tolist()
        stderr, noise = (float(np.median(x)) for x in errors)
        counts = (int(np.count_nonzero(status == RATES.index(x))) for x in ("constant", "not-constant"))
        unit = made[f"{name}_rate"].attrs["units"]
        rates.append(RateSummary(name, unit, (low, middle, high), stderr, noise, *counts))
    return tuple(rates)
