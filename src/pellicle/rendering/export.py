"""Export of a film to a renderer, with the error of the renderer's formula.

Films are those of scenes, of surfaces, and of fits with their best values.
"""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.dispersion.empirical import Constant, Table, along_the_spectrum
from pellicle.effects.presence import scene_media
from pellicle.errors import DataError, UsageError
from pellicle.files import write_text
from pellicle.fitting.film.parameters import parameters
from pellicle.fitting.result import Fit
from pellicle.rendering.appearance import Appearance, appearance
from pellicle.rendering.base_texture import (
    Base,
    base_at_texels,
    base_parameters,
    base_texture,
    compared_texels,
)
from pellicle.rendering.formula import effective, physical
from pellicle.rendering.targets import SETS, Material, Solved, target
from pellicle.rendering.textures import MappedFilm, mapped_film, roughness_image
from pellicle.scene.film import Scene
from pellicle.scene.free import Free, free_leaves, insert
from pellicle.scene.layers import Layer
from pellicle.scene.surface import Surface, check_scene

_NODES = 9
"""Thicknesses of a map at which colours are compared: its quantiles from the least to the largest."""


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
    roughness_map: Any = None,
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
    if not chosen.takes_map and (thickness_map is not None or roughness_map is not None):
        raise UsageError(
            f"{chosen.title} takes no textures of thickness or roughness: choose another target, or export"
            " the recipe alone"
        )
    mapped = None if thickness_map is None else mapped_film(thickness_map, layer)
    rough = None if roughness_map is None else roughness_image(roughness_map)
    look, base, texels = _look(scene, mapped, layer, textured=chosen.formula is not None)
    lacking = () if chosen.formula is None else look.lacking  # tables have the colours of any film
    look = replace(look, notes=(*lacking, *look.notes))
    solved, texture = None, None
    if chosen.formula is not None:
        formula = chosen.formula(look)
        if base is not None:
            texture = base_texture(formula, look, base, texels)
            formula = texture.over(formula)
        try:
            solved = Solved(formula, physical(formula, look), effective(formula, look), numbers)
        except ImportError as missing:  # colour-science
            raise UsageError(str(missing)) from None
    material = Material(out.stem, look, solved, None if mapped is None else mapped.thickness, rough, texture)
    files = chosen.write(out, material)
    text = json.dumps({"target": to} | material.record(), ensure_ascii=False, indent=1, allow_nan=False)
    write_text(record, text + "\n")
    return Export(to, chosen.title, (*files, record), material)


def _look(
    scene: Scene | Surface | Fit, mapped: MappedFilm | None, layer: str | None, textured: bool
) -> tuple[Appearance, Base | None, np.ndarray]:
    """Colours of a film at its thickness, or at texels of a map, with its notes.

    Where the parameters of the base differ over the map, and it can be `textured`, also the base, and the
    texels at which the colours are.
    """
    if mapped is None:
        return _with_notes(film_of(scene), None, layer), None, np.empty(0, int)
    medians = {} if isinstance(scene, Fit) else dict(mapped.medians)  # a fit has values of its own
    base, texels, images = None, np.empty(0, int), dict[str, np.ndarray]()
    films = scene if isinstance(scene, Fit) or not mapped.values else with_values(scene, mapped.values)
    nm = np.unique(np.quantile(mapped.thickness, np.linspace(0.0, 1.0, _NODES)))
    names = base_parameters(films, mapped.others) if textured and isinstance(films, Scene) else []
    if isinstance(films, Scene) and names:
        images = {name: mapped.others[name] for name in names}
        texels = compared_texels([mapped.thickness, *images.values()])
        nm, base = np.ravel(mapped.thickness)[texels], base_at_texels(films, images)
    look = _with_notes(film_of(films), nm, layer)
    if base is not None and not isinstance(scene, Fit):
        at = [
            mapped.values | {name: float(np.ravel(image)[i]) for name, image in images.items()}
            for i in texels
        ]
        films = [film_of(with_values(scene, values)).scene for values in at]
        xyz = [appearance(each, x, layer).xyz[0] for each, x in zip(films, nm, strict=True)]
        look = replace(look, thickness=nm, xyz=np.stack(xyz))
        medians |= {name: _textured(name, image, mapped.values[name]) for name, image in images.items()}
        mapped = mapped._replace(notes=(*mapped.notes, *filter(None, [base.note])))
    return replace(look, notes=(*look.notes, *mapped.notes, *medians.values())), base, texels


def _textured(name: str, image: np.ndarray, median: float) -> str:
    """A sentence on a parameter of a base with a texture."""
    return (
        f"{name} is a texture, {image.min():.4g} to {image.max():.4g}; the numbers of the base are those of"
        f" its median, {median:.4g}"
    )


