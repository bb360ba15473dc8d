"""A plan: which effects a scene calls for, why, and what leaving the others out costs."""

from __future__ import annotations

from dataclasses import dataclass

from pellicle.effects import EFFECTS, Row
from pellicle.scene import Scene


@dataclass(frozen=True)
class Plan:
    """Frozen, hashable and printable; `model.build` composes what it names and nothing else."""

    rows: tuple[Row, ...]
    signal: str
    polarisation: str

    def row(self, effect: str) -> Row:
        """The line of one effect; KeyError for a name that is none."""
        for row in self.rows:
            if row.effect == effect:
                return row
        raise KeyError(effect)

    def on(self, effect: str) -> bool:
        return self.row(effect).on

    @property
    def wordless(self) -> Plan:
        """The same without reasons and bounds: all that a compiled program depends on."""
        rows = tuple(Row(row.effect, row.on, "", count=row.count, around=row.around) for row in self.rows)
        return Plan(rows, self.signal, self.polarisation)

    def __str__(self) -> str:
        width = max(len(row.effect) for row in self.rows)
        lines = [f"{row.effect:<{width}}  {'on ' if row.on else 'off'}  {row.why}" for row in self.rows]
        return "\n".join(lines)


def plan(scene: Scene) -> Plan:
    """The effects that a scene calls for, judged from its types and bounds.

    An effect is left out only where it is provably absent, so every error bound is 0, but for the
    number of orders, of nodes and of rays, whose bounds are measured (see `effects`).
    """
    rows = tuple(effect.judge(scene) for effect in EFFECTS)
    return Plan(rows, scene.light.signal, scene.light.polarisation)
