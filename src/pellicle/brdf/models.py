"""Every BRDF by its name: its parameters with units and default bounds, and the function that evaluates it.

```python
>>> from pellicle.brdf.directions import direction
>>> from pellicle.brdf.models import model
>>> steel = model("microfacet-film")
>>> rgb = steel(steel.defaults() | {"thickness": 45.0}, direction(30, 0), direction(30, 180))
>>> rgb.shape
(3,)

```
"""

from __future__ import annotations

import difflib
from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from pellicle.brdf import film_colour, granier_heidrich
from pellicle.brdf.blinn_phong_film import PUBLISHED_WAVELENGTHS, blinn_phong_film, phase_average, published
from pellicle.brdf.microfacet import microfacet
from pellicle.brdf.shapes import Parameters

RGB = (645.0, 525.0, 445.0)
"""Wavelengths of R, G and B in nm (Granier and Heidrich 2002)."""


class Parameter(NamedTuple):
    """One key of a model: what it means, its default bounds and its default value."""

    key: str
    unit: str
    lower: float
    upper: float
    value: Any
    meaning: str
    per_channel: bool = False  # free as key_r, key_g, key_b
    log: bool = False  # spans decades
    linear: bool = False  # a weight: the BRDF is linear in it


class Model(NamedTuple):
    """A BRDF by name. Called with parameters and directions it gives (..., 3), RGB, in 1/sr."""

    name: str
    description: str
    parameters: tuple[Parameter, ...]
    evaluate: Callable[[Parameters, Any, Any], Any]
    wavelengths: tuple[float, ...] = RGB
    planned: Callable[[float], Callable] | None = None  # `evaluate` for films no thicker than so many nm

    def up_to(self, thickest: float) -> Model:
        """The same model for layers of at most `thickest` nm, and as quick as that allows."""
        return self if self.planned is None else self._replace(evaluate=self.planned(thickest))

    def __call__(self, parameters: Parameters, i: Any, o: Any) -> Float[Array, "... 3"]:
        """The BRDF for light from `i` to `o`, unit vectors (..., 3) with the normal as third axis.

        `parameters` has every key of the model, each a number or a map (...) that broadcasts with
        the directions, and may have `wavelengths` (nm, of R, G and B). A film's model also takes
        `weights` (wavelengths, 3): its reflectance at any wavelengths is then weighted to RGB.
        Below the horizon the BRDF is 0.
        """
        given = {"wavelengths": jnp.asarray(self.wavelengths, i.dtype), **parameters}
        above = (i[..., 2:3] >= 0) & (o[..., 2:3] >= 0)
        return jnp.where(above, self.evaluate(given, i, o), jnp.zeros(3, i.dtype))

    def defaults(self) -> dict[str, Any]:
        """Each key's default value; a channel's numbers as an array."""
        return {
            p.key: jnp.asarray(p.value) if isinstance(p.value, tuple) else p.value for p in self.parameters
        }


