"""Documents of MaterialX: nodes, materials and images of numbers, from their least to their largest value."""

import json
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.files import replacing
from pellicle.rendering.formula import ColourError
from pellicle.rendering.targets import Material
from pellicle.rendering.textures import share_of_range, write_image


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
    node = document.addMaterialNode(name, shader)
    node.setDocString(
        f"{material.drawn.used} numbers: mean ΔE2000 {error.mean:.2g}, largest {error.largest:.2g}, from the"
        " exact colours, 0 to 80 degrees"
    )
    node.setAttribute("pellicle", json.dumps(material.record(), ensure_ascii=False))


def save(document: Any, path: Path) -> tuple[Path, ...]:
    """Write a document. Raises ValueError where MaterialX does not accept it."""
    valid, why = document.validate()
    if not valid:
        raise ValueError(f"MaterialX does not accept the document: {why}")
    with replacing(path) as temporary:
        _library().writeToXmlFile(document, str(temporary))
    return (path,)


def connect_thickness(
    document: Any, path: Path, material: Material, inputs: dict[str, Any], unit: float = 1.0
) -> tuple[Path, ...]:
    """Write the image of an uneven film, and connect it to inputs of nodes, in nm times `unit`."""
    if material.thickness_map is None:
        return ()
    nm = material.drawn.chosen.scale * unit * material.thickness_map
    return connect_range(document, path, "thickness", nm, inputs)


def connect_range(
    document: Any, path: Path, what: str, values: np.ndarray, inputs: dict[str, Any]
) -> tuple[Path, ...]:
    """Write the image of values between their least and largest, and connect it to inputs of nodes."""
    image, texture = _image(document, path, what, share_of_range(values))
    range_of = _node(document, "remap", f"{what}_of_image", texture.getType(), **{"in": texture})
    ends = {"outlow": values.min(axis=(0, 1)), "outhigh": values.max(axis=(0, 1))}
    set_inputs(range_of, {k: colour3(x) for k, x in ends.items()} if values.ndim > 2 else floats(**ends))
    for name, node in inputs.items():
        _connect(node, name, range_of)
    return (image,)


def connect_roughness(
    document: Any, path: Path, material: Material, surface: Any, bsdf: Any = None
) -> tuple[Path, ...]:
    """Write the image of an uneven roughness, √α, and connect it to a surface, and squared to a BSDF."""
    if material.roughness_map is None:
        return ()
    image, texture = _image(document, path, "roughness", np.sqrt(material.roughness_map))
    _connect(surface, "specular_roughness", texture)
    if bsdf is not None:
        alpha = _node(document, "multiply", "alpha", "float", in1=texture, in2=texture)
        both = _node(document, "combine2", "alpha_of_both_axes", "vector2", in1=alpha, in2=alpha)
        _connect(bsdf, "roughness", both)
    return (image,)


def _image(document: Any, path: Path, what: str, share: np.ndarray) -> tuple[Path, Any]:
    """Write an image of numbers beside the document, and add its node."""
    image = write_image(path.with_name(f"{path.stem}_{what}.png"), share)
    kind = "float" if share.ndim == 2 else "color3"
    texture = document.addNode("image", f"{what}_image", kind)
    set_inputs(texture, {"file": ("filename", image.name), "vaddressmode": ("string", "clamp")})
    return image, texture


def _node(document: Any, category: str, name: str, kind: str, **inputs: Any) -> Any:
    """Add a node whose inputs are connected to other nodes."""
    node = document.addNode(category, name, kind)
    for key, source in inputs.items():
        node.setConnectedNode(key, source)
    return node


def _connect(node: Any, name: str, source: Any) -> None:
    """Connect an input in place of its value."""
    node.removeInput(name)
    node.setConnectedNode(name, source)


def floats(**numbers: Any) -> dict[str, tuple[str, Any]]:
    """Inputs of numbers, by name."""
    return {name: ("float", float(number)) for name, number in numbers.items()}


def colour3(value: Any) -> tuple[str, Any]:
    """An input of a colour, or of a number for each channel."""
    return "color3", np.broadcast_to(np.asarray(value, float), 3).tolist()


def _library() -> Any:
    """The package MaterialX, which declares no types."""
    return import_module("MaterialX")
