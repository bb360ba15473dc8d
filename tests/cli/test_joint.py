"""`pellicle fit --joint`: several files of one sample, one result."""

import json

import pytest


@pytest.fixture
def files(spectrum_file):
    return [spectrum_file(f"{name}.csv", seed=seed) for seed, name in enumerate("ab")]


def test_one_object_whose_data_is_a_list(pellicle, files, scene, tmp_path):
    out = tmp_path / "out"
    ran = pellicle("fit", *files, *scene, "--joint", "--json", "--out", out)
    assert ran.code == 0
    [found] = ran.objects
    assert [(d["name"], d["path"], d["points"]) for d in found["data"]] == [
        ("a", str(files[0]), 100),
        ("b", str(files[1]), 100),
    ]
    thickness = found["parameters"]["thickness"]
    assert abs(thickness["value"] - 300.0) < 4 * thickness["stderr"]
    assert json.loads((out / "result.json").read_text())["data"] == found["data"]
    assert not (out / "summary.csv").exists()


def test_a_recipe_says_so_too(pellicle, files, tmp_path):
    path = tmp_path / "film.toml"
    path.write_text(
        "[data]\nfiles = ['a.csv', 'b.csv']\njoint = true\n[scene]\nsubstrate = '3.9+0.02j'\n"
        "[[scene.layer]]\nmaterial = 1.46\nthickness = { lower = 10, upper = 800 }\n"
    )
    ran = pellicle("fit", "--recipe", path)
    assert ran.code == 0
    assert ran.out.count("[[Verdict]]") == 1
    assert "rms residual of b" in ran.out


def test_a_bad_file_is_one_failed_object(pellicle, files, scene, tmp_path):
    ran = pellicle("fit", files[0], tmp_path / "gone.csv", *scene, "--joint", "--json")
    assert ran.code == 3
    [found] = ran.objects
    assert found["status"] == "failed"
    assert len(found["data"]) == 2
    assert "gone.csv" in found["error"]
    assert "a.csv" not in found["error"]


def test_files_with_their_own_words(pellicle, files, tmp_path):
    """b.csv has counts, not fractions, so only it has a scale; and its own noise."""
    rows = files[1].read_text().splitlines()[1:]
    pairs = [row.split(",") for row in rows]
    files[1].write_text("\n".join(["wavelength_nm,intensity", *(f"{w},{3 * float(r)}" for w, r in pairs)]))
    path = tmp_path / "film.toml"
    path.write_text(
        "[data]\njoint = true\n[[data.file]]\npath = 'a.csv'\n[[data.file]]\npath = 'b.csv'\nsignal = 'R'\n"
        "noise = 0.006\nrange = [420, 790]\ninstrument = { scale = 'free' }\n"
        "[scene]\nsubstrate = '3.9+0.02j'\n"
        "[[scene.layer]]\nmaterial = 1.46\nthickness = { lower = 10, upper = 800 }\n"
    )
    ran = pellicle("fit", "--recipe", path, "--json")
    assert ran.code == 0
    [found] = ran.objects
    scale = found["parameters"]["instrument.scale.b"]
    assert abs(scale["value"] - 3) < 4 * scale["stderr"]
    assert not found["parameters"]["instrument.scale.a"]["free"]
    assert found["data"][1]["points"] < 100
    assert 0.7 < found["data"][1]["chi2_reduced"] < 1.4
    refused = pellicle("fit", files[0], "--recipe", path)
    assert refused.code == 2
    assert "exclude each other" in refused.err
