"""Textures of a base whose index is a map, in every target that takes them."""

import json
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

import pellicle as pl
from pellicle.dispersion.empirical import Cauchy, Constant
from pellicle.fitting.batch.data import CODES
from pellicle.mapping.store import IDENTITY, write_dataset
from pellicle.rendering.appearance import appearance
from pellicle.rendering.base_texture import base_at_texels, base_texture, compared_texels
from pellicle.rendering.export import with_values
from pellicle.rendering.formula import physical
from pellicle.rendering.materialx import artistic_index
from pellicle.rendering.targets import target

xarray = pytest.importorskip("xarray")
pytest.importorskip("zarr")

METAL = pl.Scene(pl.Layer(2.9, pl.Free(5, 100)), Constant(pl.Free(1, 4), pl.Free(1, 4)))
GLASS = pl.Scene(pl.Layer(1.38, pl.Free(5, 300)), Constant(pl.Free(1.3, 2)))
NM = np.array([[20.0, 30.0, 40.0], [25.0, 50.0, 60.0]])
N = np.array([[2.0, 2.2, 2.4], [3.0, 3.2, 2.7]])
K = np.array([[2.8, 2.9, 3.0], [3.1, 2.5, 2.6]])
CLEAR = np.array([[1.4, 1.5, 1.6], [1.7, 1.9, 1.45]])
STEP = 1.5 / 255
"""Share of its range by which a number may be off: half a step of the parameter and of the image each."""


@pytest.fixture(autouse=True)
def unsolved(monkeypatch):
    """Solved numbers are the physical ones, which take no seconds."""
    from pellicle.rendering import export

    monkeypatch.setattr(export, "effective", export.physical)


def exported(folder, to, scene, **images):
    """The files of a film whose map has these images, by their ending, and what was exported."""
    data = {"status": (("y", "x"), np.full(NM.shape, CODES["converged"], np.uint8))}
    data |= {name.replace(".", "_"): (("y", "x"), image) for name, image in images.items()}
    about = {IDENTITY: "{}", "path": "cube.nc", "parameters": dict.fromkeys(images, "")}
    write_dataset(folder / "map.zarr", xarray.Dataset(data, attrs=about))
    chosen, made = target(to), pl.Map(folder / "map.zarr")
    film = pl.export(scene, to=to, path=folder / f"film{chosen.suffixes[0]}", thickness_map=made)
    return film, {path.name.removeprefix("film"): path for path in film.files}


def metal(folder, to):
    return exported(folder, to, METAL, **{"thickness": NM, "substrate.n": N, "substrate.k": K})


def glass(folder, to):
    return exported(folder, to, GLASS, **{"thickness": NM, "substrate.n": CLEAR})


def close(image, expected):
    assert image.shape[:2] == expected.shape
    every = image.reshape(*image.shape[:2], -1)
    np.testing.assert_allclose(
        every, np.broadcast_to(expected[..., None], every.shape), atol=STEP * np.ptp(expected)
    )


def test_the_base_of_each_texel_is_that_of_its_own_scene():
    """A base with dispersion: its index and its colour are those of a film that is exported by itself."""
    scene = pl.Scene(pl.Layer(1.4, pl.Free(5, 300)), Cauchy(pl.Free(1.4, 2.0), pl.Free(0, 2e4)))
    values = {"substrate.A": np.array([[1.5, 1.6, 1.7]]), "substrate.B": np.array([[0.0, 1e4, 4e3]])}
    base = base_at_texels(scene, values)
    for i in range(3):
        own = {name: float(image[0, i]) for name, image in values.items()} | {"thickness": 100.0}
        look = appearance(with_values(scene, own))
        np.testing.assert_allclose(base.indices[0, i], look.base, atol=2e-3)
        np.testing.assert_allclose(base.bare[0, i], look.bare, atol=5e-4)
    assert np.ptp(base.indices[0, 1].real) > 0.02  # blue and red differ


def test_texels_at_which_colours_are_compared_have_the_extremes():
    chosen = compared_texels([NM, N, K])
    for image in (NM, N, K):
        assert {image.min(), image.max()} <= set(np.ravel(image)[chosen])
    assert list(np.ravel(NM)[chosen]) == sorted(np.ravel(NM)[chosen])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("to", "key"), [("gltf", "base"), ("materialx", "n"), ("openpbr", "edge"), ("blender", "base_ior")]
)
def test_a_formula_has_the_numbers_of_each_texel(to, key):
    look = appearance(with_values(METAL, {"thickness": 40.0, "substrate.n": 2.5, "substrate.k": 2.8}))
    formula = target(to, package_check=False).formula(look)
    base = base_at_texels(METAL, {"substrate.n": N, "substrate.k": K})
    texture = base_texture(formula, look, base, np.arange(6))
    numbers = physical(formula, look).numbers
    together = np.asarray(texture.over(formula).xyz(numbers, np.ravel(NM)))
    for i in (0, 4):
        own = {"thickness": 40.0, "substrate.n": float(N.flat[i]), "substrate.k": float(K.flat[i])}
        alone = physical(formula, appearance(with_values(METAL, own))).numbers
        np.testing.assert_allclose(
            together[i], np.asarray(formula.xyz(alone, NM.flat[i : i + 1]))[0], atol=4e-3
        )
        np.testing.assert_allclose(
            np.ravel(texture.at_texels(numbers)[key][i]), np.ravel(alone[key]), atol=0.01
        )


