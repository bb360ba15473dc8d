"""Models of CompleteEASE as the tables of a recipe; what a scene cannot express is refused by name."""

from collections.abc import Callable, Mapping
from typing import Any

from pellicle.dispersion.base import HC
from pellicle.errors import DataError
from pellicle.materials.formats import complete_ease as text
from pellicle.materials.formats.complete_ease import Block, Medium, Parameter
from pellicle.recipes.foreign_numbers import names, number, of_layer, thickness

_HBAR, _EPSILON_0 = 6.582119569e-16, 8.8541878128e-12
"""ħ (eV s) and ε₀ (F/m): CODATA 2018."""
_ANGSTROM = 0.1
_RESISTIVITY, _TIME = "Resistivity (Ohm·cm)", "Scat. Time (fs)"
_TERMS: dict[str, tuple[str, dict[str, tuple[str, ...]]]] = {
    "Tauc-Lorentz": ("tauc-lorentz", {"A": ("Amp",), "C": ("Br",), "E0": ("Eo",), "Eg": ("Eg",)}),
    "Cody-Lorentz": (
        "cody-lorentz",
        {"A": ("Amp",), "C": ("Br",), "E0": ("Eo",)} | {x: (x,) for x in ("Eg", "Ep", "Et", "Eu")},
    ),
    "Gaussian": ("gaussian", {"A": ("Amp",), "E0": ("En",), "fwhm": ("Br",)}),
    "Lorentz": ("lorentz", {"A": ("Amp", "Br", "En"), "E0": ("En",), "gamma": ("Br",)}),
    "Drude(RT)": ("drude", {"Ep": (_RESISTIVITY, _TIME), "gamma": (_TIME,)}),
}
"""Oscillators: the term of a recipe, and of each of its numbers the ones on which it depends."""
_CONVERTED: dict[tuple[str, str], Callable[[Mapping[str, float]], float]] = {
    ("lorentz", "A"): lambda p: p["Amp"] * p["Br"] / p["En"],
    ("drude", "Ep"): lambda p: _HBAR / (_EPSILON_0 * p[_RESISTIVITY] * 1e-2 * p[_TIME] * 1e-15) ** 0.5,
    ("drude", "gamma"): lambda p: _HBAR / (p[_TIME] * 1e-15),
}
"""Numbers of terms that are not numbers of the oscillators."""
_OFF = ("Ambient", "ScatteringFactor", "GlobalFit", "MultiSamp", "ParmCoupling", "MultiModel", "Patterning")
"""Blocks of options that a scene lacks or a recipe states otherwise: their first cell is F or 0 where off."""


def tables(root: Block, file: str) -> dict[str, Any]:
    """The tables of a recipe of a model whose file has the name `file`. Raises DataError."""
    options, every = root.block("Model Parms"), text.layers(root)
    _refuse(options)
    media = [text.medium(layer) for layer in every]
    layers = []
    for one, name in list(zip(media, names(x.name for x in media), strict=True))[:0:-1]:
        with of_layer(one.name):
            if one.layer.block("SL Parms").word() not in ("F", "0"):
                raise DataError("is a part of a superlattice: write it as a group in a recipe")
            size = next(iter(one.layer.numbers.values()))
            layers.append({"name": name, "material": _material(one, file), "thickness": _length(size)})
    rough = options.numbers.get("Roughness")
    if rough is not None and options.above("Roughness") == "T" and (rough.free or rough.value > 0):
        layers.insert(0, {"name": "roughness", "between": "bruggeman", "thickness": _length(rough)})
    if not layers:
        raise DataError("is a bare substrate: add a layer, or name its medium in a recipe")
    with of_layer(media[0].name):
        substrate = _substrate(options, media[0], file)
    recipe: dict[str, Any] = {"scene": {"substrate": substrate, "layer": layers}}
    offset = options.numbers.get("Angle Offset")
    if offset is not None and (offset.free or offset.value):
        bounds = {"value": offset.value, "lower": offset.lower, "upper": offset.upper}
        recipe["instrument"] = {"angle_shift": bounds if offset.free else offset.value}
    return recipe


def _refuse(options: Block) -> None:
    """Raise DataError for the first option of a model that a scene cannot have."""
    on = [name for name in _OFF if options.block(name).word() not in ("F", "0")]
    if ["T"] in options.block("Multiple Angle Offsets").rows:
        on.append("Multiple Angle Offsets")
    on += [
        x
        for x in ("PsiOffset", "Wvl. Shift (nm)", "Smear Width")
        if x in options.numbers and options.numbers[x].value
    ]
    if on:
        raise DataError(f"has the option {on[0]}, which is not read: turn it off, or write a recipe")
    how = options.above("% Thickness Non-uniformity")
    if how not in ("Ideal", "F"):
        raise DataError(
            f"has the model calculation {how!r}: set it to Ideal, and give `thickness_spread` or `bandwidth`"
            " in a recipe"
        )


def _length(size: Parameter) -> float | dict[str, float]:
    """A length in nm, fixed or free."""
    value, lower, upper = (x * _ANGSTROM for x in (size.value, size.lower, size.upper))
    if not size.free:
        return value
    wide = thickness(value)
    return wide | {"lower": max(lower, 0.0), "upper": min(upper, wide["upper"])}


