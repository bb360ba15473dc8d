"""The recipe in a result folder repeats the fit, whatever flags made it."""

import tomllib

import numpy as np
import pytest


def numbers(record):
    return {name: np.array([x["value"], x["stderr"]], float) for name, x in record["parameters"].items()}


@pytest.mark.slow
@pytest.mark.parametrize(
    "flags",
    [
        ("--range", "450:750", "--noise", "0.004", "--loss", "huber", "--tolerance", "1e-4"),
        ("--free", "n", "--bandwidth", "free", "--scale", "free", "--uncertainty", "none"),
    ],
)
def test_of_flags(pellicle, spectrum_file, scene, tmp_path, flags):
    out = tmp_path / "out"
    first = pellicle("fit", spectrum_file(), *scene, *flags, "--json", "--out", out)
    again = pellicle("fit", "--recipe", out / "recipe.toml", "--json")
    assert again.code == first.code
    for name, pair in numbers(first.objects[0]).items():
        np.testing.assert_allclose(numbers(again.objects[0])[name], pair, rtol=1e-9)
    assert again.objects[0]["warnings"] == first.objects[0]["warnings"]


@pytest.mark.slow
def test_of_a_recipe_with_files_and_flags(pellicle, spectrum_file, tmp_path):
    one, other = spectrum_file("one.csv"), spectrum_file("other.csv", seed=1)
    (tmp_path / "film.toml").write_text(f"""
[data]
joint = true
[[data.file]]
path = '{one}'
instrument = {{ scale = "free" }}
[[data.file]]
path = '{other}'
noise = 0.01
[scene]
substrate = "Si"
[[scene.layer]]
material = "SiO2"
thickness = {{ lower = 10, upper = 1000 }}
""")
    out = tmp_path / "out"
    first = pellicle("fit", "--recipe", tmp_path / "film.toml", "--range", "450:750", "--json", "--out", out)
    again = pellicle("fit", "--recipe", out / "recipe.toml", "--json")
    assert again.objects[0]["parameters"].keys() == first.objects[0]["parameters"].keys()
    for name, pair in numbers(first.objects[0]).items():
        np.testing.assert_allclose(numbers(again.objects[0])[name], pair, rtol=1e-9)
    tables = tomllib.loads((out / "recipe.toml").read_text())["data"]["file"]
    assert [table["range"] for table in tables] == [[450, 750]] * 2
