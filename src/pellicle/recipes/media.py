"""Media and numbers as recipes write them: names, models, sums of oscillators, mixtures."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import fields
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator

from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.effective_medium import MIXTURES
from pellicle.dispersion.oscillators import AbstractOscillator
from pellicle.dispersion.profiles import PROFILES
from pellicle.errors import UsageError, did_you_mean
from pellicle.materials.formats.detect import SUFFIXES as MATERIAL_SUFFIXES
from pellicle.recipes import media_words
from pellicle.recipes.dispersion_models import (
    MODELS,
    SPLINES,
    TERMS,
    Parameter,
    build_model,
    build_oscillator,
    sum_of_oscillators,
)
from pellicle.scene.free import Free
from pellicle.scene.graded import Graded
from pellicle.scene.priors import HalfNormal, LogUniform, Normal, Prior

UNIAXIAL, BIAXIAL = ("ordinary", "extraordinary"), ("x", "y", "z")
_ANGLES = ("axis_theta", "axis_phi", "axis_psi")
_NUMBER = {"anyOf": [{"type": "number"}, {"$ref": "#/$defs/FreeTable"}]}
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
    kinds: dict[str, Any] = {"values": {"type": "array", "minItems": 2, "items": _NUMBER}}
    kinds["knots"] = {"type": "array", "minItems": 2, "items": {"type": "number"}}
    own, tables = schema.pop("properties"), []
    for name, kind in PROFILES.items():
        numbers = {field.name: kinds.get(field.name, _NUMBER) for field in fields(kind)}
        required = ["graded"] if name == "linear" else ["graded", "profile"]  # linear is the default
        tables.append(_table_schema({**own, "profile": {"const": name}, **numbers}, *required))
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


class FreeTable(BaseModel):
    """A free number by its bounds, with optional start value and prior; or a fixed one by its value.

    `limits` mark default bounds, which a fit of spectra may widen up to them.
    """

    model_config = ConfigDict(extra="forbid")
    value: float | None = None
    lower: float | None = None
    upper: float | None = None
    limits: tuple[float, float] | None = None
    prior: PriorTable | None = None


Number = float | FreeTable


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
_MEDIUM: TypeAdapter[Any] = TypeAdapter(Medium)


def number(value: Number, name: str, minimum: float | None = None) -> float | Free:
    """Return a fixed number or a `Free` from what a recipe gives for `name`.

    Raises UsageError where it is neither, not finite, or below `minimum`.
    """
    if isinstance(value, float | int):
        lowest, result = float(value), float(value)
    elif value.lower is None and value.upper is None and value.value is not None:
        lowest, result = value.value, value.value
    elif value.lower is None or value.upper is None:
        raise UsageError(f"{name}: give lower and upper, or one plain number")
    else:
        try:
            prior = None if value.prior is None else value.prior.prior()
            result = Free(value.lower, value.upper, start=value.value, prior=prior, limits=value.limits)
        except ValueError as error:
            raise UsageError(f"{name}: {error}") from None
        lowest = value.lower
    if not math.isfinite(lowest):
        raise UsageError(f"{name} must be a finite number, got {lowest:g}")
    if minimum is not None and lowest < minimum:
        raise UsageError(f"{name} must not be below {minimum:g}, got {lowest:g}")
    return result


def medium(value: Medium, folder: Path, name: str = "material") -> AbstractDispersion:
    """Return the dispersion that a recipe gives for the key `name`; paths are relative to `folder`.

    Raises UsageError, or DataError for a table that cannot be read.
    """
    if isinstance(value, AnisotropicTable):
        return anisotropic_medium(value, lambda key, each: _component(key, each, folder), _parameter)
    if isinstance(value, GradedTable):
        return graded_medium(value, lambda key, each: _component(key, each, folder), _parameter)
    if isinstance(value, MixTable):
        return _mixture(value.mix, dict(value.model_extra or {}), folder)
    if isinstance(value, MediumTable):
        return _model(value.model, dict(value.model_extra or {}))
    if isinstance(value, str) and Path(value).suffix.lower() in MATERIAL_SUFFIXES:
        value = str(folder / value)
    return media_words.medium(str(value), name=name)


def _model(name: str, values: dict[str, Any]) -> AbstractDispersion:
    if name == "oscillators":
        return _oscillators(values)
    if name not in MODELS:
        known = [*MODELS, "oscillators"]
        close = did_you_mean(name, known)
        raise UsageError(f"no dispersion model {name!r}{close}; known: {', '.join(known)}")
    parameter = _parameter_per_knot if name in SPLINES else _parameter
    return build_model(name, {key: parameter(key, value) for key, value in values.items()})


def _oscillators(values: dict[str, Any]) -> AbstractDispersion:
    terms = values.pop("terms", None)
    eps_inf = _parameter("eps_inf", values.pop("eps_inf", 1.0))
    if values:
        key = next(iter(values))
        close = did_you_mean(key, ["eps_inf", "terms"])
        raise UsageError(f"oscillators has no parameter {key!r}{close}; it has eps_inf, terms")
    if not isinstance(terms, list) or not terms or not all(isinstance(t, dict) for t in terms):
        raise UsageError('oscillators needs terms, a list of tables like { kind = "lorentz", A = 1.0, ... }')
    return sum_of_oscillators(eps_inf, [_term(dict(t)) for t in terms])


def _term(values: dict[str, Any]) -> AbstractOscillator:
    if "kind" not in values:
        raise UsageError(f"a term of oscillators needs a kind: one of {', '.join(TERMS)}")
    kind = str(values.pop("kind"))
    return build_oscillator(kind, {key: _parameter(key, value) for key, value in values.items()})


def _mixture(rule: str, values: dict[str, Any], folder: Path) -> AbstractDispersion:
    if rule not in MIXTURES:
        raise UsageError(f"no mix {rule!r}{did_you_mean(rule, MIXTURES)}; known: {', '.join(MIXTURES)}")
    if "materials" in values:
        both = values.pop("materials")
        if not isinstance(both, list) or len(both) != 2 or values.keys() & {"host", "inclusion"}:
            raise UsageError(f"{rule}: materials is a list of two, the host and the inclusion")
        values |= {"host": both[0], "inclusion": both[1]}
    known = ("host", "inclusion", "fraction")
    for key in values:
        if key not in known:
            raise UsageError(f"{rule} has no {key!r}{did_you_mean(key, known)}; it has {', '.join(known)}")
    missing = [key for key in known if key not in values]
    if missing:
        raise UsageError(f"{rule}: {' and '.join(missing)} missing; it needs host, inclusion and fraction")
    fraction = _parameter("fraction", values["fraction"])
    host, inclusion = (_component(key, values[key], folder) for key in ("host", "inclusion"))
    try:
        return MIXTURES[rule](host, inclusion, fraction)
    except ValueError as error:
        raise UsageError(f"{rule}: {error}") from None


def _component(key: str, value: Any, folder: Path) -> AbstractDispersion:
    try:
        return medium(_MEDIUM.validate_python(value), folder, key)
    except ValidationError:
        raise UsageError(
            f"{key} must be a name, a number or a table with model or mix, got {value!r}"
        ) from None


def _parameter_per_knot(key: str, value: Any) -> Parameter | list[Parameter]:
    """A spline's parameter, or a list of one for each knot."""
    if isinstance(value, list):
        return [_parameter(f"{key}{i}", each) for i, each in enumerate(value, start=1)]
    return _parameter(key, value)


def _parameter(key: str, value: Any) -> Parameter:
    """A model's parameter; without bounds it is fixed."""
    try:
        table = FreeTable.model_validate(value) if isinstance(value, dict) else float(value)
    except (ValidationError, TypeError, ValueError):
        raise UsageError(
            f"{key} must be a number or a table of value, lower and upper, got {value!r}"
        ) from None
    return number(table, key)
