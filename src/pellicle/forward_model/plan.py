"""Plan: the effects that a simulation includes, why, and the error of leaving the others out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

from pellicle.signals.base import Signal
from pellicle.signals.registry import of_light

SURFACE = "brdf"
"""Word of the signal of a surface."""

CLOSED_FORMS, GENERAL, SLICED = 2, 4, 8
"""`Row.count` of the effect "anisotropy": size of the matrices; `SLICED` is 4×4 with layers that may be
strongly dichroic, which are computed in slices."""


@dataclass(frozen=True)
class Row:
    """One effect of a plan: its name, whether it is simulated, why, and the error of that choice.

    `error_bound` is in the unit of the signal: the error of leaving the effect out where it is off, of its
    numerical method where it is on. `count` is the number of orders, or of nodes of an average; a cone of
    light has `around` rays for each node.
    """

    effect: str
    on: bool
    why: str
    error_bound: float = 0.0
    count: int = 0
    around: int = 0


@runtime_checkable
class Removal(Protocol):
    """Removes one effect from a scene or a surface; frozen and hashable."""

    @property
    def effect(self) -> str: ...

    def __call__(self, scene: Any, /) -> Any: ...


@dataclass(frozen=True)
class Plan:
    """The effects that a simulation includes; frozen, hashable and printable.

    The `build` functions of `pellicle.forward_model` turn it into a forward model. `left_out` are the effects
    that are present but left out within the `tolerance` (in the unit of the signal), in the order in which
    the scene is simplified. `gradient_error` is the largest change of a derivative in a free parameter by
    that, relative to the largest value of that derivative. `reference` is the plan of the reference of a
    contrast.
    """

    rows: tuple[Row, ...]
    signal: str
    polarisation: str
    left_out: tuple[Removal, ...] = ()
    tolerance: float = 0.0
    gradient_error: float = 0.0
    transmission: bool = False
    reference: Plan | None = None

    @property
    def kind(self) -> Signal:
        """The kind of the signal. Raises KeyError for that of a surface."""
        return of_light(self.signal, self.transmission)

    def row(self, effect: str) -> Row:
        """The row of one effect. Raises KeyError for an unknown name."""
        return {row.effect: row for row in self.rows}[effect]

    def with_rows(self, *rows: Row) -> Plan:
        """The plan with these rows in place of those of their effects."""
        others = {row.effect: row for row in rows}
        return replace(self, rows=tuple(others.get(row.effect, row) for row in self.rows))

    def on(self, effect: str) -> bool:
        """True where the effect is simulated. Raises KeyError for an unknown name."""
        return self.row(effect).on

    @property
    def ellipsometric(self) -> bool:
        """True for the signals of ellipsometry."""
        return self.signal != SURFACE and self.kind.ellipsometric

    @property
    def degrees(self) -> bool:
        """True where differences of the signal are degrees on spheres of N, C, S."""
        return self.signal != SURFACE and self.kind.degrees

    @property
    def error_bound(self) -> float:
        """Bound on the error of the signal by everything that the plan leaves out or averages."""
        return sum(row.error_bound for row in self.rows)

    @cached_property
    def static_key(self) -> Plan:
        """The plan without reasons and bounds: everything that a compiled program depends on."""
        rows = tuple(Row(row.effect, row.on, "", count=row.count, around=row.around) for row in self.rows)
        reference = None if self.reference is None else self.reference.static_key
        return replace(self, rows=rows, tolerance=0.0, gradient_error=0.0, reference=reference)

    def __str__(self) -> str:
        width = max(len(row.effect) for row in self.rows)
        return "\n".join(f"{x.effect:<{width}}  {'on ' if x.on else 'off'}  {x.why}" for x in self.rows)
