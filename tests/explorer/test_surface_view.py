"""Surfaces in the explorer: the lobes are those of the model, and the recipe states the sliders."""

import jax
import numpy as np
import pytest

import pellicle as pl
from pellicle.brdf.directions import direction
from pellicle.brdf.models import model
from pellicle.explorer.session import Session

NUMBERS = {"thickness": pl.Free(100.0, 300.0), "n": [1.4, 1.45, 1.6], "diffuse": 0.2}


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


def test_data_and_fits_are_refused(session):
    assert "pellicle fit" in session.answer("data", {"name": "a.csv", "text": "1,2"})["error"]
    assert "error" in session.answer("fit", {})
