"""Order of interference in a series: the path through the minima of all times that changes most evenly.

Each time has a few minima with a Δχ². The thickness of a film that grows or dries goes on from the last two
times; a path pays for the Δχ² of its minima and for each departure from a straight line, up to the price of
a break. Least costs of the paths through each minimum say how sure the order is.

**Source:** Viterbi 1967, IEEE Trans. Inf. Theory 13, 260; min-marginals by a pass forward and one back:
Koller and Friedman 2009, Probabilistic Graphical Models, ch. 13.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.fitting.robust_losses import MAD_TO_SIGMA

BREAK = 50.0
"""Price of a break, as Δχ²."""
_STEP = 0.3
"""Share of the distance of minima above which a step is one between them."""
_FEWEST, _MOST = 5, 2000
"""Times that show how evenly a thickness changes."""
SHORT = 16
"""Times of the shortest program: fewer are filled up, so that a live series needs no other for each time."""


class OrderPath(NamedTuple):
    """Chosen minimum of each time (times,), the Δχ² of the best path through another one (times,), infinite
    where there is none, and where a break comes before a time (times,)."""

    chosen: np.ndarray
    rival: np.ndarray
    breaks: np.ndarray


def order_path(
    time: np.ndarray, thickness: np.ndarray, delta: np.ndarray, stderr: np.ndarray, systematic: np.ndarray
) -> OrderPath:
    """Choose the minima of a series by continuity.

    What all times have in common, such as the error of an index, favours the same order at all of them, so
    Δχ² of times within half an order count once. Systematic errors change with the phase of the fringes, so
    that of a step has their share that goes with a quarter of an order.

    **Arguments:** `time` (times,), three or more, increasing; `thickness` and `delta` (times, minima) with
    NaN and infinity where there are fewer, at least one at each time; `stderr` (times,) by the noise, and the
    `systematic` error (times,).
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
    share = np.minimum(np.pad(steps, (1, 0), "edge") / (0.25 * distance), 1.0)
    path = _best(time, thickness, delta, np.hypot(stderr, share * systematic), uneven, weight)
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
    there, at = np.where(delta < BREAK, thickness, np.nan), np.arange(1, len(time) - 1)
    at = at[:: -(-len(at) // _MOST)]
    steps = np.diff(time)
    before, now, after = there[at - 1, :, None, None], there[at, None, :, None], there[at + 1, None, None, :]
    first, second = (x[:, None, None, None] for x in (steps[at - 1], steps[at]))
    bends = np.abs((after - now) / second - (now - before) / first) / (0.5 * (first + second))
    bends = bends.reshape(len(bends), -1)
    error = 2 * (stderr[at + 1] / steps[at] + stderr[at - 1] / steps[at - 1]) / (steps[at] + steps[at - 1])
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
    cost = weight * np.where(np.isnan(thickness), np.inf, delta)
    # leaving a path for one time and coming back pays for three departures
    cost = np.where(cost - cost.min(axis=1, keepdims=True) > 3 * BREAK, np.inf, cost)
    most = int(np.isfinite(cost).sum(axis=1).max()) if len(time) > SHORT else cost.shape[1]
    kept = np.argsort(cost, axis=1, kind="stable")[:, :most]
    cost, there = (np.take_along_axis(x, kept, axis=1) for x in (cost, np.nan_to_num(thickness, nan=1e9)))
    rows, steps = np.arange(len(time)), np.diff(time)
    ratio = np.concatenate([[0.0, 0.0], steps[1:] / steps[:-1]])
    known = stderr**2 + ((1 + ratio) * np.roll(stderr, 1)) ** 2 + (ratio * np.roll(stderr, 2)) ** 2
    bend = 0.5 * uneven * np.concatenate([[0.0, 0.0], steps[1:] * (steps[1:] + steps[:-1])])
    more = max(SHORT - len(time), 0)  # times with one minimum that cost nothing
    one = np.where(np.arange(most) == 0, 0.0, np.inf)
    there, cost = np.vstack([there, np.zeros((more, most))]), np.vstack([cost, np.tile(one, (more, 1))])
    ratio, variance = np.append(ratio, np.ones(more)), np.append(known + bend**2, np.full(more, np.inf))
    with jax.enable_x64(True):
        found = map(np.asarray, _viterbi(there, cost, ratio, variance))
    chosen, least, paid = (x[: len(time)] for x in found)
    left = least - least[rows, chosen][:, None]
    left[rows, chosen] = np.inf
    breaks = _breaks(paid[2:] >= BREAK, len(time))
    return OrderPath(kept[rows, chosen], left.min(axis=1), breaks)


@jax.jit
def _viterbi(thickness: Any, cost: Any, ratio: Any, variance: Any) -> tuple[Any, Any, Any]:
    """The best path through minima (times, minima), least costs of paths through each of them, and prices
    (times,) of departures from straight lines on the best path, of which the first two have none.

    `cost` (times, minima) is that of a minimum; `ratio` (times,) that of a step to the one before, and
    `variance` (times,) that of a departure.
    """

    def price(before: Any, now: Any) -> Any:
        """Prices (minima at t − 2, t − 1, t)."""
        (first, second), (third, _, ratio, variance) = before, now
        line = second[None, :] + ratio * (second[None, :] - first[:, None])
        return jnp.minimum((third[None, None, :] - line[..., None]) ** 2 / variance, BREAK)

    def forward(least: Any, now: Any) -> Any:
        """Least costs of paths that end in a pair of minima, and the minima two times before."""
        before, own = now
        total = least[..., None] + price(before, own)
        return jnp.min(total, axis=0) + own[1][None, :], (least, jnp.argmin(total, axis=0))

    def backward(carry: Any, now: Any) -> Any:
        """Least costs of the rest of a path, and of paths through the minima one time before."""
        rest, pair = carry
        before, own, least, origin = now
        paid = price(before, own)
        rest = jnp.min(paid + (own[1][None, :] + rest)[None], axis=2)
        first = origin[pair]
        return (rest, (first, pair[0])), (jnp.min(least + rest, axis=0), pair[1], paid[(first, *pair)])

    every = thickness, cost, ratio, variance
    later = (thickness[:-2], thickness[1:-1]), tuple(x[2:] for x in every)
    last, (before, origin) = jax.lax.scan(forward, cost[0][:, None] + cost[1][None, :], later)
    pair = jnp.unravel_index(jnp.argmin(last), last.shape)
    carry = jnp.zeros_like(last), pair
    (rest, (first, second)), (least, third, paid) = jax.lax.scan(
        backward, carry, (*later, before, origin), reverse=True
    )
    chosen = jnp.concatenate([jnp.stack([first, second]), third])
    start = jnp.min(cost[0][:, None] + cost[1][None, :] + rest, axis=1)
    least = jnp.concatenate([start[None], least, jnp.min(last, axis=0)[None]])
    return chosen, least, jnp.concatenate([jnp.zeros(2), paid])


def _breaks(paid: np.ndarray, count: int) -> np.ndarray:
    """Breaks (times,) by where a path paid for one: a jump is paid by the two departures around it."""
    breaks = np.zeros(count, bool)
    for t in np.flatnonzero(paid) + 2:
        breaks[t] = not (breaks[t - 1] or (t >= 2 and breaks[t - 2]))
    return breaks
