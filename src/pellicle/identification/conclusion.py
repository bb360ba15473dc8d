"""Conclusion from weighed structures: which the data leave, and whether they are one film or several."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pellicle.fitting.result import Estimate
from pellicle.identification.evidence import Weighed
from pellicle.identification.growth import BARE, NOISE_LIKE, SIGNIFICANT, STRAINED, Growth, needed
from pellicle.identification.hypothesis import TABLE_UNCERTAINTY, Hypothesis, SupposedLayer
from pellicle.identification.problem import Problem
from pellicle.identification.structure import OXIDE

DECIDED = 5.0
"""Δ ln Z that excludes a hypothesis: odds of 150 to 1."""
_DEMANDED = 12.0
"""Δ ln Z to the best single film from which a second layer is needed, however thick."""
NOISY = 2.0
"""Ratio of unexplained residuals to noise above which nothing is identified."""
SEVERAL = "several films are left"
MISSTATED = 0.3
"""Shift of the angle of incidence (degrees) above which it was stated wrongly: six times a usual error."""
_LIKE = 0.02
"""Relative difference of two indices of one name: that of pages of one material."""
_SHARE = 0.95
"""Share of the probability of all that are left from which one film, by whatever names, is the answer."""
_ERRORS, _THIN = 3.0, 10.0
"""Standard errors between thicknesses and indices of one film; nm between those of its thinner neighbour."""
_SAME_INDEX = _ERRORS * math.sqrt(2) * TABLE_UNCERTAINTY
"""Relative difference of two mean indices of one film: each page of the catalogue has its uncertainty.

