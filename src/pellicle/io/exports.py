"""What ellipsometers export, told by its content and rewritten as plain columns.

Each reader takes the lines and the comments of a file and returns a `Layout` whose rows keep the
numbers of the lines they came from, or None for a file that is not of its kind. So cells, units and
axes are judged as in any other file, and messages name the user's own lines.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from pellicle.io import accurion, spectraray, woollam
from pellicle.io.layout import Layout
from pellicle.io.text import Line

Reader = Callable[[Sequence[Line], Sequence[Line], str], Layout | None]

READERS: tuple[Reader, ...] = (woollam.layout, spectraray.layout, accurion.layout)


def find_export(
    lines: Sequence[Line], comments: Sequence[Line], path: str, readers: Iterable[Reader] = READERS
) -> Layout | None:
    """The layout of an instrument's own format, or None. Raises DataError for one that is unclear."""
    return next((found for reader in readers if (found := reader(lines, comments, path))), None)
