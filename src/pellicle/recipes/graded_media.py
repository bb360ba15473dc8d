"""Graded media as recipes write them: two media and the profile of their proportions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.effective_medium import MIXTURES
from pellicle.dispersion.profiles import PROFILES
from pellicle.errors import UsageError, did_you_mean
from pellicle.scene.graded import Graded


def _profile_schema(schema: dict[str, Any]) -> None:
    """Add to the schema which numbers each profile has, for editors."""
    number = {"anyOf": [{"type": "number"}, {"$ref": "#/$defs/FreeTable"}]}
    kinds: dict[str, Any] = {"values": {"type": "array", "minItems": 2, "items": number}}
    kinds["knots"] = {"type": "array", "minItems": 2, "items": {"type": "number"}}
    own = schema.pop("properties")
    schema.pop("additionalProperties", None)
    schema["anyOf"] = [
        {
            "properties": {
                **own,
                "profile": {"const": name},
                **{field.name: kinds.get(field.name, number) for field in fields(kind)},
            },
            # linear is the default, and goes unsaid
            "required": ["graded"] if name == "linear" else ["graded", "profile"],
            "additionalProperties": False,
        }
        for name, kind in PROFILES.items()
    ]
    schema.pop("required", None)


class GradedTable(BaseModel):
    """`{ graded = ["SiO2", "Si3N4"], profile = "linear", top = 0.1, bottom = { lower = 0, upper = 1 } }`.

    Further keys are the numbers of the profile. `mix` is the mixing rule, "bruggeman" by default.
    """

    model_config = ConfigDict(extra="allow", json_schema_extra=_profile_schema)
    graded: list[Any] = Field(min_length=2, max_length=2)
    profile: str = "linear"
    mix: str = Field("bruggeman", json_schema_extra={"enum": [*MIXTURES]})


def graded_medium(
    table: GradedTable,
    component: Callable[[str, Any], AbstractDispersion],
    parameter: Callable[[str, Any], Any],
) -> Graded:
    """Return the graded medium of a table.

    `component` and `parameter` turn the value of a key into a medium and a number. Raises UsageError.
    """
    name, values = table.profile, dict(table.model_extra or {})
    for word, what, known in ((name, "profile", PROFILES), (table.mix, "mix", MIXTURES)):
        if word not in known:
            raise UsageError(f"no {what} {word!r}{did_you_mean(word, known)}; known: {', '.join(known)}")
    kind = PROFILES[name]
    keys = [field.name for field in fields(kind)]
    for key in values:
        if key not in keys:
            close = did_you_mean(key, [*keys, "graded", "profile", "mix"])
            raise UsageError(f"a {name} profile has no {key!r}{close}; it has {', '.join(keys)}")
    if name == "spline" and not isinstance(values.get("values"), list):
        raise UsageError("a spline profile needs values, a list of fractions, one for each knot")
    numbers = {}
    for key, value in values.items():
        if key == "knots" and isinstance(value, list):
            numbers[key] = [float(parameter(key, each)) for each in value]
        elif isinstance(value, list):
            numbers[key] = [parameter(f"{key}{i}", each) for i, each in enumerate(value, start=1)]
        else:
            numbers[key] = parameter(key, value)
    first, second = (component("graded", each) for each in table.graded)
    return Graded(first, second, kind(**numbers), table.mix)
