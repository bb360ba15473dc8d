"""Surfaces in the explorer: the lobes are those of the model, and the recipe states the sliders."""

import tempfile
from pathlib import Path

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.brdf.directions import direction
from pellicle.brdf.models import model
from pellicle.cli.explore import LightFlags, _session
from pellicle.cli.flags import SceneFlags
from pellicle.data.brdf_samples import write_brdf_samples
from pellicle.explorer.session import Session

FILM = {"thickness": 40.0, "n": 2.9, "base_n": 2.7, "base_k": 2.8, "roughness": 0.35, "diffuse": 0.0}
NUMBERS = {"thickness": pl.Free(100.0, 300.0), "n": [1.4, 1.45, 1.6], "diffuse": 0.2}


def csv(samples):
    """Text of a file of samples."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "samples.csv"
        write_brdf_samples(path, samples)
        return path.read_text()


@pytest.fixture(scope="module")
def session():
    return Session(pl.Surface("granier-heidrich-diffuse", NUMBERS))


def test_lobes_are_those_of_the_model(session):
    values = {"thickness": 250.0, "incidence": 30.0}
    answer = session.answer("view", {"values": values, "want": ["curves", "colour", "plan"], "wait": True})
    assert [curve["label"] for curve in answer["curves"]] == ["645 nm", "525 nm", "445 nm"]
    brdf = model("granier-heidrich-diffuse")
    at = np.array(answer["curves"][0]["x"])
    angles = np.array([-60.0, 0.0, 30.0])
    rows = [int(np.argmin(np.abs(at - angle))) for angle in angles]
    parameters = brdf.defaults() | NUMBERS | {"thickness": 250.0, "n": np.array(NUMBERS["n"])}
    expected = jax.jit(lambda i, o: brdf(parameters, i, o))(
        direction(30.0, 0.0), direction(np.abs(angles), np.where(angles >= 0, 180.0, 0.0))
    )
    found = np.array([curve["y"] for curve in answer["curves"]])[:, rows].T
    assert np.allclose(found, expected, rtol=1e-5)  # the model is computed in single precision here
    assert "colour" not in answer
    assert answer["warnings"] == []
    assert {row["effect"] for row in answer["plan"]} >= {"diffuse", "bands"}


def test_sliders_are_the_numbers_of_the_model(session):
    about = session.answer("scene", {})
    found = {each["name"]: (each["lower"], each["value"], each["upper"]) for each in about["controls"]}
    assert found["thickness"] == (100.0, 200.0, 300.0)
    assert found["diffuse"][1] == 0.2
    assert "n" not in found  # it differs between the channels
    assert about["kind"] == "surface"


def test_recipe_states_the_sliders(session, tmp_path):
    answer = session.answer("recipe", {"values": {"thickness": 250.0, "diffuse": 0.3}})
    (tmp_path / "surface.toml").write_text(answer["toml"])
    surface = pl.read_recipe(tmp_path / "surface.toml").scene()
    free = surface.numbers["thickness"]
    assert (free.lower, free.upper, free.start) == (100.0, 300.0, 250.0)
    assert surface.numbers["diffuse"] == 0.3
    assert list(surface.numbers["n"]) == [1.4, 1.45, 1.6]


SAMPLES = pl.simulate(pl.Surface("microfacet-film", FILM), noise=0.002)


@pytest.fixture
def measured():
    """A session of a surface with free numbers, and the samples of another one as a file that was dropped."""
    free = {"thickness": pl.Free(0, 300), "n": pl.Free(1.3, 3.5), "roughness": pl.Free(0.01, 1.0)}
    session = Session(pl.Surface("microfacet-film", {**FILM, **free}))
    return session, session.answer("data", {"name": "steel.csv", "text": csv(SAMPLES)})


def test_samples_are_drawn_against_the_half_angle_beside_the_model(measured):
    session, answer = measured
    assert "error" not in answer
    assert answer["notes"][0] == "steel.csv: BRDF, 1000 samples of R, G, B"
    assert any("400 samples are drawn" in note for note in answer["notes"])
    values = {"thickness": 40.0, "n": 2.9, "roughness": 0.35}
    view = session.answer("view", {"values": values, "want": ["curves"], "wait": True})
    pairs = zip(answer["curves"], view["curves"], strict=True)
    for data, seen in pairs:
        assert data["x"] == seen["x"] == sorted(seen["x"])
        assert data["label"] == seen["label"]
        residual = np.array(data["y"]) - np.array(seen["y"])
        assert 0.0015 < np.std(residual) < 0.0025  # the noise of the samples
    i, o = direction(SAMPLES.theta_i, SAMPLES.phi_i), direction(SAMPLES.theta_o, SAMPLES.phi_o)
    half = np.array(i + o) / np.linalg.norm(i + o, axis=-1, keepdims=True)
    every = np.rad2deg(np.arccos(half[:, 2]))
    assert np.all(np.min(np.abs(np.array(seen["x"])[:, None] - every), axis=1) < 2e-4)


@pytest.mark.slow
def test_samples_are_fitted_and_the_sliders_take_the_answer(measured):
    session, _ = measured
    answer = session.answer("fit", {"values": {"thickness": 150.0}})
    assert answer["values"]["thickness"] == pytest.approx(40.0, abs=0.2)
    assert answer["values"]["n"] == pytest.approx(2.9, abs=0.02)
    assert answer["tone"] == "good"
    assert "Evidence of a layer" in answer["verdict"]
    view = session.answer("view", {"values": answer["values"], "want": ["curves"], "wait": True})
    data = session.answer("scene", {})["data"]["curves"]
    for own, seen in zip(data, view["curves"], strict=True):
        assert np.std(np.array(own["y"]) - np.array(seen["y"])) < 0.0025


def test_the_recipe_names_the_samples_and_what_is_free(measured, tmp_path):
    session, _ = measured
    toml = session.answer("recipe", {"values": {"thickness": 50.0}, "free": ["thickness", "specular"]})[
        "toml"
    ]
    (tmp_path / "surface.toml").write_text(toml)
    (tmp_path / "steel.csv").write_text(csv(SAMPLES))
    recipe = pl.read_recipe(tmp_path / "surface.toml")
    assert len(recipe.read(recipe.files[0])) == 1000
    assert [number.name for number in recipe.scene().free_numbers()] == ["thickness", "specular"]
    assert recipe.scene().numbers["thickness"].start == 50.0


def test_a_reset_and_a_removal_show_the_lobes_again(measured):
    session, _ = measured
    assert "incidence" not in {each["name"] for each in session.answer("scene", {})["controls"]}
    assert session.answer("remove", {})["name"] is None
    about = session.answer("scene", {})
    assert "incidence" in {each["name"] for each in about["controls"]}
    assert about["axis"]["label"] == "angle of view (°)"


def test_files_of_another_kind_are_refused_in_a_sentence(measured):
    session, before = measured
    one = "theta_i,phi_i,theta_o,phi_o,value\n10,0,10,180,0.4\n"
    said = session.answer("data", {"name": "one.csv", "text": one})["error"]
    assert said.startswith("one.csv: 1 channels (value) for 3 of the surface")
    said = session.answer("data", {"name": "a.csv", "text": "nm,R\n400,1\n"})["error"]
    assert "no column is theta_i" in said
    assert session.answer("scene", {})["data"]["name"] == before["name"]


def test_an_index_of_each_channel_has_sliders_where_it_is_free():
    free = {"thickness": pl.Free(0, 300), "n": pl.Free(1.3, 1.8)}
    session = Session(pl.Surface("granier-heidrich", free))
    names = {each["name"] for each in session.answer("scene", {})["controls"]}
    assert {"n_r", "n_g", "n_b"} <= names
    toml = session.answer("recipe", {"values": {"n_r": 1.5, "n_g": 1.6, "n_b": 1.7}})["toml"]
    assert "n = { value = 1.5, lower = 1.3, upper = 1.8 }" in toml
    one = Session(pl.Surface("granier-heidrich", {"thickness": pl.Free(0, 300), "n": 1.5}))
    text = csv(pl.simulate(pl.Surface("granier-heidrich", {"n": 1.5})))
    assert "error" not in one.answer("data", {"name": "a.csv", "text": text})
    assert "free it in the recipe" in one.answer("fit", {"free": ["n"]})["error"]


def test_noise_is_read_by_the_field_of_the_page(measured):
    session, _ = measured
    answer = session.answer("data", {"reading": {"noise": "2 %"}})
    assert answer["reading"] == {"noise": "2 %"}
    assert session.shown.spectra[0].relative == (0.02,) * 3
    assert [field["name"] for field in session.answer("scene", {})["fields"]] == ["columns", "noise"]


def test_what_a_recipe_keeps_of_a_file_stays_when_a_field_is_changed(tmp_path):
    (tmp_path / "steel.csv").write_text(csv(SAMPLES))
    pl.write_recipe(
        pl.Surface("microfacet-film", FILM), tmp_path / "steel.toml", files=[tmp_path / "steel.csv"]
    )
    path = tmp_path / "steel.toml"
    path.write_text(path.read_text().replace("[data]", "[data]\nsamples = 300\nmax_theta = 70"))
    session = _session(str(path), SceneFlags(), LightFlags())
    kept = len(session.shown.spectra[0])
    assert kept <= 300
    assert "error" not in session.answer("data", {"reading": {"noise": "2 %"}})
    samples = session.shown.spectra[0]
    assert (len(samples), samples.relative) == (kept, (0.02,) * 3)
    assert max(samples.theta_o.max(), samples.theta_i.max()) <= 70
    toml = session.answer("recipe", {})["toml"]
    assert all(line in toml for line in ("samples = 300", "max_theta = 70", 'noise = "2 %"'))
    dropped = session.answer("data", {"name": "other.csv", "text": csv(SAMPLES)})
    assert dropped["notes"][0] == "other.csv: BRDF, 1000 samples of R, G, B"
    session.answer("reset", {})
    session.answer("data", {"reading": {}})
    assert (session.shown.spectra[0].path, len(session.shown.spectra[0])) == (samples.path, kept)


def test_without_data_a_fit_is_refused(session):
    assert "open a file" in session.answer("fit", {})["error"]
