"""Growth and drainage: the rate of change of a thickness at each pixel of a map with an axis of time.

A straight line by weighted least squares through the whole series of a pixel, or through a window around each
time. Weights are those of the noise. Where a line does not fit, that is stated, and the error of the rate
contains what it misses. Errors that all times have in common (of an index, of the angle) are propagated as
one: their share of the rate is the slope of the systematic standard error itself.

The fits of a series do not start at the thickness of the time before: the scan that this would save takes 1
to 8 % of the processor time of a fit (4096 pixels of 100 bands), and finds the rivals that decide the status.

**Source:** Barlow 1989, Statistics, ch. 6 (straight line, correlated errors); Birge 1932, Phys. Rev. 40, 207
(enlargement of errors by the square root of the reduced chi-square).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pellicle.errors import UsageError
from pellicle.fitting.batch.data import BY_NEIGHBOURS, CODES

if TYPE_CHECKING:
    from xarray import DataArray, Dataset

TIME = "time"
RATES = ("no-data", "constant", "not-constant")
"""Words of `<parameter>_rate_status`: too few times; a straight line fits; it does not."""
_ONE_IN_A_THOUSAND = 3.09
"""Quantile of the normal distribution above which χ² is too large for a line."""
_SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}
_SPELLED = {"seconds": "s", "second": "s", "sec": "s", "minutes": "min", "minute": "min"}
_SPELLED |= {"hours": "h", "hour": "h", "days": "d", "day": "d"}
_PIXELS = 100_000
"""Pixels that are computed at a time."""


class Line(NamedTuple):
    """Straight lines through the values of pixels, arrays (pixels,).

    `rate` with its errors by the noise and by what all times have in common; `chi2` of the line, `points` on
    it, and `curvature` in standard errors: how much χ² falls by a parabola, with the sign of its bend.
    """

    rate: np.ndarray
    noise: np.ndarray
    systematic: np.ndarray
    chi2: np.ndarray
    points: np.ndarray
    curvature: np.ndarray


def growth(
    dataset: Dataset,
    *,
    window: int | None = None,
    unit: str | None = None,
) -> Dataset:
    """Compute rates of change of a map's thicknesses, with errors and the χ² of a constant rate.

    Times are used where a pixel has converged or its neighbours decide. Orders that jump from one time to the
    next are best decided before (`pellicle.mapping.continuity`, for which time is a direction as any other).

    **Arguments:**

    - `dataset`: of a map with the axis `time`: dates, or numbers with the attribute `units`.
    - `window`: number of times, at least 3, for a rate at each time from those around it; None for one rate
      of the whole series.
    - `unit` of time of the rates: "s", "min", "h" or "d"; by default the one in which the series is longer
      than one and shorter than the next, for dates and for numbers in such a unit.

    **Returns:** a new dataset with, for each thickness, `<parameter>_rate`, `_rate_stderr` (noise, systematic
    part, and scatter beyond noise), `_rate_stderr_noise`, `_rate_chi2_reduced`, `_rate_points`, and
    `_rate_status`: "no-data" for fewer than three times, "constant", or "not-constant" where χ² of the line,
    or a parabola's gain on it, occurs by chance in one case of a thousand. One rate for each pixel, or with
    `window` one for each time, too.

    **Raises:** UsageError for a map without times, fewer than three of them, or times without a unit.

    **Source:** of the module.
    """
    if TIME not in dataset["status"].dims or dataset.sizes[TIME] < 3:
        raise UsageError("a rate needs a map with an axis `time` of at least three times")
    if window is not None and window < 3:
        raise UsageError(f"`window` must be at least 3 times, got {window}")
    names = [str(name).removesuffix("_stderr_noise") for name in dataset.data_vars]
    names = [n for n in names if n.split("_")[-1] == "thickness" and f"{n}_stderr_noise" in dataset]
    if not names:
        raise UsageError("a rate needs a free thickness with its standard error, and this map has none")
    time, unit = elapsed(dataset[TIME], unit)
    made = dataset.copy()
    for name in names:
        for key, variable in _rate_variables(dataset, name, time, unit, window).items():
            made[f"{name}_{key}"] = variable
    return made


def _rate_variables(
    dataset: Dataset, name: str, time: np.ndarray, unit: str, window: int | None
) -> dict[str, tuple[Any, np.ndarray, dict[str, Any]]]:
    """Variables of the rate of one parameter: axes, values and attributes by name."""
    dims = dataset["status"].dims
    keys = ("status", name, f"{name}_stderr", f"{name}_stderr_noise")
    arrays = [np.moveaxis(np.asarray(dataset[key]), dims.index(TIME), 0) for key in keys]
    count, *rest = arrays[0].shape
    columns = [array.reshape(count, -1) for array in arrays]
    width = min(window or count, count)
    starts = range(count if window else 1)
    windows = [slice(i, i + width) for i in (min(max(k - width // 2, 0), count - width) for k in starts)]
    parts = [slice(i, i + _PIXELS) for i in range(0, max(columns[0].shape[1], 1), _PIXELS)]
    rates = [[_rates(time[w], *(array[w, part] for array in columns)) for part in parts] for w in windows]
    axes, shape = tuple(dim for dim in dims if dim != TIME), tuple(rest)
    if window:
        axes, shape = (TIME, *axes), (count, *shape)
    of = f"{dataset[name].attrs.get('units', 'nm')}/{unit}"
    variables = {}
    for i, (key, dtype, words, units) in enumerate(
        (
            ("rate", np.float64, "rate of change", of),
            ("rate_stderr", np.float32, "standard error of the rate, of noise, model and scatter", of),
            ("rate_stderr_noise", np.float32, "standard error of the rate, of the noise alone", of),
            ("rate_chi2_reduced", np.float32, "reduced chi-square of a constant rate", "1"),
            ("rate_points", np.uint16, "number of times of the rate", "1"),
            ("rate_status", np.uint8, "", ""),
        )
    ):
        values = np.stack([np.concatenate([part[i] for part in row]) for row in rates]).reshape(shape)
        about = {"long_name": f"{words} of {name}", "units": units}
        variables[key] = axes, values.astype(dtype), about
    flags = {"flag_values": np.arange(len(RATES), dtype=np.uint8), "flag_meanings": " ".join(RATES)}
    return variables | {"rate_status": (*variables["rate_status"][:2], flags)}


def straight_line(
    time: np.ndarray, value: np.ndarray, noise: np.ndarray, systematic: np.ndarray, used: np.ndarray
) -> Line:
    """Fit a straight line to each column of `value` (times, pixels) by weighted least squares.

    **Arguments:** `time` (times,), errors by the noise and in common (times, pixels), and where values are
    `used`.
    """
    weight = np.where(used, np.where(used, noise, 1.0) ** -2.0, 0.0)
    total = weight.sum(axis=0)
    points = used.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        x = np.where(used, time[:, None] - (weight * time[:, None]).sum(axis=0) / total, 0.0)
        lever = weight * x / (weight * x**2).sum(axis=0)  # ∂ rate / ∂ value
        y = np.where(used, value - (weight * np.where(used, value, 0.0)).sum(axis=0) / total, 0.0)
        rate = (lever * y).sum(axis=0)
        residual = np.where(used, y - rate * x, 0.0)
        chi2 = (weight * residual**2).sum(axis=0)
        # the part of a parabola that a line does not have
        bend = x**2 - (weight * x**2).sum(axis=0) / total
        bend = np.where(used, bend - (lever * bend).sum(axis=0) * x, 0.0)
        curvature = (weight * bend * residual).sum(axis=0) / np.sqrt((weight * bend**2).sum(axis=0))
        enough = (points >= 3) & np.isfinite(rate)
        columns = (
            np.where(enough, rate, np.nan),
            np.where(enough, np.sqrt(((lever * np.where(used, noise, 0.0)) ** 2).sum(axis=0)), np.nan),
            np.where(enough, np.abs((lever * np.where(used, systematic, 0.0)).sum(axis=0)), np.nan),
            np.where(enough, chi2, np.nan),
        )
    return Line(*columns, points, np.where(points > 3, np.nan_to_num(curvature), 0.0))


def _rates(
    time: np.ndarray, state: np.ndarray, value: np.ndarray, stderr: np.ndarray, noise: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Rates of some pixels (pixels,) in a window: value, errors, reduced χ², number of times and status."""
    value, stderr, noise = (array.astype(float) for array in (value, stderr, noise))
    used = np.isin(state, [CODES["converged"], CODES[BY_NEIGHBOURS]])
    used &= np.isfinite(value) & np.isfinite(stderr) & (noise > 0) & np.isfinite(noise)
    line = straight_line(time, value, noise, np.sqrt(np.maximum(stderr**2 - noise**2, 0.0)), used)
    free = np.maximum(line.points - 2, 1)
    reduced = line.chi2 / free
    # χ² to a normal variable: Wilson and Hilferty 1931, PNAS 17, 684
    part = 2 / (9 * free)
    excess = (np.cbrt(reduced) - (1 - part)) / np.sqrt(part)
    bent = (excess > _ONE_IN_A_THOUSAND) | (np.abs(line.curvature) > _ONE_IN_A_THOUSAND)
    constant, not_constant = RATES.index("constant"), RATES.index("not-constant")
    status = np.where(np.isfinite(line.rate), np.where(bent, not_constant, constant), 0)
    enlarged = np.hypot(line.noise * np.sqrt(np.maximum(reduced, 1.0)), line.systematic)
    return line.rate, enlarged, line.noise, reduced, line.points, status


