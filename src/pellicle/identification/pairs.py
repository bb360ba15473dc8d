"""Structures of two layers: pairs of a few indices on a grid of thicknesses, then those near the best."""

from __future__ import annotations

import time
from collections.abc import Sequence
from itertools import permutations
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pellicle.identification.evidence import Weighed, weigh
from pellicle.identification.hypothesis import TABLE_UNCERTAINTY
from pellicle.identification.problem import Problem
from pellicle.identification.search import descended
from pellicle.identification.structure import Structure

if TYPE_CHECKING:
    from pellicle.identification.growth import Growth

PARTNERS = ("MgF2", "SiO2", "SU-8", "alumina", "MgO", "Y2O3", "Si3N4", "Ta2O5", "TiO2", "TiO2/Devore-e")
"""Materials of two layers: indices from 1.38 to 2.9, up to 2.5 at most a tenth apart."""
_APART = 0.03
"""Relative difference of the mean index of two layers: less is one film."""
_CALLED = 8.0
"""Fall of χ² from one film to two layers from which these can be a rival: a thickness costs 5.5 of ln Z, the
choice of a material 3.5, and a rival may lie 5 below."""
_NOISE = 1.0
"""Ratio of the residuals of one film to the noise below which they need no second layer: of an oxide in a
reflectometer (0.92), 28 nm of MgF2 on it took up what its wavelengths are off."""
_STRAINED = 2.5
"""Size of an effect, in standard uncertainties, above which two layers are tried nonetheless: 32 nm of
polystyrene on 394 nm of Y2O3 in R were one film with a slope of the lamp of 3.3 (Δ ln Z 11)."""
_HIDDEN = 1.5
"""Size of an effect above which two layers are tried on a substrate of low index, as many lower layers have:
170 nm of Al2O3 on 84 nm of SiO2 on BK7 in R were 156 nm of HfO2 with an offset of 2.3."""
_THICK = np.arange(24.0, 1200.0, 24.0)
_THIN = np.array([6.0, 16, 28, 42, 58, 76, 96, 120, 146, 174, 204, 234])
"""Thicknesses (nm) of the grid: a minimum is 50 nm wide where n is 2.4."""
_MINIMA, _ROUNDS, _NEAR, _KEPT, _FREE, _NAMED = 3, 9, 30.0, 8, 6, 4
"""Starts of a pair, steps from each, χ² above the best and number of pairs that are polished, number of those
with a free index, and of those that near tables follow."""
_PARTNERED = 6
"""Pairs of a partner from which its free index starts."""
_CHANGE, _FREED = 0.05, 0.25
"""Relative change of an index beyond which another table is nearer, and that of a free one."""


class Pair(NamedTuple):
    """Two layers at their best thicknesses (nm), with the factors of their indices, and χ² there."""

    names: tuple[str, str]
    depth: np.ndarray
    factors: np.ndarray
    cost: float


def grow(growth: Growth, settled: bool) -> None:
    """Try two layers. Where one film describes the data (`settled`), only with residuals above the noise or a
    large error of the instrument or the sample, and only pairs that are far better."""
    film, most = growth.weighed[0], _STRAINED if growth.oxidised else _HIDDEN
    if settled and film.remaining < _NOISE and film.strain < most:
        return
    names = [x for x in dict.fromkeys([*PARTNERS, *growth.order[:2]]) if x in growth.order]
    pairs = _scanned(growth, names)
    if settled:
        single = _single_cost(growth)
        pairs = [x for x in pairs if x.cost < single - _CALLED]
    if not pairs:
        return
    for pair in [x for x in pairs if x.cost < pairs[0].cost + _NEAR][:_KEPT]:
        _add(growth, pair.names, pair.depth)
    for i, pair in _freed(growth, pairs)[:_FREE]:
        _with_free_index(growth, pair, i)
    _named(growth)


