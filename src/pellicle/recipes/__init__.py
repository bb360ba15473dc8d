"""Recipes: TOML files and words of the command line to scenes and surfaces."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pellicle.recipes.read import read_recipe as read_recipe


def __getattr__(name: str) -> Any:
    # loaded when first used: the names of media are wanted without pydantic
    if name != "read_recipe":
        raise AttributeError(f"module 'pellicle.recipes' has no attribute {name!r}")
    from pellicle.recipes.read import read_recipe

    return read_recipe
