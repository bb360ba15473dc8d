"""Numbers and ranges as users write them; light enough for the command line's first breath."""

from __future__ import annotations

import math

from pellicle.errors import UsageError


def number(text: str, what: str, expected: str = "a number") -> float:
    """A finite number, or a UsageError that says what it is for, and what was expected."""
    try:
        value = float(text)
    except ValueError:
        raise UsageError(f"{what} must be {expected}, not {text!r}") from None
    if not math.isfinite(value):
        raise UsageError(f"{what} must be a finite number, not {text!r}")
    return value


def span(text: str, what: str) -> tuple[float, float]:
    """`LO:HI` as two rising numbers, or a UsageError."""
    parts = text.split(":")
    if len(parts) != 2:
        raise UsageError(f"{what} must be LO:HI, as in 10:3000, not {text!r}")
    low, high = number(parts[0], what), number(parts[1], what)
    if not low < high:
        raise UsageError(f"{what} is reversed or empty: {text!r}; write the smaller number first")
    return low, high
