"""BRDF models by name, with the units and default bounds of their parameters.

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
from typing import Any, NamedTuple, TypeAlias

import jax.numpy as jnp
from jaxtyping import Array, Float

from pellicle.brdf import film_colour, granier_heidrich
from pellicle.brdf.directions import Vectors
from pellicle.brdf.lobes import Evaluate, Parameters, blinn_phong, column, weighted_sum
from pellicle.brdf.microfacet import clear_coat, microfacet

RGB = (645.0, 525.0, 445.0)
"""Wavelengths of R, G and B in nm (Granier and Heidrich 2002)."""


class Parameter(NamedTuple):
    """One parameter of a model: its key, unit, default bounds, default value and meaning."""

    key: str
    unit: str
    lower: float
    upper: float
    value: Any
    meaning: str
    per_channel: bool = False  # free as key_r, key_g, key_b
    log: bool = False  # spans decades
    linear: bool = False  # a weight: the BRDF is linear in it


FromColour: TypeAlias = Callable[[film_colour.Colour], Evaluate]


class Model(NamedTuple):
    """A BRDF model; `model(parameters, i, o)` evaluates it, (..., 3), RGB, in 1/sr."""

    name: str
    description: str
    parameters: tuple[Parameter, ...]
    evaluate: Evaluate
    incoherent: Evaluate  # without interference: the alternative to a layer
    wavelengths: tuple[float, ...] = RGB
    from_film_colour: FromColour | None = None  # `evaluate`, from the function for the film's colour

    def for_thickness_up_to(self, thickest: float) -> Model:
        """Return the model with the cheapest evaluation that serves layers of at most `thickest` nm."""
        if self.from_film_colour is None:
            return self
        return self.by_nodes(film_colour.node_count(thickest))

    def by_nodes(self, count: int) -> Model:
        """Return the model with the film's colour by `count` nodes (`node_count`), itself for 0 of them."""
        if self.from_film_colour is None or not count:
            return self
        return self._replace(evaluate=self.from_film_colour(film_colour.interpolated(count)))

    def without_interference(self) -> Model:
        """Return the model without interference: averaged over the phase, or lobes added as intensities."""
        return self._replace(evaluate=self.incoherent, from_film_colour=None)

    def __call__(self, parameters: Parameters, i: Vectors, o: Vectors) -> Float[Array, "... channels"]:
        """Evaluate the BRDF (1/sr) for light from `i` to `o`.

        **Arguments:**

        - `parameters` has every key of the model, each a number or a map (...) that broadcasts with the
          directions. Without `k`, `base_k`, `deviation`, `multiple_scattering`, `specular`, `coat` or
          `diffuse` that effect is absent and costs nothing. `wavelengths` (nm) are one for each channel, R, G
          and B by default; with `weights` (wavelengths, channels), the bands of a sensor, they are any.
        - `i`, `o`: unit vectors (..., 3) away from the surface, with the normal as third axis.

        **Returns:** (..., 3), or one value for each wavelength; 0 below the horizon.
        """
        values = {"wavelengths": self.wavelengths, **parameters}
        arrays = {k: jnp.asarray(x, i.dtype) if isinstance(x, tuple | list) else x for k, x in values.items()}
        above = (i[..., 2:3] >= 0) & (o[..., 2:3] >= 0)
        return jnp.where(above, self.evaluate(arrays, i, o), 0.0)

    def defaults(self) -> dict[str, Any]:
        """Return the default value of each parameter; one that differs by channel as an array."""
        return {p.key: jnp.asarray(p.value) if p.per_channel else p.value for p in self.parameters}


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
    Parameter("multiple_scattering", "", 0.0, 1.0, 0.0, "1 with light reflected more than once, 0 without"),
    Parameter("specular", "", 0.0, 100.0, 1.0, "weight of the facets", linear=True),
    _GREY,
)
_COATED = (
    *_FACETS[:-1],
    Parameter("coat_n", "", 1.1, 2.0, 1.5, "index of the clear coat"),
    Parameter("coat_roughness", "", 0.003, 1.0, 0.05, "GGX alpha of the coat's face", log=True),
    Parameter("coat", "", 0.0, 100.0, 1.0, "weight of the coat's lobe", linear=True),
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


def _granier_heidrich(
    name: str,
    description: str,
    make: Callable,
    fresnel: granier_heidrich.Fresnel,
    diffuse: Parameter = _GREY,
) -> Model:
    keys = (_THICKNESS, _INDEX, *_LOBES, _SPECULAR, diffuse)
    return Model(
        name, description, keys, make(fresnel), incoherent=make(fresnel, granier_heidrich.incoherent)
    )


def blinn_phong_film(colour: film_colour.Colour = film_colour.exact) -> Evaluate:
    """Return the BRDF specular · ⟨n, h⟩₊^e R(⟨o, h⟩) + diffuse; the lobe is not normalised, as published."""

    def evaluate(parameters, i, o):
        lobe = column(blinn_phong(i, o, parameters["exponent"]))
        return weighted_sum(parameters, lambda: lobe * colour(parameters, i, o))

    return evaluate


def _shader(
    name: str, description: str, colour: film_colour.Colour, from_film_colour: FromColour | None
) -> Model:
    average = blinn_phong_film(film_colour.per_sample(film_colour.phase_average))
    evaluate, wavelengths = blinn_phong_film(colour), film_colour.SHADER_WAVELENGTHS
    return Model(name, description, _SHADER, evaluate, average, wavelengths, from_film_colour)


_ALL = (
    _granier_heidrich(
        "granier-heidrich",
        "two interfering Phong lobes, as published in 2002",
        granier_heidrich.specular,
        granier_heidrich.published,
    ),
    _granier_heidrich(
        "granier-heidrich-reciprocal",
        "two interfering Phong lobes, with reciprocal Fresnel factors",
        granier_heidrich.specular,
        granier_heidrich.reciprocal,
    ),
    Model(
        "granier-heidrich-diffuse",
        "the diffuse part with interference, eqs. 11 to 16",
        (_THICKNESS, _INDEX, _LAYERED),
        granier_heidrich.diffuse(),
        granier_heidrich.diffuse(granier_heidrich.incoherent),
    ),
    _granier_heidrich(
        "granier-heidrich-full",
        "two interfering Phong lobes and the layered diffuse part",
        granier_heidrich.full,
        granier_heidrich.published,
        _LAYERED,
    ),
    Model(
        "microfacet-film",
        "GGX microfacets under a film that may absorb",
        _FACETS,
        microfacet(),
        microfacet(film_colour.incoherent),
        from_film_colour=microfacet,
    ),
    Model(
        "clear-coat-film",
        "GGX microfacets under a film, under a clear coat with a lobe of its own",
        _COATED,
        clear_coat(),
        clear_coat(film_colour.incoherent),
        from_film_colour=clear_coat,
    ),
    _shader(
        "blinn-phong-film",
        "a transparent film in a Blinn-Phong lobe",
        film_colour.exact,
        blinn_phong_film,
    ),
    _shader(
        "blinn-phong-film-published",
        "a transparent film in a Blinn-Phong lobe, with the phase error of the published shader",
        film_colour.per_sample(film_colour.published_shader),
        None,
    ),
)

MODELS: dict[str, Model] = {each.name: each for each in _ALL}
"""All models by name."""


def model(name: str) -> Model:
    """Return the model of this name.

    **Raises:** ValueError for an unknown name, with the nearest known one.
    """
    if name in MODELS:
        return MODELS[name]
    near = difflib.get_close_matches(name, MODELS, 1)
    hint = f" (did you mean {near[0]!r}?)" if near else ""
    raise ValueError(f"no BRDF model {name!r}{hint}; known: {', '.join(MODELS)}")


_PHONG = {
    "thickness": 71.0,
    "n": (1.4, 1.45, 1.6),
    "exponent_reflection": 90.0,
    "exponent_transmission": 170.0,
    "azimuth": 0.0,
    "specular": 1.0,
}

PRESETS: dict[str, tuple[str, dict[str, Any]]] = {
    "granier-heidrich figure 3, parallel": (
        "granier-heidrich-full",
        _PHONG | {"deviation": 0.0, "diffuse": 0.7},
    ),
    "granier-heidrich figure 3, deviated": (
        "granier-heidrich-full",
        _PHONG | {"deviation": 10.0, "diffuse": 0.7},
    ),
    "granier-heidrich figure 4": ("granier-heidrich", _PHONG | {"deviation": 10.0, "diffuse": 0.0}),
    "tempered steel": (
        "microfacet-film",
        {
            "thickness": 40.0,
            "n": 2.9,
            "k": 0.0,
            "base_n": 2.7,
            "base_k": 2.8,
            "roughness": 0.2,
            "multiple_scattering": 0.0,
            "specular": 1.0,
            "diffuse": 0.0,
        },
    ),
}
"""The thickness is the middle of the published range: Granier and Heidrich vary it from 66 to
76 nm in their figures 3 and 4; the figure of tempered steel, from 10 to 70 nm."""
