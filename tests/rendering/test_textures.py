"""Textures: fitted maps without holes, images of thickness and roughness, in every target with textures."""

import json
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

import pellicle as pl
from pellicle.errors import DataError, UsageError
from pellicle.fitting.batch.data import CODES
from pellicle.mapping.store import IDENTITY, write_dataset
from pellicle.rendering.targets import TARGETS, target
from pellicle.rendering.textures import mapped_film, roughness_image

xarray = pytest.importorskip("xarray")
pytest.importorskip("zarr")

STEEL = pl.Scene(pl.Layer(pl.Free(2.5, 3.2), pl.Free(5, 100), name="oxide"), 2.7 + 2.8j)
NM = np.array([[20.0, 30.0, 40.0], [25.0, 500.0, np.nan]])
CODE = np.array([["converged", "by-neighbours", "converged"], ["converged", "misfit", "no-data"]])
ROUGH = np.array([[0.04, 0.25], [0.49, 1.0]])


def stored(path, dims=("y", "x"), parameters=("thickness", "n")):
    """A map as `pellicle map` stores it, of a thickness and an index."""
    shape = (1,) * (len(dims) - 2) + NM.shape
    code = np.vectorize(CODES.get)(CODE).astype(np.uint8)
    values = {"status": code, "thickness": NM, "n": np.where(NM < 400, 2.9 + NM / 1e3, np.nan)}
    data = {name: (dims, values[name].reshape(shape)) for name in ("status", *parameters)}
    about = {IDENTITY: "{}", "path": "cube.nc", "parameters": dict.fromkeys(parameters, "nm")}
    write_dataset(path, xarray.Dataset(data, attrs=about))
    return pl.Map(path)


def test_a_map_gives_its_thickness_and_medians(tmp_path):
    film = mapped_film(stored(tmp_path / "map.zarr"))
    # dust and a dead pixel take their nearest neighbours, not their own 500 nm
    assert film.thickness[1, 1] in (25.0, 30.0)
    assert film.thickness[1, 2] == 40.0
    np.testing.assert_array_equal(film.thickness[0], NM[0])
    assert film.values == pytest.approx({"thickness": 27.5, "n": 2.9275})
    assert film.notes[0].startswith("33 % of the map has no thickness of its own")
    assert film.medians["n"].startswith("n is 2.927, the median of the map")
    assert film.others["n"][0, 0] == pytest.approx(2.92)


def test_maps_without_a_texture_are_refused(tmp_path, refuses):
    series = stored(tmp_path / "series.zarr", dims=("time", "y", "x"))
    refuses(UsageError, "along time, y, x, and a texture has rows", mapped_film, series)
    index = stored(tmp_path / "index.zarr", parameters=("n",))
    refuses(UsageError, "no fitted thickness", mapped_film, index)
    refuses(UsageError, "no pixel with one thickness", mapped_film, [[np.nan]])