def test_gltf_has_the_reflectance_of_the_base(tmp_path):
    gltf = pytest.importorskip("pygltflib")

    def linear(model, texture):
        view = model.bufferViews[model.images[model.textures[texture].source].bufferView]
        blob = model.get_data_from_buffer_uri(model.buffers[0].uri)
        coded = (
            np.asarray(Image.open(BytesIO(blob[view.byteOffset : view.byteOffset + view.byteLength]))) / 255
        )
        return np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)

    for name, make, reflectance in (
        ("metal", metal, np.abs((N + 1j * K - 1) / (N + 1j * K + 1)) ** 2),
        ("glass", glass, ((CLEAR - 1) / (CLEAR + 1)) ** 2),
    ):
        (folder := tmp_path / name).mkdir()
        _, files = make(folder, "gltf")
        model = gltf.GLTF2().load(str(files[".gltf"]))
        [material] = model.materials
        assert model.textures[
            material.extensions["KHR_materials_iridescence"]["iridescenceThicknessTexture"]["index"]
        ]
        if name == "metal":
            colour = linear(model, material.pbrMetallicRoughness.baseColorTexture.index)
            assert material.pbrMetallicRoughness.baseColorFactor == [1, 1, 1, 1]
        else:
            ior = material.extensions["KHR_materials_ior"]["ior"]
            specular = material.extensions["KHR_materials_specular"]
            assert specular["specularColorFactor"] == [1, 1, 1]
            colour = ((ior - 1) / (ior + 1)) ** 2 * linear(model, specular["specularColorTexture"]["index"])
        np.testing.assert_allclose(colour, np.repeat(reflectance[..., None], 3, -1), rtol=0.02)


def range_of(document, folder, node, name):
    """Values of the image that is connected to an input of a node."""
    remap = document.getNode(node).getConnectedNode(name)
    file = remap.getConnectedNode("in").getInput("file").getValue()
    low, high = (remap.getInput(end).getValue() for end in ("outlow", "outhigh"))
    low, high = (np.array(x.asTuple()) if hasattr(x, "asTuple") else x for x in (low, high))
    pixels = np.asarray(Image.open(folder / file))
    return low + (high - low) * (pixels / (255 if pixels.ndim > 2 else 65535))


def test_materialx_and_open_pbr_have_the_index_of_the_base(tmp_path):
    materialx = pytest.importorskip("MaterialX")

    def document(path):
        found = materialx.createDocument()
        materialx.readFromXmlFile(found, str(path))
        valid, why = found.validate()
        assert valid, why
        return found

    made = {}
    for to in ("materialx", "openpbr"):
        for name, make in (("metal", metal), ("glass", glass)):
            (folder := tmp_path / f"{to}_{name}").mkdir()
            made[to, name] = document(make(folder, to)[1][".mtlx"]), folder
    close(range_of(*made["materialx", "metal"], "film_conductor", "ior"), N)
    close(range_of(*made["materialx", "metal"], "film_conductor", "extinction"), K)
    colours = (
        range_of(*made["materialx", "metal"], "film_standard_surface", x)
        for x in ("base_color", "specular_color")
    )
    n, k = artistic_index(*colours)
    np.testing.assert_allclose(n[..., 0], N, atol=0.05)  # of two images
    np.testing.assert_allclose(k[..., 0], K, atol=0.05)
    close(range_of(*made["materialx", "glass"], "film_dielectric", "ior"), CLEAR)
    close(range_of(*made["materialx", "glass"], "film_standard_surface", "specular_IOR"), CLEAR)
    close(range_of(*made["openpbr", "glass"], "film_open_pbr", "specular_ior"), CLEAR)
    normal = np.abs((N + 1j * K - 1) / (N + 1j * K + 1)) ** 2
    np.testing.assert_allclose(
        range_of(*made["openpbr", "metal"], "film_open_pbr", "base_color")[..., 1], normal, atol=0.003
    )


def test_blender_has_images_of_n_and_k(tmp_path):
    film, files = metal(tmp_path, "blender")
    record, text = film.material.record(), files[".py"].read_text("utf-8")
    for key, image in (("base_ior", N), ("base_extinction", K)):
        low, high = map(np.array, record["effective"]["base_range"][key])
        close(low + (high - low) * np.asarray(Image.open(files[f"_{key}.png"])) / 255, image)
        assert f"'{key}': 'film_{key}.png'" in text


def test_mitsuba_says_that_it_has_one_base(tmp_path):
    film, files = metal(tmp_path, "mitsuba")
    said = json.loads(files[".xml.json"].read_text("utf-8"))["notes"]
    assert any(note.startswith("substrate.n is 2.55, the median of the map") for note in said)
    assert film.material.base_texture is None


def test_what_is_left_of_the_map_is_said(tmp_path):
    """A base that absorbs on a part of the object, and an index of the film, which has no texture."""
    scene = pl.Scene(pl.Layer(Constant(pl.Free(1.3, 3)), pl.Free(5, 100)), Constant(2.0, pl.Free(0, 1)))
    k = np.array([[0.0, 0.0, 0.2], [0.2, 0.3, 0.4]])
    film, _ = exported(tmp_path, "blender", scene, **{"thickness": NM, "n": CLEAR, "substrate.k": k})
    assert any("absorbs on 67 % of the object" in note for note in film.material.look.notes)
    assert any(note.startswith("n is 1.55, the median") for note in film.material.look.notes)
    assert any(note.startswith("substrate.k is a texture, 0 to 0.4;") for note in film.material.look.notes)
