"""Verbs of the appearance of a film: sliders in a notebook, and materials of renderers."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from pellicle.fitting.result import Fit
from pellicle.scene.film import Scene
from pellicle.scene.kinds import check_scene
from pellicle.scene.surface import Surface

if TYPE_CHECKING:
    from pellicle.rendering.export import Export


def explore(scene: Scene | Surface, *, wavelength: ArrayLike | None = None) -> Any:
    """Show a film in a notebook: sliders beside its spectrum, colour, sphere and plan, which follow them.

    Of a surface, sliders beside the lobes of its BRDF in the plane of incidence, a sphere and the plan.

    The page is that of `pellicle explore`; it needs no network.

    **Arguments:**

    - `scene`: the film or the surface; every number in it that a slider can move has one, free or not. Of
      several angles of incidence, `pl.Light(angle=[65, 70, 75])`, each has a curve.
    - `wavelength`: wavelengths of the plot in nm, (wavelengths,), by default those of the scene's light or
      the visible ones.

    **Returns:** A widget (anywidget): `values` are the sliders' numbers by name, in their units, and setting
    them moves the sliders; `angles` are angles of incidence in degrees in place of the scene's, empty for
    those; `recipe()` is the film in its current state as TOML.

    **Raises:** UsageError without the package anywidget, and for a scene of several azimuths, of generalised
    psi and delta or of more than 12 angles at several wavelengths; DataError where the materials
    share no wavelengths.
    """
    from pellicle.explorer.session import Session
    from pellicle.explorer.widget import widget

    check_scene(scene)
    return widget(Session(scene, wavelength=wavelength))


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
