"""Sentences on wrong recipes: text that is not TOML, unknown keys, and values of another kind."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from pellicle.errors import did_you_mean

_PLACE = re.compile(r"at line (\d+), column")
_UNQUOTED = re.compile(r"\s*(?P<key>[\w.-]+)\s*=\s*(?P<value>[A-Za-z][\w./+-]*)\s*(#.*)?")


def remedy(text: str, error: tomllib.TOMLDecodeError) -> str:
    """The remedy where a line of a recipe has a text without quotation marks, or defines a table again; empty
    for another error."""
    if (place := _PLACE.search(str(error))) is None:
        return ""
    written = text.splitlines()[int(place[1]) - 1]
    if str(error).startswith(("Cannot overwrite", "Cannot declare", "Cannot mutate")):
        return f"line {place[1]}: {written.strip()} defines again what a line above defines: keep one of them"
    line = _UNQUOTED.fullmatch(written)
    if line is None:
        return ""
    return f'line {place[1]}: a text needs quotation marks: write {line["key"]} = "{line["value"]}"'


_SYNONYMS = {"min": "lower", "max": "upper", "low": "lower", "high": "upper", "from": "lower", "to": "upper"}
_SYNONYMS |= {"init": "value", "initial": "value", "guess": "value", "start": "value", "d": "thickness"}
"""Keys that other programs use, and the key of a recipe."""
_HOMES = {"data": "[data]", "instrument": "[instrument]", "layer": "[[scene.layer]]"}
"""Tables whose keys are often put elsewhere, as they are written."""


def first_error(error: ValidationError, table: type[BaseModel]) -> str:
    """One sentence on a recipe that is no `table`.

    An unknown key or an infinity goes before the errors of each branch of a union.
    """
    tables = _tables_by_key(table)
    errors = error.errors(include_url=False)
    clearest = (e for kind in ("extra_forbidden", "finite_number") for e in errors if e["type"] == kind)
    chosen = next(clearest, errors[0])
    if isinstance(chosen["input"], list):  # a number was expected, or a list, whose errors tell more
        of_lists = (e for e in errors if any(str(part).startswith("list[") for part in e["loc"]))
        chosen = next(of_lists, chosen)
    if isinstance(chosen["input"], dict):  # a number was expected, or a table of one
        of_tables = (e for e in errors if "FreeTable" in e["loc"] and e["loc"][:-1] != chosen["loc"][:-1])
        chosen = next(of_tables, chosen)
    where = [  # without the branches of unions that were tried
        part
        for part in map(str, chosen["loc"])
        if not (part[:1].isupper() or part in ("str", "float") or part.startswith(("list[", "constrained-")))
    ]
    if chosen["type"] == "extra_forbidden" and where[-1:] != [str(chosen["loc"][-1])]:
        where.append(str(chosen["loc"][-1]))  # a key of the user, as `Data`, is no branch
    key = ".".join(where)
    if chosen["type"] == "extra_forbidden":
        owner = next((part for part in reversed(where[:-1]) if not part.isdigit()), "")
        known = list(tables.get(owner, tables[""]).model_fields)
        if (meant := _SYNONYMS.get(where[-1])) in known:
            return f"unknown key {key!r}: write {meant}; known here: {', '.join(known)}"
        if where[-1] in tables[""].model_fields:
            return f"unknown key {key!r}: write [{where[-1]}], a table of its own"
        places = [(name, tables[name]) for name in _HOMES if name in tables]
        homes = [_HOMES[name] for name, table in places if where[-1] in table.model_fields]
        if homes:
            return f"unknown key {key!r}: it stands under {' or '.join(homes)}"
        return f"unknown key {key!r}{did_you_mean(where[-1], known)}; known here: {', '.join(known)}"
    if chosen["type"] == "list_type" and isinstance(chosen["input"], dict):
        return f"{key} is a list of tables: write [[{key}]] with two brackets"
    if chosen["type"] == "list_type" and isinstance(chosen["input"], str):
        return f'{key} is a list: write {where[-1]} = ["{chosen["input"]}"]'
    if chosen["type"] == "model_type":
        known = list(tables[where[-1]].model_fields) if where[-1] in tables else []
        return f"{key} is a table{' of ' * bool(known)}{', '.join(known)}, not {chosen['input']!r}"
    if chosen["type"] == "string_type" and isinstance(chosen["input"], dict):
        return _of_material(key, chosen, errors)
    if chosen["type"] == "missing":
        return f"{key} is missing"
    if chosen["type"] == "value_error":
        words = str(chosen.get("ctx", {}).get("error", chosen["msg"]))
        return f"{key}: {words}" if key else words  # of the whole recipe
    return f"{key}: {chosen['msg'][0].lower()}{chosen['msg'][1:]}, got {chosen['input']!r}"


def _of_material(key: str, chosen: Mapping[str, Any], errors: Sequence[Mapping[str, Any]]) -> str:
    """One sentence on the table of a material: the key that has a wrong value, else that it is of no kind."""
    given, at = chosen["input"], chosen["loc"][:-1]
    for wrong in errors:
        if wrong["loc"][:-2] == at and (name := wrong["loc"][-1]) in given:
            expected = 'two media, as in ["SiO2", "Si3N4"]' if name == "graded" else "a text"
            return f"{key}.{name} must be {expected}, got {wrong['input']!r}"
    kinds = "model, mix (host, inclusion, fraction), graded, ordinary and extraordinary, or x, y and z"
    return f"{key}: the table of a material has the key {kinds}, not {', '.join(given)}"


def _tables_by_key(table: type[BaseModel], key: str = "") -> dict[str, type[BaseModel]]:
    """Tables that refuse unknown keys, by their own keys: this one and all below it."""
    tables = {key: table}
    for name, field in table.model_fields.items():
        for kind in _classes(field.annotation):
            if issubclass(kind, BaseModel) and kind.model_config.get("extra") == "forbid":
                tables |= _tables_by_key(kind, name)
    return tables


def _classes(annotation: Any) -> Iterator[type]:
    for part in get_args(annotation):
        yield from _classes(part)
    if isinstance(annotation, type):
        yield annotation
