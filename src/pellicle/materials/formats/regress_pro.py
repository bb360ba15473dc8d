"""Words of recipes of Regress Pro (`.rcp`), and the tables of media in them.

The layout is that of 22 public recipes: words, numbers and texts between quotation marks, separated by blanks
whose number does not count; wavelengths in nm.
"""

import re

import numpy as np

from pellicle.data.tabular.text import decoded
from pellicle.errors import DataError
from pellicle.materials.formats import optical_constants as optical

_WORD = re.compile(r'"((?:[^"\\]|\\.)*)"|\S+')
_STEP = 1.0
"""Distance (nm) of the points by which a table is written down, between which interpolation is linear."""


class Words:
    """The words of a recipe, read one after the other. Errors are DataErrors that name the line."""

    def __init__(self, text: str):
        self._text = text
        self._words = [(m.start(), m[0] if m[1] is None else m[1]) for m in _WORD.finditer(text)]
        self._next = 0

    def peek(self) -> str:
        """The next word; empty at the end."""
        return self._words[self._next][1] if self._next < len(self._words) else ""

    def word(self, expected: str = "a word") -> str:
        """Take the next word."""
        if self._next == len(self._words):
            raise DataError(f"ends where {expected} is expected; save the recipe again")
        self._next += 1
        return self._words[self._next - 1][1]

    def take(self, word: str) -> bool:
        """Take the next word if it is this one."""
        self._next += (found := self.peek() == word)
        return found

    def number(self) -> float:
        """Take a number."""
        word = self.word("a number")
        try:
            return float(word)
        except ValueError:
            line = self._text.count("\n", 0, self._words[self._next - 1][0]) + 1
            raise DataError(f"line {line}: expected a number, found {word!r}") from None

    def numbers(self, count: int) -> list[float]:
        """Take so many numbers."""
        return [self.number() for _ in range(count)]

    def count(self) -> int:
        """Take a number of things that follow."""
        value = self.number()
        if not (value.is_integer() and 0 <= value < 1e5):
            raise DataError(f"expected a number of things, found {value:g}; save the recipe again")
        return int(value)

    def header(self) -> str:
        """Take the name of a medium and the remarks after it."""
        name = self.word("the name of a medium")
        for remark, values in (("description", 1), ("annotation", 1), ("range", 2)):
            if self.take(remark):
                for _ in range(values):
                    self.word(remark)
        return name


def words(content: bytes) -> Words | None:
    """The words of a recipe; None for another file."""
    return Words(decoded(content)) if re.match(rb"(\xef\xbb\xbf)?\s*stack\s+\d+\s", content) else None


def rows(text: Words) -> np.ndarray:
    """Take the wavelength, n and k of the points of a table, (3, points)."""
    points = text.count()
    if [text.count(), text.count()] != [points, 3] or points < 2:
        raise DataError("has a table without two rows of wavelength, n and k; save the recipe again")
    return np.reshape(text.numbers(3 * points), (points, 3)).T


def table(content: bytes, name: str) -> optical.MaterialFile:
    """The optical constants of the table `name` of a recipe, between whose points the program takes natural
    cubic splines. Raises DataError where it has none."""
    text, known = words(content), []
    while text is not None and text.peek():
        if not text.take("table"):
            text.word()
            continue
        known.append(text.header())
        nm, *values = rows(text)
        if known[-1] != name:
            continue
        if np.any(np.diff(nm) <= 0):
            raise DataError(f"the wavelengths of the table {name!r} do not rise; sort them in Regress Pro")
        fine = np.union1d(nm, np.arange(np.ceil(nm[0]), nm[-1], _STEP))
        from scipy.interpolate import CubicSpline  # imports half of SciPy, which few files need

        n, k = (CubicSpline(nm, x, bc_type="natural")(fine) for x in values)
        return optical.table(fine, n, np.maximum(k, 0.0))._replace(format="table of a Regress Pro recipe")
    raise DataError(f"has no table of a medium {name!r}; its tables: {', '.join(known) or 'none'}")
