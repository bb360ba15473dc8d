"""glTF 2.0: a sphere whose material has `KHR_materials_iridescence`.

A metal or semiconductor is a metallic material whose base colour is the base's reflectance; a transparent
base is a transmitting dielectric with `KHR_materials_ior` and `KHR_materials_specular`. Thicknesses are in
nm; a map of them is in the green channel of a texture, one of the base in that of the base colour, or of the
specular colour. Both sets of numbers are in the material's `extras`.

The film colour is the approximation of Belcour and Barla that the extension publishes. Fresnel's equations
are replaced by Schlick's at both faces, polarisation and the base's extinction are left out. three.js and
Babylon.js use the same code, but for a guard of the base's reflectance (`GLTF_GUARDED`).

Source: Khronos, KHR_materials_iridescence, "Implementation Notes" (2022).
"""

from dataclasses import replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from pellicle.colour import srgb
from pellicle.files import replacing
from pellicle.rendering.appearance import Appearance
from pellicle.rendering.formula import Formula, Key, Numbers, series
from pellicle.rendering.targets import Material, Target
from pellicle.rendering.textures import png, share_of_range

XYZ_TO_REC709 = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)


def schlick(normal: Any, cosine: Any) -> Any:
    """Reflectance of a face by Schlick's approximation, of that at normal incidence."""
    return normal + (1 - normal) * (1 - cosine) ** 5


def base_index(normal: Any) -> Any:
    """Index of a base in air, of its reflectance at normal incidence."""
    normal = jnp.clip(normal, 0.0, 0.9999)
    lit = normal > 0  # the root of 0 has no slope
    root = jnp.where(lit, jnp.sqrt(jnp.where(lit, normal, 1.0)), 0.0)
    return (1 + root) / (1 - root)


_PRODUCT = (1e-5, 0.9999)
"""Bounds of the product of both reflectances in the published code."""


_GUARD = 1e-4
"""Reflectance that the extension's own code adds to that of the base, where three.js limits it to 0.9999."""


def film(index: Any, below: Any, thickness: Any, cosine: Any) -> Any:
    """Reflectance (..., 3) of a film of one `index` on a base of indices `below` (3,) in air, linear sRGB."""
    # without a film its index becomes that of air
    ratio = jnp.clip(thickness / 0.03, 0.0, 1.0)
    index = 1 + (index - 1) * ratio**2 * (3 - 2 * ratio)
    inside = jnp.sqrt(1 - (1 - cosine**2) / index**2)
    first = schlick(((index - 1) / (index + 1)) ** 2, cosine)[..., None]
    index = jnp.asarray(index)[..., None]
    second = schlick(((below - index) / (below + index)) ** 2, inside[..., None])
    shift = jnp.pi + jnp.where(below < index, jnp.pi, 0.0)
    path = 2 * index[..., 0] * thickness * inside
    shift = jnp.broadcast_to(shift, (*path.shape, 3))
    total = series(first, second, path, shift, lambda xyz: xyz @ jnp.asarray(XYZ_TO_REC709.T), _PRODUCT)
    return jnp.maximum(total, 0.0)


def colour(numbers: Numbers, thickness: Any, cosine: Any, guard: float = 0.0) -> Any:
    """Linear sRGB (..., 3): the film's, mixed with the base's own where `factor` is below 1.

    `guard` is added to the base's reflectance where its index is computed.
    """
    base = jnp.asarray(numbers["base"])
    below = base_index(base + guard)
    with_film = film(jnp.asarray(numbers["ior"]), below, jnp.asarray(thickness), jnp.asarray(cosine))
    bare = schlick(base, jnp.asarray(cosine)[..., None])
    return bare + numbers["factor"] * (with_film - bare)


def physical(look: Appearance) -> Numbers:
    """Index of the layer at 550 nm, and the reflectance of the base at normal incidence."""
    base = look.bare
    if not look.metallic:
        n = np.real(look.base[..., 1:2])
        base = ((n - 1) / (n + 1)) ** 2 * np.ones(3)
    return {"ior": look.index, "base": base, "factor": 1.0}


GLTF = Formula(
    "glTF's approximation of Belcour and Barla",
    (Key("ior", 1.0, 4.0), Key("base", 1e-6, 1.0, 3), Key("factor", 0.25, 1.0)),
    colour,
    physical,
)
"""The formula of three.js and Babylon.js."""
GLTF_GUARDED = replace(
    GLTF, name="glTF's approximation with the extension's guard", colour=partial(colour, guard=_GUARD)
)
"""The formula of the extension's text and of the glTF Sample Viewer: a film on air is too faint."""


class Mesh(NamedTuple):
    """Unit sphere: `positions` (vertices, 3), which are the normals too, `texture` coordinates (vertices, 2)
    from the upper left of an image, and `triangles` (triangles, 3), counterclockwise from outside."""

    positions: np.ndarray
    texture: np.ndarray
    triangles: np.ndarray


