"""Verb of the explorer: a film with sliders in a notebook."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from pellicle.scene.film import Scene
from pellicle.scene.kinds import check_scene
from pellicle.scene.surface import Surface


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
