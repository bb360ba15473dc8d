"""Recipes of Regress Pro as the tables of a recipe; what a scene cannot express is refused by name."""

import math
from typing import Any

from pellicle.dispersion.base import HC
from pellicle.dispersion.local_field import PLASMA
from pellicle.errors import DataError
from pellicle.materials.formats import regress_pro as text
from pellicle.materials.formats.regress_pro import Words
from pellicle.recipes.foreign_numbers import names, number, of_layer, thickness

_EV, _EV_LORENTZ = HC / 1240.0, HC / 1239.852
"""Energies here by those of Regress Pro, whose photon energy times wavelength is rounded."""
_DENSITY = 1.3788623090164978 / PLASMA * _EV**2
_NM = 0.1
"""A thickness is in Å; recipes that are older than 2016 had nm, and other media of the library."""
_LIBRARY = {"vacuum": "air", "sio2": "SiO2", "silicon-1": "Si", "water": "water", "germanium-1": "Ge"}
"""Media of the library that comes with Regress Pro, by names of the catalogue."""

Numbers = list[tuple[dict[str, Any], str, tuple[str, ...]]]
"""Of each number that a recipe may fit: a table, its model, and the keys that become free."""


def _cauchy(words: Words) -> tuple[Any, Numbers]:
    n, k = words.numbers(3), words.numbers(3)
    if any(k):
        raise DataError("has k in a Cauchy model: give a table of n and k")
    medium = {"model": "cauchy", **dict(zip("ABC", n, strict=True))}
    return medium, [(medium, "cauchy", (key,)) for key in "ABC"]


def _harmonic(words: Words) -> tuple[Any, Numbers]:
    medium: dict[str, Any] = {"model": "harmonic-oscillators"}
    for i in range(1, words.count() + 1):
        density, energy, width, field, phase = words.numbers(5)
        turn = math.remainder(math.degrees(phase) + 180.0 * (density < 0), 360.0)
        medium |= {f"N{i}": abs(density) * _DENSITY, f"E{i}": energy * _EV, f"gamma{i}": width * _EV}
        medium |= {f"nu{i}": field, f"phase{i}": turn}
    return medium, [(medium, medium["model"], (key,)) for key in list(medium)[1:]]


def _lorentz(words: Words) -> tuple[Any, Numbers]:
    by_width, eps_inf = words.count() == 0, words.number()
    medium: dict[str, Any] = {"model": "oscillators", "eps_inf": eps_inf, "terms": []}
    fitted: Numbers = [(medium, "lorentz", ("eps_inf",))]
    for _ in range(words.count()):
        strength, energy, width = words.numbers(3)
        term = {"kind": "lorentz", "A": strength * (width / energy if by_width else 1.0)}
        medium["terms"].append(term | {"E0": energy * _EV_LORENTZ, "gamma": width * _EV_LORENTZ})
        also = ("A",) if by_width else ()
        keys = (("A",), ("E0", *also), ("gamma", *also))
        fitted += [(medium["terms"][-1], "lorentz", x) for x in keys]
    return medium, fitted


def _tauc_lorentz(words: Words) -> tuple[Any, Numbers]:
    count, rational, eps_inf, gap = words.count(), words.count(), *words.numbers(2)
    medium: dict[str, Any] = {"model": "oscillators", "eps_inf": eps_inf, "terms": []}
    fitted: Numbers = [(medium, "tauc-lorentz", ("eps_inf",))]
    for _ in range(count):
        a, b, c = words.numbers(3)
        if rational:  # place and width of the root of the denominator
            centre = (b**4 + c**4 / 4) ** 0.25
            width = math.sqrt(2 * (centre**2 - b**2))
            a, b, c = a * c**4 / (4 * centre * width), centre, width
        term = {"kind": "tauc-lorentz", "A": a * _EV, "E0": b * _EV, "C": c * _EV, "Eg": max(gap, 0.0) * _EV}
        medium["terms"].append(term)
        every = ("A", "E0", "C")
        keys = (every[:1], every, every) if rational else [(key,) for key in every]
        fitted += [(term, "tauc-lorentz", x) for x in keys]
    gaps = ("Eg",) if count == 1 else ()
    return medium, [fitted[0], (medium["terms"][0], "tauc-lorentz", gaps), *fitted[1:]]


