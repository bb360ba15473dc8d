"""MaterialX 1.39: a film on a conductor or a dielectric, and the same as a Standard Surface.

Thicknesses are in nm. A metal has its n and k per channel, which Standard Surface writes as the colours of
O. Gulbrandsen (2014, JCGT 3(4), 64), of which MaterialX computes n and k again. Both sets of numbers are in
the attribute `pellicle` of the material.
"""

from __future__ import annotations

import json
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.files import replacing
from pellicle.rendering.effective import ColourError
from pellicle.rendering.effective import error as colour_error
from pellicle.rendering.material import Material
from pellicle.rendering.materialx_formula import formula
from pellicle.rendering.targets import Target

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
    return save(document, path)


def new_document() -> Any:
    """An empty document whose colours are linear, with the primaries of sRGB."""
    document = _library().createDocument()
    document.setColorSpace("lin_rec709")
    document.setAttribute("generator", f"pellicle {version('pellicle')}")
    return document


def set_inputs(node: Any, inputs: dict[str, tuple[str, Any]]) -> None:
    """Set the inputs of a node, given as type and value."""
    kinds = {"color3": _library().Color3, "vector2": _library().Vector2}
    for name, (kind, value) in inputs.items():
        convert = kinds.get(kind)
        node.setInputValue(name, convert(*value) if convert else value, kind)


def add_material(
    document: Any, shader: Any, material: Material, error: ColourError, ending: str = ""
) -> None:
    """Add a material of a shader with its error, and with both sets of numbers."""
    name = document.createValidChildName(material.name + ending)
    found = document.addMaterialNode(name, shader)
    found.setDocString(
        f"{material.drawn.used} numbers: mean ΔE2000 {error.mean:.2g}, largest {error.largest:.2g}, from the"
        " exact colours, 0 to 80 degrees"
    )
    found.setAttribute("pellicle", json.dumps(material.record(), ensure_ascii=False))


def save(document: Any, path: Path) -> tuple[Path, ...]:
    """Write a document. Raises ValueError where MaterialX does not accept it."""
    valid, why = document.validate()
    if not valid:
        raise ValueError(f"MaterialX does not accept the document: {why}")
    with replacing(path) as temporary:
        _library().writeToXmlFile(document, str(temporary))
    return (path,)


def bsdf_of(material: Material) -> tuple[str, str, dict[str, tuple[str, Any]]]:
    """Category, name and inputs of the node of the film, by name as type and value."""
    solution, look = material.drawn.chosen, material.look
    numbers = solution.numbers
    inputs: dict[str, tuple[str, Any]] = {
        "roughness": ("vector2", [look.roughness] * 2),
        "thinfilm_thickness": ("float", solution.scale * material.thickness),
        "thinfilm_ior": ("float", float(numbers["ior"])),
    }
    if look.metallic:
        colours = {"ior": ("color3", _list(numbers["n"])), "extinction": ("color3", _list(numbers["k"]))}
        return "conductor_bsdf", "film_conductor", colours | inputs
    glass: dict[str, tuple[str, Any]] = {
        "tint": ("color3", _list(numbers["tint"])),
        "ior": ("float", float(numbers["base"])),
        "scatter_mode": ("string", "RT"),
    }
    return "dielectric_bsdf", "film_dielectric", glass | inputs


def standard_surface(material: Material) -> dict[str, tuple[str, Any]]:
    """Inputs of a Standard Surface, by name as type and value."""
    solution, look = material.drawn.chosen, material.look
    numbers = solution.numbers
    inputs: dict[str, tuple[str, Any]] = {
        "specular": ("float", 1.0),
        "specular_roughness": ("float", float(np.sqrt(look.roughness))),  # squared to GGX's α
        "thin_film_thickness": ("float", solution.scale * material.thickness),
        "thin_film_IOR": ("float", float(numbers["ior"])),
    }
    if look.metallic:
        reflectance, edge = artistic_colours(numbers["n"], numbers["k"])
        return inputs | {
            "base": ("float", 1.0),
            "base_color": ("color3", _list(reflectance)),
            "specular_color": ("color3", _list(edge)),
            "metalness": ("float", 1.0),
        }
    return inputs | {
        "base": ("float", 0.0),
        "specular_color": ("color3", _list(numbers["tint"])),
        "specular_IOR": ("float", float(numbers["base"])),
        "transmission": ("float", 1.0),
    }


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


def standard_surface_error(material: Material) -> ColourError:
    """The error of a Standard Surface, whose two colours cannot say every n and k of a metal."""
    drawn, look = material.drawn, material.look
    if not look.metallic:
        return drawn.chosen.error
    n, k = artistic_index(*artistic_colours(drawn.chosen.numbers["n"], drawn.chosen.numbers["k"]))
    return colour_error(drawn.formula, look, {**drawn.chosen.numbers, "n": n, "k": k}, drawn.chosen.scale)


def _list(value: Any) -> list[float]:
    return np.broadcast_to(np.asarray(value, float), 3).tolist()


def _library() -> Any:
    """The package MaterialX, which declares no types."""
    return import_module("MaterialX")


TARGET = Target("materialx", "MaterialX", (".mtlx",), ("MaterialX",), formula, write)
