"""Numbers of recipes of other programs: bounds that suit a global search, names of layers."""

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from pellicle.errors import DataError
from pellicle.recipes.dispersion_models import MODELS, TERMS

_WIDEST, _THINNEST, _AROUND = 3.0, 100.0, 0.2


def thickness(value: float) -> dict[str, float]:
    """A free thickness, up to three times its value or 100 nm: in bounds from 0 to 10 µm, as programs have
    that start at a value, other orders of all layers fit."""
    return {"value": value, "lower": 0.0, "upper": max(_WIDEST * value, _THINNEST)}


def number(model: str, key: str, value: float) -> dict[str, Any]:
    """A free number of a model or term: within its default bounds, and a fifth around its value."""
    spec = (TERMS.get(model) or MODELS[model]).get(key) or MODELS[model][key]
    about, (least, most) = abs(value) * _AROUND, spec.limits
    ends = min(spec.lower, value - about), max(spec.upper, value + about)
    if not least <= value <= most:
        return {"value": value, "lower": ends[0], "upper": ends[1], "limits": ends}
    return {"value": value, "lower": max(ends[0], least), "upper": min(ends[1], most)}


def names(words: Iterable[str]) -> list[str]:
    """Names of layers in the letters that a recipe takes, each once."""
    plain = [re.sub(r"[^\w-]+", "_", word).strip("_") or "layer" for word in words]
    return [
        f"{name}_{plain[: i + 1].count(name)}" if plain.count(name) > 1 else name
        for i, name in enumerate(plain)
    ]


@contextmanager
def of_layer(name: str) -> Iterator[None]:
    """Put the name of a layer in front of errors about it."""
    try:
        yield
    except DataError as error:
        raise DataError(f"layer {name}: {error}") from None
    except (LookupError, ValueError):
        raise DataError(f"layer {name}: its numbers are incomplete; save the model again") from None
