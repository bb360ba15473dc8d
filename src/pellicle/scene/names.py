"""Names and units of the numbers of a scene: `thickness`, `film.n`, `instrument.bandwidth`."""

from typing import Any

from pellicle.dispersion.anisotropic import ParameterLocation, locate_parameter
from pellicle.dispersion.base import AbstractDispersion

WIDTHS = {"bandwidth": "nm", "thickness_spread": "nm", "roughness": "nm", "angle_spread": "deg"}
_UNITS = {
    "thickness": "nm",
    "wavelength_shift": "nm",
    "plate_mm": "mm",
    "angle": "deg",
    "angle_shift": "deg",
    **WIDTHS,
}


def location_of(scene: Any, path: tuple) -> ParameterLocation:
    """Location of the number at `path` inside its medium, or inside the scene outside of media."""
    node: Any = scene
    for depth, step in enumerate(path):
        node = getattr(node, step.name) if hasattr(step, "name") else node[step.idx]
        if isinstance(node, AbstractDispersion):
            return locate_parameter(node, path[depth + 1 :])
    key = path[-1].name
    return ParameterLocation(key, key, key, None)


def unit_of(location: ParameterLocation) -> str:
    """The unit of a number, empty for none."""
    return location.unit or _UNITS.get(location.key, "")


def full_name(scene: Any, path: tuple, last: str, own: str = "") -> str:
    """Owner, last part and `own`, the scene's name among several; the owner is not named for the light and
    the only layer."""
    owner = path[0].name
    owners = layer_prefix(scene, path[1].idx) if owner == "layers" else [owner] if owner != "light" else []
    if owner == "substrate" and path[1].name == "back":
        owners = ["back"]
    return ".".join(part for part in (*owners, last, own) if part)


def name_in_fit(scene: Any, path: tuple, last: str, own: str = "") -> str:
    """Return the full name of a number in a fit, where the scene may be that of one of several samples."""
    if scene.sample is None:
        return full_name(scene, path, last, own)
    return scene.sample.called(
        aliases_of(scene, path, last), full_name(scene, path, last, own) if own else ""
    )


def aliases_of(scene: Any, path: tuple, last: str) -> list[str]:
    """Return the names by which samples share a number: the full one and, of a layer, that below it."""
    below = [f"{layer_name(scene, path[1].idx)}.{last}"] if path[0].name == "layers" else []
    return [full_name(scene, path, last), *below]


def layer_prefix(scene: Any, position: int) -> list[str]:
    """Prefix of the names of a layer's parameters: nothing if it is the only one."""
    return [] if len(scene.layers) == 1 else [layer_name(scene, position)]


def layer_name(scene: Any, position: int) -> str:
    """The name of a layer, or its number from 1."""
    return scene.layers[position].name or f"layer{position + 1}"