def sphere_mesh(rows: int = 48, columns: int = 96) -> Mesh:
    """Return a sphere of `rows` from the upper pole (+y) to the lower one, and `columns` around it."""
    v, u = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, columns + 1), indexing="ij")
    theta, phi = np.pi * v, 2 * np.pi * u
    xyz = [-np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)]
    positions = np.stack(xyz, axis=-1).reshape(-1, 3)
    texture = np.stack([u, v], axis=-1).reshape(-1, 2)
    upper_left = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).reshape(-1)
    right, below = upper_left + 1, upper_left + columns + 1
    first = np.stack([upper_left, below, right], axis=-1)[columns:]  # at the upper pole it has no area
    second = np.stack([right, below, below + 1], axis=-1)[:-columns]
    return Mesh(positions, texture, np.concatenate([first, second]))


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
    brightest = float(np.max(material.base_images.get("base", base)))
    tint = base / brightest if brightest > 0 and not material.base_images else np.ones(3)
    return {
        "KHR_materials_iridescence": iridescence,
        "KHR_materials_ior": {"ior": float(base_index(brightest)) if brightest > 0 else 1.0},
        "KHR_materials_specular": {"specularColorFactor": tint.tolist()},
        "KHR_materials_transmission": {"transmissionFactor": 1.0},
    }


def _add_material(model: Any, gltf: Any, material: Material, offset: int) -> bytes:
    """Add the material, and return the images of its textures for the buffer."""
    look, added, base = material.look, extensions(material), material.base_images.get("base")
    uniform = look.metallic and base is None
    colour = np.asarray(material.drawn.chosen.numbers["base"]).tolist() if uniform else [1.0] * 3
    roughness = float(np.sqrt(look.roughness))  # glTF squares it to GGX's α
    pbr = gltf.PbrMetallicRoughness(
        baseColorFactor=[*colour, 1.0], metallicFactor=float(look.metallic), roughnessFactor=roughness
    )
    images = b""
    if material.thickness_map is not None:
        green = np.multiply.outer(share_of_range(material.thickness_map), [0, 1, 0])
        images = _add_texture(model, gltf, green, offset)
        texture = {"index": len(model.textures) - 1}
        added["KHR_materials_iridescence"]["iridescenceThicknessTexture"] = texture
    if base is not None:  # both textures of colours are coded as sRGB
        pixels = np.asarray(srgb(base if look.metallic else base / base.max()))
        images += _add_texture(model, gltf, pixels, offset + len(images))
        texture = {"index": len(model.textures) - 1}
        if look.metallic:
            pbr.baseColorTexture = gltf.TextureInfo(**texture)
        else:
            added["KHR_materials_specular"]["specularColorTexture"] = texture
    if material.roughness_map is not None:
        share = np.sqrt(material.roughness_map)
        pixels = np.stack([0 * share, share, np.full_like(share, look.metallic)], axis=-1)
        images += _add_texture(model, gltf, pixels, offset + len(images))
        pbr.metallicRoughnessTexture = gltf.TextureInfo(index=len(model.textures) - 1)
        pbr.roughnessFactor = 1.0
    model.extensionsUsed = list(added)
    about = {"pbrMetallicRoughness": pbr, "extras": {"pellicle": material.record()}}
    model.materials = [gltf.Material(name=material.name, extensions=added, **about)]
    return images


def _add_texture(model: Any, gltf: Any, pixels: Any, offset: int) -> bytes:
    """Add a texture of values (rows, columns, 3) from 0 to 1, and return its image."""
    image = png(pixels)
    model.bufferViews.append(gltf.BufferView(buffer=0, byteOffset=offset, byteLength=len(image)))
    model.images.append(gltf.Image(bufferView=len(model.bufferViews) - 1, mimeType="image/png"))
    model.samplers = [gltf.Sampler(magFilter=9729, minFilter=9987, wrapS=10497, wrapT=33071)]
    model.textures.append(gltf.Texture(source=len(model.images) - 1, sampler=0))
    return image + b"\0" * (-len(image) % 4)


def _add_sphere(model: Any, gltf: Any) -> bytes:
    """Add a sphere of radius 1, and return its arrays for the buffer."""
    mesh, blob = sphere_mesh(), b""
    vertices = gltf.FLOAT, "<f4", gltf.ARRAY_BUFFER
    arrays = (
        (mesh.positions, "VEC3", *vertices),
        (mesh.positions, "VEC3", *vertices),  # normals of the unit sphere
        (mesh.texture, "VEC2", *vertices),
        (mesh.triangles.reshape(-1), "SCALAR", gltf.UNSIGNED_SHORT, "<u2", gltf.ELEMENT_ARRAY_BUFFER),
    )
    for number, (array, kind, component, dtype, use) in enumerate(arrays):
        content = array.astype(dtype).tobytes()
        place = {"buffer": 0, "byteOffset": len(blob), "byteLength": len(content)}
        model.bufferViews.append(gltf.BufferView(target=use, **place))
        bounds = {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()} if number == 0 else {}
        about = {"bufferView": number, "componentType": component, "count": len(array), "type": kind}
        model.accessors.append(gltf.Accessor(**about, **bounds))
        blob += content + b"\0" * (-len(content) % 4)
    attributes = gltf.Attributes(POSITION=0, NORMAL=1, TEXCOORD_0=2)
    primitive = gltf.Primitive(attributes=attributes, indices=3, material=0)
    model.meshes = [gltf.Mesh(name="sphere", primitives=[primitive])]
    model.nodes, model.scenes, model.scene = [gltf.Node(mesh=0, name="sphere")], [gltf.Scene(nodes=[0])], 0
    return blob


TARGET = Target("gltf", "glTF", (".gltf", ".glb"), ("pygltflib",), lambda look: GLTF, write, takes_map=True)
