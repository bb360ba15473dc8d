"""MaterialX 1.39 and OpenPBR 1.1: a film on a conductor or a dielectric, and as a Standard Surface.

Thicknesses are in nm; images of numbers run from their least to their largest value. A metal has its n and k
per channel, which Standard Surface writes as the colours of O. Gulbrandsen (2014, JCGT 3(4), 64), of which
MaterialX computes n and k again. Both sets of numbers are in the attribute `pellicle` of the material.
OpenPBR has a document of its own, of `open_pbr_surface`: its metals have no complex index, but a reflectance
at normal incidence and near 82 degrees.

The film colour is Belcour and Barla's formula, with polarisation and a complex base per channel. It is
`mx_fresnel_airy` of MaterialX 1.39's hardware shaders, which OpenPBR and Standard Surface share. The wave of
a channel of the base is multiplied by the sensitivity of X, Y or Z, not of red, green or blue, and XYZ
becomes RGB by a matrix of CIE RGB; renderers take the result as their linear working space.

Source: MaterialX 1.39.5, libraries/pbrlib/genglsl/lib/mx_microfacet_specular.glsl.
"""

from functools import partial
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from pellicle.rendering.appearance import Appearance
from pellicle.rendering.formula import ColourError, Formula, Key, Numbers, series
from pellicle.rendering.formula import error as colour_error
from pellicle.rendering.materialx_document import (
    add_material,
    colour3,
    connect_range,
    connect_roughness,
    connect_thickness,
    floats,
    new_document,
    save,
    set_inputs,
)
from pellicle.rendering.targets import Material, Target

XYZ_TO_RGB = np.array(
    [
        [2.3706743, -0.9000405, -0.4706338],
        [-0.5138850, 1.4253036, 0.0885814],
        [0.0052982, -0.0146949, 1.0093968],
    ]
)
"""Their matrix to CIE RGB, whose white is E."""
_PRODUCT = (1e-12, 1.0)
"""Bounds of the product of both reflectances: the root of 0 has no slope."""


def _root(x: Any) -> Any:
    """Root of numbers that may be 0, with slope 0 there."""
    positive = x > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, x, 1.0)), 0.0)


def conductor_reflectances(cosine: Any, n: Any, k: Any) -> tuple[Any, Any]:
    """Reflectances for p and s of a face between media of relative index n + ik."""
    sine2 = 1 - cosine**2
    difference = n**2 - k**2 - sine2
    both = jnp.sqrt(difference**2 + 4 * n**2 * k**2)
    double = 2 * _root(0.5 * (both + difference)) * cosine
    total = both + cosine**2
    s = (total - double) / (total + double)
    of_p, part = cosine**2 * both + sine2**2, double * sine2
    return s * (of_p - part) / (of_p + part), s


def conductor_phases(cosine: Any, above: Any, n: Any, k: Any) -> tuple[Any, Any]:
    """Phases for p and s on reflection in a medium of index `above` at a base of n + ik."""
    ratio = k / n
    a = n**2 * (1 - ratio**2) - above**2 * (1 - cosine**2)
    b = _root(a**2 + (2 * n**2 * ratio) ** 2)
    u, v = _root((a + b) / 2), _root((b - a) / 2)
    square = u**2 + v**2
    s = jnp.arctan2(2 * above * v * cosine, square - (above * cosine) ** 2)
    p = jnp.arctan2(
        2 * above * n**2 * cosine * (2 * ratio * u - (1 - ratio**2) * v),
        (n**2 * (1 + ratio**2) * cosine) ** 2 - above**2 * square,
    )
    return p, s


def hoffman_schlick(cosine: Any, normal: Any, edge: Any) -> Any:
    """Schlick's approximation of a reflectance at normal incidence, times `edge` near 82 degrees."""
    at = 1 / 7
    white = (1 - at) ** 5
    slope = (normal + (1 - normal) * white) * (1 - edge) / (at * (1 - at) ** 6)
    return normal + (1 - normal) * (1 - cosine) ** 5 - slope * cosine * (1 - cosine) ** 6


