"""The tables of media and of numbers of a recipe."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from pellicle.dispersion.effective_medium import MIXTURES
from pellicle.dispersion.profiles import PROFILES
from pellicle.dispersion.temperature import AtTemperature, ThermoOptic
from pellicle.errors import did_you_mean
from pellicle.recipes.dispersion_models import MODELS, SPLINES, TERMS
from pellicle.scene.priors import HalfNormal, LogUniform, Normal, Prior

UNIAXIAL, BIAXIAL = ("ordinary", "extraordinary"), ("x", "y", "z")
_NUMBER = {"anyOf": [{"type": "number"}, {"$ref": "#/$defs/FreeTable"}, {"type": "string"}]}
_NUMBER_PER_KNOT = {"anyOf": [*_NUMBER["anyOf"], {"type": "array", "items": _NUMBER}]}


def _table_schema(properties: dict[str, Any], *required: str) -> dict[str, Any]:
    """A table of these keys and no other, in a schema."""
    needed = {"required": [*required]} if required else {}
    return {"properties": properties, **needed, "additionalProperties": False}


def _choose(schema: dict[str, Any], tables: Iterable[dict[str, Any]]) -> None:
    """Replace the keys of a schema by several tables, one of which must fit."""
    schema.pop("additionalProperties", None)
    schema["anyOf"] = [*tables]


def _anisotropic_schema(schema: dict[str, Any]) -> None:
    """List the keys of both kinds, for editors."""
    medium = {"type": ["string", "number", "object"]}
    tables = []
    for keys in (UNIAXIAL, BIAXIAL):
        axis = {"type": "array", "items": _NUMBER, "minItems": 2, "maxItems": len(keys)}
        tables.append(_table_schema({**dict.fromkeys(keys, medium), "axis": axis}, *keys))
    _choose(schema, tables)


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


def _profile_schema(schema: dict[str, Any]) -> None:
    """Add to the schema which numbers each profile has, for editors."""
    kinds: dict[str, Any] = {"values": {"type": "array", "minItems": 2, "items": _NUMBER}}
    kinds["knots"] = {"type": "array", "minItems": 2, "items": {"type": "number"}}
    shared, tables = schema.pop("properties"), []
    for name, kind in PROFILES.items():
        numbers = {field.name: kinds.get(field.name, _NUMBER) for field in fields(kind)}
        required = ["graded"] if name == "linear" else ["graded", "profile"]  # linear is the default
        tables.append(_table_schema({**shared, "profile": {"const": name}, **numbers}, *required))
    _choose(schema, tables)
    schema.pop("required", None)


class GradedTable(BaseModel):
    """`{ graded = ["SiO2", "Si3N4"], profile = "linear", top = 0.1, bottom = { lower = 0, upper = 1 } }`.

    Further keys are the numbers of the profile. `mix` is the mixing rule, "bruggeman" by default.
    """

    model_config = ConfigDict(extra="allow", json_schema_extra=_profile_schema)
    graded: list[Any] = Field(min_length=2, max_length=2)
    profile: str = "linear"
    mix: str = Field("bruggeman", json_schema_extra={"enum": [*MIXTURES]})


class PriorTable(BaseModel):
    """A prior in the parameter's unit, truncated at the bounds.

    `{ mean = 100, sd = 5 }`, `{ half_normal = 0.01 }` (its standard deviation) or `{ log_uniform = true }`.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    mean: float | None = None
    sd: float | None = Field(None, gt=0)
    half_normal: float | None = Field(None, gt=0)
    log_uniform: Literal[True] | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> PriorTable:
        keys = {name for name, value in vars(self).items() if value is not None}
        if keys not in ({"mean", "sd"}, {"half_normal"}, {"log_uniform"}):
            raise ValueError("give mean and sd, or half_normal, or log_uniform = true")
        return self

    def prior(self) -> Prior:
        """Build the prior."""
        if self.half_normal is not None:
            return HalfNormal(self.half_normal)
        if self.mean is None or self.sd is None:
            return LogUniform()
        return Normal(self.mean, self.sd)


class KnownTable(BaseModel):
    """A number that is known, with its standard deviation."""

    model_config = ConfigDict(extra="forbid")
    mean: float
    sd: float


class FreeTable(BaseModel):
    """A free number by its bounds, with optional start value and prior; or a fixed one by its value.

    `limits` mark default bounds, which a fit of spectra may widen up to them. `varies`: how the number
    changes in a series of spectra; `first`, `last`: what is known of it at the ends of the series.
    """

    model_config = ConfigDict(extra="forbid")
    value: float | None = None
    lower: float | None = None
    upper: float | None = None
    limits: tuple[float, float] | None = None
    prior: PriorTable | None = None
    varies: Literal["slowly", "freely", "shared", "monotonic"] | None = None
    first: float | KnownTable | None = None
    last: float | KnownTable | None = None


Number = float | FreeTable | str
"""A number; a text is an expression of other parameters, to which it is tied."""


def _model_schema(schema: dict[str, Any]) -> None:
    """Add to the schema which parameters each model has, for editors."""
    choices: list[dict[str, Any]] = []
    for name, specs in MODELS.items():
        number = _NUMBER_PER_KNOT if name in SPLINES else _NUMBER
        properties = {"model": {"const": name}, **dict.fromkeys(specs, number)}
        if name in SPLINES:
            properties["knots"] = {"type": "array", "items": {"type": "number"}}
        choices.append(_table_schema(properties))
    kinds = [{"kind": {"const": kind}, **dict.fromkeys(specs, _NUMBER)} for kind, specs in TERMS.items()]
    term = [_table_schema(keys, "kind") for keys in kinds]
    terms = {"type": "array", "minItems": 1, "items": {"anyOf": term}}
    choices.append(
        _table_schema({"model": {"const": "oscillators"}, "eps_inf": _NUMBER, "terms": terms}, "terms")
    )
    for name, kind in (("thermo-optic", ThermoOptic), ("at-temperature", AtTemperature)):
        keys = dict.fromkeys((field.name for field in fields(kind)), True)
        choices.append(
            _table_schema(keys | {"model": {"const": name}, "temperature": _NUMBER}, "temperature")
        )
    _choose(schema, choices)


class MediumTable(BaseModel):
    """A dispersion model, `{ model = "cauchy", A = ..., B = ... }`: further keys are its parameters.

    `{ model = "oscillators", eps_inf = ..., terms = [{ kind = "lorentz", ... }, ...] }` is a sum.
    """

    model_config = ConfigDict(extra="allow", json_schema_extra=_model_schema)
    model: str


class MixTable(BaseModel):
    """`{ mix = "bruggeman", host = "SiO2", inclusion = "air", fraction = { lower = 0, upper = 0.5 } }`.

    `host` and `inclusion` are media of any kind; `materials = [host, inclusion]` is another way to give them.
    """

    model_config = ConfigDict(extra="allow")
    mix: str = Field(json_schema_extra={"enum": [*MIXTURES]})


Medium = str | float | MediumTable | MixTable | GradedTable | AnisotropicTable
