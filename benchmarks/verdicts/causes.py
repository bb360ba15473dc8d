"""Measurements that are flawed or described wrongly in one way that a refusal can name; its score.

Each kind has the words by which a sentence of the tool names its cause.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from families import BK7, CAUCHY, FAMILIES, PARYLENE, PLATE, SI
from family import (
    Family,
    cauchy_layer,
    depth,
    depth_and_cauchy,
    ellipsometer_view,
    one_layer,
    recipe,
    spectrum_view,
)
from measurement import Conditions, Stack, View
from media import Index, catalogued, cauchy
from scoring import Answer
from wrong_scenes import WrongScene

Draw = Callable[[np.random.Generator, Family], tuple[Stack, View, Conditions]]
OXIDE, NITRIDE, SPUTTERED = catalogued("SiO2"), catalogued("Si3N4"), (2.2, 3e4)
R = spectrum_view("R", 420, 900, 241)


def _family(
    name: str, substrate: str, material: str, sample: Callable, draw: Callable, bounds: tuple, view: View = R
) -> Family:
    toml = recipe(view.signal, substrate, material, bounds)
    box = (bounds, *CAUCHY) if material == '"cauchy"' else (bounds,)
    return Family(name, toml, view, (8e-4, 3e-3), box, draw, sample)


_STACK = recipe("R", '"Si"', '"Si3N4"', (20, 800)) + (
    '\n[[scene.layer]]\nmaterial = "SiO2"\nthickness = 250\nname = "lower"\n'
)
FURTHER = {
    family.name: family
    for family in (
        _family("nitride on glass", '"BK7"', '"Si3N4"', one_layer(NITRIDE, BK7), depth(80, 900), (10, 2000)),
        _family(
            "nitride on a plate", PLATE, '"Si3N4"', one_layer(NITRIDE, BK7, 1.0), depth(80, 900), (10, 2000)
        ),
        _family(
            "titania on glass",
            '"BK7"',
            '"cauchy"',
            cauchy_layer(BK7),
            depth_and_cauchy(80, 500, (2.15, 2.3), (2e4, 4e4)),
            (10, 1500),
        ),
        _family(
            "parylene on glass",
            '"BK7"',
            f'{{ model = "cauchy", A = {PARYLENE[0]}, B = {PARYLENE[1]} }}',
            one_layer(cauchy(*PARYLENE), BK7),
            depth(3000, 8000),
            (1000, 12000),
            spectrum_view("R", 450, 950, 601),
        ),
        _family(
            "oxide in s light at 60°",
            '"Si"',
            '"SiO2"',
            one_layer(OXIDE, SI),
            depth(150, 1200),
            (10, 3000),
            replace(R, angle=np.full(241, 60.0), polarisation="s"),
        ),
        Family(
            "nitride on oxide",
            _STACK,
            R,
            (8e-4, 3e-3),
            ((20, 800),),
            depth(80, 500),
            lambda theta: Stack(((NITRIDE, theta[0]), (OXIDE, 250.0)), SI),
        ),
        _family(
            "oxide-psi2",
            '"Si"',
            '"SiO2"',
            one_layer(OXIDE, SI),
            depth(20, 500),
            (1, 1000),
            ellipsometer_view(400, 900, 61, 65.0, 75.0),
        ),
    )
}
EVERY = FAMILIES | FURTHER


def _flaw(**about: tuple[float, float] | Index | str | bool) -> Draw:
    """The family's own sample measured under conditions drawn evenly from ranges, those above 0 with either
    sign where their name ends in `_signed`."""

    def draw(random: np.random.Generator, family: Family) -> tuple[Stack, View, Conditions]:
        stack, drawn = family.stack(family.draw(random)), {}
        for name, value in about.items():
            if isinstance(value, tuple):
                value = float(random.uniform(*value))
                if name.endswith("_signed"):
                    value *= float(random.choice([-1.0, 1.0]))
            drawn[name.removesuffix("_signed")] = value
        if "spread" in drawn:
            drawn["spread"] = min(drawn["spread"], stack.thickness / 8)
        return stack, family.view, replace(Conditions(), **drawn)

    return draw


def _sample(
    film: Index | None = None,
    substrate: Index | None = None,
    *,
    under: tuple[Index, float, float] | None = None,
    over: tuple[Index, float, float] | None = None,
    thickness: tuple[float, float] | None = None,
    swapped: bool = False,
    plate_mm: float | str | None = "own",
) -> Draw:
    """Another sample: film, substrate, a layer (index, least and largest nm) under or over it, or a plate."""

    def draw(random: np.random.Generator, family: Family) -> tuple[Stack, View, Conditions]:
        own = family.stack(family.draw(random))
        d = own.thickness if thickness is None else float(np.exp(random.uniform(*np.log(thickness))))
        above = [] if over is None else [(over[0], float(random.uniform(*over[1:])))]
        below = [] if under is None else [(under[0], float(random.uniform(*under[1:])))]
        layers = [*above, (film or own.layers[0][0], d), *own.layers[1:], *below]
        at = len(above)
        if swapped:
            layers, at = layers[::-1], len(layers) - 1 - at
        plate = own.plate_mm if plate_mm == "own" else plate_mm
        return Stack(tuple(layers), substrate or own.substrate, at, plate), family.view, Conditions()

    return draw


OBLIQUE = "oxide-psi;oxide-psi2;polymer-psi3;oxide in s light at 60°"
ORGANIC = cauchy(1.5, 4000.0)
_KINDS: tuple[tuple[str, str, Draw, str], ...] = (
    ("angle", r"angle", _flaw(angle_error_signed=(1.5, 5)), OBLIQUE),
    ("percent of percent", r"percent", _flaw(factor=(0.01, 0.01)), "oxide-R;titania-T;nitride-R"),
    ("relative to bare silicon", r"relative to .*Si\b", _flaw(reference=SI), "oxide-R;nitride-R;resist-R"),
    ("relative to aluminium", r"relative to .*Al\b", _flaw(reference=catalogued("Al")), "nitride-R"),
    ("back face", r"\bback", _sample(plate_mm=1.0), "nitride on glass;titania on glass"),
    ("no back face", r"\bback", _sample(plate_mm=None), "nitride on a plate"),
    ("share of the back face", r"\bback", _flaw(collected=(0.3, 0.6)), "nitride on a plate"),
    ("offset", r"\boffset", _flaw(offset=(0.03, 0.07)), "nitride-R;titania on glass"),
    ("scale", r"\bscale\b(?! of wavelength)", _flaw(factor=(0.6, 0.85)), "oxide-R;resist-R"),
    ("wavelength shift", r"wavelength", _flaw(shift_signed=(6, 14)), "oxide-R;oxide-psi2"),
    ("bandwidth", r"bandwidth", _flaw(slit=(18, 30)), "parylene on glass"),
    ("thickness spread", r"thickness.spread", _flaw(spread=(60, 110)), "oxide-R;parylene on glass"),
    ("roughness", r"rough", _flaw(roughness=(15, 22)), "nitride-R"),
    ("rough surface", r"rough", _flaw(roughness=(3, 5)), "oxide-psi3;polymer-psi3"),
    ("another oxide", r"Al2O3|index of the layer", _sample(catalogued("Al2O3")), "oxide-R;oxide-psi2"),
    ("another oxide, denser", r"TiO2|index of the layer", _sample(catalogued("TiO2")), "oxide-psi2"),
    ("native oxide", r"oxide|SiO2", _sample(under=(OXIDE, 4, 7)), "polymer-psi3"),
    ("oxide beneath", r"oxide|SiO2", _sample(under=(OXIDE, 30, 120)), "nitride-R"),
    ("overlayer", r"overlayer|on top", _sample(over=(ORGANIC, 4, 8)), "oxide-psi2"),
    ("swapped layers", r"swap|order of the layers", _sample(swapped=True), "nitride on oxide"),
    ("sign of delta", r"360 - delta", _flaw(convention="360 - delta"), "oxide-psi2;polymer-psi3"),
    ("other convention of delta", r"180 - delta", _flaw(convention="180 - delta"), "oxide-psi"),
    ("glass for silicon", r"substrate", _sample(substrate=BK7), "oxide-psi2;resist-R"),
    ("aluminium for silicon", r"substrate", _sample(substrate=catalogued("Al")), "oxide-psi;resist-R"),
    ("thicker than the bounds", r"bounds|thickness up to", _sample(thickness=(3000, 6000)), "nitride-R"),
    ("thicker than the bounds", r"bounds|thickness up to", _sample(thickness=(1300, 3000)), "oxide-psi2"),
)  # fmt: skip

CAUSES = tuple(
    WrongScene(kind, EVERY[name], draw) for kind, _, draw, names in _KINDS for name in names.split(";")
)
WORDS = {kind: words for kind, words, _, _ in _KINDS}
_NAMES_A_CAUSE = re.compile(r"would explain|would fit")


def sentences(answer: Answer) -> list[str]:
    """Sentences of an answer that name a cause."""
    return [s for s in answer.warnings.split(" / ") if _NAMES_A_CAUSE.search(s)]


def named(answer: Answer) -> str:
    """`right` where the first sentence on a cause names the true one, `another` or `none`."""
    said = sentences(answer)
    if not said:
        return "none"
    return "right" if re.search(WORDS[answer.kind], said[0]) else "another"


def score(answers: Sequence[Answer]) -> str:
    """How many refusals name their cause, and each that does not."""
    refused = [a for a in answers if a.group == "cause" and not a.firm]
    if not refused:
        return ""
    found = [named(a) for a in refused]
    counts = ", ".join(f"{found.count(word)} {word}" for word in ("right", "another", "none"))
    firm = [a for a in answers if a.group == "cause" and a.firm]
    tied = sum("apart:" in sentences(a)[0] for a, word in zip(refused, found, strict=True) if word == "right")
    off = sum(a.pull() > 3 for a in firm)
    lines = [
        f"refusals that name their cause: {counts}, of {len(refused)}; {tied} of the right ones beside others"
        f" that data do not tell apart ({len(firm)} firm, {off} of them outside three errors)"
    ]
    for a, word in zip(refused, found, strict=True):
        if word != "right":
            lines.append(f"  {word}: {a.name} | {a.detail}: {a.status}, {a.value:.4g} for {a.truth:.4g}")
            lines += [f"    {s}" for s in sentences(a)]
    return "\n".join(lines)
