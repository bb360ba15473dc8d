"""Plain text for reports: blocks, wrapped text and aligned columns, at most 100 characters wide."""

import textwrap
from collections.abc import Iterable, Sequence

COLUMNS = 100
INDENT = "    "


def block(title: str, lines: Sequence[str]) -> str:
    """Format a titled part of a report."""
    return "\n".join([f"[[{title}]]", *lines]) + "\n"


def wrapped(text: str, first: str = "", rest: str = "") -> list[str]:
    """Wrap `text`; `first` precedes the first line and `rest` each other one."""
    return textwrap.wrap(
        text,
        COLUMNS,
        initial_indent=INDENT + first,
        subsequent_indent=INDENT + rest,
        break_on_hyphens=False,
        break_long_words=False,  # paths stay whole
    )


def facts(rows: Iterable[tuple[str, str]]) -> list[str]:
    """Format labels and their texts side by side."""
    rows = list(rows)
    width = max((len(label) for label, _ in rows), default=0)
    return [line for label, text in rows for line in wrapped(text, f"{label:<{width}}  ", " " * (width + 2))]


def table(rows: Sequence[Sequence[str]]) -> list[str]:
    """Format aligned columns; a row that is too long continues on the next line."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows]
    return [part for line in lines for part in wrapped(line, "", INDENT)]
