"""glTF files of films, read by pygltflib, and the record beside them."""

import json
from io import BytesIO

import numpy as np
import pytest

import pellicle as pl
from pellicle.errors import DataError, UsageError
from pellicle.rendering.gltf import sphere_mesh

pygltflib = pytest.importorskip("pygltflib")

SOAP = pl.Scene(pl.Layer(1.33, pl.Free(0, 600)), 1.0)
STEEL = pl.Scene(pl.Layer(2.9, 40.0), 2.7 + 2.8j)


@pytest.fixture(scope="module")
def soap(tmp_path_factory):
    """A soap film with a map of thicknesses from 100 to 400 nm."""
    folder = tmp_path_factory.mktemp("soap")
    np.save(folder / "map.npy", np.linspace(100.0, 400.0, 32).reshape(4, 8))
    made = pl.export(SOAP, to="gltf", path=folder / "soap.glb", thickness_map=folder / "map.npy")
    return made, pygltflib.GLTF2().load(str(folder / "soap.glb"))


@pytest.mark.slow
def test_a_transparent_film_has_a_map_in_nm(soap):
    made, model = soap
    [material] = model.materials
    film = material.extensions["KHR_materials_iridescence"]
    scale = made.material.solved.effective.scale
    np.testing.assert_allclose(film["iridescenceThicknessMinimum"], 100 * scale)
    np.testing.assert_allclose(film["iridescenceThicknessMaximum"], 400 * scale)
    assert material.pbrMetallicRoughness.metallicFactor == 0
    assert set(model.extensionsUsed) == set(material.extensions)
    assert 1.0 <= material.extensions["KHR_materials_ior"]["ior"] < 1.2  # air behind the film

    from PIL import Image

    view = model.bufferViews[model.images[0].bufferView]
    content = model.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
    pixels = np.asarray(Image.open(BytesIO(content)))
    green = pixels[..., 1] / 255
    assert pixels.shape == (4, 8, 3)
    np.testing.assert_allclose(100 + 300 * green, np.linspace(100, 400, 32).reshape(4, 8), atol=300 / 255)


@pytest.mark.slow
def test_the_record_has_both_sets(soap):
    made, model = soap
    record = json.loads(made.files[1].read_text("utf-8"))
    assert record["target"] == "gltf"
    assert record["used"] == "effective"
    assert record["physical"]["ior"] == 1.33
    assert record["physical"]["thickness_nm"] == [100, 400]
    assert record["effective"]["delta_e2000"]["mean"] <= record["physical"]["delta_e2000"]["mean"]
    inside = model.materials[0].extras["pellicle"]
    assert {"notes": [], **inside} == {key: x for key, x in record.items() if key != "target"}


@pytest.mark.slow  # compiles for 5 s; cli/test_export_command.py writes the same sphere
def test_a_metal_is_drawn_as_it_is(tmp_path):
    made = pl.export(STEEL, to="gltf", path=tmp_path / "steel.gltf", numbers="physical")
    model = pygltflib.GLTF2().load(str(tmp_path / "steel.gltf"))
    [material] = model.materials
    film = material.extensions["KHR_materials_iridescence"]
    assert (film["iridescenceThicknessMaximum"], film["iridescenceIor"]) == (40, 2.9)
    assert set(material.extensions) == {"KHR_materials_iridescence"}
    assert material.pbrMetallicRoughness.metallicFactor == 1
    bare = (1.7**2 + 2.8**2) / (3.7**2 + 2.8**2)
    np.testing.assert_allclose(material.pbrMetallicRoughness.baseColorFactor, [bare] * 3 + [1], atol=2e-4)
    assert model.accessors[0].count == len(sphere_mesh().positions)
    assert "physical numbers are used" in str(made)


def test_the_sphere_faces_outwards():
    mesh = sphere_mesh(8, 16)
    np.testing.assert_allclose(np.linalg.norm(mesh.positions, axis=1), 1)
    a, b, c = (mesh.positions[mesh.triangles[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    assert np.all(np.sum(normal * (a + b + c), axis=1) > 0)
    # 8 × 16 facets enclose a little less than the sphere
    volume = np.sum(a * np.cross(b, c)) / 6
    assert 0.93 * 4 / 3 * np.pi < volume < 4 / 3 * np.pi


def test_what_is_refused(tmp_path, refuses):
    (tmp_path / "there.glb").write_text("")
    np.save(tmp_path / "row.npy", np.zeros(3))
    for options, words in (
        ({"to": "gtlf", "path": tmp_path / "a.glb"}, "did you mean 'gltf'"),
        ({"to": "gltf", "path": tmp_path / "a.obj"}, "ends in .gltf or .glb"),
        ({"to": "gltf", "path": tmp_path / "there.glb"}, "exists"),
        ({"to": "gltf", "path": tmp_path / "a.glb", "numbers": "best"}, "effective or physical"),
        ({"to": "gltf", "path": tmp_path / "a.glb", "thickness_map": [[1.0, -1.0]]}, "none below 0"),
        ({"to": "gltf", "path": tmp_path / "a.glb", "thickness_map": [[0.1, 0.3]]}, "in nm, not in µm"),
        ({"to": "gltf", "path": tmp_path / "a.glb", "thickness_map": [["a"]]}, "must have numbers"),
    ):
        refuses(UsageError, words, pl.export, STEEL, **options)
    with pytest.raises(DataError, match="rows, columns"):
        pl.export(STEEL, to="gltf", path=tmp_path / "a.glb", thickness_map=tmp_path / "row.npy")
    with pytest.raises(DataError, match="cannot be read as a map"):
        pl.export(STEEL, to="gltf", path=tmp_path / "a.glb", thickness_map=tmp_path / "no.png")
