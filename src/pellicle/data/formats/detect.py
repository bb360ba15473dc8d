"""Detection of ellipsometers' exports by their content.

Each reader takes the lines and comments of a file and returns a `Layout` of plain columns whose rows keep
their line numbers, or None for another format. Cells, units and axes are then checked as in any other
file, and messages name the lines of the user's file.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pellicle.data.formats import accurion, spectraray, woollam
from pellicle.data.tabular.layout import Layout
from pellicle.data.tabular.text import Line
from pellicle.errors import UsageError

Reader = Callable[[Sequence[Line], Sequence[Line], str], Layout | None]

READERS: tuple[Reader, ...] = (woollam.layout, spectraray.layout)


def find_export(
    lines: Sequence[Line], comments: Sequence[Line], path: str, spot: int | None = None
) -> Layout | None:
    """Return the layout of an instrument's format, or None.

    `spot`, from 1, selects one of several spots in a file. Raises DataError for an ambiguous file, UsageError
    for a missing or wrong spot.
    """
    layout = accurion.layout(lines, comments, path, spot)
    if layout is None and spot is not None:
        raise UsageError(f"{path}: `spot` selects a spot of an Accurion file, which this is not")
    layouts = (reader(lines, comments, path) for reader in READERS)
    return layout or next((layout for layout in layouts if layout), None)
