"""Media and numbers of recipes and of the command line: words and tables to dispersions, fixed or free."""

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from pellicle.data.options import is_range, length_range, parse_length, parse_number
from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.effective_medium import MIXTURES
from pellicle.dispersion.empirical import Constant
from pellicle.dispersion.oscillators import Oscillators
from pellicle.dispersion.profiles import PROFILES
from pellicle.dispersion.temperature import AtTemperature, ThermoOptic
from pellicle.errors import UsageError, did_you_mean
from pellicle.materials import UnknownMaterial, contents, material
from pellicle.materials.formats.detect import names_file
from pellicle.recipes import dispersion_models as models
from pellicle.recipes import medium_schema
from pellicle.recipes.free_numbers import free_numbers
from pellicle.scene.free import Free
from pellicle.scene.graded import Graded
from pellicle.scene.priors import Normal
from pellicle.scene.ties import Tied

_MEDIUM: TypeAdapter[Any] = TypeAdapter(medium_schema.Medium)
_ANGLES = ("axis_theta", "axis_phi", "axis_psi")
_DECIMAL_COMMA = re.compile(r"\s*\d+,\d+\s*")

_COMPOSED: dict[str, tuple[Any, tuple[str, ...]]] = {
    "oscillators": (Oscillators, ("terms",)),
    "thermo-optic": (ThermoOptic, ("base",)),
    "at-temperature": (AtTemperature, ("media", "temperatures")),
}
"""Models of several parts, and the keys that they need."""

_CALL = re.compile(r"\s*([A-Za-z][\w-]*)\s*(?:\((.*)\))?\s*")


def thickness(text: str) -> Free | float:
    """Parse `LO:HI` in nm as a free thickness, or one number as a fixed one. Raises UsageError."""
    if not is_range(text):
        fixed = parse_length(text, "`thickness`", "LO:HI in nm, as in 10:3000, or a number")
        if fixed < 0:
            raise UsageError(f"`thickness` must not be negative, got {text} nm")
        return fixed
    low, high = length_range(text, "`thickness`")
    if low < 0:
        raise UsageError(f"`thickness` must not be negative: its lower bound is {low:g} nm")
    return Free(low, high)


def free_or_number(text: str, name: str, default: Free) -> Free | float:
    """Parse `free` (the default), `LO:HI` or a number. Raises UsageError."""
    if text == "free":
        return default
    if is_range(text):
        return Free(*length_range(text, name))
    return parse_length(text, name)


def drift(text: str, name: str) -> str | float:
    """Parse `free`, `slow` or a number, for scale and offset. Raises UsageError."""
    return text if text in ("free", "slow") else parse_number(text, name)


def medium(
    value: medium_schema.Medium, free: Iterable[str] = (), name: str = "`layer`", folder: Path | None = None
) -> AbstractDispersion:
    """Return the dispersion for a word of the command line, or for what a recipe has under the key `name`.

    A word is a material or its file, a number (`1.46`, `2.9+0.1j`) or a model: `cauchy` leaves the model's
    parameters free within the default bounds of `MODELS`; `cauchy(1.46,3000)` fixes them, in the order of
    that table; `spline(400,500,600,800)` gives knots. Paths are relative to `folder`. `free` has items such
    as `n`, `k`, `A` or `n=1.3:1.7`: see `free_numbers`.

    Raises UsageError, or DataError for a file that cannot be read.
    """
    if isinstance(value, medium_schema.AnisotropicTable):
        dispersion: AbstractDispersion = _anisotropic(dict(value.model_extra or {}), folder)
    elif isinstance(value, medium_schema.GradedTable):
        dispersion = _graded(value, dict(value.model_extra or {}), folder)
    elif isinstance(value, medium_schema.MixTable):
        dispersion = _mixture(value.mix, dict(value.model_extra or {}), folder)
    elif isinstance(value, medium_schema.MediumTable):
        dispersion = _model(value.model, dict(value.model_extra or {}), folder)
    else:
        word = str(value).strip()
        if folder is not None and names_file(word):
            word = str(folder / word)
        dispersion = _index_model_or_material(word, name)
    return free_numbers(dispersion, free)


