"""`pellicle simulate`, `plan` and `cost` of surfaces."""

import json

import numpy as np
import pytest

from pellicle.data.read_brdf import read_brdf_samples
from tests.directions import unit

SEEN = 'files = ["seen.csv"]'
FILM = "thickness = { lower = 200, upper = 300 }\n"
BARE = "thickness = { value = 0, lower = 0, upper = 700 }\nn = 1.5\nbase_n = 2\nexponent = 4\ndiffuse = 0.05"


@pytest.fixture
def recipe(write):
    """Writes a recipe of a surface, and samples at viewing angles from 0 to 79 degrees in these steps."""

    def recipe(model="blinn-phong-film", numbers=BARE, data='signal = "brdf"', step=10):
        rows = "".join(f"30,0,{t},180,0.1,0.2,0.3\n" for t in range(0, 80, step))
        write("theta_i,phi_i,theta_o,phi_o,R,G,B\n" + rows, "seen.csv")
        return write(f'[data]\n{data}\n[scene.surface]\nmodel = "{model}"\n{numbers}', "bare.toml")

    return recipe


def by_hand(d):
    """A bare face of index 2 in a Blinn-Phong lobe of exponent 4, on 0.05/sr."""
    i, o = unit(d.theta_i, d.phi_i), unit(d.theta_o, d.phi_o)
    h = (i + o) / np.linalg.norm(i + o, axis=-1, keepdims=True)
    c0 = np.sum(i * h, axis=-1)
    c1 = np.sqrt(1 - (1 - c0**2) / 4)
    fresnel = 0.5 * ((c0 - 2 * c1) / (c0 + 2 * c1)) ** 2 + 0.5 * ((2 * c0 - c1) / (2 * c0 + c1)) ** 2
    return h[:, 2] ** 4 * fresnel + 0.05


def test_the_command_writes_what_the_surface_sends_back(pellicle, recipe, tmp_path):
    ran = pellicle("simulate", recipe(), "--out", tmp_path / "bare.csv")
    assert (ran.code, ran.out) == (0, "")
    assert "1000 spread over the lobe" in ran.err
    text = (tmp_path / "bare.csv").read_text().splitlines()
    assert "SYNTHETIC" in text[1]
    assert "recipe bare.toml, seed 0, noise 0" in text[2]
    assert "thickness = 0 nm" in text[3]
    found = read_brdf_samples(tmp_path / "bare.csv")
    assert found.sigma is None
    np.testing.assert_allclose(found.values, np.tile(by_hand(found)[:, None], 3), rtol=1e-9)


def test_noise_and_the_directions_of_a_file(pellicle, recipe, tmp_path):
    path = recipe(data=f'signal = "brdf"\n{SEEN}\nnoise = 0.02', step=1)
    pellicle("simulate", path, "--out", tmp_path / "a.csv", code=0)
    made = read_brdf_samples(tmp_path / "a.csv")
    np.testing.assert_array_equal(made.theta_o, np.arange(80.0))
    assert np.all(made.sigma == 0.02)
    assert 0.017 < np.std(made.values - by_hand(made)[:, None]) < 0.023


@pytest.mark.slow
def test_a_plan_names_the_effects_of_a_surface(pellicle, recipe):
    path = recipe("granier-heidrich-full", f"{FILM}deviation = 1e-4\ndiffuse = 0.2", SEEN)
    (record,) = pellicle("plan", path, "--tolerance", 1e-3, "--json").objects
    assert (record["schema"], record["tolerance"]) == ("pellicle.plan/1", 1e-3)
    found = {row["effect"]: row for row in record["effects"]}
    names = ("spectral-sampling", "bands", "roughness", "deviation", "diffuse", "coherence", "precision")
    assert tuple(found) == names
    assert sum(row["error_bound"] for row in found.values()) == record["error_bound"] <= 1e-3
    assert not found["deviation"]["on"]
    assert 0 < found["deviation"]["error_without"] < 1e-3 < found["diffuse"]["error_without"]
    recipe("granier-heidrich-full", f"{FILM}diffuse = 0\nspecular = 0", SEEN)
    pellicle("plan", path).refused(2, "nothing to compute")


@pytest.mark.slow
def test_what_accuracy_costs_for_a_surface(pellicle, recipe, tmp_path):
    path, out = recipe("granier-heidrich-diffuse", FILM, SEEN), tmp_path / "cost"
    (record,) = pellicle("cost", path, "--json", "--out", out, "--tolerance", 1e-5, code=0).objects
    assert record == json.loads((out / "result.json").read_text())
    assert (record["schema"], record["unit"], record["tolerance"]) == ("pellicle.cost/1", "relative", 1e-5)
    found = {rung["name"]: rung for rung in record["rungs"]}
    assert {"float64", "float32", "planned", "without interference", "one wavelength"} == found.keys()
    assert record["recommended"] in found
    assert found["float64"]["error"] == 0.0
    assert 1e-9 < found["float32"]["error"] < 1e-5 < found["one wavelength"]["error"]
    assert all(rung["seconds"] > 0 for rung in found.values())
    assert record["left_out"]["no diffuse part"] == "nothing else is left of the BRDF"
    assert "three wavelengths only" in record["no_colours"]
    assert (out / "cost.png").read_bytes().startswith(b"\x89PNG")
    assert "No colours:" in (out / "report.txt").read_text()
    assert len((out / "cost.csv").read_text().splitlines()) == 1 + len(found)


def test_what_cannot_be_asked_of_a_surface(pellicle, recipe, tmp_path):
    for command, flags, said in (
        ("cost", ("--reference", "mpmath"), "--reference is for films"),
        ("cost", ("--tolerance", 0), "--tolerance must be above zero"),
        ("plan", ("--tolerance", -1), "--tolerance must be above zero"),
        ("simulate", ("--out", tmp_path / "x.csv", "--noise", -1), "--noise must be a standard deviation"),
    ):
        pellicle(command, recipe(), *flags).refused(2, said)
