"""Formats and renderers that a film can be exported to, one module each.

A module has a `TARGET`. To add one, write it and add its name to `MODULES`.
"""

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from pellicle.errors import UsageError, did_you_mean, install_command
from pellicle.rendering.appearance import Appearance
from pellicle.rendering.formula import Formula
from pellicle.rendering.material import Material


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


MODULES = {
    "blender": "pellicle.rendering.blender",
    "gltf": "pellicle.rendering.gltf",
    "materialx": "pellicle.rendering.materialx",
    "mitsuba": "pellicle.rendering.mitsuba",
    "openpbr": "pellicle.rendering.openpbr",
    "usd": "pellicle.rendering.usd",
}
"""The module of each target."""


def target(name: str, package_check: bool = True) -> Target:
    """Return a target by its name.

    **Raises:** UsageError for an unknown name, and where a package that it needs is absent.
    """
    if name not in MODULES:
        known = ", ".join(MODULES)
        raise UsageError(f"no renderer or format {name!r}{did_you_mean(name, MODULES)}; known: {known}")
    chosen: Target = import_module(MODULES[name]).TARGET
    absent = [package for package in chosen.packages if find_spec(package) is None]
    if package_check and absent:
        raise UsageError(f"{chosen.title} needs the package {absent[0]}: {install_command('render')}")
    return chosen
