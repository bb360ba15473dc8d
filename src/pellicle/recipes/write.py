"""Writing recipes: the TOML text of a film or a surface, which reads back as the same scene."""

import json
import os
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from pellicle.colour.observers import ILLUMINANTS, OBSERVERS
from pellicle.data.cameras import SRGB, band_sensor
from pellicle.data.options import CameraOptions, FileOptions
from pellicle.errors import UsageError
from pellicle.files import write_text
from pellicle.materials.formats.detect import names_file
from pellicle.recipes import parts
from pellicle.recipes.read import FilmRecipe, checked
from pellicle.recipes.schema import SceneTable
from pellicle.recipes.written_media import same, written_medium, written_number
from pellicle.scene.film import Light, Scene, with_wavelength
from pellicle.scene.free import Free
from pellicle.scene.layers import medium as medium_of
from pellicle.scene.surface import Surface, check_scene

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_WHOLE = 1e15
"""Whole numbers below this are written without a fraction."""


def write_recipe(
    scene: Scene | Surface, path: str | os.PathLike[str], *, files: Iterable[str | os.PathLike[str]] = ()
) -> None:
    """Write a scene as a recipe, a TOML file that `pellicle.read_recipe` reads as the same scene.

    **Arguments:** `scene`, a `Scene` or a `Surface`; `path` of the recipe, which must not exist; `files`,
    data files that the recipe shall name. Paths in the recipe are relative to it.

    **Raises:** UsageError where a recipe cannot express a part of the scene, naming it, and where the file
    exists or cannot be written.

    ```python
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "film.toml"
    >>> pl.write_recipe(pl.Scene(pl.Layer("SiO2", pl.Free(10, 3000)), "Si"), path)
    >>> pl.read_recipe(path).scene().layers[0].thickness.upper
    3000.0

    ```
    """
    write_text(path, recipe_text(scene, Path(path).parent, files=files))


def recipe_text(
    scene: Scene | Surface,
    folder: str | os.PathLike[str] = ".",
    *,
    files: Iterable[str | os.PathLike[str]] = (),
    wavelength: np.ndarray | None = None,
    reading: Mapping[str, Any] = MappingProxyType({}),
    tables: Sequence[Mapping[str, Any]] = (),
) -> str:
    """Return the text of a recipe that lies in `folder`; the rest as for `write_recipe`.

    `wavelength` in nm, (wavelengths,), is that of a light which has none: each of its angles and azimuths is
    seen at all of them. `reading` has the options of `[data]` and `[camera]` by which the files are read and
    fitted; `tables` are those of `[[data.file]]`. Paths in both are relative to the working folder.
    """
    check_scene(scene)
    place = Path(folder)
    data, camera = _options(reading, place)
    if names := [_relative(file, place) for file in files]:
        data = {"files": names} | data
    if isinstance(scene, Surface):
        text = _document({"data": {"signal": "brdf", **data}, "scene.surface": _surface(scene, place)})
        again: Any = checked(tomllib.loads(text), str(place / "recipe")).scene()
        _check_surface(scene, again)
        return text
    ambient = written_medium(scene.ambient, "the ambient", place)
    stated = parts.uncertainty_keys(scene.uncertainty)
    of_scene = {key: x for key, x in stated.items() if key in SceneTable.model_fields}
    of_instrument = {key: x for key, x in stated.items() if key not in of_scene}
    data = data if wavelength is None else {"wavelengths": _wavelengths(wavelength)} | data
    text = _document(
        {
            "data": _data(scene) | data,
            "data.file": [_file_keys(table, place) for table in tables],
            "scene": {
                **({} if ambient == 1.0 else {"ambient": ambient}),
                "substrate": parts.substrate_keys(scene.substrate, place),
                **of_scene,
            },
            **parts.layer_tables(scene.layers, "scene", place),
            **({} if scene.reference is None else parts.reference_tables(scene.reference, place)),
            "instrument": parts.instrument_keys(scene.instrument) | of_instrument,
            "camera": camera,
        }
    )
    again: Any = checked(tomllib.loads(text), str(place / "recipe")).scene()
    _check_film(with_wavelength(scene, None), again)
    return text


