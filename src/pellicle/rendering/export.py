"""Export of a film to a renderer, with the error of the renderer's formula."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pellicle.errors import UsageError
from pellicle.files import write_text
from pellicle.fitting.result import Fit
from pellicle.rendering.appearance import Appearance, appearance
from pellicle.rendering.effective import effective, physical
from pellicle.rendering.films import film_of
from pellicle.rendering.material import SETS, Material, Solved
from pellicle.rendering.targets import Target, target
from pellicle.rendering.thickness_map import checked, nodes, read_thickness_map
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface


@dataclass(frozen=True)
class Export:
    """Files of an exported film, and what they contain."""

    target: str
    title: str
    files: tuple[Path, ...]
    material: Material

    def __str__(self) -> str:
        names, solved = ", ".join(path.name for path in self.files), self.material.solved
        if solved is None:
            return f"{self.title}: {names}"
        errors = ", ".join(f"{name} {each.error.mean:.2g}" for name, each in solved.sets.items())
        return f"{self.title}: {names}; mean ΔE2000 {errors}; {solved.used} numbers are used"

    __repr__ = __str__


def export(
    scene: Scene | Surface | Fit,
    to: str,
    path: str | os.PathLike[str],
    *,
    numbers: str = "effective",
    thickness_map: Any = None,
    layer: str | None = None,
) -> Export:
    """Write a film as a material; see `pellicle.export`."""
    if numbers not in SETS:
        raise UsageError(f"`numbers` must be {' or '.join(SETS)}, not {numbers!r}")
    chosen, out = target(to), Path(path)
    if out.suffix.lower() not in chosen.suffixes:
        raise UsageError(f"{out}: a file of {chosen.title} ends in {' or '.join(chosen.suffixes)}")
    record = out.with_name(out.name + ".json")
    for each in (out, record):
        if each.exists():
            raise UsageError(f"{each}: exists and is not overwritten; choose another `path` or remove it")
    if isinstance(thickness_map, str | os.PathLike):
        thickness_map = read_thickness_map(thickness_map)
    if thickness_map is not None:
        if not chosen.takes_map:
            raise UsageError(f"{chosen.title} takes no map of thicknesses; leave `thickness_map` out")
        thickness_map = checked(thickness_map)
    film = film_of(scene)
    look = appearance(film.scene, None if thickness_map is None else nodes(thickness_map), layer)
    lacking = () if chosen.formula is None else look.lacking  # tables have the colours of any film
    look = replace(look, roughness=film.roughness, notes=(*lacking, *look.notes, *film.notes))
    material = Material(out.stem, look, _solved(chosen, look, numbers), thickness_map)
    files = chosen.write(out, material)
    text = json.dumps({"target": to} | material.record(), ensure_ascii=False, indent=1, allow_nan=False)
    write_text(record, text + "\n")
    return Export(to, chosen.title, (*files, record), material)


def _solved(chosen: Target, look: Appearance, numbers: str) -> Solved | None:
    if chosen.formula is None:
        return None
    formula = chosen.formula(look)
    try:
        return Solved(formula, physical(formula, look), effective(formula, look), numbers)
    except ImportError as missing:  # colour-science
        raise UsageError(str(missing)) from None