_MODELS = {"cauchy": _cauchy, "ho": _harmonic, "lorentz": _lorentz, "tauc-lorentz": _tauc_lorentz}


def _medium(words: Words, file: str) -> tuple[str, Any, Numbers]:
    """Take a medium: its name, its place in a scene, its numbers. Raises DataError for others."""
    kind, name = words.word("a medium"), words.header()
    if kind in _MODELS:
        return name, *_MODELS[kind](words)
    if kind == "table":
        text.rows(words)
        return name, f"{file}#{name}", []
    if kind == "library" and name in _LIBRARY:
        return name, _LIBRARY[name], []
    raise DataError(f"is the {kind} {name!r}, whose numbers are not read: write it in a recipe")


def tables(words: Words, file: str) -> dict[str, Any]:
    """The tables of a recipe, from the words of the one with the name `file`. Raises DataError."""
    words.take("stack")
    count = words.count()
    if count < 3:
        raise DataError(f"has {count} media: a recipe has an ambient, layers and a substrate")
    sizes, media = words.numbers(count - 2), []
    for i in range(count):
        with of_layer(str(i)):
            media.append(_medium(words, file))
    data: dict[str, Any] = {}
    while words.peek() not in ("fit-parameters", ""):
        if words.take("wavelength-range"):
            data["range"] = words.numbers(2)
        else:
            words.word()
    called = names(name for name, *_ in media[1:-1])
    layers = [
        {"name": name, "material": one, "thickness": size * _NM}
        for name, (_, one, _), size in zip(called, media[1:-1], sizes, strict=True)
    ]
    for (what, *where), (start, delta) in _fitted(words):
        with of_layer(where[0] if where else what):
            if what == "thickness":
                layer = layers[int(where[0]) - 1]
                value = layer["thickness"] if start is None else start * _NM
                layer["thickness"] = thickness(value)
                if delta is not None:
                    layer["thickness"] |= {
                        "lower": max(value - delta * _NM, 0.0),
                        "upper": value + delta * _NM,
                    }
            elif what == "n" and where[1] in _MODELS and (keys := media[int(where[0])][2][int(where[2])])[2]:
                table, model, free = keys
                table |= {key: number(model, key, x) for key in free if isinstance(x := table[key], float)}
            else:
                raise DataError(f"fits {' '.join([what, *where])}, which is not read: fix it")
    ambient = "air" if media[0][1] == {"model": "cauchy", "A": 1.0, "B": 0.0, "C": 0.0} else media[0][1]
    return {"data": data, "scene": {"ambient": ambient, "substrate": media[-1][1], "layer": layers}}


def _fitted(words: Words) -> list[tuple[list[str], tuple[float | None, float | None]]]:
    """Take the fitted numbers and, of each, the start value and the range on both sides of it."""
    more, fitted, seeds = {"thickness": 1, "n": 3}, [], []
    words.take("fit-parameters")
    for _ in range(words.count()):
        what = words.word("a fitted number")
        fitted.append([what, *(words.word() for _ in range(more.get(what, 0)))])
    words.take("seed-list")
    for _ in range(words.count()):
        kind = words.word("a seed")
        start = words.number() if kind in ("range", "value") else None
        seeds.append((start, words.number() if kind == "range" else None))
    if words.take("multi-sample"):
        raise DataError("is of several samples: write them as [[sample]] in a recipe")
    if len(seeds) != len(fitted):
        raise DataError("has other seeds than fitted numbers; save the recipe again")
    return list(zip(fitted, seeds, strict=True))
