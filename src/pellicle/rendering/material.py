"""A film as a renderer takes it: numbers of its formula, physical and effective, with their errors."""

from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np

from pellicle.rendering.appearance import ANGLES, Appearance
from pellicle.rendering.effective import Solution
from pellicle.rendering.formula import Formula

SCHEMA = "pellicle.export/1"
SETS = ("effective", "physical")
"""Sets of numbers: solved for the exact colours, and those of the film as they are."""


@dataclass(frozen=True)
class Solved:
    """A renderer's formula with both sets of numbers of a film; `used` names the one that is drawn."""

    formula: Formula
    physical: Solution
    effective: Solution
    used: str

    @property
    def chosen(self) -> Solution:
        """The set that is drawn."""
        return self.effective if self.used == "effective" else self.physical

    @property
    def sets(self) -> dict[str, Solution]:
        """Both sets by name."""
        return {"effective": self.effective, "physical": self.physical}


@dataclass(frozen=True)
class Material:
    """A film for a renderer.

    `solved` is None for a target without a formula of its own, which tabulates the exact colours.
    `thickness_map` (rows, columns) is in nm, None for an even film.
    """

    name: str
    look: Appearance
    solved: Solved | None
    thickness_map: np.ndarray | None = None

    @property
    def thickness(self) -> float:
        """Thickness in nm: the largest of an uneven film."""
        return float(self.look.thickness[-1])

    @property
    def drawn(self) -> Solved:
        """The solved formula. Raises TypeError for a target that has none."""
        if self.solved is None:
            raise TypeError("this target tabulates the exact colours and has no formula")
        return self.solved

    def record(self) -> dict[str, Any]:
        """The sets of numbers with their errors, as JSON: for metadata, and beside the file."""
        entries: dict[str, Any] = {
            "schema": SCHEMA,
            "name": self.name,
            "thickness_nm": [float(x) for x in (self.look.thickness[0], self.look.thickness[-1])],
            "angles_deg": [float(ANGLES[0]), float(ANGLES[-1])],
            "colours": "CIE 1931, D65",
            "notes": list(self.look.notes),
            "pellicle": version("pellicle"),
        }
        if self.solved is None:
            return entries
        return entries | {
            "formula": self.solved.formula.name,
            "used": self.solved.used,
            **{name: self._set(solution) for name, solution in self.solved.sets.items()},
        }

    def _set(self, solution: Solution) -> dict[str, Any]:
        return {
            "thickness_nm": [float(solution.scale * x) for x in (self.look.thickness[0], self.thickness)],
            **{key: np.asarray(x).tolist() for key, x in solution.numbers.items()},
            "delta_e2000": {"mean": solution.error.mean, "largest": solution.error.largest},
        }