def _scanned(growth: Growth, names: list[str]) -> list[Pair]:
    """Pairs of films, the best first: each from the best places of a grid of thicknesses."""
    problem, most = growth.scanned, growth.problem.thickest
    mean = {name: float(np.mean(np.abs(growth.tables(name)[0]))) for name in names}
    chosen = [x for x in permutations(names, 2) if abs(mean[x[0]] / mean[x[1]] - 1) > _APART]
    starts: list[np.ndarray] = []
    of: list[tuple[str, str]] = []
    for pair in chosen:
        if time.monotonic() > growth.deadline:
            break
        index = [np.stack(x) for x in zip(*(growth.tables(name) for name in pair), strict=True)]
        found = []
        for upper, lower in ((_THICK, _THIN), (_THIN, _THICK)):
            values = [v.simulate_grid(own, upper, lower) for v, own in zip(problem.views, index, strict=True)]
            costs = problem.metric.costs(np.concatenate(values, axis=1) - problem.data)
            found += _lowest(costs.reshape(len(upper), len(lower)), upper, lower)
        found = sorted(found, key=lambda x: x[0])[:_MINIMA]
        starts += [depth for _, depth in found]
        of += [pair] * len(found)
    if not of:
        return []
    change = np.full((len(of), 2), _CHANGE)
    x, costs = _refined(problem, _stacked(growth, of), np.stack(starts), 0 * change + most, change)
    best: dict[tuple[str, str], Pair] = {}
    for names_, row, cost in sorted(zip(of, x, costs, strict=True), key=lambda entry: entry[2]):
        best.setdefault(names_, Pair(names_, row[:2], 1 + row[2:], float(cost)))
    return list(best.values())


def _stacked(growth: Growth, pairs: list[tuple[str, str]]) -> list[np.ndarray]:
    """Indices (pairs, 2, padded points) of pairs in each view."""
    count = len(growth.scanned.views)
    return [np.stack([[growth.tables(name)[v] for name in pair] for pair in pairs]) for v in range(count)]


def _lowest(costs: np.ndarray, upper: np.ndarray, lower: np.ndarray) -> list[tuple[float, np.ndarray]]:
    """The lowest local minima of a grid of χ², with their thicknesses."""
    edge = np.pad(costs, 1, constant_values=np.inf)
    sides = (edge[:-2, 1:-1], edge[2:, 1:-1], edge[1:-1, :-2], edge[1:-1, 2:])
    places = np.argwhere(np.all([costs <= x for x in sides], axis=0))
    order = np.argsort(costs[tuple(places.T)])[:_MINIMA]
    return [(float(costs[i, j]), np.array([upper[i], lower[j]])) for i, j in places[order]]