def film(index: Any, base: Any, thickness: Any, cosine: Any) -> Any:
    """Linear RGB (..., 3) of a film on a base; `base(inside, index)` gives its reflectances and phases.

    These are pairs for p and s, (..., 3), at the cosine `inside` the film.
    """
    index = jnp.maximum(index, 1.0)
    inside = jnp.sqrt(1 - (1 - cosine**2) / index**2)
    first = conductor_reflectances(cosine, index, 0.0)
    below, phases = base(inside[..., None], index)
    # the upper face from below: no turn for p beyond Brewster's angle
    from_below = (jnp.where(cosine < jnp.cos(jnp.arctan(index)), 0.0, jnp.pi), jnp.pi)
    path = 2 * index * inside * thickness
    total: Any = 0.0
    for upper, lower, turn, phase in zip(first, below, from_below, phases, strict=True):
        shift = jnp.broadcast_to(phase + jnp.asarray(turn)[..., None], (*path.shape, 3))
        total = total + series(upper[..., None], lower, path, shift, lambda xyz: xyz, _PRODUCT)
    return jnp.clip((0.5 * total) @ jnp.asarray(XYZ_TO_RGB.T), 0.0, 1.0)


def conductor(numbers: Numbers, thickness: Any, cosine: Any) -> Any:
    """Linear RGB of `conductor_bsdf` with a film."""
    n, k = (jnp.asarray(numbers[key]) for key in ("n", "k"))

    def base(inside: Any, index: Any) -> tuple[Any, Any]:
        return conductor_reflectances(inside, n / index, k / index), conductor_phases(inside, index, n, k)

    return film(jnp.asarray(numbers["ior"]), base, jnp.asarray(thickness), jnp.asarray(cosine))


def dielectric(numbers: Numbers, thickness: Any, cosine: Any) -> Any:
    """Linear RGB of `dielectric_bsdf` with a film, times its `tint`."""
    n = jnp.asarray(numbers["base"]) * jnp.ones(3)
    colour = conductor({"ior": numbers["ior"], "n": n, "k": jnp.zeros(3)}, thickness, cosine)
    return colour * jnp.asarray(numbers["tint"])


def schlick(numbers: Numbers, thickness: Any, cosine: Any) -> Any:
    """Linear RGB of `generalized_schlick_bsdf` with a film of a `weight`, as of OpenPBR's metals."""
    normal, edge = (jnp.asarray(numbers[key]) for key in ("base", "edge"))
    root = jnp.sqrt(jnp.clip(normal, 0.01, 0.99))
    n = (1 + root) / (1 - root)

    def base(inside: Any, index: Any) -> tuple[Any, Any]:
        half = 0.5 * hoffman_schlick(inside, normal, edge)
        turn = jnp.where(n < index, jnp.pi, 0.0)
        return (half, half), (turn, turn)

    with_film = film(jnp.asarray(numbers["ior"]), base, jnp.asarray(thickness), jnp.asarray(cosine))
    bare = hoffman_schlick(jnp.asarray(cosine)[..., None], normal, edge)
    return bare + numbers["weight"] * (with_film - bare)


def _physical_metal(look: Appearance) -> Numbers:
    """F0, and F82 relative to Schlick's, of the bare base."""
    at = 1 / 7
    p, s = conductor_reflectances(at, np.real(look.base), np.imag(look.base))
    white = look.bare + (1 - look.bare) * (1 - at) ** 5
    edge = np.clip(np.asarray(0.5 * (p + s)) / white, 0.0, 1.0)
    return {"ior": look.index, "base": look.bare, "edge": edge, "weight": 1.0}


_FILM = Key("ior", 1.0, 4.0)
CONDUCTOR = Formula(
    "MaterialX's conductor with a film",
    (_FILM, Key("n", 0.05, 8.0, 3), Key("k", 0.0, 8.0, 3)),
    conductor,
    lambda look: {"ior": look.index, "n": np.real(look.base), "k": np.imag(look.base)},
)
DIELECTRIC = Formula(
    "MaterialX's dielectric with a film",
    (_FILM, Key("base", 1.0, 4.0), Key("tint", 0.0, 1.0, 3)),
    dielectric,
    lambda look: {"ior": look.index, "base": np.real(look.base[..., 1]), "tint": np.ones(3)},
)
METAL = Formula(
    "OpenPBR's metal with a film",
    (_FILM, Key("base", 0.0, 1.0, 3), Key("edge", 0.0, 1.0, 3), Key("weight", 0.25, 1.0)),
    schlick,
    _physical_metal,
)


