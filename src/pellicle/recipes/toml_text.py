"""Text of a TOML document: short tables on one line, as recipes are written by hand."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_WHOLE = 1e15
"""Whole numbers below this are written without a fraction."""


def document(tables: Mapping[str, Mapping[str, Any] | Sequence[Mapping[str, Any]]]) -> str:
    """Format tables by their names; a list of tables is an array of tables. Empty ones are left out."""
    parts = []
    for name, content in tables.items():
        several = not isinstance(content, Mapping)
        head = f"[[{name}]]" if several else f"[{name}]"
        for table in content if several else [content]:
            if table:
                parts.append("\n".join([head, *(f"{_key(k)} = {value(v)}" for k, v in table.items())]))
    return "\n\n".join(parts) + "\n"


def value(thing: Any) -> str:
    """Format a string, number, truth value, list or table on one line. Raises TypeError for anything else."""
    if isinstance(thing, bool):
        return "true" if thing else "false"
    if isinstance(thing, str):
        # JSON's escapes are TOML's, except that JSON leaves DEL as it is
        return json.dumps(thing, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(thing, int):
        return str(thing)
    if isinstance(thing, float):
        return str(int(thing)) if thing.is_integer() and abs(thing) < _WHOLE else repr(thing)
    if isinstance(thing, Mapping):
        return "{ " + ", ".join(f"{_key(k)} = {value(v)}" for k, v in thing.items()) + " }"
    if isinstance(thing, list | tuple):
        return "[" + ", ".join(map(value, thing)) + "]"
    raise TypeError(f"{type(thing).__name__} has no form in TOML")


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else value(key)