def _substrate(options: Block, one: Medium, file: str) -> Any:
    """The substrate; a plate where its back face reflects."""
    material = _material(one, file)
    count, first = (options.numbers.get(x) for x in ("# Back Reflections", "% 1st Reflection"))
    if count is None or first is None or options.above("# Back Reflections") != "T":
        return material
    size = next(iter(one.layer.numbers.values())).value
    plate = {"material": material, "back": "air", "plate_mm": size * _ANGSTROM * 1e-6}
    if count.free or first.free:
        return plate | {"back_collected": {"lower": 0.0, "upper": 1.0}}
    if not count.value.is_integer():
        raise DataError(f"has {count.value:g} back reflections: take a whole number, or fit it")
    share = {} if first.value == 100 else {"back_collected": first.value / 100}
    return plate | {"back_reflections": int(count.value)} | share


def _material(one: Medium, file: str) -> Any:
    """The medium of a layer as a recipe has it. Raises DataError for kinds that it has not."""
    if text.is_table(one):
        if one.part("Fit Parms").rows:
            raise DataError("has a table with numbers to fit: give `free` of the layer in a recipe")
        return f"{file}#{one.name}"
    if one.kind == "CAUCHY":
        return _cauchy(one.part("Fit Parms"))
    if one.kind == "GENOSC":
        return _oscillators(one)
    raise DataError(
        f"is of the kind {one.kind}, which is not read: save its n and k as a material file (.mat), and name"
        " that in a recipe"
    )


def _cauchy(block: Block) -> dict[str, Any]:
    """A Cauchy layer, whose wavelength is in µm, with or without its absorption edge."""
    p = block.numbers
    edge, exponent = p["k Amplitude"], p["Exponent"]
    model = "cauchy-urbach" if edge.value or edge.free else "cauchy"
    powers = (("A", 1.0), ("B", 1e6), ("C", 1e12))
    medium = {"model": model, **{key: _number(model, key, p[key].value * x, p[key]) for key, x in powers}}
    if model == "cauchy":
        return medium
    if not exponent.value:
        raise DataError("has a k with the exponent 0: write it as constant n and k in a recipe")
    medium |= {"k0": _number(model, "k0", edge.value, edge)}
    medium |= {"Eu": _number(model, "Eu", 1 / exponent.value, exponent)}
    return medium | {"Eb": HC / (float(block.rows[-1][0]) * _ANGSTROM)}


def _number(model: str, key: str, value: float, *of: Parameter) -> Any:
    """A number of a model, free where one of the parameters is on which it depends."""
    return number(model, key, value) if any(x.free for x in of) else value


def _oscillators(one: Medium) -> dict[str, Any]:
    """The sum of oscillators and poles of a Gen-Osc layer."""
    for part in ("Grade Parms", "Permanent Poles", "Fit Parms"):  # graded, an Urbach tail, one gap of all
        if ["T"] in one.part(part).rows:
            raise DataError(f"has an option of {part}, which is not read: turn it off, or write a recipe")
    unit = one.part("Energy Units").rows
    if unit and unit[0][0] == "T" and unit[0][-1] not in ("", "eV"):
        raise DataError(f"has oscillators in {unit[0][-1]}: choose eV, and save the model again")
    einf, *rows = one.part("Fit Parms").rows
    terms: list[tuple[str, dict[str, Parameter]]] = []
    for row in rows:
        if (p := text.parameter(row)) is not None:
            terms[-1][1][p.name] = p
        elif row[0] not in ("T", "F"):
            terms.append((row[0], {}))
    used = one.layer.block(f"{one.name}Enabled Oscillators").rows or [["T"] * len(terms)]
    made = [_term(*term) for term, on in zip(terms, used[0], strict=True) if on == "T"]
    poles = one.part("Permanent Poles").numbers
    for name, kind in (("UV Pole", "uv-pole"), ("IR Pole", "ir-pole")):
        own = {"A": poles.get(f"{name} Amp.")} | ({"E0": poles[f"{name} En."]} if name == "UV Pole" else {})
        if own["A"] is not None and (own["A"].free or own["A"].value):
            made.append({"kind": kind} | {key: _number(kind, key, x.value, x) for key, x in own.items() if x})
    infinite = text.parameter(einf)
    if infinite is None or not made:
        raise DataError("has no oscillators: write its index in a recipe")
    eps_inf = _number("lorentz", "eps_inf", infinite.value, infinite)
    return {"model": "oscillators", "eps_inf": eps_inf, "terms": made}


def _term(name: str, p: dict[str, Parameter]) -> dict[str, Any]:
    """One oscillator as a term of a recipe."""
    if name not in _TERMS or ("iAmp" in p and p["iAmp"].value):
        raise DataError(f"has the oscillator {name}, which is not read; read are real {', '.join(_TERMS)}")
    kind, keys = _TERMS[name]
    values = {key: x.value for key, x in p.items()}
    term: dict[str, Any] = {"kind": kind}
    for key, own in keys.items():
        value = _CONVERTED[kind, key](values) if (kind, key) in _CONVERTED else values[own[0]]
        term[key] = _number(kind, key, value, *(p[x] for x in own))
    return term