Two layers told as one film of several names need more care, so of two layers, and of one R or T, all that are
left must be within `_LIKE`: 54 nm of polystyrene on 104 nm of Si3N4 in T were a film of 1.93 to 2.00."""


def survivors(weighed: Sequence[Weighed]) -> list[Weighed]:
    """Structures that describe the data and are not excluded by their evidence, the best first.

    The evidence chooses: where the best does not describe the data and no rival as good does, none is left.
    Two layers may be needed while neither their thicknesses nor their indices are known: they are left where
    no other is, and beside others: 60 nm of PMMA on oxide were identified as 24 nm of SU-8, with less
    evidence than a free index of unknown thickness.
    """
    single = max((x.ln_z for x in weighed if len(x.structure.layers) == 1), default=-math.inf)
    vague = [x for x in weighed if needed(x) or (x.ln_z > single + _DEMANDED and not x.structure.effects)]
    firm = [x for x in weighed if needed(x)]
    if firm and len(firm[0].structure.layers) > 1:
        firm = [x for x in vague if needed(x, layered=True)]
    for pool in (firm or list(weighed), vague):
        near = [x for x in pool if pool[0].ln_z - x.ln_z < DECIDED and x.adequate]
        if near:
            return near
    return []


def shapeless(weighed: Sequence[Weighed]) -> list[Weighed]:
    """Structures that leave but noise and have a free index of another shape than any model's, if the best
    are such: 249 nm of ITO in Ψ and Δ was 249.7 ± 3.1 nm, with an index that is bent by 2 %."""
    near = [x for x in weighed if weighed[0].ln_z - x.ln_z < DECIDED]
    # a model that a bound holds has not the shape either, as Urbach's for 333 nm of Si3N4
    near = [x for x in near if needed(x)] or near
    return [x for x in near if x.shapeless and x.remaining < NOISE_LIKE]


def plausible(weighed: Sequence[Weighed]) -> list[Weighed]:
    """Structures that leave but noise with usual errors, where those with more evidence need unusual ones:
    29 nm of polystyrene on 390 nm of HfO2 in Ψ and Δ had Δ ln Z 11 less than uneven alumina."""
    near = [x for x in weighed if weighed[0].ln_z - x.ln_z < _DEMANDED and needed(x)]
    return [x for x in near if x.adequate and x.remaining < NOISE_LIKE]


def doubt(problem: Problem, kept: Sequence[Weighed]) -> str:
    """Reason for which the best of the structures that are left is not certain, empty for none."""
    best, alike = kept[0], one_film(problem, kept)
    # an oxide that is thicker than a native one is a layer too
    depths = zip(best.structure.layers, _depths(best), strict=True)
    layered = sum(layer.most > OXIDE or v > BARE for layer, v in depths) > 1
    share = 1.0 if layered else _SHARE
    if len(alike) < len(kept) and sum(_shares(alike, best)) < share * sum(_shares(kept, best)):
        return SEVERAL
    # of 22 certain answers of two layers 8 were from one R or T, and 2 left 1.3 times the noise: 6 were wrong
    if layered and _lone(problem):
        return "one spectrum of R or T does not determine two layers"
    if best.remaining > (NOISE_LIKE if layered else NOISY):
        return f"its residuals are {best.remaining:.2g} times the noise"
    if best.strain > STRAINED:
        return f"an error of the instrument or the sample is {best.strain:.2g} times its usual size"
    for n, v, e in zip(best.structure.numbers, best.x, best.stderr, strict=True):
        if n.name == "angle_shift" and abs(v) > MISSTATED:
            return "the angle of incidence is not the one that was stated"
        if n.name == "thickness" and n.upper > BARE and not v > SIGNIFICANT * e:
            return "a thickness is not determined"
    # a table that needs an unusual error does not vouch for a free index
    unlike = all(_like_no_film(problem, x) for x in alike if x.strain <= STRAINED)
    return "its free index may stand for another structure" if unlike else ""


def _like_no_film(problem: Problem, x: Weighed) -> bool:
    """True where a layer has a free index without dispersion, or one that leaves more than noise, or one like
    that of no film and from one R or T.

    Of 23 samples two layers or another substrate were told as such a film three times, with residuals of
    noise; ψ and Δ have two numbers at each wavelength.
    """
    for i, layer in enumerate(x.structure.layers):
        numbers = zip(x.structure.numbers, x.x, strict=True)
        flat = any(
            n.layer == i and n.name == "B" and v < n.lower + 1e-3 * (n.upper - n.lower) for n, v in numbers
        )
        unlike = _lone(problem) and not _alike_films(problem, index_of(problem, x, i))
        if layer.modelled and _depths(x)[i] > BARE and (flat or unlike or x.remaining > NOISE_LIKE):
            return True
    return False


def _alike_films(problem: Problem, index: np.ndarray) -> tuple[str, ...]:
    """Names of films of the catalogue that have nearly this index at the wavelengths of all spectra."""
    distances = {}
    for name in problem.views[0].tables:
        table = np.concatenate([view.tables[name][: view.points] for view in problem.views])
        distances[name] = float(np.sqrt(np.mean(np.abs(table - index) ** 2)) / np.mean(np.abs(index)))
    return tuple(x for x in sorted(distances, key=lambda w: distances[w]) if distances[x] < _LIKE)


def one_film(problem: Problem, kept: Sequence[Weighed]) -> list[Weighed]:
    """Structures that are the best of these in other words."""
    return [x for x in kept if x is kept[0] or same(problem, kept[0], x)]


def _shares(weighed: Sequence[Weighed], best: Weighed) -> list[float]:
    return [math.exp(x.ln_z - best.ln_z) for x in weighed]


def same(problem: Problem, a: Weighed, b: Weighed) -> bool:
    """True where two structures are one sample in other words: thicknesses and indices of all layers but very
    thin ones alike within errors."""
    if abs(_others(a) - _others(b)) > _THIN and len(a.structure.layers) != len(b.structure.layers):
        return False
    one, other = _seen(problem, a), _seen(problem, b)
    most = _LIKE if len(one) > 1 or _lone(problem) else _SAME_INDEX
    return len(one) == len(other) and all(_alike(*pair, most) for pair in zip(one, other, strict=True))


def _lone(problem: Problem) -> bool:
    """True for one R or T, where ψ and Δ have two numbers at each wavelength."""
    return len(problem.views) == 1 and problem.views[0].channels == 1


def _seen(problem: Problem, x: Weighed) -> list[tuple[np.ndarray, float, float]]:
    """Index, thickness and its error, at most a tenth, of each layer that is seen."""
    depths = [
        (v, e) for n, v, e in zip(x.structure.numbers, x.x, x.stderr, strict=True) if n.name == "thickness"
    ]
    found = [(i, *depths[i]) for i in _not_thin([v for v, _ in depths])]
    return [
        (index_of(problem, x, i), v, min(e, 0.1 * v) if math.isfinite(e) else 0.1 * v) for i, v, e in found
    ]


def _not_thin(depths: Sequence[float]) -> list[int]:
    """Positions of layers that are not very thin, or of the thickest."""
    return [i for i, v in enumerate(depths) if v > BARE] or [int(np.argmax(depths))]


def _alike(a: tuple[np.ndarray, float, float], b: tuple[np.ndarray, float, float], most: float) -> bool:
    (n, d, e), (m, other, error) = a, b
    near = np.max(np.abs(n / m - 1)) < 2 * most and abs(n.mean() / m.mean() - 1) < most
    return bool((near or max(d, other) <= BARE) and abs(d - other) <= _ERRORS * math.hypot(e, error))


def index_of(problem: Problem, x: Weighed, layer: int) -> Any:
    """Complex index of a layer at the wavelengths of all spectra, with the change that the effects make."""
    views = problem.views
    index = np.concatenate([x.structure.index(layer, x.x[None], v)[0, : v.points] for v in views])
    return index * (1 + x.index_changes[layer])


def _depths(x: Weighed) -> np.ndarray:
    return x.structure.thicknesses(x.x[None])[0]


def thickest(x: Weighed) -> tuple[float, float]:
    """Thickness of the thickest layer and its standard error."""
    thicknesses = [
        (v, e) for n, v, e in zip(x.structure.numbers, x.x, x.stderr, strict=True) if n.name == "thickness"
    ]
    return max(thicknesses)


def _others(x: Weighed) -> float:
    """Thickness (nm) of the other layers together."""
    depths = _depths(x)
    return float(depths.sum() - depths.max())


def hypotheses(growth: Growth, weighed: Sequence[Weighed], condition: str = "") -> list[Hypothesis]:
    """Structures as hypotheses, with their probabilities beside each other."""
    shares = np.exp([x.ln_z - weighed[0].ln_z for x in weighed]) if weighed else np.zeros(0)
    found = [_hypothesis(growth, x, condition) for x in weighed]
    names = [x.name for x in found]
    found = [
        replace(x, name=f"{x.name}, {' and '.join(_digits(y.thickness.value) for y in x.layers)} nm")
        if names.count(x.name) > 1
        else x
        for x in found
    ]
    return [
        replace(x, probability=float(p)) for x, p in zip(found, shares / max(shares.sum(), 1.0), strict=True)
    ]


def _digits(nm: float) -> str:
    return f"{nm:.3g}" if nm < 999.5 else f"{nm:.0f}"


def answer(alike: Sequence[Hypothesis]) -> Hypothesis:
    """The first of several hypotheses that are one film, with errors of its thicknesses that include the
    choice among them, each as probable (J. Hoeting et al., 1999, Statist. Sci. 14, 382)."""
    best, layers = alike[0], list(alike[0].layers)
    places = [_not_thin([layer.thickness.value for layer in x.layers]) for x in alike]
    for own in zip(*places, strict=True):
        every = [x.layers[i].thickness for x, i in zip(alike, own, strict=True)]
        square = np.mean([x.stderr**2 + (x.value - every[0].value) ** 2 for x in every])
        first, *rest = layers[own[0]].numbers
        layers[own[0]] = replace(layers[own[0]], numbers=(replace(first, stderr=float(square**0.5)), *rest))
    return replace(best, layers=tuple(layers))


def _hypothesis(growth: Growth, x: Weighed, condition: str) -> Hypothesis:
    problem, structure = growth.problem, x.structure
    estimates = _estimates(x)
    layers = tuple(
        _supposed(growth, x, i, tuple(e for number, e in estimates if number.layer == i))
        for i in range(len(structure.layers))
    )
    instrument = tuple(
        replace(e, name=f"instrument.{e.name}") for number, e in estimates if number.layer is None
    )
    values = problem.by_channel(x.attempt.values)
    return Hypothesis(
        name_of(x), layers, x.ln_z, x.remaining, x.adequate, problem.views[0].around,
        tuple(view.quantities(own.ravel()) for view, own in values), instrument, condition,
    )  # fmt: skip


def name_of(x: Weighed) -> str:
    """Name of a structure; one of a native oxide alone is bare."""
    if len(x.x) == 1 and x.structure.layers[0].most == BARE:
        return "native oxide" if x.x[0] > SIGNIFICANT * x.stderr[0] else "bare substrate"
    return x.structure.name


def _estimates(x: Weighed) -> list[tuple]:
    """Each number with its estimate. A thickness is free around its value, as a fit may confirm it."""
    found = []
    for number, value, error, noise in zip(x.structure.numbers, x.x, x.stderr, x.stderr_noise, strict=True):
        lower, upper = number.lower, number.upper
        if number.name == "thickness":
            lower, upper = max(0.0, 0.7 * value - 10), 1.4 * value + 20
        error, noise = (e if e < upper - lower else math.inf for e in (float(error), float(noise)))
        own = Estimate(
            number.name, float(value), error, number.unit, lower, upper, free=True, stderr_noise=noise
        )
        found.append((number, own))
    return found


def _supposed(growth: Growth, x: Weighed, layer: int, numbers: tuple[Estimate, ...]) -> SupposedLayer:
    index = index_of(growth.problem, x, layer)
    n, k = ((float(part.min()), float(part.max())) for part in (index.real, index.imag))
    own = x.structure.layers[layer]
    near = _alike_films(growth.problem, index)
    if not own.modelled:
        near = (own.name, *(name for name in near if name != own.name))
    return SupposedLayer(own.name, near, n, k, numbers)