def formula(look: Appearance, metal: Formula = CONDUCTOR) -> Formula:
    """The formula of MaterialX's own nodes, and of Standard Surface, for a base; with `METAL` of OpenPBR."""
    return metal if look.metallic else DIELECTRIC


_BRIGHTEST = 0.99
"""Largest reflectance of MaterialX's `artistic_ior`."""


def write(path: Path, material: Material) -> tuple[Path, ...]:
    """Write a document with two materials, of MaterialX's own nodes and of a Standard Surface."""
    document = new_document()
    category, name, inputs = bsdf_of(material)
    bsdf = document.addNode(category, name, "BSDF")
    set_inputs(bsdf, inputs)
    surface = document.addNode("surface", "film_surface", "surfaceshader")
    surface.setConnectedNode("bsdf", bsdf)
    add_material(document, surface, material, material.drawn.chosen.error)
    standard = document.addNode("standard_surface", "film_standard_surface", "surfaceshader")
    set_inputs(standard, standard_surface(material))
    add_material(document, standard, material, standard_surface_error(material), "_standard_surface")
    inputs = {"thinfilm_thickness": bsdf, "thin_film_thickness": standard}
    images = connect_thickness(document, path, material, inputs)
    for what, values, nodes in base_images(material, bsdf, standard):
        images += connect_range(document, path, what, values, nodes)
    images += connect_roughness(document, path, material, standard, bsdf)
    return (*save(document, path), *images)


def bsdf_of(material: Material) -> tuple[str, str, dict[str, tuple[str, Any]]]:
    """Category, name and inputs of the node of the film, by name as type and value."""
    solution, look = material.drawn.chosen, material.look
    numbers = solution.numbers
    inputs = {"roughness": ("vector2", [look.roughness] * 2)}
    inputs |= floats(thinfilm_thickness=solution.scale * material.thickness, thinfilm_ior=numbers["ior"])
    if look.metallic:
        colours = {"ior": colour3(numbers["n"]), "extinction": colour3(numbers["k"])}
        return "conductor_bsdf", "film_conductor", colours | inputs
    glass = {
        "tint": colour3(numbers["tint"]),
        **floats(ior=numbers["base"]),
        "scatter_mode": ("string", "RT"),
    }
    return "dielectric_bsdf", "film_dielectric", glass | inputs


def standard_surface(material: Material) -> dict[str, tuple[str, Any]]:
    """Inputs of a Standard Surface, by name as type and value."""
    solution, look = material.drawn.chosen, material.look
    numbers = solution.numbers
    inputs = floats(
        specular=1.0,
        specular_roughness=np.sqrt(look.roughness),  # squared to GGX's α
        thin_film_thickness=solution.scale * material.thickness,
        thin_film_IOR=numbers["ior"],
    )
    if look.metallic:
        reflectance, edge = artistic_colours(numbers["n"], numbers["k"])
        colours = {"base_color": colour3(reflectance), "specular_color": colour3(edge)}
        return inputs | colours | floats(base=1.0, metalness=1.0)
    glass = floats(base=0.0, specular_IOR=numbers["base"], transmission=1.0)
    return inputs | glass | {"specular_color": colour3(numbers["tint"])}


def artistic_colours(n: Any, k: Any) -> tuple[np.ndarray, np.ndarray]:
    """Reflectance at normal incidence and edge colour of n + ik, after Gulbrandsen (2014).

    Reflectances above 0.99 become 0.99, as in MaterialX.
    """
    n, k = np.asarray(n, float), np.asarray(k, float)
    reflectance = np.minimum(((n - 1) ** 2 + k**2) / ((n + 1) ** 2 + k**2), _BRIGHTEST)
    root = np.sqrt(reflectance)
    largest, least = (1 + root) / (1 - root), (1 - reflectance) / (1 + reflectance)
    span = largest - least
    edge = np.where(span > 0, (largest - n) / np.where(span > 0, span, 1.0), 1.0)
    return reflectance, np.clip(edge, 0.0, 1.0)


