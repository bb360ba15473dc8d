"""Sentences of an identification: what stands, what the data need, and what is excluded."""

from __future__ import annotations

import math
from collections.abc import Container, Sequence
from dataclasses import replace

from pellicle.fitting.result import Estimate
from pellicle.fitting.status import with_error
from pellicle.identification.conclusion import DECIDED, SEVERAL, name_of
from pellicle.identification.evidence import Weighed
from pellicle.identification.growth import BARE
from pellicle.identification.hypothesis import Hypothesis, NotTried, SupposedLayer

_SHOWN = 4
"""Names of hypotheses and materials in one sentence."""


def verdict(
    kept: Sequence[Hypothesis],
    alike: Sequence[Hypothesis],
    excluded: Sequence[Hypothesis],
    doubt: str,
    nearest: Weighed,
    left_out: Sequence[NotTried],
    substrate: str,
) -> str:
    """Return the verdict on a sample on `substrate`: what it is, or what the data leave open.

    `doubt` is the reason for which the first of the hypotheses that are left is not certain, empty for none;
    `alike` are then those of them that are the same film.
    """
    far = [x for x in excluded if kept and kept[0].ln_z - x.ln_z >= DECIDED]
    unlike = _unlike(kept, far)
    if not kept:
        (name, size), own = nearest.excess, name_of(nearest)
        closest = "the bare substrate" if own == "bare substrate" else f"{own} on {substrate}"
        sentences = [
            "No hypothesis that was tried describes the data within usual errors.",
            f"The nearest, {closest}, leaves residuals of {nearest.remaining:.2g} times the noise and needs"
            f" an error of {name} of {size:.2g} times its usual size.",
        ]
    elif not doubt:
        sentences = [f"{_sentence(_named(alike), substrate, unlike)}.", *_effects(kept[0], excluded)]
        rest = [x for x in kept if all(x is not y for y in alike)]
        rest = [f"{x.name} ({100 * x.probability:.1f} %)" for x in rest]
        sentences += [f"Less probable: {', '.join(rest[:_SHOWN])}."] if rest else []
    else:
        sentences = _undecided(kept, substrate, doubt, unlike)
    rows = [f"{x.name} (Δ ln Z {kept[0].ln_z - x.ln_z:.0f})" for x in far if not _freely(x, kept[0])]
    sentences += [f"Excluded: {', '.join(rows[:_SHOWN])}."] if rows else []
    if left_out:
        names = ", ".join(x.material for x in left_out[:_SHOWN])
        more = f" and {len(left_out) - _SHOWN} more" if len(left_out) > _SHOWN else ""
        sentences.append(f"Not tried, as their tables do not cover the data: {names}{more}.")
    return " ".join(sentences)


def _undecided(kept: Sequence[Hypothesis], substrate: str, doubt: str, unlike: Container[str]) -> list[str]:
    best = _sentence(kept[0], substrate, unlike)
    names = [x.name for x in kept]
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    if kept[0].condition:
        others = [f"{x.name} ({100 * x.probability:.0f} %)" for x in kept[1 : _SHOWN + 1]]
        rest = f" and {len(kept) - 1 - _SHOWN} more" if len(kept) - 1 > _SHOWN else ""
        return [
            "No hypothesis describes the data as they are stated.",
            f"If {kept[0].condition}, they may be of this: {_lower(best)}.",
            *([f"Also left: {', '.join(others)}{rest}."] if others else []),
        ]
    if doubt != SEVERAL:
        only = f"One answer is left, but is not certain, as {doubt}: {_lower(best)}."
        return [only, *_effects(kept[0], ())]
    sentences = [f"On {substrate} the data do not decide between these: {', '.join(names[:_SHOWN])}{more}."]
    main = [max(x.layers, key=lambda layer: layer.thickness.value) for x in kept]
    n = min(x.n[0] for x in main), max(x.n[1] for x in main)
    like = dict.fromkeys(name for x in main for name in x.like[:2] if name not in unlike)
    unseen = all(x.thickness.value > BARE and not math.isfinite(x.thickness.stderr) for x in main)
    if unseen and len({x.material for x in main}) == 1:
        sentences.append(
            "All are one film, from whose lower face no light returns: its thickness is unknown."
        )
    depths = [_interval(x.thickness) for x in main]
    low, high = min(x for x, _ in depths), max(x for _, x in depths)
    if all(x.thickness.value > BARE for x in main) and high < 1.5 * low:
        sentences.append(
            f"In all of them a film has an index of {_range(n)}{_as(tuple(like))}, and a thickness of"
            f" {low:.4g} to {high:.4g} nm."
        )
    return sentences


