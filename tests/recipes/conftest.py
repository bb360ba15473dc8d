"""Reading of a recipe from its text, and refusals."""

import pytest

from pellicle.errors import DataError
from pellicle.recipes.read import read_recipe


@pytest.fixture
def read(write):
    return lambda text: read_recipe(write(text, "film.toml"))


@pytest.fixture
def scene(read):
    return lambda text: read(text).scene()


@pytest.fixture
def scene_of(scene):
    """The scene of 100 nm of a material on silicon, with more lines of its layer."""
    head = "[scene]\nsubstrate = 'Si'\n[[scene.layer]]\nthickness = 100\n"
    return lambda material, more="": scene(f"{head}material = {material}\n{more}")


@pytest.fixture
def refused(write, refusal):
    """Check that a recipe, or its scene, is refused by one sentence with these words."""

    def refused(text: str, *said: str):
        refusal(lambda path: read_recipe(path).scene(), write(text, "film.toml"), DataError, *said)

    return refused
