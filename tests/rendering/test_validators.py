"""Every kind of exported file by the validators of its format; test_documents.py has that of OpenUSD."""

import json
import subprocess
from shutil import which

import numpy as np
import pytest

import pellicle as pl
from pellicle.dispersion.empirical import Constant
from pellicle.fitting.batch.data import CODES
from pellicle.mapping.store import IDENTITY, write_dataset

xarray = pytest.importorskip("xarray")
pytest.importorskip("zarr")

NM, ALPHA = np.array([[20.0, 30.0, 40.0], [25.0, 50.0, 60.0]]), np.array([[0.1, 0.3], [0.2, 0.9]])
FREE = pl.Free(5, 100)
FILMS = {
    "metal": pl.Scene(pl.Layer(2.9, FREE), Constant(pl.Free(1, 4), pl.Free(1, 4))),
    "glass": pl.Scene(pl.Layer(1.38, FREE), Constant(pl.Free(1.3, 2))),
    "bubble": pl.Scene(pl.Layer(1.33, FREE), 1.0),
    "stack": pl.Scene([pl.Layer("SiO2", FREE), pl.Layer(2.0, 80.0)], "Si"),
}
IMAGES = {
    "metal": {"substrate.n": 2 + NM / 50, "substrate.k": 3 - NM / 50},
    "glass": {"substrate.n": 1.3 + NM / 100},
}
GLTF_VALIDATOR = """
const validator = require('gltf-validator'), fs = require('fs');
const read = (file) => validator.validateBytes(new Uint8Array(fs.readFileSync(file)));
Promise.all(process.argv.slice(1).map(read)).then((all) => console.log(JSON.stringify(all)));
"""


@pytest.fixture(scope="module")
def films(tmp_path_factory):
    """Exports films as they are, plain and with textures; solved numbers take no other form."""

    def exported(to, suffix):
        written = []
        for name, scene in FILMS.items():
            for maps in ({}, _maps(name, tmp_path_factory.mktemp(name))):
                path = tmp_path_factory.mktemp(f"{name}_{to}") / f"{name}{suffix}"
                written.append(pl.export(scene, to=to, path=path, numbers="physical", **maps).files[0])
        return written

    with pytest.MonkeyPatch.context() as patch:
        from pellicle.rendering import export

        patch.setattr(export, "effective", export.physical)
        yield exported


def _maps(name, folder):
    images = {"layer1.thickness" if name == "stack" else "thickness": NM} | IMAGES.get(name, {})
    data = {"status": (("y", "x"), np.full(NM.shape, CODES["converged"], np.uint8))}
    data |= {key.replace(".", "_"): (("y", "x"), image) for key, image in images.items()}
    about = {IDENTITY: "{}", "path": "cube.nc", "parameters": dict.fromkeys(images, "")}
    write_dataset(folder / "map.zarr", xarray.Dataset(data, attrs=about))
    return {"thickness_map": pl.Map(folder / "map.zarr"), "roughness_map": ALPHA}


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".gltf", ".glb"])
def test_gltf_validator_finds_no_errors_and_warnings(films, suffix):
    """Packages of npm are found where the tests run, or by NODE_PATH."""
    pytest.importorskip("pygltflib")
    node = which("node")
    if (
        node is None
        or subprocess.run([node, "-e", "require('gltf-validator')"], capture_output=True).returncode
    ):
        pytest.skip("gltf-validator is not installed: npm install gltf-validator")
    files = films("gltf", suffix)
    ran = subprocess.run([node, "-e", GLTF_VALIDATOR, *map(str, files)], capture_output=True, check=True)
    for file, report in zip(files, json.loads(ran.stdout), strict=True):
        # unused textures and odd sizes of images are remarks
        serious = [x["message"] for x in report["issues"]["messages"] if x["severity"] < 2]
        assert not serious, (file, serious)
        assert report["info"]["materialCount"] == 1
        assert not [x for x in report["issues"]["messages"] if x["code"] == "UNSUPPORTED_EXTENSION"]


@pytest.mark.slow
@pytest.mark.parametrize("to", ["materialx", "openpbr"])
def test_materialx_accepts_every_node_and_input(films, to):
    materialx = pytest.importorskip("MaterialX")
    library = materialx.createDocument()
    folders, path = materialx.getDefaultDataLibraryFolders(), materialx.getDefaultDataSearchPath()
    materialx.loadLibraries(folders, path, library)
    for file in films(to, ".mtlx"):
        found = materialx.createDocument()
        materialx.readFromXmlFile(found, str(file))
        found.setDataLibrary(library)
        valid, why = found.validate()
        assert valid, (file, why)
        for node in found.getNodes():
            assert node.getNodeDef() is not None, (file, node.getName())
