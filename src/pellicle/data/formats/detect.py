"""What ellipsometers export, told by its content and rewritten as plain columns.

Each reader takes the lines and the comments of a file and returns a `Layout` whose rows keep the
numbers of the lines they came from, or None for a file that is not of its kind. So cells, units and
axes are judged as in any other file, and messages name the user's own lines.
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
    """The layout of an instrument's own format, or None.

    `spot`, from 1, chooses among several in one file. Raises DataError for a file that is unclear,
    UsageError where spots leave open which, or there is no such spot.
    """
    found = accurion.layout(lines, comments, path, spot)
    if found is None and spot is not None:
        raise UsageError(f"{path}: --spot chooses among the spots of an Accurion file, which this is not")
    return found or next((known for reader in READERS if (known := reader(lines, comments, path))), None)