def samples_text(
    recipe: FilmRecipe, reading: Mapping[str, Any], fitting: Mapping[str, Any], folder: Path
) -> str:
    """Return the text of a recipe of several samples as one in `folder`, with options of the command line and
    paths that are adapted.

    **Raises:** UsageError for options that files name, which it cannot express.
    """
    tables = recipe.tables.model_dump(exclude_unset=True)
    tables["data"] = tables.get("data", {}) | dict(fitting)
    for sample in tables["sample"]:
        for own in (sample, *sample.get("file", ())):
            own |= reading
    source = Path(recipe.path).parent
    files = {name for name, (_, option) in FileOptions.declared().items() if option.is_file}

    def adapted(thing: Any, key: str = "") -> Any:
        if isinstance(thing, Mapping):
            return {name: adapted(x, name) for name, x in thing.items() if x is not None}
        if isinstance(thing, list | tuple):
            return [adapted(x, key) for x in thing]
        of_medium = isinstance(thing, str) and names_file(thing)
        if key in (*files, "files", "path") or (of_medium and key != "name"):
            return _relative(source / thing, folder)
        return thing

    text = _document(adapted(tables))
    checked(tomllib.loads(text), str(folder / "recipe"))
    return text


def _relative(path: str | os.PathLike[str], folder: Path) -> str:
    return Path(os.path.relpath(path, folder)).as_posix()


