"""Scripts for Blender: their numbers, what they set in Blender, and a `.blend` where bpy is installed."""

import json
import subprocess
import sys
from importlib.util import find_spec
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest
from PIL import Image

import pellicle as pl
from pellicle.errors import UsageError
from pellicle.rendering.formula import physical

STEEL = pl.Scene(pl.Layer(2.9, 40.0), 2.7 + 2.8j)
SOAP = pl.Scene(pl.Layer(1.33, pl.Free(0, 600)), 1.0)
SCALE = 1.25


@pytest.fixture(scope="module", autouse=True)
def _unsolved():
    """A scale in place of the solution, which takes seconds; test_formulas.py has that."""
    with pytest.MonkeyPatch.context() as patch:
        unsolved = lambda *film: physical(*film)._replace(scale=SCALE)  # noqa: E731
        patch.setattr("pellicle.rendering.export.effective", unsolved)
        yield


@pytest.fixture(scope="module")
def steel(tmp_path_factory):
    return pl.export(STEEL, to="blender", path=tmp_path_factory.mktemp("steel") / "steel.py")


def script(path, monkeypatch, version=(5, 0, 1)):
    """Names of a script that is read with a stand-in for bpy, which remembers nodes by their type."""
    bpy, nodes = MagicMock(), {}
    bpy.app.version = version
    material = bpy.data.materials.new.return_value
    material.node_tree.nodes.new.side_effect = lambda kind: nodes.setdefault(kind, Node())
    monkeypatch.setitem(sys.modules, "bpy", bpy)
    found: dict[str, Any] = {"__name__": "script", "__file__": str(path)}
    exec(compile(path.read_text("utf-8"), str(path), "exec"), found)
    return found, nodes


class Node(MagicMock):
    """A node whose sockets are found by name, and stay."""

    def __init__(self, *arguments, **named):
        super().__init__(*arguments, **named)
        self.inputs = Sockets()


class Sockets(dict):
    def __missing__(self, name):
        self[name] = MagicMock()
        return self[name]


def test_a_metal_has_its_film_and_indices_in_the_script(steel, monkeypatch):
    path, record = steel.files
    found, nodes = script(path, monkeypatch)
    written = json.loads(record.read_text("utf-8"))
    assert found["RECORD"] == {k: v for k, v in written.items() if k != "target"}
    found["film_material"]("physical")
    metal = nodes["ShaderNodeBsdfMetallic"]
    assert metal.fresnel_type == "PHYSICAL_CONDUCTOR"
    values = {name: socket.default_value for name, socket in metal.inputs.items()}
    assert values["Thin Film Thickness"] == 40.0
    assert values["Thin Film IOR"] == 2.9
    assert values["IOR"] == [2.7] * 3
    assert values["Extinction"] == [2.8] * 3
    assert values["Roughness"] == 0.0
    found["film_material"]()  # the solved numbers
    assert metal.inputs["Thin Film Thickness"].default_value == 40.0 * SCALE


def test_an_old_blender_is_refused(steel, monkeypatch, refuses):
    found, _ = script(steel.files[0], monkeypatch, version=(4, 5, 0))
    refuses(RuntimeError, r"Blender 5\.0", found["film_material"])


def test_a_map_is_an_image_of_16_bits(tmp_path, monkeypatch):
    nm = np.linspace(100.0, 400.0, 32).reshape(4, 8)
    made = pl.export(SOAP, to="blender", path=tmp_path / "soap.py", thickness_map=nm, numbers="physical")
    path, image, _ = made.files
    share = np.asarray(Image.open(image)) / 65535
    np.testing.assert_allclose(100 + 300 * share, nm, atol=300 / 65535)
    found, nodes = script(path, monkeypatch, version=(4, 2, 0))
    found["film_material"]()
    assert found["THICKNESS_MAP"] == image.name
    span = nodes["ShaderNodeMapRange"].inputs
    assert [span[end].default_value for end in ("To Min", "To Max")] == [100.0, 400.0]
    glass = nodes["ShaderNodeBsdfPrincipled"].inputs
    assert glass["Transmission Weight"].default_value == 1.0
    assert glass["IOR"].default_value == 1.0


@pytest.mark.skipif(find_spec("bpy") is not None, reason="bpy is installed")
def test_a_blend_file_needs_bpy(tmp_path):
    with pytest.raises(UsageError, match="needs the package bpy"):
        pl.export(STEEL, to="blender", path=tmp_path / "steel.blend")
    assert list(tmp_path.iterdir()) == []


RENDER = """
import sys
import bpy, numpy as np
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
scene = bpy.context.scene
scene.cycles.samples, scene.render.resolution_x, scene.render.resolution_y = 1, 65, 65
scene.cycles.use_denoising, scene.cycles.pixel_filter_type, scene.cycles.filter_width = False, "BOX", 0.01
scene.camera.data.ortho_scale = 2.0
scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
scene.render.filepath = sys.argv[2]
bpy.ops.render.render(write_still=True)
image = bpy.data.images.load(sys.argv[2])
image.colorspace_settings.name = "Non-Color"
np.savetxt(sys.argv[3], np.array(image.pixels[:]).reshape(65, 65, -1)[32, 32:, :3])
"""


def test_cycles_renders_the_formula(tmp_path):
    """A row of pixels from the middle of the sphere to its edge, one angle each."""
    pytest.importorskip("bpy")
    made = pl.export(STEEL, to="blender", path=tmp_path / "steel.blend")
    drawn = tmp_path / "row.txt"
    run = [sys.executable, "-c", RENDER, str(made.files[0]), str(tmp_path / "row.exr"), str(drawn)]
    subprocess.run(run, check=True, capture_output=True)
    solved = made.material.drawn
    sine = np.arange(30) / 32.5
    thickness = solved.chosen.scale * np.array(40.0)
    expected = solved.formula.colour(solved.chosen.numbers, thickness, np.sqrt(1 - sine**2))
    np.testing.assert_allclose(np.loadtxt(drawn)[:30], expected, atol=4e-3)  # a mesh of 96 by 48 facets
