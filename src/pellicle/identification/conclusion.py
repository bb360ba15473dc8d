"""Conclusion from weighed structures: which the data leave, and whether they are one film or several."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pellicle.fitting.result import Estimate
from pellicle.identification.evidence import Weighed
from pellicle.identification.growth import BARE, NOISE_LIKE, SIGNIFICANT, Growth, needed
from pellicle.identification.hypothesis import Hypothesis, SupposedLayer
from pellicle.identification.problem import Problem

DECIDED = 5.0
"""Δ ln Z that excludes a hypothesis: odds of 150 to 1."""
_DEMANDED = 12.0
"""Δ ln Z to the best single film from which a second layer is needed, however thick."""
NOISY = 2.0
"""Ratio of unexplained residuals to noise above which nothing is identified."""
SEVERAL = "several films are left"
STRAINED = 3.0
"""Size of an effect, in standard uncertainties, above which nothing is identified."""
MISSTATED = 0.3
"""Shift of the angle of incidence (degrees) above which it was stated wrongly: six times a usual error."""
_LIKE = 0.02
"""Relative difference of two indices that name one film: that of pages of one material."""
_SAME_THICKNESS, _THIN = 3.0, 10.0
"""Standard errors between thicknesses of one film, and nm between those of its thinner neighbour."""


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


def doubt(problem: Problem, kept: Sequence[Weighed]) -> str:
    """Reason for which the best of the structures that are left is not certain, empty for none."""
    best = kept[0]
    if not all(same(problem, best, x) for x in kept[1:]):
        return SEVERAL
    if best.remaining > NOISY:
        return f"its residuals are {best.remaining:.2g} times the noise"
    if best.strain > STRAINED:
        return f"an error of the instrument or the sample is {best.strain:.2g} times its usual size"
    for n, v, e in zip(best.structure.numbers, best.x, best.stderr, strict=True):
        if n.name == "angle_shift" and abs(v) > MISSTATED:
            return "the angle of incidence is not the one that was stated"
        if n.name == "thickness" and n.upper > BARE and not v > SIGNIFICANT * e:
            return "a thickness is not determined"
    unlike = all(_like_no_film(problem, x) for x in kept)
    return "its free index may stand for another structure" if unlike else ""


def _like_no_film(problem: Problem, x: Weighed) -> bool:
    """True where a layer has a free index without dispersion, or one that leaves more than noise, or one like
    that of no film and from one R or T.

    Of 23 samples two layers or another substrate were told as such a film three times, with residuals of
    noise; ψ and Δ have two numbers at each wavelength.
    """
    lone = len(problem.views) == 1 and problem.views[0].channels == 1
    for i, layer in enumerate(x.structure.layers):
        numbers = zip(x.structure.numbers, x.x, strict=True)
        flat = any(
            n.layer == i and n.name == "B" and v < n.lower + 1e-3 * (n.upper - n.lower) for n, v in numbers
        )
        unlike = lone and not _alike_films(problem, index_of(problem, x, i))
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


def same(problem: Problem, a: Weighed, b: Weighed) -> bool:
    """True where two structures are one sample in other words: thicknesses alike within errors, and indices
    of all layers but very thin ones."""
    (da, ea), (db, eb) = thickest(a), thickest(b)
    ea, eb = (min(e, 0.1 * d) if math.isfinite(e) else 0.1 * d for e, d in ((ea, da), (eb, db)))
    thin = [_others(x) for x in (a, b)]
    if abs(da - db) > _SAME_THICKNESS * math.hypot(ea, eb) or abs(thin[0] - thin[1]) > _THIN:
        return False
    pairs = zip(_seen(problem, a), _seen(problem, b), strict=False)
    return len(_seen(problem, a)) == len(_seen(problem, b)) and all(_alike(*pair) for pair in pairs)


def _seen(problem: Problem, x: Weighed) -> list[np.ndarray]:
    """Index of each layer that is not very thin."""
    return [index_of(problem, x, i) for i, depth in enumerate(_depths(x)) if depth > BARE]


def _alike(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(np.max(np.abs(a / b - 1)) < 2 * _LIKE and abs(a.mean() / b.mean() - 1) < _LIKE)


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
    return [
        replace(x, probability=float(p)) for x, p in zip(found, shares / max(shares.sum(), 1.0), strict=True)
    ]


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
        _name(x), layers, x.ln_z, x.remaining, x.adequate, problem.views[0].around,
        tuple(view.quantities(own.ravel()) for view, own in values), instrument, condition,
    )  # fmt: skip


def _name(x: Weighed) -> str:
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
