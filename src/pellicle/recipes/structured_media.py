"""Birefringent and graded media as recipes write them: principal media and axes, media and a profile."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, model_validator

from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.effective_medium import MIXTURES
from pellicle.dispersion.profiles import PROFILES
from pellicle.errors import UsageError, did_you_mean
from pellicle.scene.graded import Graded

UNIAXIAL, BIAXIAL = ("ordinary", "extraordinary"), ("x", "y", "z")
_ANGLES = ("axis_theta", "axis_phi", "axis_psi")


def _anisotropic_schema(schema: dict[str, Any]) -> None:
    """List the keys of both kinds, for editors."""
    number = {"anyOf": [{"type": "number"}, {"$ref": "#/$defs/FreeTable"}]}
    medium = {"type": ["string", "number", "object"]}
    schema.pop("additionalProperties", None)
    schema["anyOf"] = [
        {
            "properties": {
                **dict.fromkeys(keys, medium),
                "axis": {"type": "array", "items": number, "minItems": 2, "maxItems": len(keys)},
            },
            "required": [*keys],
            "additionalProperties": False,
        }
        for keys in (UNIAXIAL, BIAXIAL)
    ]


class AnisotropicTable(BaseModel):
    """`{ ordinary = "TiO2-o", extraordinary = "TiO2-e", axis = [0, 0] }`, or `{ x = ..., y = ..., z = ... }`.

    The principal media are media of any kind. `axis` is [theta, phi], of x, y and z [theta, phi, psi], each a
    number of degrees or a table of bounds.
    """

    model_config = ConfigDict(extra="allow", json_schema_extra=_anisotropic_schema)

    @model_validator(mode="before")
    @classmethod
    def _is_meant(cls, given: Any) -> Any:
        known = (*UNIAXIAL, *BIAXIAL, "axis")
        if not isinstance(given, dict) or not any(key in known or did_you_mean(key, known) for key in given):
            raise ValueError("a birefringent material has ordinary and extraordinary, or x, y and z")
        return given


def anisotropic_medium(
    table: AnisotropicTable,
    component: Callable[[str, Any], AbstractDispersion],
    parameter: Callable[[str, Any], Any],
) -> Anisotropic:
    """Return the medium of a table.

    `component` and `parameter` turn the value of a key into a medium and a number. Raises UsageError.
    """
    values = dict(table.model_extra or {})
    axis = values.pop("axis", [0.0, 0.0])
    keys = BIAXIAL if values.keys() & {*BIAXIAL} else UNIAXIAL
    for key in values:
        if key not in keys:
            close = did_you_mean(key, [*keys, "axis"])
            raise UsageError(f"a birefringent material has no {key!r}{close}; it has {', '.join(keys)}, axis")
    missing = [key for key in keys if key not in values]
    if missing:
        raise UsageError(f"a birefringent material lacks {' and '.join(missing)}: it has {', '.join(keys)}")
    most = len(keys)
    if not isinstance(axis, list) or not 2 <= len(axis) <= most:
        names = "[theta, phi]" if most == 2 else "[theta, phi] or [theta, phi, psi]"
        raise UsageError(f"axis must be {names} in degrees, each a number or a table of lower and upper")
    angles = [parameter(name, each) for name, each in zip(_ANGLES, axis, strict=False)]
    media = {key: component(key, values[key]) for key in keys}
    return Anisotropic(**media, axis=angles)


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
