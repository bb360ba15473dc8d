"""Path of a film's thickness through the branches of a trace of one or a few wavelengths.

One value of one wavelength belongs to two thicknesses in each fringe, one on each side of an extremum, so
that each window of time has many candidates. A path pays for the misfit of its candidates and for changes
of its rate. At an extremum of the light it goes on as before, or turns: its rate tells which.

**Source:** Viterbi 1967, IEEE Trans. Inf. Theory 13, 260; min-marginals as in `order_path`.
"""

from typing import NamedTuple

import numpy as np

KINK = 20.0
"""Price of an abrupt change of the rate, as Δχ²."""
LEAP = 12.0
"""Price of a step that is twice as long as one can be, for each such length more, as Δχ²: of several jumps
the shorter one."""
_BEND = 0.3
"""Usual change of a step from one window to the next, as its share."""
_NEAR = 6
"""Candidates of the window before from which a path may come: the nearest."""


_SAME = 4.0
"""Distance in standard errors within which two candidates are one."""


class Candidates(NamedTuple):
    """Local minima of the misfit in each window: `thickness`, `delta` (above the best of the window) and
    `stderr`, (windows, candidates), by increasing thickness, NaN where there are fewer."""

    thickness: np.ndarray
    delta: np.ndarray
    stderr: np.ndarray

    def same(self, chosen: np.ndarray) -> np.ndarray:
        """True (windows, candidates) where one is the `chosen` of its window (windows,): at an extremum two
        branches meet."""
        own = np.arange(len(chosen)), chosen
        away = np.abs(self.thickness - self.thickness[own][:, None])
        return away <= _SAME * np.hypot(self.stderr, self.stderr[own][:, None])


class TracePath(NamedTuple):
    """Chosen candidate of each window (windows,), the Δχ² of the best path through another one (windows,),
    the price of the path, and the windows (windows,) at which its rate changes abruptly."""

    chosen: np.ndarray
    rival: np.ndarray
    price: float
    kinks: np.ndarray


class Course(NamedTuple):
    """Expected course of a film: `turn` is the price, as Δχ², of one that both grows and thins, infinite
    where none does; a step longer than `far` (nm) is a jump, whose length has a price, too."""

    turn: float = 0.0
    far: float = np.inf


ANY = Course()
"""The course of a film that grows and thins as it likes."""


def trace_path(time: np.ndarray, candidates: Candidates, course: Course = ANY) -> TracePath:
    """Find the path through the candidates of all windows, three at least, at the times (windows,).

    Where turning has a price, a film that only grows, one that only thins, and one that turns are rivals.
    """
    if course.turn == 0:
        return _path(time, candidates, 0, course.far)
    found = [_path(time, candidates, way, course.far) for way in (1, -1)]
    if course.turn < np.inf:
        free = _path(time, candidates, 0, course.far)
        found.append(free._replace(price=free.price + course.turn))
    best = min(found, key=lambda path: path.price)
    with np.errstate(invalid="ignore"):
        rivals = [p.price - best.price + np.where(p.chosen == best.chosen, p.rival, 0.0) for p in found]
    return best._replace(rival=np.min(np.nan_to_num(rivals, nan=np.inf, posinf=np.inf), axis=0))


def _path(time: np.ndarray, candidates: Candidates, way: int, far: float) -> TracePath:
    """The cheapest path that changes in this `way`: 1 grows, −1 thins, 0 does either."""
    thickness, delta, stderr = candidates
    there = np.isfinite(thickness)
    cost, sigma = np.where(there, delta, np.inf), np.where(there, stderr, 1.0)
    place, steps = np.where(there, thickness, 1e9), np.diff(time)
    count, size = thickness.shape
    near = min(_NEAR, size)
    # states: a candidate, and one of those nearest to it in the window before
    before = np.argsort(np.abs(place[1:, :, None] - place[:-1, None, :]), axis=2, kind="stable")[..., :near]

    def price(t: int) -> np.ndarray:
        """Prices (candidates at t, those before, those before these) of changes of the rate."""
        i, ratio = before[t - 1], steps[t - 1] / steps[t - 2]
        j = before[t - 2][i]
        step = place[t][:, None, None] - place[t - 1][i][..., None]
        last = ratio * (place[t - 1][i][..., None] - place[t - 2][j])
        bend = 0.5 * _BEND * (np.abs(step) + np.abs(last))
        noise = [sigma[t][:, None, None], (1 + ratio) * sigma[t - 1][i][..., None], ratio * sigma[t - 2][j]]
        return np.minimum((step - last) ** 2 / (bend**2 + sum(x**2 for x in noise)), KINK)

    def forbidden(t: int) -> np.ndarray:
        """Prices of long steps (candidates at t, those before), infinite for those in the wrong way by more
        than the noise."""
        i = before[t - 1]
        step = place[t][:, None] - place[t - 1][i]
        wrong = way * step < -3 * np.hypot(sigma[t][:, None], sigma[t - 1][i])
        return np.where(wrong, np.inf, LEAP * np.maximum(np.abs(step) / far - 1, 0.0))

    forward, origin = np.empty((count, size, near)), np.zeros((count, size, near), int)
    forward[1] = cost[0][before[0]] + cost[1][:, None] + forbidden(1)
    for t in range(2, count):
        total = forward[t - 1][before[t - 1]] + price(t)
        origin[t] = np.argmin(total, axis=2)
        forward[t] = np.min(total, axis=2) + cost[t][:, None] + forbidden(t)
    backward, least = np.zeros((size, near)), np.full((count, size), np.inf)
    least[-1] = forward[-1].min(axis=1)
    for t in range(count - 1, 1, -1):
        ahead = price(t) + (cost[t][:, None] + forbidden(t) + backward)[..., None]
        backward = np.full((size, near), np.inf)
        np.minimum.at(backward, before[t - 1], ahead)
        least[t - 1] = np.min(forward[t - 1] + backward, axis=1)
    np.minimum.at(least[0], before[0], forward[1] + backward)
    chosen, pairs = _traced(forward[-1], origin, before)
    best = float(forward[-1].min())
    with np.errstate(invalid="ignore"):
        left = np.nan_to_num(least - best, nan=np.inf, posinf=np.inf)
    left[candidates.same(chosen)] = np.inf
    paid = [price(t)[chosen[t], pairs[t], pairs[t - 1]] for t in range(2, count)]
    kinks = np.pad(np.array(paid) >= KINK, 1)
    return TracePath(chosen, left.min(axis=1), best, kinks)


def _traced(last: np.ndarray, origin: np.ndarray, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The best path (windows,) back from the prices (candidates, those before) at the `last` window, and the
    place of each candidate's predecessor among those nearest to it (windows,)."""
    chosen, pairs = np.zeros((2, len(origin)), int)
    chosen[-1], pairs[-1] = divmod(int(np.argmin(last)), last.shape[1])
    for t in range(len(origin) - 1, 0, -1):
        chosen[t - 1] = before[t - 1][chosen[t], pairs[t]]
        pairs[t - 1] = origin[t][chosen[t], pairs[t]]
    return chosen, pairs
