"""MaterialX, OpenPBR and USD files of an oxide on steel and of an oil film, read by their own libraries."""

import json

import matplotlib.pyplot as plt
import numpy as np
import pytest

import pellicle as pl
from pellicle.rendering.appearance import appearance
from pellicle.rendering.formula import physical
from pellicle.rendering.targets import Material, Solved, target

MaterialX = pytest.importorskip("MaterialX")
pxr = pytest.importorskip("pxr")

OIL = pl.Scene(pl.Layer(1.5, 400.0), 1.33)
STEEL = pl.Scene(pl.Layer(2.9, 40.0), 2.7 + 2.8j)


@pytest.fixture(scope="module")
def looks():
    return {name: appearance(scene) for name, scene in (("oil", OIL), ("steel", STEEL))}


def write(to, look, path, nm=None):
    """Write a film as it is, without the seconds of solving for effective numbers."""
    formula = target(to).formula(look)
    solution = physical(formula, look)
    target(to).write(path, Material(path.stem, look, Solved(formula, solution, solution, "physical"), nm))
    return solution


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("documents")


@pytest.fixture(scope="module")
def library():
    """MaterialX's own definitions of its nodes."""
    found = MaterialX.createDocument()
    folders, path = MaterialX.getDefaultDataLibraryFolders(), MaterialX.getDefaultDataSearchPath()
    MaterialX.loadLibraries(folders, path, found)
    return found


def document(path, library):
    """A file with the definitions of all nodes; every input is one that its node has."""
    found = MaterialX.createDocument()
    MaterialX.readFromXmlFile(found, str(path))
    found.setDataLibrary(library)
    valid, why = found.validate()
    assert valid, why
    for node in found.getNodes():
        definition = node.getNodeDef()
        assert definition is not None, node.getName()
        known = {each.getName(): each.getType() for each in definition.getActiveInputs()}
        assert {x.getName(): x.getType() for x in node.getInputs()}.items() <= known.items()
    return found


def value(node, name):
    found = node.getInput(name).getValue()
    return np.array(found.asTuple()) if hasattr(found, "asTuple") else found


@pytest.mark.slow
def test_materialx_has_a_conductor_in_nm(folder, library):
    made = pl.export(STEEL, to="materialx", path=folder / "steel.mtlx", numbers="physical")
    found = document(folder / "steel.mtlx", library)
    bsdf, standard = found.getNode("film_conductor"), found.getNode("film_standard_surface")
    assert (value(bsdf, "thinfilm_thickness"), value(standard, "thin_film_thickness")) == (40, 40)
    np.testing.assert_allclose(value(bsdf, "thinfilm_ior"), 2.9, rtol=1e-6)
    np.testing.assert_allclose(value(bsdf, "ior"), [2.7] * 3, rtol=1e-6)
    np.testing.assert_allclose(value(bsdf, "extinction"), [2.8] * 3, rtol=1e-6)
    bare = (1.7**2 + 2.8**2) / (3.7**2 + 2.8**2)
    np.testing.assert_allclose(value(standard, "base_color"), [bare] * 3, rtol=1e-5)
    assert len(found.getMaterialNodes()) == 2
    record = json.loads(found.getMaterialNodes()[0].getAttribute("pellicle"))
    assert record["used"] == "physical"
    solved, as_is = made.material.solved.effective.error, made.material.solved.physical.error
    assert solved.mean <= as_is.mean
    assert solved.mean < 0.5  # the index of a base may differ between channels


def test_open_pbr_has_micrometres(folder, library, looks):
    write("openpbr", looks["oil"], folder / "oil.mtlx")
    found = document(folder / "oil.mtlx", library)
    node = found.getNode("film_open_pbr")
    assert node.getCategory() == "open_pbr_surface"
    np.testing.assert_allclose(value(node, "thin_film_thickness"), 0.4, rtol=1e-6)
    assert (value(node, "thin_film_weight"), value(node, "transmission_weight")) == (1, 1)
    np.testing.assert_allclose(value(node, "specular_ior"), 1.33, rtol=1e-6)


