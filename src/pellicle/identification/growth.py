"""Growth of structures from the bare substrate until one describes the data within usual effects."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from pellicle.identification import pairs
from pellicle.identification.evidence import NATIVE, Weighed, weigh
from pellicle.identification.free_models import CONDUCTOR, FREE_MODELS
from pellicle.identification.hypothesis import EFFECTS
from pellicle.identification.problem import Attempt, Column, Problem
from pellicle.identification.search import minima, rivals, scan, thickness_grid
from pellicle.identification.structure import OXIDE, Material, Structure

NOISE_LIKE = 1.3
"""Ratio of unexplained residuals to noise up to which growth ends."""
STRAINED = 3.0
"""Size of an effect, in standard uncertainties, above which nothing is identified: other models are tried."""
BARE = 15.0
"""Largest thickness (nm) of the native oxide on a bare substrate."""
SIGNIFICANT = 3.5
"""Total standard errors that a further number must differ from 0 by."""
_LOOSE = 0.1
"""Error, as a share of its range, from which a number on a bound is unknown and not held there: A of a Cauchy
film of 20 nm in R."""
_FLEXIBLE = 4
"""Numbers up to which one film that describes the data needs no two layers as rivals: an absorbing film of
five described 60 nm of titania on 300 nm of oxide."""
WRONG_ANGLES = (-3.0, -2.5, -2.0, -1.5, -1.0, 1.0, 1.5, 2.0, 2.5, 3.0)
"""Errors of an angle of incidence (degrees) that was stated wrongly; a shift of half a degree is fitted."""
_TABLES, _MOST_TABLES, _CLOSE = 8, 16, 15.0
"""Films of the catalogue that a scan lets through: so many, and up to so many within this χ² of the best. In
R all films of 30 nm look alike."""
_STARTS: dict[str, list[dict[str, float]]] = {
    "cauchy": [
        {"A": a, "B": min(1.2e4 * (a - 1) ** 2, 9e4)}
        for a in (1.38, 1.46, 1.55, 1.65, 1.8, 1.95, 2.1, 2.25, 2.45, 2.7)
    ],
    "sellmeier": [{"B1": n**2 - 1, "C1": c} for n in (1.4, 1.6, 1.9, 2.3) for c in (8e3, 2e4)],
    "cauchy-urbach": [
        {"A": a, "B": 1e4, "k0": k, "Eu": 0.4} for a in (1.5, 1.8, 2.1, 2.5) for k in (0.05, 0.4)
    ],
    CONDUCTOR: [
        {"term1.Ep": p, "term1.gamma": g, "term2.A": a, "term2.E0": e, "term2.gamma": 0.2}
        for p, g in ((1.0, 1.0), (1.8, 0.2))
        for a, e in ((2.1, 4.6), (2.0, 6.0), (2.8, 7.3), (4.0, 7.3))
    ],
    "drude": [{"eps_inf": e, "Ep": p, "gamma": 0.15} for e in (2.5, 3.5, 4.5) for p in (1.0, 1.7, 2.5)],
    "lorentz": [
        {"eps_inf": 2.0, "A": a, "E0": e, "gamma": 0.6} for a in (1.0, 4.0) for e in (2.2, 3.0, 3.8, 5.0)
    ],
    "tauc-lorentz": [
        {"eps_inf": e, "A": a, "E0": p, "C": 1.5, "Eg": g}
        for e, a, p, g in (
            *((1.5, 80.0, 4.0, 2.2), (1.5, 200.0, 3.6, 1.5), (2.0, 100.0, 5.0, 3.2)),
            *((1.5, 150.0, 6.5, 4.5), (1.5, 250.0, 7.5, 5.0)),
        )
    ],
}
"""Starts of models, by their index; thicknesses are scanned for each."""


def needed(x: Weighed, layered: bool = False) -> bool:
    """True where the data need each further layer, unless `layered` says so, and each effect, and no model is
    held by a bound."""
    layers = len(x.structure.layers)
    for number, value, error in zip(x.structure.numbers, x.x, x.stderr, strict=True):
        reach, held = 1e-6 * (number.upper - number.lower), error < _LOOSE * (number.upper - number.lower)
        further = layers > 1 and not layered and number.name == "thickness"
        extra = further or number.name in EFFECTS or number.name == "k0"
        if extra and abs(value) < SIGNIFICANT * error:
            return False
        low = number.name == "A" and value < number.lower + reach
        # an oxide at the largest thickness of a native one, or of one below a film, is a film
        if (held or number.upper in (BARE, OXIDE)) and (low or value > number.upper - reach):
            return False
    return True


@dataclass
class Growth:
    """Attempts at one problem, and their weights so far, the best first."""

    problem: Problem
    names: Sequence[str]
    """Materials of the catalogue that are tried."""
    deadline: float = np.inf
    """Time of `time.monotonic` after which nothing more is tried."""
    attempts: list[Attempt] = field(default_factory=list)
    weighed: list[Weighed] = field(default_factory=list)
    columns: dict[int, list[Column]] = field(default_factory=dict)

    @cached_property
    def ranks(self) -> dict[str, tuple[float, np.ndarray]]:
        """χ² and the best thicknesses of a film of each material by a scan, the best film first."""
        grid, found = thickness_grid(self.problem), []
        for name in self.names:
            costs = scan(self.scanned, [[x] for x in self.tables(name)], grid[:, None])
            at = minima(costs, 3)
            found.append((float(costs[at[0]]), name, grid[at]))
        return {name: (cost, at) for cost, name, at in sorted(found, key=lambda x: x[0])}

    @property
    def order(self) -> list[str]:
        """Materials of the catalogue, the best single film first."""
        return list(self.ranks)

    @property
    def least(self) -> float:
        """χ² of the best film of the catalogue by a scan."""
        return min((cost for cost, _ in self.ranks.values()), default=np.inf)

    @property
    def oxidised(self) -> bool:
        """True for a substrate that has a native oxide."""
        return float(np.mean(self.problem.views[0].media[1].real)) > NATIVE

    def done(self, most: int = 99, strain: float = np.inf) -> bool:
        """Weigh all; true where time is up, or the best needs at most `most` numbers, leaves but noise, and
        needs no effect above `strain` of its standard uncertainties."""
        self.weighed = weigh(self.problem, self.attempts, self.columns)
        best = next((x for x in self.weighed if needed(x)), self.weighed[0])
        enough = best.adequate and best.remaining < NOISE_LIKE and best.strain <= strain
        return (enough and len(best.x) <= most) or time.monotonic() > self.deadline

    def add(self, layers: Sequence[Material], starts: Iterable[np.ndarray], *effects: str) -> None:
        """Polish a structure from starts (numbers,) and keep it, unless time is up."""
        if self.attempts and time.monotonic() > self.deadline:
            return
        structure = Structure(tuple(layers), effects)
        self.attempts += rivals(self.problem, structure, list(starts))

    def film(self, name: str) -> Material:
        return Material(name, self.problem.thickest)

    @property
    def scanned(self) -> Problem:
        """The problem with the points of a scan."""
        return self.problem.coarse or self.problem

    def likely_shift(self) -> float:
        """Error of the stated angle of incidence (degrees) with which a film of the catalogue is nearest."""
        grid, problem = thickness_grid(self.problem), self.scanned
        costs = {
            shift: min(
                float(scan(problem, [[x] for x in self.tables(name)], grid[:, None], shift).min())
                for name in self.order[:_TABLES]
            )
            for shift in WRONG_ANGLES
        }
        return min(costs, key=lambda shift: costs[shift])

    def tables(self, name: str) -> list[np.ndarray]:
        """Index of a material at the points of a scan, in each view."""
        return [view.tables[name] for view in self.scanned.views]


def grow(growth: Growth, layers: int = 2) -> Growth:
    """Grow structures of the materials of the catalogue and of models, up to `layers` layers."""
    if "SiO2" in growth.problem.views[0].tables:
        growth.add([Material("SiO2", BARE)], [np.array([2.0])])
    _single_films(growth)
    growth.add([growth.film("cauchy")], _model_starts(growth, "cauchy", 4))
    if not growth.done(strain=STRAINED):
        for model in ("sellmeier", "cauchy-urbach", CONDUCTOR, "drude", "lorentz", "tauc-lorentz"):
            growth.add([growth.film(model)], _model_starts(growth, model, 3))
    if not growth.done(_FLEXIBLE):
        _effects(growth)
    enough = growth.done(_FLEXIBLE)
    if layers > 1 and time.monotonic() < growth.deadline:
        pairs.grow(growth, settled=enough)
    if layers > 1 and not growth.done():
        _pair_effects(growth)
    growth.weighed = weigh(growth.problem, growth.attempts, growth.columns)
    return growth


def _single_films(growth: Growth) -> None:
    for i, (name, (cost, at)) in enumerate(growth.ranks.items()):
        if i < _TABLES or (i < _MOST_TABLES and cost < growth.least + _CLOSE):
            growth.add([growth.film(name)], at[:, None])


def _model_starts(growth: Growth, model: str, keep: int) -> list[np.ndarray]:
    """The best starts of a film of a model: its numbers with the thickness that a scan finds."""
    grid, found = thickness_grid(growth.problem), []
    structure = Structure((growth.film(model),))
    keys = FREE_MODELS[model]
    for start in _STARTS[model]:
        x = np.array([[0.0, *(start[key] for key in keys)]])
        index = [[structure.index(0, x, view)[0]] for view in growth.scanned.views]
        costs = scan(growth.scanned, index, grid[:, None])
        best = int(np.argmin(costs))
        found.append((costs[best], np.array([grid[best], *x[0, 1:]])))
    return [x for _, x in sorted(found, key=lambda pair: pair[0])[:keep]]


def _effects(growth: Growth) -> None:
    """Effects on the best film of a table, on the free index, and on another model that is far better."""
    single = [x for x in growth.weighed if len(x.structure.layers) == 1 and x.attempt.x[0] > BARE]
    tables = [x for x in single if not x.structure.layers[0].modelled]
    cauchy = [x for x in single if x.structure.layers[0].name == "cauchy"]
    others = [x for x in single if x.structure.layers[0].modelled and x.structure.layers[0].name != "cauchy"]
    bases = [*tables[:1], *cauchy[:1]]
    if others and (not bases or others[0].ln_z > bases[0].ln_z + 20):
        bases.append(others[0])
    tried: dict[str, tuple[float, ...]] = {"roughness": (3.0, 12.0), "thickness_spread": (5.0, 20.0)}
    if any(view.oblique for view in growth.problem.views):
        tried["angle_shift"] = (-2.0, -0.4, 0.4, 2.0)
    for base in bases:
        x, layers = base.attempt.x, base.structure.layers
        _with_each(growth, base, tried)
        if growth.oxidised and layers[-1].name != "SiO2" and "SiO2" in growth.order:
            growth.add([*layers, Material("SiO2", OXIDE)], [np.append(x, value) for value in (3.0, 15.0)])


def _with_each(growth: Growth, base: Weighed, tried: dict[str, tuple[float, ...]]) -> None:
    """Add a structure with each effect, from its starts."""
    for effect, starts in tried.items():
        x = base.attempt.x
        growth.add(base.structure.layers, [np.append(x, value) for value in starts], effect)


def _pair_effects(growth: Growth) -> None:
    """Both of the best two layers with a free index, then effects on the best, on the best that describe
    the data, and on these: 29 nm of polystyrene on 454 nm of uneven hafnia had no hypothesis in Ψ and Δ."""
    free = [x for x in _pairs(growth) if {y.name for y in x.structure.layers if y.modelled} == {"cauchy"}]
    for pair in free[:1]:
        pairs.free_both(growth, pair)
        growth.done()
    found = _pairs(growth)
    adequate = [x for x in found if x.adequate]
    both = [x for x in found if all(y.name == "cauchy" for y in x.structure.layers)]
    bases = {x.structure: x for x in (*found[:1], *adequate[:1], *both[:1])}
    for pair in bases.values():
        _with_each(growth, pair, {"roughness": (6.0,), "thickness_spread": (2.0, 6.0)})


def _pairs(growth: Growth) -> list[Weighed]:
    """Two layers without effects, the best first."""
    return [x for x in growth.weighed if len(x.structure.layers) == 2 and not x.structure.effects]
