"""Films to export: of scenes, of surfaces, and of fits with their best values."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.dispersion.empirical import Constant, Table, along_the_spectrum
from pellicle.effects.anisotropy import scene_media
from pellicle.errors import DataError, UsageError
from pellicle.fitting.film.parameters import parameters
from pellicle.fitting.result import Fit
from pellicle.scene.film import Scene
from pellicle.scene.free import Free, free_leaves, insert
from pellicle.scene.layers import Layer
from pellicle.scene.surface import Surface, check_scene

_SAMPLE = ("layers", "substrate", "ambient")
"""Parts of a scene that are the film: light and instrument belong to the measurement."""


class Film(NamedTuple):
    """A film, the GGX α of the facets that it covers, and sentences on what is left out of a surface."""

    scene: Scene
    roughness: float = 0.0
    notes: tuple[str, ...] = ()


def film_of(described: Scene | Surface | Fit) -> Film:
    """Return the film of a scene or a surface, or of a fit with its best values.

    **Raises:** UsageError for a surface without a film on a base, for a fit without a scene and for a
    birefringent film.
    """
    if isinstance(described, Fit):
        scene: Any = described.scene
        if scene is None:
            raise UsageError("this fit does not have its scene: export the scene itself")
        values = {name: estimate.value for name, estimate in described.parameters.items()}
        return film_of(with_values(scene[0] if isinstance(scene, tuple) else scene, values))
    check_scene(described)
    if isinstance(described, Surface):
        return _of_surface(described)
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


def _of_surface(surface: Surface) -> Film:
    """The film on the facets of a surface."""
    if surface.brdf.from_film_colour is None:
        raise UsageError(
            f"{surface.model} has no film on a base, as renderers do: export microfacet-film or"
            " blinn-phong-film"
        )
    numbers: dict[str, Any] = dict(surface.start_numbers())
    own = (("n", "k"), ("base_n", "base_k"))
    layer, base = (
        _medium(numbers, *keys) if given is None else given
        for given, keys in zip((surface.film, surface.base), own, strict=True)
    )
    scene = Scene(
        Layer(layer, float(numbers["thickness"])), base, ambient=_medium(numbers, "ambient_n", "ambient_k")
    )
    notes = []
    if np.any(numbers.get("diffuse", 0.0)):
        notes.append("the diffuse part of the surface is left out")
    if not np.all(numbers.get("specular", 1.0) == 1.0):
        notes.append("the weight of the specular part is left out: it is 1")
    if "exponent" in numbers:
        notes.append("the Blinn-Phong lobe becomes GGX facets of nearly its width")
        return Film(scene, float(np.sqrt(2 / (float(numbers["exponent"]) + 2))), tuple(notes))
    return Film(scene, float(numbers["roughness"]), tuple(notes))


def _medium(numbers: Mapping[str, Any], n: str, k: str) -> Constant | Table:
    """The index of a medium: constant, or between the wavelengths of the channels."""
    index, extinction = numbers.get(n, 1.0), numbers.get(k)
    if not np.any(extinction):
        extinction = None
    if np.ndim(index) == 0 and np.ndim(extinction if extinction is not None else 0.0) == 0:
        return Constant(float(index), None if extinction is None else float(extinction))
    nm = numbers["wavelengths"]
    table = along_the_spectrum(np.broadcast_to(index, np.shape(nm)), nm)
    if extinction is None:
        return table
    return Table(
        table.wavelength, table.n, along_the_spectrum(np.broadcast_to(extinction, np.shape(nm)), nm).n
    )