def _unlike(kept: Sequence[Hypothesis], excluded: Sequence[Hypothesis]) -> set[str]:
    """Names of films that are excluded where the best hypothesis is one film."""
    if not kept or len(kept[0].layers) > 1:
        return set()
    names = {x.layers[0].material for x in excluded if len(x.layers) == 1}
    return names - {layer.material for x in kept for layer in x.layers}


def _freely(x: Hypothesis, best: Hypothesis) -> bool:
    """True for the best film again, by a free index or as more than a native oxide, at a higher price."""
    several = max(len(x.layers), len(best.layers)) > 1
    if several or best.layers[0].modelled or x.effects != best.effects:
        return False
    own, film = x.layers[0], best.layers[0]
    apart = abs(own.thickness.value - film.thickness.value)
    known = film.material in own.like and (own.modelled or own.material == film.material)
    return known and apart < own.thickness.stderr + film.thickness.stderr


def _named(alike: Sequence[Hypothesis]) -> Hypothesis:
    """The first of several hypotheses that are one film, with the index and the names of all of one layer."""
    best = alike[0]
    every = [x.layers[0] for x in alike if len(x.layers) == 1 == len(best.layers)]
    if len(every) < 2:
        return best
    n, k = (
        (min(x for x, _ in part), max(x for _, x in part))
        for part in zip(*((x.n, x.k) for x in every), strict=True)
    )
    like = tuple(dict.fromkeys(name for x in every for name in x.like))
    return replace(best, layers=(replace(best.layers[0], n=n, k=k, like=like),))


def _lower(sentence: str) -> str:
    return sentence[0].lower() + sentence[1:]


def _sentence(x: Hypothesis, substrate: str, unlike: Container[str]) -> str:
    if x.name == "bare substrate":
        own = x.layers[0].thickness
        most = f": an oxide is thinner than {own.value + 1.645 * own.stderr:.2g} nm"
        return f"No film is seen on {substrate}{most if math.isfinite(own.stderr) else ''}"
    if x.name == "native oxide":
        return f"{substrate} with a native oxide of {_value(x.layers[0].thickness)}"
    films = [_film(layer, unlike) for layer in x.layers]
    if len(films) == 1:
        return f"A film {films[0]} on {substrate}"
    return f"{len(films)} layers on {substrate}: " + " on ".join(f"one {film}" for film in films)


def _film(layer: SupposedLayer, unlike: Container[str]) -> str:
    names = [name for name in layer.like if name not in unlike]
    like = _as(names) or _as(layer.like).replace("as", "near", 1)
    absorbing = f", k {layer.k[0]:.2g} to {layer.k[1]:.2g}" if layer.k[1] > 1e-3 else ""
    of = f"of index {_range(layer.n)}{absorbing}{like}"
    return f"{of}, {_value(layer.thickness)} thick"


def _effects(best: Hypothesis, excluded: Sequence[Hypothesis]) -> list[str]:
    """Sentences on the effects that the data need, and on those that were tried and are not needed."""
    called = [f"{word} of {_value(x)}" for word, x in best.effect_numbers()]
    tried = dict.fromkeys(word for x in excluded for word in x.effects if word not in best.effects)
    two = any(len(x.layers) > len(best.layers) for x in excluded)
    idle = [*tried, *(["a further layer"] if two else [])]
    sentences = [f"The data need {' and '.join(called)}."] if called else []
    return [*sentences, *([f"They do not need {' or '.join(idle)}."] if idle else [])]


def _as(names: Sequence[str]) -> str:
    return f", as {', '.join(names[:_SHOWN])}" if names else ""


def _range(n: tuple[float, float]) -> str:
    low, high = (f"{x:.3g}" for x in n)
    return low if low == high else f"{low} to {high}"


def _interval(x: Estimate) -> tuple[float, float]:
    reach = x.stderr if math.isfinite(x.stderr) else 0.0
    return max(x.value - reach, 0.0), x.value + reach


def _value(x: Estimate) -> str:
    if not math.isfinite(x.stderr):
        return f"{x.value:.3g} {x.unit} (not determined)"
    return f"{with_error(x.value, x.stderr)} {x.unit}"