def _refined(
    problem: Problem, index: list[np.ndarray], depth: np.ndarray, most: np.ndarray, change: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Thicknesses and relative changes of the indices (rows, 4) of many pairs, and χ², after steps of all.

    `index` (rows, 2, padded points) is that of each view, `depth` (rows, 2) where to start, `most` (rows, 2)
    the largest thicknesses and `change` (rows, 2) the largest changes: those of up to `_CHANGE` have the
    uncertainty of a table, larger ones none.
    """

    def at(rows: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _linearised(problem, [own[rows] for own in index], x)

    bounds = np.concatenate([0 * most, -change], axis=1), np.concatenate([most, change], axis=1)
    prior = np.concatenate([0 * most, np.where(change > _CHANGE, 0.0, TABLE_UNCERTAINTY**-2)], axis=1)
    start = np.concatenate([depth, 0 * depth], axis=1)
    found = descended(problem, at, start, bounds, _ROUNDS, prior)
    return found.x, found.cost


def _linearised(problem: Problem, index: list[np.ndarray], x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values (rows, values) of pairs at thicknesses and index changes `x` (rows, 4), and slopes."""
    step = np.array([0.05, 0.05, 1e-4, 1e-4])
    rows = x[:, None] + np.concatenate([np.zeros((1, 4)), np.diag(step)])
    found = []
    for view, own in zip(problem.views, index, strict=True):
        changed = (own[:, None] * (1 + rows[..., 2:, None])).reshape(-1, *own.shape[1:])
        found.append(view.simulate(changed, rows[..., :2].reshape(-1, 2)).reshape(len(x), 5, -1))
    values = np.concatenate(found, axis=2)
    return values[:, 0], (values[:, 1:] - values[:, :1]) / step[:, None]


def _single_cost(growth: Growth) -> float:
    """χ² of the best single film on the points of a scan."""
    problem = growth.scanned
    single = [x.attempt for x in growth.weighed if len(x.structure.layers) == 1]
    values = [problem.simulate(x.structure, x.x[None]) for x in single]
    tables = [x for x in single if not x.structure.layers[0].modelled and not x.structure.effects]
    costs = [*problem.metric.costs(np.concatenate(values) - problem.data)]
    if tables:
        names = [x.structure.layers[0].name for x in tables]
        depth = np.array([[x.x[0], 0.0] for x in tables])
        index, most = _stacked(growth, [(x, x) for x in names]), 0 * depth + [growth.problem.thickest, 0.0]
        costs += [*_refined(problem, index, depth, most, 0 * depth + [_CHANGE, 0.0])[1]]
    return float(min(costs))


def _freed(growth: Growth, pairs: list[Pair]) -> list[tuple[int, Pair]]:
    """Pairs with the index of one layer free, the best first: its position, and the pair there.

    Each material in each position is the partner of a free index, which starts from the best pairs of it:
    rutile has an index a fifth above the TiO2 of the catalogue, and is in no pair of tables on oxide.
    """
    partners = dict.fromkeys((1 - i, x.names[i]) for x in pairs for i in (0, 1))
    starts = [
        (i, x) for i, name in partners for x in [x for x in pairs if x.names[1 - i] == name][:_PARTNERED]
    ]
    index = _stacked(growth, [x.names for _, x in starts])
    depth = np.stack([x.depth for _, x in starts])
    change = np.array([[_FREED if j == i else _CHANGE for j in (0, 1)] for i, _ in starts])
    most = np.full_like(depth, growth.problem.thickest)
    x, costs = _refined(growth.scanned, index, depth, most, change)
    best: dict[tuple[int, str], tuple[int, Pair]] = {}
    for k in np.argsort(costs):
        i, pair = starts[k]
        found = Pair(pair.names, x[k, :2], 1 + x[k, 2:], float(costs[k]))
        best.setdefault((i, pair.names[1 - i]), (i, found))
    return list(best.values())


def _with_free_index(growth: Growth, pair: Pair, position: int) -> None:
    """Add a pair with a free index in place of one of its tables."""
    view, index = growth.scanned.views[0], growth.tables(pair.names[position])[0]
    free = as_cauchy(index * pair.factors[position], view.wavelength)
    own, other = [pair.depth[position], *free], [pair.depth[1 - position]]
    names = ["cauchy", pair.names[1 - position]]
    start = np.array([*own, *other] if position == 0 else [*other, *own])
    _add(growth, names if position == 0 else names[::-1], start)


def free_both(growth: Growth, pair: Weighed) -> None:
    """Add a pair of which one index is free with the other free too."""
    x, view, parts = pair.attempt.x, growth.problem.views[0], []
    for i, layer in enumerate(pair.structure.layers):
        own = [value for number, value in zip(pair.structure.numbers, x, strict=True) if number.layer == i]
        parts += own if layer.modelled else [*own, *as_cauchy(view.tables[layer.name], view.wavelength)]
    _add(growth, ["cauchy", "cauchy"], np.array(parts))


def _add(growth: Growth, names: Sequence[str], start: np.ndarray) -> None:
    """Polish two layers and keep them, unless their indices have become those of one film."""
    before = len(growth.attempts)
    growth.add([growth.film(name) for name in names], [start])
    if len(growth.attempts) == before:
        return
    last, view = growth.attempts[-1], growth.problem.views[0]
    upper, lower = (np.mean(np.abs(last.structure.index(i, last.x[None], view))) for i in (0, 1))
    if abs(upper / lower - 1) < _APART:
        growth.attempts.pop()


def _named(growth: Growth) -> None:
    """Tables in place of the free index of the best pairs, where two are near it."""
    growth.weighed = weigh(growth.problem, growth.attempts, growth.columns)
    view, tried = growth.problem.views[0], {x.structure for x in growth.attempts}
    pairs = [x for x in growth.weighed if len(x.structure.layers) == 2 and not x.structure.effects]
    for x in pairs[:_NAMED]:
        layers, depths = x.structure.layers, x.structure.thicknesses(x.x[None])[0]
        for i, layer in enumerate(layers):
            index = x.structure.index(i, x.x[None], view)[0]
            distance = {name: float(np.mean(np.abs(view.tables[name] - index))) for name in growth.order}
            near = sorted(distance, key=lambda name: distance[name])[:3] if layer.name == "cauchy" else []
            for own in near:
                pair = tuple(growth.film(own if j == i else x.name) for j, x in enumerate(layers))
                if Structure(pair) not in tried:
                    tried.add(Structure(pair))
                    _add(growth, [x.name for x in pair], depths)


def as_cauchy(index: Any, wavelength: np.ndarray) -> tuple[float, float]:
    """A and B of a free index near a table's."""
    slope, mean = np.polynomial.Polynomial.fit(wavelength**-2.0, index.real, 1).convert().coef[::-1]
    return float(np.clip(mean, 1.25, 2.9)), float(np.clip(slope, 0.0, 1.9e5))