def test_images_are_read(tmp_path, refuses):
    grey = np.array([[0, 51], [102, 255]])
    for dtype, white in ((np.uint8, 255), (np.uint16, 65535)):
        path = tmp_path / f"{white}.png"
        Image.fromarray((grey * (white // 255)).astype(dtype)).save(path)
        np.testing.assert_allclose(roughness_image(path), grey / 255)
        np.testing.assert_allclose(mapped_film(path).thickness, grey * (white // 255))
    refuses(UsageError, "α .GGX. from 0 to 1", roughness_image, [[1.5]])
    np.save(tmp_path / "alpha.npy", np.array([[-0.1]]))
    refuses(DataError, r"alpha\.npy: must have roughnesses", roughness_image, tmp_path / "alpha.npy")
    for mode in ("RGB", "P", "LA"):
        Image.new(mode, (2, 2)).save(tmp_path / "colour.png")
        refuses(
            DataError, r"colour\.png: .* \(it has a palette or several ", mapped_film, tmp_path / "colour.png"
        )
    Image.new("1", (2, 2), 1).save(tmp_path / "bit.png")
    np.testing.assert_array_equal(roughness_image(tmp_path / "bit.png"), 1)
    Image.fromarray(np.float32([[0.25]])).save(tmp_path / "float.tif")
    np.testing.assert_array_equal(roughness_image(tmp_path / "float.tif"), 0.25)


def written(to, folder, **maps):
    """The files of a film as it is, with textures, by their ending."""
    chosen = target(to)
    made = pl.export(STEEL, to=to, path=folder / f"film{chosen.suffixes[0]}", numbers="physical", **maps)
    return made, {path.name.removeprefix("film"): path for path in made.files}


@pytest.fixture
def unsolved(monkeypatch):
    """Solved numbers are the physical ones: these tests need none."""
    from pellicle.rendering import export

    monkeypatch.setattr(export, "effective", export.physical)


def test_gltf_has_both_textures(tmp_path, unsolved):
    gltf = pytest.importorskip("pygltflib")
    made, files = written("gltf", tmp_path, thickness_map=stored(tmp_path / "map.zarr"), roughness_map=ROUGH)
    assert made.material.look.index == pytest.approx(2.9275)
    model = gltf.GLTF2().load(str(files[".gltf"]))
    [material] = model.materials
    pbr, blob = material.pbrMetallicRoughness, model.get_data_from_buffer_uri(model.buffers[0].uri)

    def pixels(index):
        view = model.bufferViews[model.images[model.textures[index].source].bufferView]
        return (
            np.asarray(Image.open(BytesIO(blob[view.byteOffset : view.byteOffset + view.byteLength]))) / 255
        )

    film = material.extensions["KHR_materials_iridescence"]
    low, high = film["iridescenceThicknessMinimum"], film["iridescenceThicknessMaximum"]
    nm = low + (high - low) * pixels(film["iridescenceThicknessTexture"]["index"])[..., 1]
    np.testing.assert_allclose(nm[0], NM[0], atol=20 / 255)
    rough = pixels(pbr.metallicRoughnessTexture.index)
    np.testing.assert_allclose((pbr.roughnessFactor * rough[..., 1]) ** 2, ROUGH, atol=1 / 255)
    np.testing.assert_array_equal(pbr.metallicFactor * rough[..., 2], 1.0)


def test_materialx_squares_the_roughness_of_its_image(tmp_path, unsolved):
    materialx = pytest.importorskip("MaterialX")
    for to, surface in (("materialx", "film_standard_surface"), ("openpbr", "film_open_pbr")):
        folder = tmp_path / to
        folder.mkdir()
        _, files = written(to, folder, roughness_map=ROUGH)
        document = materialx.createDocument()
        materialx.readFromXmlFile(document, str(files[".mtlx"]))
        np.testing.assert_allclose(
            (np.asarray(Image.open(files["_roughness.png"])) / 65535) ** 2, ROUGH, atol=1e-4
        )
        image = document.getNode(surface).getConnectedNode("specular_roughness")
        assert image.getInput("file").getValue() == "film_roughness.png"
        if to == "materialx":
            both = document.getNode("film_conductor").getConnectedNode("roughness")
            assert (both.getCategory(), both.getType()) == ("combine2", "vector2")
            product = both.getConnectedNode("in2")
            assert product.getCategory() == "multiply"
            names = {product.getConnectedNode(x).getName() for x in ("in1", "in2")}
            assert names == {image.getName()}
        valid, why = document.validate()
        assert valid, why


@pytest.mark.slow
def test_blender_and_mitsuba_have_images_of_the_roughness(tmp_path, unsolved):
    _, files = written("blender", tmp_path, roughness_map=ROUGH)
    assert "ROUGHNESS_MAP = 'film_roughness.png'" in files[".py"].read_text("utf-8")
    (folder := tmp_path / "mitsuba").mkdir()
    _, files = written("mitsuba", folder, roughness_map=ROUGH)
    share = np.asarray(Image.open(files["_roughness.png"])) / 65535
    np.testing.assert_allclose(share, ROUGH, atol=1e-5)  # α itself
    scene = files[".xml"].read_text("utf-8")
    assert '<texture type="bitmap" name="alpha">' in scene
    assert '<float name="thickness"' in scene


@pytest.mark.slow
def test_mitsuba_takes_the_roughness_of_its_image(tmp_path):
    mi = pytest.importorskip("mitsuba")
    from pellicle.rendering import mitsuba_plugin

    _, files = written("mitsuba", tmp_path, thickness_map=[[20.0, 20.0], [40.0, 40.0]], roughness_map=ROUGH)
    mi.set_variant("scalar_rgb")
    mitsuba_plugin.register()
    scene = mi.load_file(str(files[".xml"]))
    [bsdf] = [shape.bsdf() for shape in scene.shapes() if "pellicle_film" in str(shape.bsdf())]
    at = {"smooth": (0.25, 0.25), "rough": (0.75, 0.75)}
    si, peak = mi.SurfaceInteraction3f(), {}
    si.wi = mi.Vector3f(0, 0, 1)
    for name, uv in at.items():
        si.uv = mi.Point2f(*uv)
        peak[name] = np.ravel(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(0, 0, 1)))[1]
    assert peak["smooth"] > 100 * peak["rough"]


def test_targets_without_textures_are_named(tmp_path, refuses):
    without = [name for name in TARGETS if not target(name, package_check=False).takes_map]
    assert without == ["usd"]
    pytest.importorskip("pxr")
    options = {"to": "usd", "path": tmp_path / "a.usda", "roughness_map": ROUGH}
    refuses(UsageError, "no textures of thickness or roughness", pl.export, STEEL, **options)


def test_the_folder_of_a_map_is_exported(tmp_path, monkeypatch, unsolved):
    """The record of the map names its recipe."""
    from pellicle.cli.export import export

    recipe = tmp_path / "steel.toml"
    recipe.write_text(
        '[scene]\nsubstrate = "2.7+2.8j"\n[[scene.layer]]\nname = "oxide"\n'
        'material = { model = "constant", n = { lower = 2.5, upper = 3.2 } }\n'
        "thickness = { lower = 5, upper = 100 }\n"
    )
    folder = tmp_path / "wafer"
    folder.mkdir()
    stored(folder / "map.zarr")
    record = {"schema": "pellicle.cube-map/1", "parameters": {"thickness": {"median": 27.5}}}
    (folder / "result.json").write_text(json.dumps(record | {"scene": {"recipe": str(recipe)}}))
    assert export(str(folder), to="mitsuba", out=str(tmp_path / "wafer.xml")) == 0
    share = np.asarray(Image.open(tmp_path / "wafer_thickness.png")) / 65535
    np.testing.assert_allclose(20 + 20 * share[0], NM[0], atol=1e-3)
    notes = json.loads((tmp_path / "wafer.xml.json").read_text("utf-8"))["notes"]
    assert any("n is 2.927" in note for note in notes)
    (folder / "map.zarr").rename(tmp_path / "elsewhere.zarr")
    np.save(folder / "thickness.npy", NM[:1])  # of a photograph
    (folder / "result.json").write_text(
        json.dumps({"schema": "pellicle.map/1", "scene": {"recipe": str(recipe)}})
    )
    assert export(str(folder), to="mitsuba", out=str(tmp_path / "photograph.xml")) == 0
    (folder / "strip.csv").touch()
    with pytest.raises(UsageError, match="map of a strip"):
        export(str(folder), to="mitsuba", out=str(tmp_path / "strip.xml"))
