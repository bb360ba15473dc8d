"""`pellicle demo`: a newcomer's first minute."""

import json
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.image import imread


@pytest.fixture
def ran(pellicle, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return pellicle("demo")


@pytest.mark.slow
def test_it_leaves_a_folder_to_look_at(ran, tmp_path):
    folder = tmp_path / "pellicle-demo"
    assert ran.code == 0, ran.err
    assert f"see {folder.name}/result" in ran.err
    found = json.loads((folder / "result" / "result.json").read_text())
    thickness = found["parameters"]["thickness"]
    assert found["status"] == "converged"
    assert abs(thickness["value"] - 140.0) < 4 * thickness["stderr_noise"]  # what the recipe simulates
    assert found["posterior"]["trusted"] is True
    for name in ("colours.png", "result/figure.png", "result/corner.png"):
        assert np.ptp(imread(folder / name)[..., :3]) > 0.5


def test_a_folder_that_is_there_is_not_touched(pellicle, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    module = import_module("pellicle.cli.simulate")  # the name in its package is the command
    monkeypatch.setattr(module, "Batch", lambda *arguments, **options: SimpleNamespace(run=lambda: 0))
    monkeypatch.setattr(import_module("pellicle.cli.chart"), "chart", lambda *arguments, **more: 0)
    (tmp_path / "pellicle-demo").mkdir()
    mine = tmp_path / "pellicle-demo" / "hematite.toml"
    mine.write_text("mine")
    assert pellicle("demo").code == 0
    assert mine.read_text() == "mine"
    assert (tmp_path / "pellicle-demo-2" / "hematite.csv").is_file()
