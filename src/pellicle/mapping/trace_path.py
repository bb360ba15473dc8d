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
    steps = _steps_of(time, candidates)
    if course.turn == 0:
        return _path(candidates, steps, 0, course.far)
    found = [_path(candidates, steps, way, course.far) for way in (1, -1)]
    if course.turn < np.inf:
        free = _path(candidates, steps, 0, course.far)
        found.append(free._replace(price=free.price + course.turn))
    best = min(found, key=lambda path: path.price)
    with np.errstate(invalid="ignore"):
        rivals = [p.price - best.price + np.where(p.chosen == best.chosen, p.rival, 0.0) for p in found]
    return best._replace(rival=np.min(np.nan_to_num(rivals, nan=np.inf, posinf=np.inf), axis=0))


class _Steps(NamedTuple):
    """Steps from each window to the next, which all courses share: the nearest candidates `before` each
    (windows - 1, candidates, those before), and length (nm) and noise of each step, of the same shape.

    `prices` (candidates, those before, those before these) are of changes of the rate, from the third window.
    """

    before: np.ndarray
    length: np.ndarray
    noise: np.ndarray
    prices: list[np.ndarray]


def _steps_of(time: np.ndarray, candidates: Candidates) -> _Steps:
    thickness, _, stderr = candidates
    there = np.isfinite(thickness)
    place, sigma = np.where(there, thickness, 1e9), np.where(there, stderr, 1.0)
    away = place[1:, :, None] - place[:-1, None, :]
    before = np.argsort(np.abs(away), axis=2, kind="stable")[..., : min(_NEAR, thickness.shape[1])]
    length = np.take_along_axis(away, before, axis=2)
    last = np.take_along_axis(np.broadcast_to(sigma[:-1, None, :], away.shape), before, axis=2)
    own, duration = np.broadcast_to(sigma[1:, :, None], last.shape), np.diff(time)

    def price(t: int) -> np.ndarray:
        i, ratio = before[t - 1], duration[t - 1] / duration[t - 2]
        step, past = length[t - 1][..., None], ratio * length[t - 2][i]
        bend = 0.5 * _BEND * (np.abs(step) + np.abs(past))
        middle, first = (1 + ratio) * last[t - 1][..., None], ratio * last[t - 2][i]
        noise = bend**2 + (own[t - 1][..., None] ** 2 + middle**2 + first**2)
        return np.minimum((step - past) ** 2 / noise, KINK)

    return _Steps(before, length, np.hypot(own, last), [price(t) for t in range(2, len(time))])


def _path(candidates: Candidates, steps: _Steps, way: int, far: float) -> TracePath:
    """The cheapest path that changes in this `way`: 1 grows, −1 thins, 0 does either."""
    there = np.isfinite(candidates.thickness)
    cost, (count, size) = np.where(there, candidates.delta, np.inf), there.shape
    # states: a candidate, and one of those nearest to it in the window before
    before, prices, near = steps.before, [np.empty(0)] * 2 + steps.prices, steps.before.shape[2]
    # of long steps, infinite for those in the wrong way by more than the noise
    leaps = LEAP * np.maximum(np.abs(steps.length) / far - 1, 0.0)
    paid_at = cost[1:, :, None] + np.where(way * steps.length < -3 * steps.noise, np.inf, leaps)

    forward, origin = np.empty((count, size, near)), np.zeros((count, size, near), int)
    forward[1] = cost[0][before[0]] + paid_at[0]
    for t in range(2, count):
        total = forward[t - 1][before[t - 1]] + prices[t]
        origin[t] = np.argmin(total, axis=2)
        forward[t] = np.min(total, axis=2) + paid_at[t - 1]
    backward, least = np.zeros((size, near)), np.full((count, size), np.inf)
    least[-1] = forward[-1].min(axis=1)
    for t in range(count - 1, 1, -1):
        ahead = prices[t] + (paid_at[t - 1] + backward)[..., None]
        backward = np.full((size, near), np.inf)
        np.minimum.at(backward, before[t - 1], ahead)
        least[t - 1] = np.min(forward[t - 1] + backward, axis=1)
    np.minimum.at(least[0], before[0], forward[1] + backward)
    chosen, pairs = _traced(forward[-1], origin, before)
    best = float(forward[-1].min())
    with np.errstate(invalid="ignore"):
        left = np.nan_to_num(least - best, nan=np.inf, posinf=np.inf)
    left[candidates.same(chosen)] = np.inf
    paid = [prices[t][chosen[t], pairs[t], pairs[t - 1]] for t in range(2, count)]
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
