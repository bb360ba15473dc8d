"""Numbers and ranges written as text. Imports nothing heavy, so that wrong flags are refused at once."""

from __future__ import annotations

import math

from pellicle.errors import UsageError


def parse_number(text: str, name: str, expected: str = "a number") -> float:
    """Parse a finite number. Raises UsageError with the name of the argument and what was expected."""
    try:
        value = float(text)
    except ValueError:
        raise UsageError(f"{name} must be {expected}, not {text!r}") from None
    if not math.isfinite(value):
        raise UsageError(f"{name} must be a finite number, not {text!r}")
    return value


def parse_range(text: str, name: str) -> tuple[float, float]:
    """Parse `LO:HI` as two rising numbers. Raises UsageError with the name of the argument."""
    parts = text.split(":")
    if len(parts) != 2:
        raise UsageError(f"{name} must be LO:HI, as in 10:3000, not {text!r}")
    low, high = parse_number(parts[0], name), parse_number(parts[1], name)
    if not low < high:
        raise UsageError(f"{name} is reversed or empty: {text!r}; write the smaller number first")
    return low, high
