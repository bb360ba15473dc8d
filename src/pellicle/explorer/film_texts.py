"""Media and thicknesses of a film as texts in the fields of a page, and the scene that changed texts make."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.empirical import Constant
from pellicle.errors import UsageError
from pellicle.materials.contents import known_words
from pellicle.recipes.dispersion_models import MODELS
from pellicle.recipes.media import thickness
from pellicle.recipes.written_media import written_medium
from pellicle.scene.film import Scene
from pellicle.scene.free import Free
from pellicle.scene.layers import Interface, Layer, Plate
from pellicle.scene.names import layer_prefix

MOST_LAYERS = 40
"""Layers of a film in fields: more are described in a recipe."""
_FIRST = 100.0
"""Thickness in nm of a new layer, where its bounds allow it."""

ReadMedium = Callable[[str], AbstractDispersion]


def described(scene: Scene) -> list[dict[str, Any]]:
    """Return the ambient, each layer and the substrate as texts that `rebuilt` takes; None has no field."""
    rows: list[dict[str, Any]] = [{"part": "ambient", "material": _text(scene.ambient)}]
    for i, layer in enumerate(scene.layers):
        named = f" ({layer.name})" if layer.name else ""
        medium = None if isinstance(layer, Interface) else _text(layer.material)
        bounds = None if isinstance(layer, Plate) else _bounds(layer.thickness)
        index = ".".join([*layer_prefix(scene, i), "n"]) if isinstance(layer, Layer) else None
        row = {"part": f"layer {i + 1}{named}", "was": i, "material": medium, "thickness": bounds}
        rows.append({**row, "index": index})
    substrate = {"part": "substrate", "material": _text(scene.substrate.material), "index": "substrate.n"}
    return [*rows, substrate]


def words() -> list[str]:
    """Return the names of materials and of models, which a field suggests."""
    return list(dict.fromkeys([*known_words(), *MODELS]))


def rebuilt(scene: Scene, rows: Any, medium: ReadMedium) -> Scene | list[str]:
    """Return the scene with changed media and layers, or a sentence for each row, empty for a right one.

    The first of the `rows` is the ambient, the last the substrate. A layer has the place where it `was`, None
    for a new one; a text that is None is unchanged. Raises ValueError as scenes do.
    """
    known = isinstance(rows, list) and all(isinstance(row, Mapping) for row in rows)
    if not known or not 2 <= len(rows) <= MOST_LAYERS + 2:
        raise UsageError(f"a film has an ambient, up to {MOST_LAYERS} layers and a substrate")
    old = [scene.ambient, *(_layer_at(scene, row.get("was")) for row in rows[1:-1]), scene.substrate]
    made, wrong = [], [""] * len(rows)
    for i, (row, part) in enumerate(zip(rows, old, strict=True)):
        try:
            made.append(_part(row, part, medium))
        except (ValueError, OSError) as error:
            wrong[i] = str(error)
    if any(wrong):
        return wrong
    _check_groups(scene.layers, [row.get("was") for row in rows[1:-1]])
    return replace(scene, ambient=made[0], layers=tuple(made[1:-1]), substrate=made[-1])


def _layer_at(scene: Scene, place: Any) -> Layer | Interface | Plate | None:
    if place is None:
        return None
    if type(place) is not int or place not in range(len(scene.layers)):
        raise UsageError(f"there is no layer {place!r}: load the page again")
    return scene.layers[place]


def _part(row: Mapping[str, Any], old: Any, medium: ReadMedium) -> Any:
    """A medium, a layer or a substrate with the texts of a row."""
    material, bounds = row.get("material"), row.get("thickness")
    if not all(text is None or isinstance(text, str) for text in (material, bounds)):
        raise UsageError("a material and a thickness are texts")
    if material is not None and not material.strip():
        raise UsageError("name a material, or give an index such as 1.46 or 2.9+0.1j")
    made = None if material is None else medium(material)
    if isinstance(old, AbstractDispersion):
        return old if made is None else made
    if old is None:
        if made is None or bounds is None:
            raise UsageError("a new layer needs a material and a thickness")
        return Layer(made, _starting(thickness(bounds), _FIRST))
    changes: dict[str, Any] = {} if made is None else {"material": made}
    if made is not None and hasattr(old, "index_uncertainty"):
        changes["index_uncertainty"] = None  # that of the old material
    if bounds is not None:
        now = old.thickness
        changes["thickness"] = _starting(thickness(bounds), now.start if isinstance(now, Free) else now)
    return replace(old, **changes)


def _starting(number: Free | float, value: Any) -> Free | float:
    """A thickness that starts at a value where its bounds allow it."""
    if isinstance(number, Free) and number.lower <= value <= number.upper:
        return Free(number.lower, number.upper, start=float(value))
    return number


def _check_groups(layers: Sequence[Any], kept: list[int | None]) -> None:
    """Raise UsageError where a repeated group of layers is torn apart."""
    groups: dict[Any, list[int]] = {}
    for i, layer in enumerate(layers):
        if isinstance(layer, Layer) and layer.group is not None:
            groups.setdefault(layer.group, []).append(i)
    for members in groups.values():
        at = kept.index(members[0]) if members[0] in kept else 0
        if set(members) & {*kept} and kept[at : at + len(members)] != members:
            raise UsageError("a repeated group of layers stays as it is: change it in the recipe")


def _text(dispersion: Any) -> str:
    """The word of a medium, as in a recipe or on the command line; for others what they are."""
    if isinstance(dispersion, Constant) and not isinstance(dispersion.n, Free):
        k = 0.0 if dispersion.k is None else dispersion.k
        if dispersion.n == 1 and k == 0:
            return "air"
        return "index" if isinstance(k, Free) else f"{dispersion.n:.6g}{f'+{k:.6g}j' if k else ''}"
    try:
        written = written_medium(dispersion, "the medium", Path.cwd())
    except UsageError:
        return type(dispersion).__name__
    if isinstance(written, str | float | int):
        return str(written)
    if set(written) - {"model"} <= MODELS.get(written.get("model"), {}).keys():
        numbers = [written.get(key) for key in MODELS[written["model"]] if key in written]
        if all(isinstance(x, int | float) for x in numbers):
            return f"{written['model']}({', '.join(f'{x:.6g}' for x in numbers)})"
    kinds = (written[key] for key in ("model", "mix", "profile") if key in written)
    return f"{next(kinds, 'medium')} of the scene"


def _bounds(number: Any) -> str | None:
    """Bounds of a thickness, or the number, in nm."""
    if isinstance(number, Free):
        return None if number.tie is not None else f"{number.lower:.10g}:{number.upper:.10g}"
    return f"{number:.10g}" if isinstance(number, int | float) else None
