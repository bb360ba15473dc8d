"""glTF 2.0: a sphere whose material has `KHR_materials_iridescence`.

A metal or semiconductor is a metallic material whose base colour is the base's reflectance; a transparent
base is a transmitting dielectric with `KHR_materials_ior` and `KHR_materials_specular`. Thicknesses are in
nm; a map of them is in the green channel of a texture. Both sets of numbers are in the material's `extras`.
"""

from __future__ import annotations

from importlib.metadata import version
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.files import replacing
from pellicle.rendering.appearance import Appearance
from pellicle.rendering.gltf_formula import GLTF, base_index
from pellicle.rendering.material import Material
from pellicle.rendering.sphere_mesh import sphere_mesh
from pellicle.rendering.targets import Target

_FLOAT, _INDEX = 5126, 5123
_VERTICES, _ELEMENTS = 34962, 34963


def write(path: Path, material: Material) -> tuple[Path, ...]:
    """Write a `.gltf` with its buffers inside, or a `.glb`."""
    import pygltflib

    model: Any = pygltflib.GLTF2()
    model.asset.generator = f"pellicle {version('pellicle')}"
    blob = _add_sphere(model, pygltflib)
    blob += _add_material(model, pygltflib, material, len(blob))
    model.buffers = [pygltflib.Buffer(byteLength=len(blob))]
    model.set_binary_blob(blob)
    if path.suffix.lower() == ".gltf":
        model.convert_buffers(pygltflib.BufferFormat.DATAURI)
    with replacing(path) as temporary:
        model.save(str(temporary))
    return (path,)


def extensions(material: Material) -> dict[str, dict[str, Any]]:
    """The extensions of the material, without a texture."""
    solution, look = material.drawn.chosen, material.look
    least, largest = (float(solution.scale * x) for x in (look.thickness[0], look.thickness[-1]))
    iridescence = {
        "iridescenceFactor": float(solution.numbers["factor"]),
        "iridescenceIor": float(solution.numbers["ior"]),
        "iridescenceThicknessMaximum": largest,
    }
    if material.thickness_map is not None:
        iridescence["iridescenceThicknessMinimum"] = least
    if look.metallic:
        return {"KHR_materials_iridescence": iridescence}
    base = np.asarray(solution.numbers["base"])
    brightest = float(np.max(base))
    tint = base / brightest if brightest > 0 else np.ones(3)
    return {
        "KHR_materials_iridescence": iridescence,
        "KHR_materials_ior": {"ior": float(base_index(brightest)) if brightest > 0 else 1.0},
        "KHR_materials_specular": {"specularColorFactor": tint.tolist()},
        "KHR_materials_transmission": {"transmissionFactor": 1.0},
    }


def _add_material(model: Any, gltf: Any, material: Material, offset: int) -> bytes:
    """Add the material, and return the image of its thickness for the buffer."""
    look, added = material.look, extensions(material)
    colour = np.asarray(material.drawn.chosen.numbers["base"]).tolist() if look.metallic else [1.0] * 3
    image = b""
    if material.thickness_map is not None:
        image = _thickness_image(material.thickness_map)
        model.bufferViews.append(gltf.BufferView(buffer=0, byteOffset=offset, byteLength=len(image)))
        model.images = [gltf.Image(bufferView=len(model.bufferViews) - 1, mimeType="image/png")]
        model.samplers = [gltf.Sampler(magFilter=9729, minFilter=9987, wrapS=10497, wrapT=33071)]
        model.textures = [gltf.Texture(source=0, sampler=0)]
        added["KHR_materials_iridescence"]["iridescenceThicknessTexture"] = {"index": 0}
    model.extensionsUsed = list(added)
    model.materials = [
        gltf.Material(
            name=material.name,
            pbrMetallicRoughness=gltf.PbrMetallicRoughness(
                baseColorFactor=[*colour, 1.0],
                metallicFactor=float(look.metallic),
                roughnessFactor=float(np.sqrt(look.roughness)),  # glTF squares it to GGX's α
            ),
            extensions=added,
            extras={"pellicle": material.record()},
        )
    ]
    return image


def _thickness_image(thickness: np.ndarray) -> bytes:
    """PNG whose green channel is the thickness between the least (0) and the largest (255)."""
    from PIL import Image  # a requirement of Matplotlib

    span = np.ptp(thickness)
    share = (thickness - thickness.min()) / (span if span > 0 else 1.0)
    pixels = np.zeros((*thickness.shape, 3), np.uint8)
    pixels[..., 1] = np.round(255 * share)
    written = BytesIO()
    Image.fromarray(pixels).save(written, format="PNG")
    return written.getvalue()


def _add_sphere(model: Any, gltf: Any) -> bytes:
    """Add a sphere of radius 1, and return its arrays for the buffer."""
    mesh, blob = sphere_mesh(), b""
    arrays = (
        (mesh.positions, "VEC3", _FLOAT, _VERTICES),
        (mesh.positions, "VEC3", _FLOAT, _VERTICES),  # normals of the unit sphere
        (mesh.texture, "VEC2", _FLOAT, _VERTICES),
        (mesh.triangles.reshape(-1), "SCALAR", _INDEX, _ELEMENTS),
    )
    for number, (array, kind, component, use) in enumerate(arrays):
        content = array.astype("<u2" if component == _INDEX else "<f4").tobytes()
        model.bufferViews.append(
            gltf.BufferView(buffer=0, byteOffset=len(blob), byteLength=len(content), target=use)
        )
        bounds = {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()} if number == 0 else {}
        model.accessors.append(
            gltf.Accessor(bufferView=number, componentType=component, count=len(array), type=kind, **bounds)
        )
        blob += content + b"\0" * (-len(content) % 4)
    attributes = gltf.Attributes(POSITION=0, NORMAL=1, TEXCOORD_0=2)
    model.meshes = [
        gltf.Mesh(name="sphere", primitives=[gltf.Primitive(attributes=attributes, indices=3, material=0)])
    ]
    model.nodes, model.scenes, model.scene = [gltf.Node(mesh=0, name="sphere")], [gltf.Scene(nodes=[0])], 0
    return blob


def _formula(look: Appearance) -> Any:
    return GLTF


TARGET = Target("gltf", "glTF", (".gltf", ".glb"), ("pygltflib",), _formula, write, takes_map=True)