def first_date(array: DataArray) -> str:
    """Date of the first time, as ISO 8601, or an empty text where times have no date."""
    [first] = np.asarray(array.values[:1])
    return str(first.astype("datetime64[ms]")) if array.dtype.kind == "M" else ""


def elapsed(array: DataArray, unit: str | None) -> tuple[np.ndarray, str]:
    """Times since the first one, and their unit."""
    if unit is not None and unit not in _SECONDS:
        raise UsageError(f"`unit` must be one of {', '.join(_SECONDS)}, got {unit!r}")
    stamps = np.asarray(array.values)
    since = stamps - stamps[0]
    given = "s"
    if stamps.dtype.kind in "mM":
        since = since / np.timedelta64(1, "s")
    else:
        given = str(array.attrs.get("units", "")).split(" since ")[0].strip()
        given = _SPELLED.get(given, given)
    since = np.asarray(since, float)
    if not given:
        raise UsageError("times are numbers without a unit: give the coordinate `time` `units`, such as s")
    if given not in _SECONDS and unit is not None:
        raise UsageError(f"`unit` is {unit!r}, but the times are in {given!r}: leave it out")
    if not np.isfinite(since).all() or len(np.unique(since)) < 3:
        raise UsageError("a rate needs at least three different times, each of them known")
    if given not in _SECONDS:
        return since, given
    seconds = since * _SECONDS[given]
    spanned = [u for u in _SECONDS if np.ptp(seconds) >= _SECONDS[u]]
    chosen = unit or max(spanned, key=_SECONDS.__getitem__, default="s")
    return seconds / _SECONDS[chosen], chosen