_SPECULAR = Parameter("specular", "", 0.0, 100.0, 1.0, "weight of the layered lobes", linear=True)
_GREY = Parameter("diffuse", "1/sr", 0.0, 2.0, 0.1, "grey diffuse BRDF", linear=True)
_LAYERED = Parameter("diffuse", "1/sr", 0.0, 2.0, 0.1, "weight of the layered diffuse BRDF", linear=True)
_THICKNESS = Parameter("thickness", "nm", 0.0, 1000.0, 300.0, "thickness of the layer")
_INDEX = Parameter("n", "", 1.05, 2.5, (1.5, 1.5, 1.5), "index of the layer for R, G and B", per_channel=True)
_LOBES = (
    Parameter("exponent_reflection", "", 1.0, 1000.0, 90.0, "Phong exponent of the upper boundary", log=True),
    Parameter(
        "exponent_transmission", "", 1.0, 1000.0, 170.0, "Phong exponent of the lower boundary", log=True
    ),
    Parameter("deviation", "degree", 0.0, 20.0, 0.0, "angle between the two normals"),
    Parameter("azimuth", "degree", -180.0, 180.0, 0.0, "azimuth of the lower normal"),
)
_FACETS = (
    Parameter("thickness", "nm", 0.0, 1500.0, 300.0, "thickness of the film"),
    Parameter("n", "", 1.1, 3.0, 1.5, "index of the film"),
    Parameter("k", "", 0.0, 1.0, 0.0, "extinction of the film"),
    Parameter("base_n", "", 1.05, 4.0, 2.7, "index of the base"),
    Parameter("base_k", "", 0.0, 6.0, 2.8, "extinction of the base"),
    Parameter("roughness", "", 0.003, 1.0, 0.2, "GGX alpha", log=True),
    Parameter("specular", "", 0.0, 100.0, 1.0, "weight of the facets", linear=True),
    _GREY,
)
_SHADER = (
    Parameter("thickness", "nm", 0.0, 3000.0, 250.0, "thickness of the film"),
    Parameter("n", "", 1.05, 3.0, 1.5, "index of the film"),
    Parameter("base_n", "", 1.05, 3.0, 1.25, "index of the base"),
    Parameter("ambient_n", "", 1.0, 3.0, 1.0, "index of the ambient"),
    Parameter("exponent", "", 1.0, 1000.0, 100.0, "Blinn-Phong exponent", log=True),
    Parameter("specular", "", 0.0, 100.0, 1.0, "weight of the lobe", linear=True),
    _GREY,
)


def _granier_heidrich(name: str, description: str, *options: Callable) -> Model:
    keys = (_THICKNESS, _INDEX, *_LOBES, _SPECULAR, _GREY)
    return Model(name, description, keys, granier_heidrich.specular(*options))


def _polynomial(thickest: float) -> Callable:
    return microfacet(film_colour.chebyshev(thickest))


def _shader(name: str, description: str, *reflectance: Callable) -> Model:
    return Model(name, description, _SHADER, blinn_phong_film(*reflectance), PUBLISHED_WAVELENGTHS)


_ALL = (
    _granier_heidrich("granier-heidrich", "two interfering Phong lobes, as published in 2002"),
    _granier_heidrich(
        "granier-heidrich-reciprocal",
        "the same with Fresnel factors that obey reciprocity",
        granier_heidrich.reciprocal,
    ),
    _granier_heidrich(
        "granier-heidrich-incoherent",
        "granier-heidrich without interference: what a layer must beat",
        granier_heidrich.published,
        granier_heidrich.incoherent,
    ),
    Model(
        "granier-heidrich-diffuse",
        "the diffuse part with interference, eqs. 11 to 16",
        (_THICKNESS, _INDEX, _LAYERED),
        granier_heidrich.diffuse(),
    ),
    Model(
        "granier-heidrich-full",
        "two interfering Phong lobes and the layered diffuse part",
        (_THICKNESS, _INDEX, *_LOBES, _SPECULAR, _LAYERED),
        granier_heidrich.full(),
    ),
    Model(
        "microfacet-film",
        "GGX microfacets under a film that may absorb",
        _FACETS,
        _polynomial(_FACETS[0].upper),
        planned=_polynomial,
    ),
    Model(
        "microfacet-film-exact",
        "the same with the film computed for every sample",
        _FACETS,
        microfacet(),
    ),
    _shader("blinn-phong-film", "a transparent film in a Blinn-Phong lobe"),
    _shader("blinn-phong-film-published", "the same with the shader's phase counted twice", published),
    _shader("blinn-phong-film-average", "the same averaged over the phase: no interference", phase_average),
)

MODELS: dict[str, Model] = {each.name: each for each in _ALL}
"""All models by name."""


def model(name: str) -> Model:
    """The model of this name; ValueError, with the nearest, for a name that is none."""
    if name in MODELS:
        return MODELS[name]
    near = difflib.get_close_matches(name, MODELS, 1)
    hint = f" (did you mean {near[0]!r}?)" if near else ""
    raise ValueError(f"no BRDF model {name!r}{hint}; known: {', '.join(MODELS)}")