def _file_keys(table: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    given = {**table, **table.get("camera", {})}
    keys, camera = _options({key: x for key, x in given.items() if key != "camera"}, folder)
    return keys | {"path": _relative(table["path"], folder)} | ({"camera": camera} if camera else {})


def _options(reading: Mapping[str, Any], folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Keys of `[data]` and of `[camera]`, with paths relative to `folder`."""
    files = {name for name, (_, option) in FileOptions.declared().items() if option.is_file}
    keys = {name: _relative(x, folder) if name in files else x for name, x in reading.items()}
    camera = CameraOptions.declared().keys() & keys.keys()
    return {name: x for name, x in keys.items() if name not in camera}, {name: keys[name] for name in camera}


def _data(scene: Scene) -> dict[str, Any]:
    light, keys = scene.light, {}
    if light.signal != "R":
        keys["signal"] = light.signal
    if isinstance(light.angle, Free) or np.ndim(light.angle) or light.angle != 0:
        keys["angle"] = _one_or_several(light.angle, light, "the angle of incidence")
    if light.transmission:
        keys["transmission"] = True
    if light.azimuth is not None:
        keys["azimuth"] = _one_or_several(light.azimuth, light, "the azimuth of the sample")
    if light.polarisation != "unpolarised":
        keys["polarisation"] = light.polarisation
    if light.wavelength is not None:
        keys["wavelengths"] = _wavelengths(np.asarray(light.wavelength, float))
    return keys


def _one_or_several(angle: Any, light: Light, name: str) -> Any:
    """An angle, or several of which each is for all wavelengths."""
    if np.ndim(angle) and light.wavelength is None:
        return np.asarray(angle, float).tolist()
    return written_number(angle, name)


def _wavelengths(nm: np.ndarray) -> Any:
    """Start, stop and step where they give these wavelengths exactly, else a list."""
    if len(nm) > 2:
        start, stop, step = float(nm[0]), float(nm[-1]), float(nm[1] - nm[0])
        grid = np.arange(start, stop + step / 2, step) if step > 0 else nm[:0]
        if np.array_equal(grid, nm):
            return {"start": start, "stop": stop, "step": step}
    return nm.tolist()


def _surface(scene: Surface, folder: Path) -> dict[str, Any]:
    keys: dict[str, Any] = {"model": scene.model}
    if scene.wavelengths is not None:
        keys["wavelengths"] = [float(nm) for nm in scene.wavelengths]
    if scene.sensor is not None:
        keys |= next(
            (
                {"sensor": name, "illuminant": illuminant}
                for name in (*OBSERVERS, SRGB)
                for illuminant in ILLUMINANTS
                if same(band_sensor(name, illuminant, None, folder), scene.sensor)
            ),
            {},
        )
        if "sensor" not in keys:
            raise UsageError(
                "the sensor is no observer of the CIE: name the file of its sensitivities in a recipe"
            )
    for part in ("film", "base"):
        medium = getattr(scene, part)
        if medium is not None:
            keys[part] = written_medium(medium_of(medium), part, folder)
    keys |= parts.uncertainty_keys(scene.uncertainty)
    for key, value in scene.numbers.items():
        several = not isinstance(value, Free) and np.ndim(value) == 1
        keys[key] = [float(x) for x in np.ravel(value)] if several else written_number(value, key)  # pyright: ignore[reportArgumentType,reportCallIssue]
    return keys


def _check_film(scene: Scene, again: Scene) -> None:
    """Raise UsageError for the first part of a scene that the recipe does not give back."""
    layers = [(f"layer {i}", *pair) for i, pair in enumerate(zip(scene.layers, again.layers, strict=True), 1)]
    names = ("substrate", "ambient", "light", "instrument", "reference")
    _check(
        [*layers, *((name, getattr(scene, name), getattr(again, name)) for name in names)],
        "the {} of this scene",
    )
    if scene.uncertainty != again.uncertainty:
        raise UsageError("a recipe cannot express the uncertainty of this scene")


def _check_surface(scene: Surface, again: Surface) -> None:
    """Raise UsageError for the first part of a surface that the recipe does not give back."""

    def medium(part: Any) -> Any:
        return None if part is None else medium_of(part)

    pairs: list[tuple[str, Any, Any]] = [
        (key, scene.numbers[key], again.numbers[key]) for key in scene.numbers
    ]
    pairs += [(part, medium(getattr(scene, part)), medium(getattr(again, part))) for part in ("film", "base")]
    pairs += [(name, getattr(scene, name), getattr(again, name)) for name in ("wavelengths", "sensor")]
    pairs.append(("uncertainty", vars(scene.uncertainty), vars(again.uncertainty)))
    _check(pairs, "{} of this surface")


def _check(parts: Iterable[tuple[str, Any, Any]], words: str) -> None:
    for name, one, other in parts:
        if not same(one, other):
            raise UsageError(f"a recipe cannot express {words.format(name)}")


def _document(tables: Mapping[str, Any]) -> str:
    """Format tables by their names; a list of tables is an array of tables, one of strings a key above all
    tables. Empty ones are left out."""
    keys, parts = [], []
    for name, content in tables.items():
        several = not isinstance(content, Mapping)
        if several and content and isinstance(content[0], str):
            keys.append(f"{_key(name)} = {_toml(content)}")
            continue
        head = f"[[{name}]]" if several else f"[{name}]"
        for table in content if several else [content]:
            if table:
                parts.append("\n".join([head, *(f"{_key(k)} = {_toml(v)}" for k, v in table.items())]))
    return "\n\n".join([*keys, *parts]) + "\n"


def _toml(thing: Any) -> str:
    """Format a string, number, truth value, list or table on one line. Raises TypeError for anything else."""
    if isinstance(thing, bool):
        return "true" if thing else "false"
    if isinstance(thing, str):
        # JSON's escapes are TOML's, except that JSON leaves DEL as it is
        return json.dumps(thing, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(thing, int):
        return str(thing)
    if isinstance(thing, float):
        return str(int(thing)) if thing.is_integer() and abs(thing) < _WHOLE else repr(thing)
    if isinstance(thing, Mapping):
        return "{ " + ", ".join(f"{_key(k)} = {_toml(v)}" for k, v in thing.items()) + " }"
    if isinstance(thing, list | tuple):
        return "[" + ", ".join(map(_toml, thing)) + "]"
    raise TypeError(f"{type(thing).__name__} has no form in TOML")


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _toml(key)
