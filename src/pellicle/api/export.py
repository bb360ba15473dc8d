"""Verb of export: a film as a material of a renderer."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from pellicle.fitting.result import Fit
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface

if TYPE_CHECKING:
    from pellicle.rendering.export import Export


def export(
    scene: Scene | Surface | Fit,
    *,
    to: str,
    path: str | os.PathLike[str],
    numbers: str = "effective",
    thickness_map: ArrayLike | str | os.PathLike[str] | None = None,
    layer: str | None = None,
) -> Export:
    """Write a film as a material of a renderer, and how far its formula is from the exact colours.

    A renderer computes a film's colour by an approximate formula. `pellicle` solves for the thickness, index
    and base with which this formula comes closest to the exact colours (CIE 1931, D65) from 0 to 80 degrees,
    and writes them and the film's own numbers with the mean and the largest ΔE2000 of both.

    **Arguments:**

    - `scene`: `Scene` or `Surface`, whose free parameters take their start values, or `Fit` with its best
      values.
    - `to`: "blender", "gltf", "materialx", "mitsuba", "openpbr" or "usd".
    - `path`: file to write, which must not exist; a record in JSON is written beside it.
    - `numbers`: the set that the renderer draws, "effective" or "physical".
    - `thickness_map`: thicknesses in nm over the object, (rows, columns) from the upper left, or the path of
      a `.npy` file or a grey image of them ("gltf").
    - `layer`: name of the layer whose thickness it is (the free one, or else the first).

    **Returns:** `Export`: the files, and `material` with both sets of numbers and their errors.

    **Raises:** UsageError for an unknown renderer, for a package that is absent, and for a file that exists;
    ValueError where a material has no data between 380 and 730 nm.
    """
    from pellicle.rendering.export import export as export_film

    return export_film(scene, to, path, numbers=numbers, thickness_map=thickness_map, layer=layer)