@pytest.mark.parametrize(
    ("to", "inputs", "unit"),
    [
        (
            "materialx",
            {"film_conductor": "thinfilm_thickness", "film_standard_surface": "thin_film_thickness"},
            1,
        ),
        ("openpbr", {"film_open_pbr": "thin_film_thickness"}, 1e-3),
    ],
)
def test_an_uneven_film_takes_its_thickness_from_an_image(folder, library, to, inputs, unit):
    nm = np.array([[20.0, 35.0], [60.0, 41.0]])
    write(to, appearance(STEEL, np.unique(nm)), folder / f"uneven_{to}.mtlx", nm)
    found = document(folder / f"uneven_{to}.mtlx", library)
    for name, key in inputs.items():
        node = found.getNode(name).getConnectedNode(key)
        image = node.getConnectedNode("in")
        shares = plt.imread(folder / value(image, "file"))
        low, high = (value(node, each) for each in ("outlow", "outhigh"))
        np.testing.assert_allclose(low + (high - low) * shares, nm * unit, atol=1e-3 * unit)


def test_open_pbr_metal_has_two_colours(folder, library, looks):
    solution = write("openpbr", looks["steel"], folder / "metal.mtlx")
    found = document(folder / "metal.mtlx", library)
    node = found.getNode("film_open_pbr")
    np.testing.assert_allclose(value(node, "thin_film_thickness"), 0.04, rtol=1e-5)
    np.testing.assert_allclose(value(node, "base_color"), solution.numbers["base"], rtol=1e-5)
    assert value(node, "base_metalness") == 1
    # F82 of the bare metal, by complex amplitudes at a cosine of 1/7
    n, cosine = 2.7 + 2.8j, 1 / 7
    inside = np.sqrt(n**2 - 1 + cosine**2)
    amplitudes = (cosine - inside) / (cosine + inside), (n**2 * cosine - inside) / (n**2 * cosine + inside)
    mean = np.mean(np.abs(amplitudes) ** 2)
    normal = (1.7**2 + 2.8**2) / (3.7**2 + 2.8**2)
    schlick = normal + (1 - normal) * (6 / 7) ** 5
    np.testing.assert_allclose(solution.numbers["edge"], mean / schlick, rtol=1e-3)
    np.testing.assert_allclose(value(node, "specular_color"), solution.numbers["edge"], rtol=1e-5)


def test_usd_has_the_nodes_and_a_preview(folder, looks):
    from pxr import Usd, UsdShade

    write("usd", looks["oil"], folder / "oil.usda")
    stage = Usd.Stage.Open(str(folder / "oil.usda"))
    sphere = stage.GetPrimAtPath("/film/sphere")
    material, _ = UsdShade.MaterialBindingAPI(sphere).ComputeBoundMaterial()
    surface, _, _ = material.ComputeSurfaceSource("mtlx")
    assert surface.GetIdAttr().Get() == "ND_surface"
    bsdf = UsdShade.Shader(surface.GetInput("bsdf").GetConnectedSource()[0].GetPrim())
    assert bsdf.GetIdAttr().Get() == "ND_dielectric_bsdf"
    assert bsdf.GetInput("thinfilm_thickness").Get() == 400
    np.testing.assert_allclose(bsdf.GetInput("ior").Get(), 1.33, rtol=1e-6)
    assert material.GetPrim().GetAttribute("config:mtlx:version").Get() == "1.39"
    preview, _, _ = material.ComputeSurfaceSource()
    assert preview.GetIdAttr().Get() == "UsdPreviewSurface"
    record = json.loads(material.GetPrim().GetCustomDataByKey("pellicle"))
    assert record["physical"]["thickness_nm"] == [400, 400]


@pytest.mark.parametrize("name", ["oil", "steel"])
def test_usd_passes_the_validators_of_its_library(tmp_path, looks, name):
    """Those of usdchecker; packages of pip lack the registry of MaterialX's nodes, and only that is said."""
    from pxr import Usd

    validation = pytest.importorskip("pxr.UsdValidation")
    write("usd", looks[name], tmp_path / "film.usda")
    validators = validation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 10
    found = validation.ValidationContext(validators).Validate(Usd.Stage.Open(str(tmp_path / "film.usda")))
    unknown = [x.GetMessage() for x in found if x.GetName() == "MissingShaderIdInRegistry"]
    assert all("'ND_" in message for message in unknown)
    assert [x.GetMessage() for x in found if x.GetName() != "MissingShaderIdInRegistry"] == []
