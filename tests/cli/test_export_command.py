"""`pellicle export` writes the files and prints both errors."""

import pytest

pytest.importorskip("pygltflib")

RECIPE = '[scene]\nsubstrate = "2.7+2.8j"\n[[scene.layer]]\nmaterial = 2.9\nthickness = 40\n'


def test_the_command_writes_and_reports(pellicle, tmp_path):
    recipe, out = tmp_path / "steel.toml", tmp_path / "steel.glb"
    recipe.write_text(RECIPE)
    ran = pellicle("export", recipe, "--to", "gltf", "--out", out)
    assert ran.code == 0, ran.err
    assert out.read_bytes().startswith(b"glTF")
    assert "mean ΔE2000" in ran.out
    assert "solved numbers are drawn" in ran.out
    for flags, words in (
        (("--to", "gltf", "--out", out), "exists"),
        (("--to", "glt", "--out", out), "did you mean 'gltf'"),
        (("--to", "gltf", "--out", tmp_path / "b.glb", "--numbers", "best"), "--numbers must be"),
    ):
        pellicle("export", recipe, *flags).refused(2, words)
