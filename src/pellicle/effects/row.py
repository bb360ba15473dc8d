"""What a plan says of one effect, and what knows how to judge it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Row:
    """One line of a plan: the effect, whether it is simulated, why, and how far off the plan is by it.

    `error_bound` is in the unit of the signal: of leaving the effect out where it is off, of how it is
    computed where it is on. `count` is the number of orders, or of nodes where an average is taken; a
    cone of light has `around` rays for each of its nodes.
    """

    effect: str
    on: bool
    why: str
    error_bound: float = 0.0
    count: int = 0
    around: int = 0


@dataclass(frozen=True)
class Effect:
    """A name that plans know, and the judge of whether a scene, a film's or a surface's, calls for it."""

    name: str
    judge: Callable[[Any], Row]
