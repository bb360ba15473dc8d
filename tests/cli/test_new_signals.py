"""Optical contrast, and Ψ and Δ in transmission, from end to end."""

import pytest

CONTRAST = """
[data]
signal = "contrast"
wavelengths = { start = 450, stop = 750, step = 4 }

[scene]
substrate = "3.9+0.02j"
layer = [
    { name = "flake", material = "2.6+1.3j", thickness = { lower = 0.1, upper = 20, value = 3.35 } },
    { name = "oxide", material = 1.46, thickness = 285 },
]

[reference]
substrate = "3.9+0.02j"
layer = [{ material = 1.46, thickness = 285 }]
"""
TRANSMISSION = """
[data]
signal = "psi-delta"
transmission = true
angle = 60
wavelengths = { start = 450, stop = 750, step = 4 }

[scene]
substrate = 1.52
layer = [{ material = "2.1+0.01j", thickness = { lower = 10, upper = 400, value = 180 } }]
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("recipe", "noise", "name", "truth"),
    [(CONTRAST, 0.004, "flake.thickness", 3.35), (TRANSMISSION, 0.02, "thickness", 180.0)],
    ids=["contrast", "transmission"],
)
def test_simulate_plan_and_fit(pellicle, tmp_path, recipe, noise, name, truth):
    path, data = tmp_path / "film.toml", tmp_path / "film.csv"
    path.write_text(recipe, encoding="utf-8")
    assert pellicle("simulate", path, "--out", data, "--noise", noise).code == 0
    assert pellicle("plan", path).code == 0
    ran = pellicle("fit", data, "--recipe", path, "--json", "--out", tmp_path / "out")
    assert ran.code == 0, ran.err
    [record] = ran.objects
    found = record["parameters"][name]
    assert abs(found["value"] - truth) < 3 * found["stderr"]
    again = pellicle("fit", "--recipe", tmp_path / "out" / "recipe.toml", "--json").objects[0]
    assert again["parameters"][name]["value"] == pytest.approx(found["value"], rel=1e-9)


@pytest.mark.slow
def test_flags_of_transmission(pellicle, tmp_path):
    path, data = tmp_path / "film.toml", tmp_path / "film.csv"
    path.write_text(TRANSMISSION, encoding="utf-8")
    pellicle("simulate", path, "--out", data, "--noise", 0.02)
    flags = ["--layer", "2.1+0.01j", "--substrate", "1.52", "--thickness", "10:400", "--transmission"]
    [record] = pellicle("fit", data, *flags, "--json").objects
    assert record["parameters"]["thickness"]["value"] == pytest.approx(180.0, abs=1.0)
