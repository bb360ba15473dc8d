"""Figures of the map of a cube: values, standard errors, statuses, rivals and histograms."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from xarray import Dataset


def figures(dataset: Dataset) -> Iterator[tuple[str, Figure]]:
    """Draw a map: yield the name of each figure's file, without suffix, and the figure."""
    yield from ()
