"""OpenPBR 1.1 as a MaterialX document: `open_pbr_surface` with a thin film.

`thin_film_thickness` is in µm. A metal has no complex index: its reflectance at normal incidence and near 82
degrees are colours.
"""

from pathlib import Path
from typing import Any

import numpy as np

from pellicle.rendering.material import Material
from pellicle.rendering.materialx import add_material, new_document, open_pbr_formula, save, set_inputs
from pellicle.rendering.targets import Target


def write(path: Path, material: Material) -> tuple[Path, ...]:
    """Write a document with one material."""
    document = new_document()
    surface = document.addNode("open_pbr_surface", "film_open_pbr", "surfaceshader")
    set_inputs(surface, inputs(material))
    add_material(document, surface, material, material.drawn.chosen.error)
    return save(document, path)


def inputs(material: Material) -> dict[str, tuple[str, Any]]:
    """Inputs of the node, by name as type and value."""
    solution, look = material.drawn.chosen, material.look
    numbers = solution.numbers
    values: dict[str, tuple[str, Any]] = {
        "specular_roughness": ("float", float(np.sqrt(look.roughness))),  # squared to GGX's α
        "thin_film_weight": ("float", float(numbers.get("weight", 1.0))),
        "thin_film_thickness": ("float", 1e-3 * solution.scale * material.thickness),
        "thin_film_ior": ("float", float(numbers["ior"])),
    }
    if look.metallic:
        return values | {
            "base_color": ("color3", np.asarray(numbers["base"]).tolist()),
            "base_metalness": ("float", 1.0),
            "specular_color": ("color3", np.asarray(numbers["edge"]).tolist()),
        }
    return values | {
        "base_weight": ("float", 0.0),
        "specular_color": ("color3", np.asarray(numbers["tint"]).tolist()),
        "specular_ior": ("float", float(numbers["base"])),
        "transmission_weight": ("float", 1.0),
    }


TARGET = Target("openpbr", "OpenPBR", (".mtlx",), ("MaterialX",), open_pbr_formula, write)
