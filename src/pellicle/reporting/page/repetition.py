"""Command, recipe and lines of Python that repeat a fit, to copy from the page."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pellicle.fitting.result import Fit

_LONGEST = 200_000
"""Bytes of a recipe above which it is not copied into the page."""


def repetition(fit: Fit, described: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    """Descriptions and texts of the command and the recipe of a fit; empty for a fit in Python.

    `described` is what the scene was built from: a recipe's path, or flags.
    """
    if described is None:
        return []
    files = list(dict.fromkeys(part.data.path for part in fit.parts if part.data.path))
    words = ["pellicle", "fit", *files]
    recipe = described.get("recipe")
    words += [] if recipe is None else ["--recipe", str(recipe)]
    for name, value in {**described.get("flags", {}), **described.get("reading", {})}.items():
        flag = f"--{name.replace('_', '-')}"
        words += [flag] if value is True else [flag, _word(value)]
    joint = ["--joint"] if len(files) > 1 and recipe is None else []
    result = [("Command", shlex.join([*words, *joint]))]
    if recipe is None:
        return result
    text = _text(Path(recipe))
    return result if text is None else [*result, (f"Recipe {Path(recipe).name}", text)]


def _word(value: Any) -> str:
    if isinstance(value, tuple | list):
        numbers = all(isinstance(each, float | int) for each in value)
        return (":" if numbers and isinstance(value, tuple) else ",").join(f"{each}" for each in value)
    return str(value)


def _text(path: Path) -> str | None:
    """The text of a recipe, None where it has gone since, or is too long."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError):
        return None
    return text if len(text) <= _LONGEST else None
