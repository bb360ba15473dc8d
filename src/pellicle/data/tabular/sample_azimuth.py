"""Azimuths of a sample in a file: rows of several are no repeats of one measurement."""

from __future__ import annotations

import numpy as np

from pellicle.data.tabular.columns import Column
from pellicle.data.tabular.table import Table
from pellicle.errors import DataError

_MOST_LISTED = 6


def check_azimuth(table: Table, column: Column | None) -> None:
    """Raise DataError for several azimuths of the sample; None where the table has no column of them."""
    if column is None:
        return
    [azimuths] = table.numbers([column.position])
    several = np.unique(azimuths)
    if len(several) > 1:
        listed = ", ".join(f"{azimuth:g}" for azimuth in several[:_MOST_LISTED])
        more = ", ..." if len(several) > _MOST_LISTED else ""
        raise DataError(
            f"{table.path}: {table.label(column.position)} has {len(several)} azimuths of the sample"
            f" ({listed}{more}), which are measurements of their own; write each into its own file"
        )