def scattering_back(
    word: str, signal: str, part: tuple[Free | float | None, int | None]
) -> tuple[AbstractDispersion, float]:
    """Medium behind a back face that is `rough` or `taped`, and the share of its light that is collected: 0.

    `part` is the share and the number of reflections that were given with it. Raises UsageError for either,
    and for a transmittance.
    """
    if part != (None, None):
        raise UsageError(f"`back` {word} returns no light: leave out `back_collected` and `back_reflections`")
    if signal == "T":
        raise UsageError(
            f"light through a {word} back is scattered or blocked, and its transmittance is not simulated"
        )
    return Constant(1.0), 0.0


def _index_model_or_material(text: str, name: str) -> AbstractDispersion:
    """The dispersion of a word. Raises UsageError."""
    try:
        index = complex(re.sub("i$", "j", text.replace(" ", "")))
    except ValueError:
        index = None
    if index is not None:
        if np.isfinite(index) and index.real >= 0 and index.imag >= 0 and index != 0:
            return Constant(index.real, index.imag if index.imag else None)
        raise UsageError(
            f"{name} must be n + ik, with n and k finite, not negative and not both 0, got {text}"
        )
    match = _CALL.fullmatch(text)
    if match is not None and (model := match[1].lower()) in models.MODELS:
        if match[2] is None:
            return models.free_model(model)
        label = f"{name}: a parameter of {model}"
        return models.fixed_model(
            model, [parse_number(v, label) for v in match[2].split(",") if v.strip()], name
        )
    try:
        return material(text)
    except UnknownMaterial as error:
        if text.lower() in (*MIXTURES, *_COMPOSED):
            raise UsageError(f"{text} consists of several parts: describe it in a recipe") from None
        if _DECIMAL_COMMA.fullmatch(text):
            raise UsageError(
                f"{text!r} is no material; an index has a decimal point: {text.replace(',', '.')}"
            ) from None
        if "," in text and all(contents.find_name(word) for word in text.split(",")):
            raise UsageError(
                f"{text}: flags describe one layer: write a [[scene.layer]] for each into a recipe"
            ) from None
        if "(" in text and text.partition("(")[0].strip().lower() in models.MODELS:
            raise UsageError(
                f"{name} {text}: the bracket of the model is not closed: write {text})"
            ) from None
        close = did_you_mean(text.lower(), models.MODELS, 0.8)
        raise UsageError(f"no material or model {text!r}{close}" if close else str(error)) from None


def _anisotropic(values: dict[str, Any], folder: Path | None) -> Anisotropic:
    axis = values.pop("axis", [0.0, 0.0])
    keys = medium_schema.BIAXIAL if values.keys() & {*medium_schema.BIAXIAL} else medium_schema.UNIAXIAL
    _check_keys(values, [*keys, "axis"], "a birefringent material has no")
    missing = [key for key in keys if key not in values]
    if missing:
        raise UsageError(f"a birefringent material lacks {' and '.join(missing)}: it has {', '.join(keys)}")
    most = len(keys)
    if not isinstance(axis, list) or not 2 <= len(axis) <= most:
        names = "[theta, phi]" if most == 2 else "[theta, phi] or [theta, phi, psi]"
        raise UsageError(f"axis must be {names} in degrees, each a number or a table of lower and upper")
    angles: Any = [_parameter(name, angle) for name, angle in zip(_ANGLES, axis, strict=False)]
    media = {key: _component(key, values[key], folder) for key in keys}
    return Anisotropic(**media, axis=angles)


