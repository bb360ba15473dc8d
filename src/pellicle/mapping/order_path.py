"""Order of interference in a series: the path through the minima of all times that changes most evenly.

Each time has a few minima with a Δχ². The thickness of a film that grows or dries goes on from the last two
times; a path pays for the Δχ² of its minima and for each departure from a straight line, up to the price of
a break. Least costs of the paths through each minimum say how sure the order is.

**Source:** Viterbi 1967, IEEE Trans. Inf. Theory 13, 260; min-marginals by a pass forward and one back:
Koller and Friedman 2009, Probabilistic Graphical Models, ch. 13.
"""

from typing import NamedTuple

import numpy as np

from pellicle.fitting.robust_losses import MAD_TO_SIGMA

BREAK = 50.0
"""Price of a break, as Δχ²."""
_STEP = 0.3
"""Share of the distance of minima above which a step is one between them."""
_FEWEST = 5
"""Times in a row that show how evenly a thickness changes."""


class OrderPath(NamedTuple):
    """Chosen minimum of each time (times,), the Δχ² of the best path through another one (times,), infinite
    where there is none, and where a break comes before a time (times,)."""

    chosen: np.ndarray
    rival: np.ndarray
    breaks: np.ndarray


def order_path(time: np.ndarray, thickness: np.ndarray, delta: np.ndarray, stderr: np.ndarray) -> OrderPath:
    """Choose the minima of a series by continuity.

    What all times have in common, such as the error of an index, favours the same order at all of them, so
    Δχ² of times within half an order count once.

    **Arguments:** `time` (times,), three or more, increasing; `thickness` and `delta` (times, minima) with
    NaN and infinity where there are fewer, at least one at each time; `stderr` (times,) by the noise.
    """
    uneven = _unevenness(time, thickness, delta, stderr)
    rows = np.arange(len(time))
    path = _best(time, thickness, delta, stderr, uneven, 1.0)
    others = np.abs(thickness - thickness[rows, path.chosen][:, None])
    others = np.where(np.isfinite(delta) & (others > 0), others, np.nan)
    near = others[(delta < BREAK) & np.isfinite(others)]
    distance = float(np.median(near)) if near.size else float(np.nanmin(others, initial=np.inf))
    steps = np.abs(np.diff(thickness[rows, path.chosen]))
    # neither a step within the noise nor one to another order is a new look
    steps = np.where(steps < _STEP * distance, np.maximum(steps - 2 * stderr[1:], 0.0), 0.0)
    looks = 1.0 + float(np.sum(steps)) / (0.5 * distance)
    weight = min(1.0, looks / len(time))
    if weight < 1:
        path = _best(time, thickness, delta, stderr, uneven, weight)
    return path._replace(rival=np.minimum(path.rival, _unlisted(path, weight * delta)))


def _unlisted(path: OrderPath, cost: np.ndarray) -> np.ndarray:
    """Least Δχ² (times,) of a path through minima that were not listed: no less than the second best of each
    time between breaks, where all of them have as many minima as are kept."""
    full = np.isfinite(cost).all(axis=1) & (cost.shape[1] > 1)
    second = np.where(full, np.sort(cost, axis=1)[:, min(1, cost.shape[1] - 1)], np.inf)
    above = second - cost[np.arange(len(cost)), path.chosen]
    part = np.cumsum(path.breaks)
    return np.array([above[part == i].sum() for i in range(part[-1] + 1)])[part]


def _unevenness(time: np.ndarray, thickness: np.ndarray, delta: np.ndarray, stderr: np.ndarray) -> float:
    """Usual departure from a straight line through three times, in nm over the square of the interval, from
    times that have one minimum; where these are few, from the straightest three minima of any times."""
    steps, there = np.diff(time), np.where(delta < BREAK, thickness, np.nan)
    before, now, after = there[:-2, :, None, None], there[1:-1, None, :, None], there[2:, None, None, :]
    first, second = (x[:, None, None, None] for x in (steps[:-1], steps[1:]))
    bends = np.abs((after - now) / second - (now - before) / first) / (0.5 * (first + second))
    bends = bends.reshape(len(bends), -1)
    error = 2 * (stderr[2:] / steps[1:] + stderr[:-2] / steps[:-1]) / (steps[1:] + steps[:-1])
    known = np.isfinite(bends)
    sure = known.sum(axis=1) == 1
    # the least of several is less than what is usual
    used, more = (sure, 1.0) if np.sum(sure) >= _FEWEST else (known.any(axis=1), 2.0)
    least = np.where(known, bends, np.inf).min(axis=1)
    size = more * MAD_TO_SIGMA * float(np.median(least[used]))
    return max(size, 0.1 * float(np.median(error[used])), 1e-300)


def _best(
    time: np.ndarray,
    thickness: np.ndarray,
    delta: np.ndarray,
    stderr: np.ndarray,
    uneven: float,
    weight: float,
) -> OrderPath:
    """The path of least cost, with Δχ² times a `weight`."""
    count, orders = thickness.shape
    there, cost = np.nan_to_num(thickness, nan=1e9), weight * np.where(np.isnan(thickness), np.inf, delta)
    steps = np.diff(time)

    def price(t: int) -> np.ndarray:
        """Prices (minima at t − 2, t − 1, t) of departures from straight lines."""
        ratio = steps[t - 1] / steps[t - 2]
        line = there[t - 1][None, :] + ratio * (there[t - 1][None, :] - there[t - 2][:, None])
        known = stderr[t] ** 2 + ((1 + ratio) * stderr[t - 1]) ** 2 + (ratio * stderr[t - 2]) ** 2
        bend = 0.5 * uneven * steps[t - 1] * (steps[t - 1] + steps[t - 2])
        return np.minimum((there[t][None, None, :] - line[..., None]) ** 2 / (known + bend**2), BREAK)

    forward = np.empty((count, orders, orders))  # of paths that end in a pair of minima
    forward[1] = cost[0][:, None] + cost[1][None, :]
    origin = np.zeros((count, orders, orders), int)
    for t in range(2, count):
        total = forward[t - 1][..., None] + price(t)
        origin[t] = np.argmin(total, axis=0)
        forward[t] = np.min(total, axis=0) + cost[t][None, :]
    backward = np.zeros((orders, orders))
    least = np.empty((count, orders))  # of paths through each minimum
    least[-1] = forward[-1].min(axis=0)
    for t in range(count - 1, 1, -1):
        backward = np.min(price(t) + (cost[t][None, :] + backward)[None], axis=2)
        least[t - 1] = np.min(forward[t - 1] + backward, axis=0)
    least[0] = np.min(forward[1] + backward, axis=1)
    chosen = np.empty(count, int)
    chosen[-2:] = np.unravel_index(int(np.argmin(forward[-1])), (orders, orders))
    for t in range(count - 1, 1, -1):
        chosen[t - 2] = origin[t][chosen[t - 1], chosen[t]]
    rows = np.arange(count)
    left = least - least[rows, chosen][:, None]
    left[rows, chosen] = np.inf
    paid = np.array([price(t)[tuple(chosen[t - 2 : t + 1])] for t in range(2, count)])
    return OrderPath(chosen, left.min(axis=1), _breaks(paid >= BREAK, count))


def _breaks(paid: np.ndarray, count: int) -> np.ndarray:
    """Breaks (times,) by where a path paid for one: a jump is paid by the two departures around it."""
    breaks = np.zeros(count, bool)
    for t in np.flatnonzero(paid) + 2:
        breaks[t] = not (breaks[t - 1] or (t >= 2 and breaks[t - 2]))
    return breaks
