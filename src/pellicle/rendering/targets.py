"""Formats and renderers that a film can be exported to, and the material that they write.

A module has a `TARGET`. To add one, write it and add its place to `TARGETS`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, NamedTuple

import numpy as np

from pellicle.errors import UsageError, did_you_mean, install_command
from pellicle.rendering.appearance import ANGLES, Appearance
from pellicle.rendering.base_texture import BaseTexture
from pellicle.rendering.formula import Formula, Solution

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
    `thickness_map` (rows, columns) is in nm, None for an even film; `roughness_map` (rows, columns) is the
    GGX α over the object, None for that of `look`; `base_texture` the numbers of its base, None for one base.
    """

    name: str
    look: Appearance
    solved: Solved | None
    thickness_map: np.ndarray | None = None
    roughness_map: np.ndarray | None = None
    base_texture: BaseTexture | None = None

    @property
    def base_images(self) -> dict[str, np.ndarray]:
        """Images of the drawn numbers of the base, by key; none for one base."""
        if self.base_texture is None:
            return {}
        chosen = self.drawn.chosen.numbers
        return {key: self.base_texture.image(key, chosen) for key in self.base_texture.numbers}

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
        entries |= {"formula": self.solved.formula.name, "used": self.solved.used}
        for name, solution in self.solved.sets.items():
            entries[name] = {
                "thickness_nm": [float(solution.scale * x) for x in (self.look.thickness[0], self.thickness)],
                **{key: np.asarray(x).tolist() for key, x in solution.numbers.items()},
                **self._base_range(solution),
                "delta_e2000": {"mean": solution.error.mean, "largest": solution.error.largest},
            }
        return entries

    def _base_range(self, solution: Solution) -> dict[str, Any]:
        """The least and the largest numbers of a base with a texture."""
        if self.base_texture is None:
            return {}
        ends = {key: x.ends(solution.numbers[key]) for key, x in self.base_texture.numbers.items()}
        return {"base_range": {key: [x.tolist() for x in both] for key, both in ends.items()}}


class Target(NamedTuple):
    """A format or renderer.

    `suffixes` are those of its files, the usual one first. `packages` must be importable. `formula` returns
    the renderer's own formula for a film, and is None where exact colours are tabulated. `write` writes the
    file at a path, with more files beside it where the format needs them, and returns all of them.
    """

    name: str
    title: str
    suffixes: tuple[str, ...]
    packages: tuple[str, ...]
    formula: Callable[[Appearance], Formula] | None
    write: Callable[[Path, Material], tuple[Path, ...]]
    takes_map: bool = False


TARGETS = {
    "blender": "pellicle.rendering.blender:TARGET",
    "gltf": "pellicle.rendering.gltf:TARGET",
    "materialx": "pellicle.rendering.materialx:TARGET",
    "mitsuba": "pellicle.rendering.mitsuba:TARGET",
    "openpbr": "pellicle.rendering.materialx:OPEN_PBR",
    "usd": "pellicle.rendering.usd:TARGET",
}
"""The place of each target, imported when it is used."""


def target(name: str, package_check: bool = True) -> Target:
    """Return a target by its name.

    **Raises:** UsageError for an unknown name, and where a package that it needs is absent.
    """
    if name not in TARGETS:
        known = ", ".join(TARGETS)
        raise UsageError(f"no renderer or format {name!r}{did_you_mean(name, TARGETS)}; known: {known}")
    chosen: Target = resolve_name(TARGETS[name])
    absent = [package for package in chosen.packages if find_spec(package) is None]
    if package_check and absent:
        raise UsageError(f"{chosen.title} needs the package {absent[0]}: {install_command('render')}")
    return chosen
