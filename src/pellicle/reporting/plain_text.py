"""Plain text for reports: indented, wrapped, in aligned columns of at most 100 characters."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

COLUMNS = 100
INDENT = "    "


def block(title: str, lines: Sequence[str]) -> str:
    """A titled part of a report."""
    return "\n".join([f"[[{title}]]", *lines]) + "\n"


def wrapped(text: str, first: str = "", rest: str = "") -> list[str]:
    """Lines of `text`; `first` and `rest` go before the first line and the others."""
    return textwrap.wrap(
        text,
        COLUMNS,
        initial_indent=INDENT + first,
        subsequent_indent=INDENT + rest,
        break_on_hyphens=False,
    )


def facts(rows: Iterable[tuple[str, str]]) -> list[str]:
    """Labels and their texts, side by side."""
    rows = list(rows)
    width = max((len(label) for label, _ in rows), default=0)
    return [line for label, text in rows for line in wrapped(text, f"{label:<{width}}  ", " " * (width + 2))]


def table(rows: Sequence[Sequence[str]]) -> list[str]:
    """Aligned columns; a row that is too long goes on below itself."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows]
    return [part for line in lines for part in wrapped(line, "", INDENT)]
