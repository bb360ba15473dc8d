"""Optical contrast, Ψ and Δ in transmission, and counts against a stack, from end to end."""

import numpy as np
import pytest

import pellicle as pl
from tests.film_recipes import CONTRAST, TRANSMISSION


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
    [record] = pellicle("fit", data, "--recipe", path, "--json", "--out", tmp_path / "out", code=0).objects
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


COUNTS = """
[data]
files = ["film.csv"]
signal = "R"
noise = 0.002
{reference}

[scene]
substrate = "Si"
layer = [{{ material = "SiO2", thickness = {{ lower = 100, upper = 800 }} }}]

[reference]
substrate = "Si"
layer = [{{ material = "SiO2", thickness = 100 }}]
"""


def repeated(pellicle, recipe, out):
    """A fit that finds 450 nm, and whose own recipe repeats it."""
    ran = pellicle("fit", "--recipe", recipe, "--json", "--verbose", "--out", out)
    assert ran.objects[0]["parameters"]["thickness"]["value"] == pytest.approx(450.0, abs=0.1)
    [again] = pellicle("fit", "--recipe", out / "recipe.toml", "--json").objects
    assert again["parameters"] == ran.objects[0]["parameters"]
    return ran.err


@pytest.mark.parametrize(("unit", "scale"), [("", 1), pytest.param(" (%)", 100, marks=pytest.mark.slow)])
def test_a_reflectance_relative_to_a_stack_of_known_layers(pellicle, tmp_path, write, unit, scale):
    """At 500 nm it is above 2: the oxide of the reference is antireflecting there."""
    nm = np.linspace(450.0, 850.0, 100)
    film, wafer = (pl.simulate(pl.Scene(pl.Layer("SiO2", d), "Si"), nm).values for d in (450.0, 100.0))
    rows = [f"{x},{y}" for x, y in zip(nm, scale * film / wafer, strict=True)]
    (tmp_path / "film.csv").write_text("\n".join([f"nm,R{unit}", *rows]), encoding="utf-8")
    path = write(COUNTS.format(reference=""), "film.toml")
    assert "relative to the reference" in repeated(pellicle, path, tmp_path / "out")


def test_counts_of_a_film_and_of_a_stack_of_known_layers(pellicle, tmp_path, write):
    nm = np.linspace(450.0, 850.0, 100)
    lamp = 4e4 * np.exp(-(((nm - 650) / 150) ** 2)) + 2000
    for name, thickness in (("film", 450.0), ("wafer", 100.0)):
        seen = pl.simulate(pl.Scene(pl.Layer("SiO2", thickness), "Si"), nm).values
        rows = [f"{x},{y}" for x, y in zip(nm, lamp * seen, strict=True)]
        (tmp_path / f"{name}.csv").write_text("\n".join(["nm,counts", *rows]), encoding="utf-8")
    path = write(COUNTS.format(reference='reference = "wafer.csv"'), "film.toml")
    repeated(pellicle, path, tmp_path / "out")
    pellicle("fit", "--recipe", path, "--reference-material", "Si").refused(3, "leave one out")
    path.write_text(COUNTS.format(reference=""), encoding="utf-8")
    pellicle("fit", "--recipe", path).refused(3, "no column of reference counts")
