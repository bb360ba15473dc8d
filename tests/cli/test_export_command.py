"""`pellicle export` writes the files and prints both errors."""

import json

import pytest

from pellicle.rendering.targets import TARGETS

pytest.importorskip("pygltflib")

RECIPE = '[scene]\nsubstrate = "2.7+2.8j"\n[[scene.layer]]\nmaterial = 2.9\nthickness = 40\n'


def test_the_command_writes_and_reports(pellicle, tmp_path):
    recipe, out = tmp_path / "steel.toml", tmp_path / "steel.glb"
    recipe.write_text(RECIPE)
    ran = pellicle("export", recipe, "--to", "gltf", "--out", out, code=0)
    assert out.read_bytes().startswith(b"glTF")
    assert "mean ΔE2000" in ran.out
    assert "solved numbers are drawn" in ran.out
    for flags, words in (
        (("--to", "gltf", "--out", out), "exists"),
        (("--to", "glt", "--out", out), "did you mean 'gltf'"),
        (("--to", "gltf", "--out", tmp_path / "b.glb", "--numbers", "best"), "--numbers must be"),
    ):
        pellicle("export", recipe, *flags).refused(2, words)


def test_a_fit_is_exported_with_its_values(pellicle, tmp_path):
    """The record of a fit names its recipe, or has its flags."""
    recipe, record = tmp_path / "steel.toml", tmp_path / "result.json"
    recipe.write_text(RECIPE.replace("thickness = 40", "thickness = { lower = 10, upper = 100 }"))
    flags = {"layer": "2.9", "substrate": "2.7+2.8j", "thickness": "10:100"}
    fit = {"parameters": {"thickness": {"value": 40.0}}}
    for number, source in enumerate(({"recipe": str(recipe)}, {"flags": flags})):
        record.write_text(json.dumps(fit | {"scene": source}))
        out = ("--to", "gltf", "--out", tmp_path / f"{number}.glb", "--json")
        assert pellicle("export", record, *out, code=0).objects[0]["thickness_nm"] == [40, 40]
    out = ("--to", "gltf", "--out", tmp_path / "c.glb")
    for text, code, words in (
        (json.dumps(fit | {"scene": {"recipe": "no.toml"}}), 2, ("no.toml is not there", "--recipe")),
        ('{"parameters": {}}', 3, ("no fitted parameters",)),
        ("{", 3, ("is not JSON",)),
    ):
        record.write_text(text)
        pellicle("export", record, *out).refused(code, *words)


def test_the_help_names_every_renderer(pellicle):
    words = pellicle("export", "--help").out.replace(",", " ").replace(".", " ").split()
    assert set(TARGETS) <= set(words)