def _with_notes(film: "Film", thickness: np.ndarray | None, layer: str | None) -> Appearance:
    look = appearance(film.scene, thickness, layer)
    return replace(look, roughness=film.roughness, notes=(*look.notes, *film.notes))


_SAMPLE = ("layers", "substrate", "ambient")
"""Parts of a scene that are the film: light and instrument belong to the measurement."""


class Film(NamedTuple):
    """A film, the GGX α of the facets that it covers, and sentences on what is left out of a surface."""

    scene: Scene
    roughness: float = 0.0
    notes: tuple[str, ...] = ()


def film_of(described: Scene | Surface | Fit) -> Film:
    """Return the film of a scene or a surface, or of a fit with its best values.

    **Raises:** UsageError for a surface other than a film on a base in air, for a fit without a scene and for
    a birefringent film.
    """
    if isinstance(described, Fit):
        scene: Any = described.scene
        if scene is None:
            raise UsageError("this fit does not have its scene: export the scene itself")
        values = {name: estimate.value for name, estimate in described.parameters.items()}
        return film_of(with_values(scene[0] if isinstance(scene, tuple) else scene, values))
    check_scene(described)
    if isinstance(described, Surface):
        # the film on the facets of a surface
        numbers: dict[str, Any] = dict(described.start_numbers())
        if described.brdf.from_film_colour is None or "coat_n" in numbers:
            raise UsageError(
                f"{described.model} is not a film on a base in air, as renderers have: export"
                " microfacet-film or blinn-phong-film"
            )
        layer = _medium(numbers, "n", "k") if described.film is None else described.film
        base = _medium(numbers, "base_n", "base_k") if described.base is None else described.base
        ambient = _medium(numbers, "ambient_n", "ambient_k")
        scene = Scene(Layer(layer, float(numbers["thickness"])), base, ambient=ambient)
        notes = []
        if np.any(numbers.get("diffuse", 0.0)):
            notes.append("the diffuse part of the surface is left out")
        if not np.all(numbers.get("specular", 1.0) == 1.0):
            notes.append("the weight of the specular part is left out: it is 1")
        if np.any(numbers.get("multiple_scattering", 0.0)):
            notes.append("light reflected more than once between facets is left out")
        if "exponent" in numbers:
            notes.append("the Blinn-Phong lobe becomes GGX facets of nearly its width")
            return Film(scene, float(np.sqrt(2 / (float(numbers["exponent"]) + 2))), tuple(notes))
        return Film(scene, float(numbers["roughness"]), tuple(notes))
    if any(isinstance(medium, Anisotropic) for medium in scene_media(described)):
        raise UsageError(
            "a birefringent film is not exported: materials of renderers have one index: give it one"
        )
    return Film(described)


def with_values(described: Scene | Surface, values: Mapping[str, float]) -> Scene | Surface:
    """Return a scene or a surface whose free parameters start at values by name.

    Free numbers of the light and the instrument keep their start values where they have none.

    **Raises:** DataError where a free number of the film has no value.
    """
    if isinstance(described, Surface):
        numbers: dict[str, Any] = dict(described.numbers)
        for free in described.free_numbers():
            value = _value(values, free.name)
            own = numbers[free.key]
            if free.channel is None:
                numbers[free.key] = value
            else:
                numbers[free.key] = [*([] if isinstance(own, Free) else own), value]
        return replace(described, numbers=numbers)
    leaves = []
    for (path, free), parameter in zip(free_leaves(described), parameters(described), strict=True):
        name: Any = path[0]
        if name.name not in _SAMPLE and parameter.name not in values:
            leaves.append(free)
            continue
        value = _value(values, parameter.name)
        leaves.append(Free(min(free.lower, value), max(free.upper, value), start=value))
    return insert(described, leaves)


def _value(values: Mapping[str, float], name: str) -> float:
    if values.get(name) is None:
        raise DataError(
            f"the fit has no value of {name}, which its scene leaves free: give the scene it is of"
        )
    return values[name]


def _medium(numbers: Mapping[str, Any], n: str, k: str) -> Constant | Table:
    """The index of a medium: constant, or between the wavelengths of the channels."""
    index, extinction = numbers.get(n, 1.0), numbers.get(k)
    if not np.any(extinction):
        extinction = None
    if np.ndim(index) == 0 and np.ndim(extinction if extinction is not None else 0.0) == 0:
        return Constant(float(index), None if extinction is None else float(extinction))
    nm = numbers["wavelengths"]
    known = [x for x in (index, extinction) if x is not None]
    tables = [along_the_spectrum(np.broadcast_to(x, np.shape(nm)), nm) for x in known]
    return Table(tables[0].wavelength, *(table.n for table in tables))
