"""Mitsuba 3: tabulated `.bsdf` files of the built-in `measured`, a lookup for a BSDF in Python, and scenes.

Beside `film.bsdf` (RGB) and `film_spectral.bsdf` there are `film.npz` with the lookup over thickness and
cosine, `pellicle_film.py`, the BSDF that reads it, and two scenes of a sphere: `film.xml` by `measured`,
which needs no Python, and `film_lookup.xml` by the lookup, whose thickness may vary over the surface.
"""

from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.write_rgl import write_rgl
from pellicle.errors import UsageError
from pellicle.files import replacing, write_text
from pellicle.rendering.material import Material
from pellicle.rendering.mitsuba_tables import film_tables, lookup
from pellicle.rendering.targets import Target

ALPHA = 0.1
"""GGX roughness of a film that has none of its own: `measured` has no perfect mirrors."""
PLUGIN = "pellicle_film"

_SCENE = """<?xml version="1.0" encoding="utf-8"?>
<!-- {comment} -->
<scene version="3.0.0">
    <default name="spp" value="256"/>
    <default name="size" value="512"/>
{defaults}
    <integrator type="path">
        <integer name="max_depth" value="5"/>
    </integrator>
    <sensor type="perspective">
        <float name="fov" value="26"/>
        <transform name="to_world">
            <lookat origin="0, -5.5, 2.2" target="0, 0, 0" up="0, 0, 1"/>
        </transform>
        <film type="hdrfilm">
            <integer name="width" value="$size"/>
            <integer name="height" value="$size"/>
        </film>
        <sampler type="independent">
            <integer name="sample_count" value="$spp"/>
        </sampler>
    </sensor>
    <emitter type="constant">
        {dim}
    </emitter>
    <shape type="rectangle">
        <transform name="to_world">
            <scale x="1.6" y="1.6"/>
            <lookat origin="-2.5, -2.5, 5" target="0, 0, 0" up="0, 0, 1"/>
        </transform>
        <emitter type="area">
            {bright}
        </emitter>
    </shape>
    <shape type="rectangle">
        <transform name="to_world">
            <scale value="20"/>
            <translate z="-1"/>
        </transform>
        <bsdf type="diffuse">
            <spectrum name="reflectance" value="0.2"/>
        </bsdf>
    </shape>
    <shape type="sphere">
{bsdf}
    </shape>
</scene>
"""
_LIGHT = '<spectrum name="radiance" type="d65"><float name="scale" value="{}"/></spectrum>'
_MEASURED = """        <bsdf type="measured">
            <string name="filename" value="$table"/>
        </bsdf>"""
_LOOKUP = """        <bsdf type="pellicle_film">
            <string name="filename" value="{table}"/>
            <float name="alpha" value="$alpha"/>
{thickness}
        </bsdf>"""
_EVEN = '            <float name="thickness" value="{:.6g}"/>'
_MAP = """            <texture type="bitmap" name="thickness">
                <string name="filename" value="{}"/>
                <boolean name="raw" value="true"/>
            </texture>
            <float name="thickness_min" value="{:.6g}"/>
            <float name="thickness_max" value="{:.6g}"/>"""


def write(path: Path, material: Material) -> tuple[Path, ...]:
    """Write tables, plugin and scenes beside each other, the tables alone for a `.bsdf`.

    An uneven film has no `.bsdf`, whose directions are those of one thickness.
    """
    look, stem = material.look, path.with_suffix("")
    alpha = look.roughness if look.roughness > 0 else ALPHA
    names = {
        "rgb": path.with_suffix(".bsdf"),
        "spectral": stem.with_name(f"{stem.name}_spectral.bsdf"),
        "lookup": path.with_suffix(".npz"),
        "map": stem.with_name(f"{stem.name}_thickness.png"),
        "plugin": path.with_name(f"{PLUGIN}.py"),
        "measured": path.with_suffix(".xml"),
        "scene": stem.with_name(f"{stem.name}_lookup.xml"),
    }
    source = Path(__file__).with_name("mitsuba_plugin.py")
    uneven = material.thickness_map is not None
    if path.suffix.lower() == ".bsdf":
        if uneven:
            raise UsageError(f"{path}: a .bsdf has one thickness; export a map of thicknesses as .xml")
        written = ["rgb", "spectral"]
    elif uneven:
        names["scene"] = names["measured"]
        written = ["lookup", "map", "plugin", "scene"]
    else:
        written = ["rgb", "spectral", "lookup", "plugin", "measured", "scene"]
    files = {key: names[key] for key in written}
    for key, file in files.items():
        if file.exists() and key != "plugin":  # the same for every film
            raise UsageError(f"{file}: exists and is not overwritten; choose another `path` or remove it")
    if "rgb" in files:
        for key, fields in zip(("rgb", "spectral"), film_tables(look, alpha), strict=True):
            write_rgl(files[key], fields)
    if "lookup" in files:
        arrays: dict[str, Any] = dict(lookup(look).arrays())
        with replacing(files["lookup"]) as temporary:
            np.savez_compressed(temporary, **arrays)
        write_text(files["plugin"], source.read_text("utf-8"), overwrite=True)
        thickness = _EVEN.format(look.thickness[-1])
        if material.thickness_map is not None:
            thickness = _write_map(files["map"], material.thickness_map)
        bsdf = _LOOKUP.format(table=files["lookup"].name, thickness=thickness)
        note = f"import {PLUGIN} and call its register() first, see there"
        write_text(files["scene"], _scene(note, f'    <default name="alpha" value="{alpha:g}"/>', bsdf))
    if "measured" in files:
        name = f'    <default name="table" value="{files["rgb"].name}"/>'
        note = f"mitsuba -m scalar_rgb {path.name}; in spectral variants -D table={names['spectral'].name}"
        write_text(files["measured"], _scene(note, name, _MEASURED))
    return tuple(files.values())


def _scene(comment: str, defaults: str, bsdf: str) -> str:
    lights = {"dim": _LIGHT.format(0.35), "bright": _LIGHT.format(8.0)}
    return _SCENE.format(comment=comment, defaults=defaults, bsdf=bsdf, **lights)


def _write_map(path: Path, thickness: np.ndarray) -> str:
    """Write a map as a grey image of 16 bits, and return the parameters that read it."""
    from PIL import Image  # a requirement of Matplotlib

    low, high = float(np.min(thickness)), float(np.max(thickness))
    share = (thickness - low) / (high - low if high > low else 1.0)
    with replacing(path) as temporary:
        Image.fromarray(np.round(65535 * share).astype(np.uint16)).save(temporary)
    return _MAP.format(path.name, low, high)


TARGET = Target("mitsuba", "Mitsuba", (".xml", ".bsdf"), (), None, write, takes_map=True)
