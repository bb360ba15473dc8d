"""Checks of a recipe's tables, with the first error in one sentence."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from pellicle.errors import UsageError, did_you_mean

_Table = TypeVar("_Table", bound=BaseModel)


def validated(loaded: dict[str, Any], tables: Mapping[str, type[_Table] | type[BaseModel]]) -> Any:
    """Check a parsed recipe against the table of the key "", whose sub-tables `tables` lists by their keys.

    Raises UsageError: which key, what was expected, the nearest known one.
    """
    try:
        return tables[""].model_validate(loaded)
    except ValidationError as error:
        raise UsageError(_first_error(error, tables)) from None


def _is_branch(part: str) -> bool:
    """True for the name of the branch of a union that was tried, a part of the location of its errors."""
    return part[:1].isupper() or part in ("str", "float") or part.startswith(("list[", "constrained-"))


def _first_error(error: ValidationError, tables: Mapping[str, type[BaseModel]]) -> str:
    """One sentence: an unknown key or an infinity goes before the errors of each branch of a union."""
    errors = error.errors(include_url=False)
    clearest = (e for kind in ("extra_forbidden", "finite_number") for e in errors if e["type"] == kind)
    chosen = next(clearest, errors[0])
    if isinstance(chosen["input"], list):  # a number was expected, or a list, whose errors tell more
        of_lists = (e for e in errors if any(str(part).startswith("list[") for part in e["loc"]))
        chosen = next(of_lists, chosen)
    where = [str(part) for part in chosen["loc"] if not _is_branch(str(part))]
    if chosen["type"] == "extra_forbidden" and where[-1:] != [str(chosen["loc"][-1])]:
        where.append(str(chosen["loc"][-1]))  # a key of the user, as `Data`, is no branch
    key = ".".join(where)
    if chosen["type"] == "extra_forbidden":
        owner = next((part for part in reversed(where[:-1]) if not part.isdigit()), "")
        known = list(tables.get(owner, tables[""]).model_fields)
        return f"unknown key {key!r}{did_you_mean(where[-1], known)}; known here: {', '.join(known)}"
    if chosen["type"] == "missing":
        return f"{key} is missing"
    if chosen["type"] == "value_error":
        return f"{key}: {chosen.get('ctx', {}).get('error', chosen['msg'])}"
    return f"{key}: {chosen['msg'][0].lower()}{chosen['msg'][1:]}, got {chosen['input']!r}"
