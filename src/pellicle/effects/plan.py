"""A plan: which effects a scene calls for, why, and what leaving the others out costs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable


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


@runtime_checkable
class LeaveOut(Protocol):
    """Makes a scene simpler by one effect; frozen and hashable."""

    @property
    def effect(self) -> str: ...

    def __call__(self, scene: Any, /) -> Any: ...


@dataclass(frozen=True)
class Plan:
    """Frozen, hashable and printable; `model.build` composes what it names and nothing else.

    `left_out` are the effects that a `tolerance` (in the unit of the signal) leaves out although they
    are there, in the order in which the scene is simplified. `gradient_error` is by how much of its
    largest value a derivative in a free parameter changes through that, at most.
    """

    rows: tuple[Row, ...]
    signal: str
    polarisation: str
    left_out: tuple[LeaveOut, ...] = ()
    tolerance: float = 0.0
    gradient_error: float = 0.0

    def row(self, effect: str) -> Row:
        """The line of one effect; KeyError for a name that is none."""
        for row in self.rows:
            if row.effect == effect:
                return row
        raise KeyError(effect)

    def on(self, effect: str) -> bool:
        return self.row(effect).on

    @property
    def error_bound(self) -> float:
        """How far the signal can be off by all that the plan leaves out, and by how it averages."""
        return sum(row.error_bound for row in self.rows)

    @property
    def static_key(self) -> Plan:
        """The same without reasons and bounds: all that a compiled program depends on."""
        rows = tuple(Row(row.effect, row.on, "", count=row.count, around=row.around) for row in self.rows)
        return Plan(rows, self.signal, self.polarisation, self.left_out)

    def __str__(self) -> str:
        width = max(len(row.effect) for row in self.rows)
        lines = [f"{row.effect:<{width}}  {'on ' if row.on else 'off'}  {row.why}" for row in self.rows]
        return "\n".join(lines)
