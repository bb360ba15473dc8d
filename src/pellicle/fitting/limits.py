"""One-sided limits where the misfit never rises on one side of the best thickness."""

from __future__ import annotations

import math

import numpy as np

from pellicle.fitting.result import Profile
from pellicle.fitting.status import RIVAL

_ONE_SIDED = 2.71
"""χ² above the best at a one-sided 95 % limit."""
_LEAST_RISE = 0.1
"""Smaller rises of χ² are counted as this one: their logarithm is that of rounding, not of a film."""
_OPEN = RIVAL
"""A side where the misfit never rises by as much as would rule a rival out is open."""
_NEAR = 1e-3
"""A best thickness this close (nm) to a bound rests on it; the side is open if the misfit is flat there."""


def limits(profile: Profile, best: float) -> tuple[float | None, float | None, bool]:
    """One-sided limits where the misfit never rises between the best thickness and a bound.

    Returns (lower, upper, bounded): both None and True where both sides are bounded.
    """
    close, level = profile.delta_chi2 < _ONE_SIDED, profile.delta_chi2 < _OPEN
    left, right = profile.thickness < best - _NEAR, profile.thickness > best + _NEAR
    open_left = _stays(level, left) if left.any() else bool(close[right][:1].all())
    open_right = _stays(level, right) if right.any() else bool(close[left][-1:].all())
    if not (open_left or open_right):
        return None, None, True
    lower = None if open_left else _crossing(profile, best, left & ~close, -1)
    upper = None if open_right else _crossing(profile, best, right & ~close, 0)
    return lower, upper, False


def _stays(level: np.ndarray, side: np.ndarray) -> bool:
    return bool(level[side].all())


def _crossing(profile: Profile, best: float, beyond: np.ndarray, nearest: int) -> float:
    """Where Δχ² reaches the limit, between the nearest point beyond it and the next one towards the best.

    Light that returns through an absorber falls exponentially with its thickness, and Δχ² with it: its
    logarithm is taken as linear.
    """
    if not beyond.any():
        return best
    at = np.flatnonzero(beyond)[nearest]
    inner = at + (1 if nearest < 0 else -1)
    far, delta = profile.thickness[at], float(profile.delta_chi2[at])
    near, low = profile.thickness[inner], float(profile.delta_chi2[inner])
    if abs(best - far) <= abs(near - far):
        near, low = best, 0.0
    low = max(low, _LEAST_RISE)
    return float(far + (near - far) * math.log(delta / _ONE_SIDED) / math.log(delta / low))