def _graded(table: medium_schema.GradedTable, values: dict[str, Any], folder: Path | None) -> Graded:
    name = table.profile
    _check_word(name, PROFILES, "profile")
    _check_word(table.mix, MIXTURES, "mix")
    keys = [field.name for field in fields(PROFILES[name])]
    _check_keys(values, keys, f"a {name} profile has no", ("graded", "profile", "mix"))
    if name == "spline" and not isinstance(values.get("values"), list):
        raise UsageError("a spline profile needs values, a list of fractions, one for each knot")
    numbers: dict[str, Any] = {}
    for key, value in values.items():
        if key == "knots" and isinstance(value, list):
            numbers[key] = [float(_parameter(key, knot)) for knot in value]  # pyright: ignore[reportArgumentType]
        else:
            numbers[key] = _parameters(key, value)
    first, second = (_component("graded", value, folder) for value in table.graded)
    return Graded(first, second, PROFILES[name](**numbers), table.mix)


def _model(name: str, values: dict[str, Any], folder: Path | None) -> AbstractDispersion:
    """A model by its name, a sum of oscillators, or a medium at a temperature."""
    if name in _COMPOSED and name != "oscillators":
        return _at_temperature(name, values, folder)
    if name != "oscillators":
        _check_word(name, [*models.MODELS, *_COMPOSED], "dispersion model")
        parameter, more = (_parameters, ["knots"]) if name in models.SPLINES else (_parameter, [])
        _check_keys(values, [*models.MODELS[name], *more], f"{name} has no parameter")
        return models.build_model(name, {key: parameter(key, value) for key, value in values.items()})
    terms = values.pop("terms", None)
    eps_inf = _parameter("eps_inf", values.pop("eps_inf", 1.0))
    _check_keys(values, ("eps_inf", "terms"), "oscillators has no parameter")
    if not isinstance(terms, list) or not terms or not all(isinstance(t, dict) for t in terms):
        raise UsageError('oscillators needs terms, a list of tables like { kind = "lorentz", A = 1.0, ... }')
    built = []
    for term in terms:
        if "kind" not in term:
            raise UsageError(f"a term of oscillators needs a kind: one of {', '.join(models.TERMS)}")
        kind, numbers = str(term["kind"]), {key: value for key, value in term.items() if key != "kind"}
        _check_word(kind, models.TERMS, "oscillator")
        _check_keys(numbers, [*models.TERMS[kind]], f"{kind} has no parameter")
        built.append(
            models.build_oscillator(kind, {key: _parameter(key, value) for key, value in numbers.items()})
        )
    with models.usage_errors():
        return Oscillators(eps_inf, tuple(built))


def _at_temperature(name: str, values: dict[str, Any], folder: Path | None) -> AbstractDispersion:
    """A medium changed by thermo-optic terms, or media at several temperatures."""
    kind, part = _COMPOSED[name]
    _check_keys(values, [field.name for field in fields(kind)], f"{name} has no parameter")
    if missing := [key for key in (*part, "temperature") if key not in values]:
        raise UsageError(f"{name} needs {' and '.join(missing)}")
    given: dict[str, Any] = {key: _parameters(key, x) for key, x in values.items() if key not in part[:1]}
    first = values[part[0]]
    if part[0] == "media" and not (isinstance(first, list) and isinstance(given["temperatures"], list)):
        raise UsageError(f"{name}: media and temperatures must be lists, one medium for each temperature")
    made = [_component(part[0], x, folder) for x in (first if part[0] == "media" else [first])]
    with models.usage_errors(f"{name}: "):
        return kind(**given, **{part[0]: made if part[0] == "media" else made[0]})


def _mixture(rule: str, values: dict[str, Any], folder: Path | None) -> AbstractDispersion:
    _check_word(rule, MIXTURES, "mix")
    if "materials" in values:
        both = values.pop("materials")
        if not isinstance(both, list) or len(both) != 2 or values.keys() & {"host", "inclusion"}:
            raise UsageError(f"{rule}: materials is a list of two, the host and the inclusion")
        values |= {"host": both[0], "inclusion": both[1]}
    known = ("host", "inclusion", "fraction")
    _check_keys(values, known, f"{rule} has no")
    missing = [key for key in known if key not in values]
    if missing:
        raise UsageError(f"{rule}: {' and '.join(missing)} missing; it needs host, inclusion and fraction")
    fraction = _parameter("fraction", values["fraction"])
    host, inclusion = (_component(key, values[key], folder) for key in ("host", "inclusion"))
    with models.usage_errors(f"{rule}: "):
        return MIXTURES[rule](host, inclusion, fraction)


