"""Media and numbers as recipes write them: names, models, sums of oscillators, mixtures."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator

from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.effective_medium import MIXTURES
from pellicle.errors import UsageError
from pellicle.recipes import dispersion_models, media_words
from pellicle.recipes.dispersion_models import nearest
from pellicle.scene.free import Free
from pellicle.scene.priors import HalfNormal, LogUniform, Normal, Prior


class PriorTable(BaseModel):
    """`{ mean = 100, sd = 5 }`, `{ half_normal = 0.01 }` by its standard deviation, or
    `{ log_uniform = true }`; in the parameter's unit, cut off at the bounds."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    mean: float | None = None
    sd: float | None = Field(None, gt=0)
    half_normal: float | None = Field(None, gt=0)
    log_uniform: Literal[True] | None = None

    @model_validator(mode="after")
    def _one(self) -> PriorTable:
        given = {name for name, value in vars(self).items() if value is not None}
        if given not in ({"mean", "sd"}, {"half_normal"}, {"log_uniform"}):
            raise ValueError("give mean and sd, or half_normal, or log_uniform = true")
        return self

    def prior(self) -> Prior:
        if self.half_normal is not None:
            return HalfNormal(self.half_normal)
        if self.mean is None or self.sd is None:
            return LogUniform()
        return Normal(self.mean, self.sd)


class FreeTable(BaseModel):
    """A number that may be free: bounds, and optionally a start value and a prior; or fixed."""

    model_config = ConfigDict(extra="forbid")
    value: float | None = None
    lower: float | None = None
    upper: float | None = None
    prior: PriorTable | None = None


Number = float | FreeTable


class MediumTable(BaseModel):
    """`{ model = "cauchy", A = ..., B = ... }`: what else it holds are the model's parameters.

    `{ model = "oscillators", eps_inf = ..., terms = [{ kind = "lorentz", ... }, ...] }` is a sum.
    """

    model_config = ConfigDict(extra="allow")
    model: str


class MixTable(BaseModel):
    """`{ mix = "bruggeman", host = "SiO2", inclusion = "air", fraction = { lower = 0, upper = 0.5 } }`.

    `host` and `inclusion` are media of any kind; `materials = [host, inclusion]` says the same.
    """

    model_config = ConfigDict(extra="allow")
    mix: str


Medium = str | float | MediumTable | MixTable
_MEDIUM: TypeAdapter[Any] = TypeAdapter(Medium)


def number(given: Number, what: str, natural: float | None = None) -> float | Free:
    """A fixed number or a `Free`; ValueError where it is neither, not finite, or below what nature allows."""
    if isinstance(given, float | int):
        lowest, result = float(given), float(given)
    elif given.lower is None and given.upper is None and given.value is not None:
        lowest, result = given.value, given.value
    elif given.lower is None or given.upper is None:
        raise UsageError(f"{what}: give lower and upper, or one plain number")
    else:
        try:
            prior = None if given.prior is None else given.prior.prior()
            result = Free(given.lower, given.upper, start=given.value, prior=prior)
        except ValueError as error:
            raise UsageError(f"{what}: {error}") from None
        lowest = given.lower
    if not math.isfinite(lowest):
        raise UsageError(f"{what} must be a finite number, got {lowest:g}")
    if natural is not None and lowest < natural:
        raise UsageError(f"{what} must not be below {natural:g}, got {lowest:g}")
    return result


def medium(given: Medium, folder: Path) -> AbstractDispersion:
    """The dispersion that a recipe names; paths are relative to `folder`. Raises UsageError."""
    if isinstance(given, MixTable):
        return _mixture(given.mix, dict(given.model_extra or {}), folder)
    if isinstance(given, MediumTable):
        return _model(given.model, dict(given.model_extra or {}))
    if isinstance(given, str) and given.lower().endswith((".csv", ".txt", ".dat")):
        given = str(folder / given)
    return media_words.medium(str(given), what="material")


def _model(name: str, given: dict[str, Any]) -> AbstractDispersion:
    if name == "oscillators":
        return _oscillators(given)
    if name not in dispersion_models.MODELS:
        known = [*dispersion_models.MODELS, "oscillators"]
        raise UsageError(f"no dispersion model {name!r}{nearest(name, known)}; known: {', '.join(known)}")
    return dispersion_models.model(name, {key: _parameter(key, value) for key, value in given.items()})


def _oscillators(given: dict[str, Any]) -> AbstractDispersion:
    terms = given.pop("terms", None)
    eps_inf = _parameter("eps_inf", given.pop("eps_inf", 1.0))
    if given:
        wrong = next(iter(given))
        close = nearest(wrong, ["eps_inf", "terms"])
        raise UsageError(f"oscillators has no parameter {wrong!r}{close}; it has eps_inf, terms")
    if not isinstance(terms, list) or not terms or not all(isinstance(t, dict) for t in terms):
        raise UsageError('oscillators needs terms, a list of tables like { kind = "lorentz", A = 1.0, ... }')
    return dispersion_models.oscillators(eps_inf, [_term(dict(t)) for t in terms])


def _term(given: dict[str, Any]) -> Any:
    if "kind" not in given:
        raise UsageError(f"a term of oscillators needs a kind: one of {', '.join(dispersion_models.TERMS)}")
    kind = str(given.pop("kind"))
    return dispersion_models.term(kind, {key: _parameter(key, value) for key, value in given.items()})


def _mixture(rule: str, given: dict[str, Any], folder: Path) -> AbstractDispersion:
    if rule not in MIXTURES:
        raise UsageError(f"no mix {rule!r}{nearest(rule, MIXTURES)}; known: {', '.join(MIXTURES)}")
    if "materials" in given:
        both = given.pop("materials")
        if not isinstance(both, list) or len(both) != 2 or given.keys() & {"host", "inclusion"}:
            raise UsageError(f"{rule}: materials is a list of two, the host and the inclusion")
        given |= {"host": both[0], "inclusion": both[1]}
    known = ("host", "inclusion", "fraction")
    for key in given:
        if key not in known:
            raise UsageError(f"{rule} has no {key!r}{nearest(key, known)}; it has {', '.join(known)}")
    missing = [key for key in known if key not in given]
    if missing:
        raise UsageError(f"{rule}: {' and '.join(missing)} missing; it needs host, inclusion and fraction")
    fraction = _parameter("fraction", given["fraction"])
    host, inclusion = (_nested(key, given[key], folder) for key in ("host", "inclusion"))
    try:
        return MIXTURES[rule](host, inclusion, fraction)
    except ValueError as error:
        raise UsageError(f"{rule}: {error}") from None


def _nested(key: str, value: Any, folder: Path) -> AbstractDispersion:
    try:
        return medium(_MEDIUM.validate_python(value), folder)
    except ValidationError:
        raise UsageError(
            f"{key} must be a name, a number or a table with model or mix, got {value!r}"
        ) from None


def _parameter(key: str, value: Any) -> Any:
    """A model's parameter; without bounds of its own it is fixed. A list is one for each knot."""
    if isinstance(value, list):
        return [_parameter(f"{key}{i + 1}", each) for i, each in enumerate(value)]
    try:
        table = FreeTable.model_validate(value) if isinstance(value, dict) else float(value)
    except (ValidationError, TypeError, ValueError):
        raise UsageError(
            f"{key} must be a number or a table of value, lower and upper, got {value!r}"
        ) from None
    return number(table, key)
