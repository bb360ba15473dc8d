"""Birefringent media as recipes write them: principal media and the orientation of the axes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator

from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.dispersion.base import AbstractDispersion
from pellicle.errors import UsageError, did_you_mean

UNIAXIAL, BIAXIAL = ("ordinary", "extraordinary"), ("x", "y", "z")
_ANGLES = ("axis_theta", "axis_phi", "axis_psi")


def _schema(schema: dict[str, Any]) -> None:
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

    model_config = ConfigDict(extra="allow", json_schema_extra=_schema)

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
