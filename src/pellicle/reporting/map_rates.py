"""Rates of change of a map with an axis of time, summarised for reports."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pellicle.errors import UsageError
from pellicle.mapping.growth import RATES, TIME, growth

if TYPE_CHECKING:
    from xarray import Dataset


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
    found = []
    for name in (str(key).removesuffix("_rate_status") for key in made if str(key).endswith("_rate_status")):
        status = made[f"{name}_rate_status"].values
        known = status != RATES.index("no-data")
        if not known.any():
            continue
        of = {key: made[f"{name}_rate{key}"].values[known] for key in ("", "_stderr", "_stderr_noise")}
        low, middle, high = np.percentile(of[""], [5, 50, 95]).tolist()
        found.append(
            RateSummary(
                name,
                made[f"{name}_rate"].attrs["units"],
                (low, middle, high),
                float(np.median(of["_stderr"])),
                float(np.median(of["_stderr_noise"])),
                int(np.count_nonzero(status == RATES.index("constant"))),
                int(np.count_nonzero(status == RATES.index("not-constant"))),
            )
        )
    return tuple(found)
