"""OpenUSD: a sphere with MaterialX's nodes of a film, and UsdPreviewSurface for renderers without them.

UsdPreviewSurface has no film: it gets the film's colour at normal incidence. Both sets of numbers are in the
custom data of the material.
"""

import json
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.colour import linear_srgb, sensor
from pellicle.files import replacing
from pellicle.rendering.materialx import bsdf_of, formula
from pellicle.rendering.targets import Material, Target


def write(path: Path, material: Material) -> tuple[Path, ...]:
    """Write a stage with a sphere and its material."""
    Gf, Sdf, Tf, Usd, UsdGeom, UsdShade = _usd("Gf", "Sdf", "Tf", "Usd", "UsdGeom", "UsdShade")
    stage = Usd.Stage.CreateInMemory()
    stage.SetMetadata("comment", f"pellicle {version('pellicle')}")
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    root = UsdGeom.Xform.Define(stage, "/film")
    stage.SetDefaultPrim(root.GetPrim())
    sphere = UsdGeom.Sphere.Define(stage, "/film/sphere")
    drawn = UsdShade.Material.Define(stage, f"/film/{Tf.MakeValidIdentifier(material.name)}_material")
    drawn.GetPrim().SetCustomDataByKey("pellicle", json.dumps(material.record(), ensure_ascii=False))
    _connect_materialx(stage, drawn, material)
    look = material.look
    normal = np.clip(np.asarray(linear_srgb(look.xyz[-1, 0], sensor().white)), 0.0, 1.0)
    preview = UsdShade.Shader.Define(stage, drawn.GetPath().AppendChild("preview"))
    preview.CreateIdAttr("UsdPreviewSurface")
    preview.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*normal.tolist()))
    preview.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(1.0)
    preview.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(float(np.sqrt(look.roughness)))
    drawn.CreateSurfaceOutput().ConnectToSource(preview.CreateOutput("surface", Sdf.ValueTypeNames.Token))
    UsdShade.MaterialBindingAPI.Apply(sphere.GetPrim()).Bind(drawn)
    with replacing(path) as temporary:
        stage.GetRootLayer().Export(str(temporary))
    return (path,)


def _connect_materialx(stage: Any, drawn: Any, material: Material) -> None:
    Gf, Sdf, UsdShade = _usd("Gf", "Sdf", "UsdShade")
    kinds = {
        "float": (Sdf.ValueTypeNames.Float, float),
        "string": (Sdf.ValueTypeNames.String, str),
        "color3": (Sdf.ValueTypeNames.Color3f, lambda x: Gf.Vec3f(*x)),
        "vector2": (Sdf.ValueTypeNames.Float2, lambda x: Gf.Vec2f(*x)),
    }
    # without its version the document is taken for MaterialX 1.38, whose nodes have no film
    prim = drawn.GetPrim()
    prim.AddAppliedSchema("MaterialXConfigAPI")
    prim.CreateAttribute("config:mtlx:version", Sdf.ValueTypeNames.String, False).Set("1.39")
    category, name, inputs = bsdf_of(material)
    bsdf = UsdShade.Shader.Define(stage, drawn.GetPath().AppendChild(name))
    bsdf.CreateIdAttr(f"ND_{category}")
    for key, (kind, value) in inputs.items():
        of_usd, convert = kinds[kind]
        bsdf.CreateInput(key, of_usd).Set(convert(value))
    surface = UsdShade.Shader.Define(stage, drawn.GetPath().AppendChild("surface"))
    surface.CreateIdAttr("ND_surface")
    output = bsdf.CreateOutput("out", Sdf.ValueTypeNames.Token)
    surface.CreateInput("bsdf", Sdf.ValueTypeNames.Token).ConnectToSource(output)
    drawn.CreateSurfaceOutput("mtlx").ConnectToSource(surface.CreateOutput("out", Sdf.ValueTypeNames.Token))


def _usd(*names: str) -> list[Any]:
    """Modules of OpenUSD, which declares no types."""
    return [import_module(f"pxr.{name}") for name in names]


TARGET = Target("usd", "OpenUSD", (".usda", ".usdc", ".usd"), ("pxr",), formula, write)
