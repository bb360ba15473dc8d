"""`pellicle explore`: what it serves, and what it refuses before it does."""

import sys
from pathlib import Path

import numpy as np
import pytest

from pellicle.cli import main
from tests.film_recipes import film_recipe

ROOT = Path(__file__).parents[2]
DATA = 'files = ["film.csv"]\nsignal = "T"\nrange = [450, 700]'
LAYER = 'material = "SiO2"\nthickness = { lower = 10, upper = 3000, value = 500 }'
RECIPE = film_recipe(DATA, LAYER, substrate='"BK7"')


@pytest.fixture
def explore(monkeypatch):
    """Run the command up to its server; returns the exit code and the session that would be served."""

    def run(*words):
        served = []
        ended = type("Ended", (Exception,), {})

        def serve(session, port, ready):
            served.append((session, port))
            raise ended

        monkeypatch.setattr("pellicle.explorer.server.serve", serve)
        monkeypatch.setattr(sys, "argv", ["pellicle", "explore", *words])
        try:
            return main(), served
        except ended:
            return 0, served

    return run


def values(session):
    return {each["name"]: each["value"] for each in session.answer("scene", {})["controls"]}


def test_without_a_recipe_it_shows_oxide_on_silicon(explore, capsys):
    code, [(session, port)] = explore("--port", "8123", "--no-browser")
    assert (code, port, session.title) == (0, 8123, "SiO2 on Si")
    assert values(session)["thickness"] == 500.0
    assert "0 to 1000 nm" in capsys.readouterr().err


def test_flags_describe_another_film(explore):
    words = "--layer 1.7 --substrate BK7 --back air --signal T --thickness 100:300 --angle 30"
    _, [(session, _)] = explore(*words.split())
    about = session.answer("scene", {})
    assert about["signals"] == ["T"]
    assert {"thickness": 200.0, "n": 1.7, "angle": 30.0}.items() <= values(session).items()


def test_several_angles_are_shown(explore):
    _, [(session, _)] = explore("--signal", "psi-delta", "--angle", "65,70,75")
    assert session.answer("scene", {})["angles"] == [65.0, 70.0, 75.0]


def test_a_recipe_comes_with_its_data(explore, tmp_path):
    (tmp_path / "film.toml").write_text(RECIPE)
    rows = [f"{nm:g},0.9" for nm in np.arange(400, 801, 2)]
    (tmp_path / "film.csv").write_text("\n".join(["wavelength_nm,T", *rows]))
    _, [(session, _)] = explore(str(tmp_path / "film.toml"))
    about = session.answer("scene", {})
    assert (about["title"], about["signals"], about["data"]["name"]) == ("film.toml", ["T"], "film.csv")
    [curve] = about["data"]["curves"]
    assert (curve["x"][0], curve["x"][-1]) == (450.0, 700.0)  # the range of the recipe
    assert 'files = ["film.csv"]' in session.answer("recipe", {})["toml"]


def test_the_recipe_on_the_page_reads_its_data_as_they_were_read(explore, tmp_path):
    points = ((500, 20), (600, 60), (700, 90))
    rows = [f"{nm},{angle},30,{delta}" for angle in (60, 70) for nm, delta in points]
    (tmp_path / "e.csv").write_text("\n".join(["wavelength_nm,angle_deg,psi_deg,delta_deg", *rows]))
    text = RECIPE[RECIPE.index("[scene]") :]
    text = f'[data]\nfiles = ["e.csv"]\nsignal = "psi-delta"\nfolded = true\nnoise = 0.1\n{text}'
    (tmp_path / "film.toml").write_text(text)
    _, [(session, _)] = explore(str(tmp_path / "film.toml"))
    toml = session.answer("recipe", {})["toml"]
    assert "folded = true" in toml
    assert "noise = 0.1" in toml
    assert "angle" not in toml
    dropped = {"name": "own.csv", "text": "wavelength_nm,R\n400,0.1\n500,0.2\n600,0.3\n", "angles": [0]}
    assert "error" not in session.answer("data", dropped)
    assert "folded" not in session.answer("recipe", {})["toml"]


def test_missing_data_are_no_obstacle(explore, tmp_path, capsys):
    (tmp_path / "film.toml").write_text(RECIPE)
    code, [(session, _)] = explore(str(tmp_path / "film.toml"))
    assert code == 0
    assert "data" not in session.answer("scene", {})
    assert "film.csv" in capsys.readouterr().err


def test_a_recipe_of_a_surface_is_shown_too(explore):
    code, [(session, _)] = explore(str(ROOT / "docs/surfaces/oil_film.toml"))
    assert (code, session.answer("scene", {})["kind"]) == (0, "surface")


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["none.toml"], 3, "none.toml"),
        (["film.toml", "--layer", "SiO2"], 2, "exclude each other"),
        (["--angle", "65,x"], 2, "degrees such as 70"),
        (["--angle", "65,95"], 2, "0 to 89.9 degrees"),
        (["--angle", ",".join(map(str, range(60, 74)))], 2, "up to 12 angles of incidence"),
        (["--layer", "Si02"], 2, "Si02"),
        (["--layer", "Si/Chandler-Horowitz"], 3, "share no wavelengths"),
    ],
)
def test_refusals(explore, words, code, said, capsys):
    found, served = explore(*words)
    assert (found, served) == (code, [])
    error = capsys.readouterr().err
    assert said in error
    assert "Traceback" not in error
