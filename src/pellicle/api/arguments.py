"""Arguments of verbs that take both kinds of scenes."""

from __future__ import annotations

from typing import Any

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.scene.surface import Surface, SurfaceView, surface_view
from pellicle.simulation.brdf import Directions, default_directions


def refuse(kind: str, **arguments: Any) -> None:
    """Raise TypeError where an argument of the other kind of scene is given."""
    for name, value in arguments.items():
        if value is not None:
            raise TypeError(f"`{name}` has no meaning for {kind}")


def viewed(surface: Surface, directions: Directions | BrdfSamples | None) -> SurfaceView:
    """A surface seen in `directions`, by default those of `pellicle.simulate`."""
    return surface_view(surface, default_directions() if directions is None else directions)