def _check_word(word: str, known: Iterable[str], what: str) -> None:
    """Raise UsageError for a word that is not known, with the nearest known one."""
    if word not in known:
        raise UsageError(f"no {what} {word!r}{did_you_mean(word, known)}; known: {', '.join(known)}")


def _check_keys(
    keys: Iterable[str], known: Sequence[str], what_lacks: str, elsewhere: Sequence[str] = ()
) -> None:
    """Raise UsageError for the first unknown key, with the nearest known one, which may stand `elsewhere`."""
    for key in keys:
        if key not in known:
            close = did_you_mean(key, [*known, *elsewhere])
            raise UsageError(f"{what_lacks} {key!r}{close}; it has {', '.join(known)}")


def _component(key: str, value: Any, folder: Path | None) -> AbstractDispersion:
    try:
        return medium(_MEDIUM.validate_python(value), name=key, folder=folder)
    except ValidationError:
        raise UsageError(
            f"{key} must be a name, a number or a table with model or mix, got {value!r}"
        ) from None


def _parameters(key: str, value: Any) -> models.Parameter | list[models.Parameter]:
    """A number of a model, or a list of one for each knot of a spline."""
    if isinstance(value, list):
        return [_parameter(f"{key}{i}", one) for i, one in enumerate(value, start=1)]
    return _parameter(key, value)


def _parameter(key: str, value: Any) -> models.Parameter:
    """A model's parameter; without bounds it is fixed."""
    try:
        table = medium_schema.FreeTable.model_validate(value) if isinstance(value, dict) else value
        if not isinstance(table, str | medium_schema.FreeTable):
            table = float(table)
    except (ValidationError, TypeError, ValueError):
        raise UsageError(
            f"{key} must be a number or a table of value, lower and upper, got {value!r}"
        ) from None
    return number(table, key)


def number(value: medium_schema.Number, name: str, minimum: float | None = None) -> float | Free | Tied:
    """Return a fixed number, a `Free` or a `Tied` from what a recipe gives for `name`.

    Raises UsageError where it is neither, not finite, or below `minimum`.
    """
    if isinstance(value, str):
        try:
            value = float(value)
        except ValueError:
            ends = value.replace(" to ", ":")
            if is_range(ends):
                lower, upper = length_range(ends, name)
                raise UsageError(
                    f"{name}: {value!r} is a range: write {{ lower = {lower:g}, upper = {upper:g} }}"
                ) from None
            try:
                return Tied(value)
            except ValueError as error:
                raise UsageError(f"{name}: {error}") from None
    if isinstance(value, float | int):
        lowest, result = float(value), float(value)
    elif value.lower is None and value.upper is None and value.value is not None:
        lowest, result = value.value, value.value
    elif value.lower is None or value.upper is None:
        raise UsageError(f"{name}: give lower and upper, or one plain number")
    else:
        with models.usage_errors(f"{name}: "):
            prior = None if value.prior is None else value.prior.prior()
            ends = {
                name: Normal(x.mean, x.sd) if isinstance(x, medium_schema.KnownTable) else x
                for name, x in (("first", value.first), ("last", value.last))
            }
            about = {"prior": prior, "limits": value.limits, "varies": value.varies, **ends}
            result = Free(value.lower, value.upper, start=value.value, **about)
        lowest = value.lower
    if not math.isfinite(lowest):
        raise UsageError(f"{name} must be a finite number, got {lowest:g}")
    if minimum is not None and lowest < minimum:
        raise UsageError(f"{name} must not be below {minimum:g}, got {lowest:g}")
    return result
