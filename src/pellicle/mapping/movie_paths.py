"""Paths of the thickness at all places of a movie, by continuity in time and in space.

The light of the place that decides its order best gives the gain and the dark level of each channel, from the
extrema of its fringes, and a path through the branches of its light as of a trace. From there paths spread to
the neighbours, each with a price for leaving those that are known.

**Source:** of `trace_path`; the places in the order of a minimum spanning tree: Prim 1957, Bell Syst. Tech.
J. 36, 1389.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from logging import getLogger
from typing import NamedTuple

import numpy as np

from pellicle.mapping.movie_light import BLACK, FilmLight, black_from, neighbours
from pellicle.mapping.trace_branches import (
    Branches,
    anchored,
    branches_in,
    candidates_of,
    explained,
    gain_of,
)
from pellicle.mapping.trace_light import LEAST, Light, windows_of
from pellicle.mapping.trace_path import KINK, Candidates, Course, trace_path
from pellicle.scene.priors import Normal

log = getLogger(__name__)

_TRIED, _OTHERS, _SURELY = 9, 4, 60.0
"""Places from which the gain is sought, other paths whose gain is tried too, and the Δχ² from which none
is."""
_TOLERANCE = 0.02
"""Error of the model as a share of the range of the light."""
_APART = 0.1
"""Usual distance of a path from the straight line through those of its neighbours, in orders."""
FAR = 0.5
"""Longest step from one window to the next, of which there are about eight in an order, in orders."""
TURN = 15.0
"""Price of a place at which the film both grows and thins, as Δχ², where the recipe says nothing: an abrupt
turn at an extremum, which looks as if the film went on, is then undecided."""
_LOCAL = 0.25
"""Distance of two paths of one order in orders: they differ only beside an extremum."""
_ANCHOR = Normal(BLACK / 2, BLACK / 4)
_BEFORE = 0.3
"""Usual thickness from which a film turns black at once, in orders: black spots open in the thinnest film."""


class PlacePath(NamedTuple):
    """Thickness (times,) in nm of a place, the Δχ² of the best path through another branch, and the frame
    from which it is black, None where it is not."""

    thickness: np.ndarray
    rival: np.ndarray
    black: int | None


class Paths(NamedTuple):
    """Paths by place, the gain and dark level (channels, 2), and how sure the order of the first place is."""

    found: dict[int, PlacePath]
    gain: np.ndarray
    sure: float


def paths_of(lights: list[Light], shape: tuple[int, ...], film: FilmLight, course: Course) -> Paths | None:
    """Find the paths of all places, whose `lights` are flat over `shape`; None without a place to start."""
    enough = [p for p, light in enumerate(lights) if np.isfinite(light.values).all(axis=1).sum() >= LEAST]
    if not enough:
        return None
    tried = [(p, _begun(lights[p], film, course, None, None)) for p in _some(enough)]
    begun = [(p, made) for p, made in tried if made is not None]
    if not begun:
        return None
    gain = np.median([made.gain for _, (made, _) in begun], axis=0)
    black = black_from(lights, shape, film, gain)
    if anchors := [p for p in enough if p in black]:
        tried = [(p, _begun(lights[p], film, course, gain, black[p])) for p in _some(anchors)]
        begun = [(p, made) for p, made in tried if made is not None] or begun
    seed, (best, sure) = max(begun, key=lambda one: one[1][1])
    log.info("order and gain by place %d: Δχ² %.3g", seed, sure)
    gain, found = best.gain, dict[int, PlacePath]()
    known: dict[int, np.ndarray] = {}
    for place, near in _spreading(lights, shape, seed, enough):
        prior = _prior(near, known, shape, place, film.order)
        made = place_path(lights[place], film, gain, course, prior, black.get(place))
        if made is not None:
            found[place], known[place] = made, made.thickness
    for place in list(found):  # again with the neighbours on all sides, where these disagree
        near = [q for q in neighbours(place, shape) if q in known]
        prior = _prior(near, known, shape, place, film.order)
        off = 0.0 if prior is None else np.median(np.abs(prior[0] - known[place]))
        if place == seed or off > 0.25 * film.order:
            again = place_path(lights[place], film, gain, course, prior, black.get(place))
            if again is not None:
                found[place], known[place] = again, again.thickness
    return Paths(found, levels(lights, known, film), sure)


def _some(places: list[int]) -> list[int]:
    """Some of the places, evenly spread."""
    return [places[i] for i in np.unique(np.linspace(0, len(places) - 1, _TRIED).astype(int))]


def _begun(
    light: Light, film: FilmLight, course: Course, gain: np.ndarray | None, black: int | None
) -> tuple[Branches, float] | None:
    """The path of one place by itself with its gain, and the Δχ² of the best other one, which has a gain of
    its own; None where no thickness explains the light. `gain` is known of a place that is black from
    the frame `black` on."""
    windows, _ = windows_of(light)
    centre = np.array([light.time[w].mean() for w in windows])
    ends = _ends(light, centre, film, black)
    best = branches_in(light, film.grid, film.table, ends, course, gain)
    if best is None or len(best.path.chosen) < 3:
        return None
    seen = np.stack([np.nanmean(light.values[w], axis=0) for w in windows])
    rival, sure, tried = best.path.rival.copy(), np.inf, 0
    while tried < _OTHERS and rival.min() < min(sure, _SURELY):
        window = int(np.argmin(rival))
        other = best.without(best.path, window)
        rival[~best.candidates.same(best.path.chosen)[np.arange(len(rival)), other.chosen]] = np.inf
        rival[window] = np.inf
        away = np.max(np.abs(best.thickness(other) - best.thickness(best.path)))
        if not np.isfinite(other.price) or away < _LOCAL * film.order:
            continue
        sure, tried = min(sure, other.price - best.path.price), tried + 1
        first = best.gain_of(other, seen[best.inside], film.grid, film.table, light.known)
        made = branches_in(light, film.grid, film.table, ends, course, first)
        if made is None:
            continue
        gap = made.along(made.path, light.time) - best.along(best.path, light.time)
        if np.max(np.abs(gap)) < _LOCAL * film.order:
            continue
        sure = min(sure, abs(made.price - best.price))
        if made.price < best.price:
            best, rival = made, made.path.rival.copy()
    return best, sure


def _ends(light: Light, centre: np.ndarray, film: FilmLight, black: int | None) -> list[tuple[int, Normal]]:
    """Knowledge of the windows at the times `centre` (windows,) of a place, by their positions from the
    end: it ends as a black film, and was thin before that."""
    if black is None:
        return []
    before = int(np.searchsorted(centre, light.time[black])) - 1
    rest = [(before - len(centre), Normal(0.0, _BEFORE * film.order))] if before >= 0 else []
    return [(-1, _ANCHOR), *rest]


def place_path(
    light: Light,
    film: FilmLight,
    gain: np.ndarray,
    course: Course,
    prior: tuple[np.ndarray, np.ndarray] | None,
    black: int | None,
) -> PlacePath | None:
    """The path of one place with a known gain; `prior` are thickness and spread (times,) by its neighbours,
    and `black` is the frame from which it is black, None where it is not."""
    windows, weight = windows_of(light)
    seen = np.stack([np.nanmean(light.values[w], axis=0) for w in windows])
    centre = np.array([light.time[w].mean() for w in windows])
    count = np.array([len(w) for w in windows])
    error = np.hypot(light.noise / np.sqrt(count)[:, None], _TOLERANCE * light.span)
    candidates, least = candidates_of(film.grid, film.table, seen, error, gain, weight)
    inside = explained(least)
    if inside.sum() < 3:
        return None
    own = Candidates(*(x[inside] for x in candidates))
    if prior is not None:
        expected, spread = (np.interp(centre[inside], light.time, x)[:, None] for x in prior)
        away = (own.thickness - expected) ** 2 / (spread**2 + own.stderr**2)
        own = own._replace(delta=own.delta + np.minimum(np.nan_to_num(away, nan=np.inf), KINK))
    own = anchored(own, _ends(light, centre[inside], film, black))
    path = trace_path(centre[inside], own, course)
    chosen = own.thickness[np.arange(len(path.chosen)), path.chosen]
    nearest = np.searchsorted(0.5 * (centre[1:] + centre[:-1]), light.time)
    rival = np.zeros(len(centre))
    rival[inside] = path.rival
    thickness = np.interp(light.time, centre[inside], chosen)
    if black is not None:  # a black film begins at once
        for late in (False, True):
            of, at = (
                x >= light.time[black] if late else x < light.time[black]
                for x in (centre[inside], light.time)
            )
            if of.any():
                thickness[at] = np.interp(light.time[at], centre[inside][of], chosen[of])
    return PlacePath(thickness, rival[nearest], black)


def _prior(
    near: list[int], known: dict[int, np.ndarray], shape: tuple[int, ...], place: int, order: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """Thickness and its spread (times,) that known neighbours expect: on the line through two of them."""
    if not near:
        return None
    expected, spread = [], []
    for q in near:
        beyond = _beyond(place, q, shape)
        step = known[q] - known[beyond] if beyond in known else np.zeros_like(known[q])
        expected.append(known[q] + step)
        spread.append(np.hypot(_APART * order * (1 if beyond in known else 2), 0.5 * step))
    return np.mean(expected, axis=0), np.mean(spread, axis=0)


def _beyond(place: int, near: int, shape: tuple[int, ...]) -> int:
    """The place beyond a neighbour, as seen from a place; −1 outside."""
    one, other = (np.array(np.unravel_index(p, shape)) for p in (place, near))
    there = 2 * other - one
    return int(np.ravel_multi_index(tuple(there), shape)) if np.all((there >= 0) & (there < shape)) else -1


def _spreading(
    lights: list[Light], shape: tuple[int, ...], seed: int, enough: list[int]
) -> Iterator[tuple[int, list[int]]]:
    """Places from the seed outwards, those like a neighbour before others, with the neighbours before
    them."""
    done, waiting, there = set[int](), [(0.0, seed)], set(enough)
    while waiting or there - done:
        _, place = heapq.heappop(waiting) if waiting else (0.0, min(there - done))
        if place in done:
            continue
        yield place, [q for q in neighbours(place, shape) if q in done]
        done.add(place)
        for q in neighbours(place, shape):
            if q in there and q not in done:
                unlike = (lights[q].values - lights[place].values) / lights[place].span
                heapq.heappush(waiting, (float(np.nanmean(np.abs(unlike))), q))


def levels(lights: list[Light], known: dict[int, np.ndarray], film: FilmLight) -> np.ndarray:
    """Gain and dark level (channels, 2) of the places together whose thickness is known."""
    seen = np.concatenate([lights[p].values for p in known])
    reflected = film.at(np.concatenate([*known.values()]))
    used = np.isfinite(seen).all(axis=1)
    return gain_of(seen[used], reflected[used], (None, None))
