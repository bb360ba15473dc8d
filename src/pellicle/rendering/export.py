"""Export of a film to a renderer, with the error of the renderer's formula, and maps of thickness in nm."""

import json
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.errors import DataError, UsageError
from pellicle.files import write_text
from pellicle.fitting.result import Fit
from pellicle.rendering.appearance import Appearance, appearance
from pellicle.rendering.effective import effective, physical
from pellicle.rendering.films import film_of
from pellicle.rendering.material import SETS, Material, Solved
from pellicle.rendering.targets import Target, target
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface

_NODES = 9
"""Thicknesses of a map at which colours are compared: its quantiles from the least to the largest."""

_LEAST = 3.0
"""Largest thickness (nm) of a map in nm at least: one of 3 µm is beyond all interference colours."""


def read_thickness_map(path: str | os.PathLike[str]) -> np.ndarray:
    """Read a map of thicknesses in nm, (rows, columns): an array in `.npy`, or a grey image of 8 or 16 bits.

    **Raises:** DataError for a file that cannot be read, and for an image in colour.
    """
    try:
        if Path(path).suffix.lower() == ".npy":
            values = np.load(path, allow_pickle=False)
        else:
            from PIL import Image  # a requirement of Matplotlib

            with Image.open(path) as image:
                values = np.asarray(image)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise DataError(
            f"{path}: cannot be read as a map of thicknesses ({reason}); give an array in .npy or a grey PNG,"
            " in nm"
        ) from None
    if values.ndim != 2:
        raise DataError(
            f"{path}: has the shape {values.shape}; a map of thicknesses is (rows, columns), as a grey image"
        )
    try:
        return checked(values)
    except UsageError as error:
        raise DataError(f"{path}: {error}") from None


def checked(values: Any) -> np.ndarray:
    """Return a map of thicknesses as an array. Raises UsageError for another shape, and for wrong values."""
    try:
        array = np.asarray(values, float)
    except ValueError:
        raise UsageError("`thickness_map` must have numbers, thicknesses in nm") from None
    if array.ndim != 2 or array.size == 0:
        raise UsageError(f"`thickness_map` must have the shape (rows, columns), not {array.shape}")
    if not np.all(np.isfinite(array)) or np.min(array) < 0:
        raise UsageError("`thickness_map` must have finite thicknesses in nm, none below 0")
    if np.max(array) < _LEAST:
        raise UsageError(
            f"`thickness_map` is {np.max(array):.3g} nm thick at most: give thicknesses in nm, not in µm"
        )
    return array


def nodes(thickness_map: np.ndarray) -> np.ndarray:
    """Return thicknesses that stand for a map: quantiles, with the least and the largest."""
    return np.unique(np.quantile(thickness_map, np.linspace(0.0, 1.0, _NODES)))


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
