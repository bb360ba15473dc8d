"""Thinning laws: power law and exponential of a thickness against time, with errors.

Laws are fitted to what each time says by itself, whose errors are independent: those of a smoothed thickness
hang together. Residuals that are larger than the errors, or hang together, enlarge the errors of the law.

**Source:** Schwarz 1978, Ann. Stat. 6, 461 (choice between laws of different numbers of parameters).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pellicle.fitting.noise import correlation_length

POWER, SHIFTED, EXPONENTIAL = "power", "power-shifted", "exponential"
FORMULAS = {
    POWER: "A t^(-exponent)",
    SHIFTED: "A (t - origin)^(-exponent)",
    EXPONENTIAL: "A exp(-t / time constant)",
}
_FEWEST = 8
_FAR = 3.0
"""Most times the length of the movie from the origin of a power law to the first time."""
_HIGHEST = 30.0
"""Logarithm of the largest thickness in nm that a search may try."""
_LEAST = 1e-3
"""Relative error that no thickness falls below."""


class Looks(NamedTuple):
    """Thickness (times,) in nm by each time alone, its standard error, and what errors that all times have in
    common change it by (times, effects)."""

    value: np.ndarray
    stderr: np.ndarray
    common: np.ndarray


class Law(NamedTuple):
    """A law, its numbers by name with their standard errors, the rms of its residuals in shares of the
    thickness, and how much worse it is than the best one, as Δ of Schwarz's criterion."""

    name: str
    numbers: dict[str, tuple[float, float]]
    rms: float
    worse: float

    def thickness(self, time: np.ndarray) -> np.ndarray:
        """Thickness in nm at times."""
        a, *rest = (value for value, _ in self.numbers.values())
        if self.name == EXPONENTIAL:
            return a * np.exp(-time / rest[0])
        return a * (time - (rest[1] if len(rest) > 1 else 0.0)) ** -rest[0]


def thinning_laws(time: np.ndarray, thickness: np.ndarray, looks: Looks) -> list[Law]:
    """Fit the laws to looks at a thickness in nm, the best one first; empty for fewer than eight times.

    Times count from that of the data: a power law without an origin needs the time since the film was made,
    and leaves out what is not after 0. `thickness` is the smoothed one, NaN at times that are left out.
    """
    used = np.isfinite(thickness) & (thickness > 0) & np.isfinite(looks.stderr)
    if used.sum() < _FEWEST:
        return []
    time, value, looks = time[used], np.log(thickness[used]), Looks(*(x[used] for x in looks))
    looks = looks._replace(stderr=np.maximum(looks.stderr, _LEAST * thickness[used]))
    span = float(np.ptp(time))
    rows: list[tuple[str, tuple[str, ...], Callable[[np.ndarray], np.ndarray], list[np.ndarray], np.ndarray]]
    slope = -np.polyfit(time, value, 1)[0]
    rows = [
        (
            EXPONENTIAL,
            ("A", "time constant"),
            lambda p: p[0] - p[1] * (time - time[0]),
            [np.array([value[0], slope])],
            np.ones(len(time), bool),
        ),
        (
            SHIFTED,
            ("A", "exponent", "origin"),
            lambda p: p[0] - p[1] * np.log1p((time - time[0]) / np.exp(p[2])),
            [np.array([value[0], 0.5, np.log(span * x)]) for x in (0.03, 0.3, 3.0)],
            np.ones(len(time), bool),
        ),
    ]
    later = time > max(0.0, 1e-9 * time[-1])
    if time[0] >= 0 and later.sum() >= _FEWEST:
        at = np.log(np.where(later, time, 1.0))
        power = np.array([value[-1], 0.5])
        rows.append((POWER, ("A", "exponent"), lambda p: p[0] - p[1] * at, [power], later))
    found = [_fitted(time, value, looks, *row) for row in rows]
    least = min(score for _, score in found)
    laws = [law._replace(worse=score - least) for law, score in found]
    return sorted(laws, key=lambda law: law.worse)


def _fitted(
    time: np.ndarray,
    value: np.ndarray,
    looks: Looks,
    name: str,
    names: tuple[str, ...],
    curve: Callable[[np.ndarray], np.ndarray],
    starts: list[np.ndarray],
    used: np.ndarray,
) -> tuple[Law, float]:
    """One law and its score: the criterion for as many independent residuals as there are."""

    def missed(p: np.ndarray) -> np.ndarray:
        return ((np.exp(np.minimum(curve(p), _HIGHEST)) - looks.value) / looks.stderr)[used]

    highest = np.full(len(starts[0]), np.inf)
    if name == SHIFTED:  # a power law with a farther origin is an exponential
        highest[2] = np.log(_FAR * np.ptp(time))
    from scipy.optimize import least_squares  # slow to import

    fits = [least_squares(missed, start, bounds=(-np.inf, highest)) for start in starts]
    best = min(fits, key=lambda fit: fit.cost)
    residual, count = best.fun, int(used.sum())
    together = correlation_length(residual)
    reduced = max(float(np.sum(residual**2)) / max(count - len(best.x), 1), 1.0)
    inverse = np.linalg.pinv(best.jac.T @ best.jac)
    common = inverse @ best.jac.T @ (looks.common / looks.stderr[:, None])[used]
    covariance = inverse * reduced * together + common @ common.T
    p, jacobian = best.x, np.eye(len(best.x))
    numbers = p.copy()
    if name == EXPONENTIAL:
        # A at time 0
        numbers = np.array([np.exp(p[0] + p[1] * time[0]), 1 / p[1]])
        jacobian = np.array([[numbers[0], numbers[0] * time[0]], [0.0, -(numbers[1] ** 2)]])
    elif name == SHIFTED:
        since = np.exp(p[2])
        numbers = np.array([np.exp(p[0] + p[1] * p[2]), p[1], time[0] - since])
        jacobian = np.array(
            [[numbers[0], numbers[0] * p[2], numbers[0] * p[1]], [0.0, 1.0, 0.0], [0.0, 0.0, -since]]
        )
    else:
        numbers[0] = np.exp(p[0])
        jacobian[0, 0] = numbers[0]
    errors = np.sqrt(np.diagonal(jacobian @ covariance @ jacobian.T))
    rms = float(np.sqrt(np.mean((curve(p) - value)[used] ** 2)))
    # a law that leaves out times is compared on the others
    score = count / together * np.log(np.mean(residual**2)) + len(p) * np.log(max(count / together, 2.0))
    pairs = {key: (float(v), float(e)) for key, v, e in zip(names, numbers, errors, strict=True)}
    return Law(name, pairs, rms, 0.0), float(score)
