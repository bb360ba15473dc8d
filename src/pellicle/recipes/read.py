"""Reading recipes: TOML files that describe a film, or a surface by its BRDF."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import Any

from pellicle.errors import DataError
from pellicle.recipes import film, surface
from pellicle.recipes.film import FilmRecipe
from pellicle.recipes.surface import SurfaceRecipe
from pellicle.recipes.validation import validated


def read_recipe(path: str | os.PathLike[str]) -> FilmRecipe | SurfaceRecipe:
    """Read and check a recipe, a TOML file.

    **Arguments:** `path` of the recipe. Data files and tables of n and k that it names are relative to it.

    **Returns:** a `FilmRecipe`, or a `SurfaceRecipe` where the recipe has `[scene.surface]` or the signal
    "brdf". Both have `path`, `files` and `scene()`, which builds the `Scene` or the `Surface`.

    **Raises:** DataError in one sentence: which key, what was expected, the nearest known key.
    """
    loaded = _load(Path(path))
    try:
        if _describes_surface(loaded):
            return SurfaceRecipe(str(path), validated(loaded, surface.TABLES))
        return FilmRecipe(str(path), validated(loaded, film.TABLES))
    except ValueError as error:
        raise DataError(f"{path}: {error}") from None


def _load(path: Path) -> dict[str, Any]:
    """The parsed TOML. Raises DataError."""
    try:
        return tomllib.loads(path.read_bytes().decode("utf-8-sig"))
    except IsADirectoryError:
        raise DataError(f"{path}: is a folder; give the recipe's TOML file") from None
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror}); check the recipe's path") from None
    except UnicodeDecodeError:
        raise DataError(
            f"{path}: is not UTF-8 text, and a recipe is a TOML file; data files are arguments of their own"
        ) from None
    except tomllib.TOMLDecodeError as error:
        raise DataError(f"{path}: is not TOML, as a recipe must be: {error}") from None
    except RecursionError:
        raise DataError(f"{path}: is not a recipe: its brackets are nested too deeply") from None


def _describes_surface(loaded: dict[str, Any]) -> bool:
    data, scene = loaded.get("data"), loaded.get("scene")
    by_signal = isinstance(data, dict) and data.get("signal") == "brdf"
    return by_signal or (isinstance(scene, dict) and "surface" in scene)