def artistic_index(reflectance: Any, edge: Any) -> tuple[np.ndarray, np.ndarray]:
    """n and k of a reflectance at normal incidence and an edge colour, as MaterialX computes them."""
    root = np.sqrt(reflectance)
    largest, least = (1 + root) / (1 - root), (1 - reflectance) / (1 + reflectance)
    n = largest + (least - largest) * edge
    k2 = ((n + 1) ** 2 * reflectance - (n - 1) ** 2) / (1 - reflectance)
    return n, np.sqrt(np.maximum(k2, 0.0))


def base_images(material: Material, bsdf: Any, standard: Any) -> list[tuple[str, np.ndarray, dict[str, Any]]]:
    """Images of a base by name, with the inputs of both nodes that take each."""
    images = material.base_images
    if not images:
        return []
    if not material.look.metallic:
        return [("ior", images["base"], {"ior": bsdf, "specular_IOR": standard})]
    n, k = (images.get(key, material.drawn.chosen.numbers[key]) for key in ("n", "k"))
    named = {"base_color": standard, "specular_color": standard}
    of_standard = zip(named.items(), artistic_colours(n, k), strict=True)
    return [
        *(
            (name, images[key], {name: bsdf})
            for key, name in (("n", "ior"), ("k", "extinction"))
            if key in images
        ),
        *((name, values, {name: node}) for (name, node), values in of_standard),
    ]


def standard_surface_error(material: Material) -> ColourError:
    """The error of a Standard Surface, whose two colours cannot say every n and k of a metal."""
    drawn, look = material.drawn, material.look
    if not look.metallic:
        return drawn.chosen.error
    numbers = drawn.chosen.numbers
    if material.base_texture is not None:
        numbers = material.base_texture.at_texels(numbers)
    n, k = artistic_index(*artistic_colours(numbers["n"], numbers["k"]))
    return colour_error(CONDUCTOR, look, {**numbers, "n": n, "k": k}, drawn.chosen.scale)


def write_open_pbr(path: Path, material: Material) -> tuple[Path, ...]:
    """Write a document with one material, an `open_pbr_surface`."""
    document = new_document()
    surface = document.addNode("open_pbr_surface", "film_open_pbr", "surfaceshader")
    set_inputs(surface, open_pbr(material))
    add_material(document, surface, material, material.drawn.chosen.error)
    images = connect_thickness(document, path, material, {"thin_film_thickness": surface}, unit=1e-3)
    metal = {"base": "base_color", "edge": "specular_color"}
    names = metal if material.look.metallic else {"base": "specular_ior"}
    for key, values in material.base_images.items():
        images += connect_range(document, path, names[key], values, {names[key]: surface})
    images += connect_roughness(document, path, material, surface)
    return (*save(document, path), *images)


def open_pbr(material: Material) -> dict[str, tuple[str, Any]]:
    """Inputs of an OpenPBR surface, by name as type and value; its thickness is in µm."""
    solution, look = material.drawn.chosen, material.look
    numbers = solution.numbers
    values = floats(
        specular_roughness=np.sqrt(look.roughness),  # squared to GGX's α
        thin_film_weight=numbers.get("weight", 1.0),
        thin_film_thickness=1e-3 * solution.scale * material.thickness,
        thin_film_ior=numbers["ior"],
    )
    if look.metallic:
        colours = {"base_color": colour3(numbers["base"]), "specular_color": colour3(numbers["edge"])}
        return values | colours | floats(base_metalness=1.0)
    glass = floats(base_weight=0.0, specular_ior=numbers["base"], transmission_weight=1.0)
    return values | glass | {"specular_color": colour3(numbers["tint"])}


TARGET = Target("materialx", "MaterialX", (".mtlx",), ("MaterialX",), formula, write, takes_map=True)
OPEN_PBR = Target(
    "openpbr", "OpenPBR", (".mtlx",), ("MaterialX",), partial(formula, metal=METAL), write_open_pbr, True
)
