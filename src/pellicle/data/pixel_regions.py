"""Pixels of a photograph to measure: rectangles, points and strips."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pellicle.data.read_photograph import Photograph
from pellicle.errors import UsageError

POINT = 2
"""Pixels around a point on each side, which are measured with it: 5 by 5, as colour pickers do."""
STRIP = 5
"""Pixels across a strip."""
_LONGEST = 4000
"""Most positions along a strip."""


class Region(NamedTuple):
    """A rectangle of pixels: column and row of its upper left corner, from 0, width and height."""

    x: int
    y: int
    width: int
    height: int

    def checked(self, name: str) -> Region:
        """Return the region. Raises UsageError for a negative corner, or without a pixel."""
        if min(self.x, self.y) < 0 or min(self.width, self.height) < 1:
            raise UsageError(f"`{name}` must be x,y,width,height in pixels, from 0, got {self}")
        return self

    def pixels(self, photograph: Photograph, name: str = "region") -> np.ndarray:
        """Coded pixels (N, 3). Raises UsageError where the rectangle leaves the photograph."""
        self.checked(name)
        width, height = photograph.size
        if self.x + self.width > width or self.y + self.height > height:
            raise UsageError(
                f"{photograph.path}: `{name}` {self} leaves the photograph of {width} by {height} pixels;"
                " shift or shrink it"
            )
        rows, columns = slice(self.y, self.y + self.height), slice(self.x, self.x + self.width)
        return photograph.pixels[rows, columns].reshape(-1, 3)

    def __str__(self) -> str:
        return f"{self.x},{self.y},{self.width},{self.height}"


def parse_regions(value: str | Sequence[int] | Sequence[Sequence[int]], name: str = "region") -> list[Region]:
    """Return the rectangles of `x,y,w,h;x,y,w,h`, of four numbers or of a list of them. Raises UsageError."""
    return [Region(*four).checked(name) for four in whole_numbers(value, 4, name, "x,y,width,height")]


def parse_points(
    value: str | Sequence[int] | Sequence[Sequence[int]], photograph: Photograph
) -> list[Region]:
    """Return the squares of 5 by 5 pixels around points `x,y;x,y`, cut at the edges. Raises UsageError."""
    width, height = photograph.size
    found = []
    for x, y in whole_numbers(value, 2, "points", "x,y"):
        if not (0 <= x < width and 0 <= y < height):
            raise UsageError(
                f"{photograph.path}: the point {x},{y} is not in the photograph of {width} by {height} pixels"
            )
        left, top = max(x - POINT, 0), max(y - POINT, 0)
        right, bottom = min(x + POINT + 1, width), min(y + POINT + 1, height)
        found.append(Region(left, top, right - left, bottom - top))
    return found


class Strip(NamedTuple):
    """Positions along a line in pixels from its start, (N,), and the coded pixels across it, (N, 5, 3)."""

    position: np.ndarray
    pixels: np.ndarray


def strip(photograph: Photograph, value: str | Sequence[int]) -> Strip:
    """Return the pixels along the line `x0,y0,x1,y1`, one position per pixel, 5 pixels wide.

    Pixels beyond the edges of the photograph are those at the edge.

    **Raises:** UsageError for ends outside the photograph or on the same pixel.
    """
    x0, y0, x1, y1 = whole_numbers(value, 4, "strip", "x0,y0,x1,y1")[0]
    width, height = photograph.size
    for x, y in ((x0, y0), (x1, y1)):
        if not (0 <= x < width and 0 <= y < height):
            raise UsageError(
                f"{photograph.path}: the end {x},{y} of `strip` is not in its {width} by {height} pixels"
            )
    length = float(np.hypot(x1 - x0, y1 - y0))
    if length < 1:
        raise UsageError('`strip` must join two different pixels, as in `strip="10,40,300,40"`')
    along = np.linspace(0.0, 1.0, min(round(length) + 1, _LONGEST), dtype=float)
    across = np.arange(STRIP) - STRIP // 2
    x = x0 + along[:, None] * (x1 - x0) - across * (y1 - y0) / length
    y = y0 + along[:, None] * (y1 - y0) + across * (x1 - x0) / length
    column, row = (np.clip(np.rint(at), 0, size - 1).astype(int) for at, size in ((x, width), (y, height)))
    return Strip(along * length, photograph.pixels[row, column])


def whole_numbers(value: str | Sequence, count: int, name: str, form: str) -> list[tuple[int, ...]]:
    """Return whole numbers in groups of `count`, from text or from lists. Raises UsageError."""
    if isinstance(value, str):
        groups: list = [re.split(r"\s*,\s*", part.strip()) for part in value.split(";") if part.strip()]
    else:
        groups = [list(part) for part in value] if value and np.ndim(value[0]) else [list(value)]
    try:
        numbers = [tuple(int(x) for x in group) for group in groups]
    except (TypeError, ValueError):
        numbers = []
    if not numbers or any(len(group) != count for group in numbers):
        raise UsageError(f"`{name}` must be {form} in whole pixels, got {value!r}")
    return numbers
