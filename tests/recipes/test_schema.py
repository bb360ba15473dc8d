"""The kept JSON schema of recipes: the one that the models give, and true of the repository's recipes."""

import json
import runpy
import tomllib
from pathlib import Path

import jsonschema
import pytest

ROOT = Path(__file__).parents[2]
KEPT = json.loads((ROOT / "docs" / "recipe.schema.json").read_text(encoding="utf-8"))
VALIDATOR = jsonschema.validators.validator_for(KEPT)(KEPT)
FOLDERS = ("docs", "fits", "measurements")
RECIPES = sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.toml"))


def test_it_is_what_the_models_say():
    """Else run `make schema`."""
    assert runpy.run_path(str(ROOT / "scripts" / "make_schema.py"))["schema"]() == KEPT
    VALIDATOR.check_schema(KEPT)


@pytest.mark.parametrize("path", RECIPES, ids=lambda path: str(path.relative_to(ROOT)))
def test_recipes_of_the_repository_are_valid(path):
    VALIDATOR.validate(tomllib.loads(path.read_text(encoding="utf-8")))


FILM = """[scene]
substrate = 'Si'
[[scene.layer]]
material = { model = 'constant', n = 1.8, k = { lower = 0, upper = 0.5 } }
thickness = 100
"""


def test_parameters_of_models():
    VALIDATOR.validate(tomllib.loads(FILM))


@pytest.mark.parametrize(
    "wrong",
    [
        "[scene]\nsubstrat = 'Si'\n[[scene.layer]]\nmaterial = 1.46\nthickness = 100",
        "[scene]\nsubstrate = 'Si'\n[[scene.layer]]\nmaterial = 1.46\nthickness = ['thick']",
        "[data]\nsignal = 'X'\n[scene]\nsubstrate = 'Si'\n[[scene.layer]]\nmaterial = 1.46\nthickness = 100",
        FILM.replace("'constant'", "'constand'"),
        FILM.replace("n = 1.8", "m = 1.8"),
    ],
    ids=["key", "type", "word", "model", "parameter"],
)
def test_wrong_recipes_are_not(wrong):
    with pytest.raises(jsonschema.ValidationError):
        VALIDATOR.validate(tomllib.loads(wrong))
