"""The two kinds of scene: a film and a surface."""

from __future__ import annotations

import os
from typing import Any

from pellicle.errors import UsageError
from pellicle.scene.film import Scene
from pellicle.scene.layers import Interface, Layer, Plate
from pellicle.scene.surface import Surface


def check_scene(scene: Any, several: bool = False) -> None:
    """Raise UsageError unless `scene` is a `Scene` or a `Surface`, or with `several` a list of scenes.

    The message has the call that makes one.
    """
    kinds = "a Scene, a Surface or a list of scenes" if several else "a Scene or a Surface"
    for each in scene if several and isinstance(scene, list | tuple) else [scene]:
        if isinstance(each, Scene | Surface):
            continue
        name, remedy = type(each).__name__, "pl.Scene(pl.Layer(material, thickness), substrate) makes one"
        if isinstance(each, str | os.PathLike):
            name = repr(os.fspath(each))
            remedy = f"a recipe gives one by pl.read_recipe({name}).scene()"
        elif isinstance(each, Layer | Interface | Plate):
            remedy = "give it a substrate, as in pl.Scene(layer, 'Si')"
        elif callable(getattr(each, "scene", None)):
            remedy = "its .scene() is one"
        raise UsageError(f"`scene` must be {kinds}, not {name}: {remedy}")


def refuse(kind: str, **arguments: Any) -> None:
    """Raise TypeError where an argument of the other kind of scene is given."""
    for name, value in arguments.items():
        if value is not None:
            raise TypeError(f"`{name}` has no meaning for {kind}")
