"""Reading recipes: TOML files that describe a film, or a surface by its BRDF."""

import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from pellicle.errors import DataError, UsageError, did_you_mean
from pellicle.recipes import film, surface
from pellicle.recipes.film import FilmRecipe
from pellicle.recipes.surface import SurfaceRecipe


def read_recipe(path: str | os.PathLike[str]) -> FilmRecipe | SurfaceRecipe:
    """Read and check a recipe, a TOML file.

    **Arguments:** `path` of the recipe. Data files and tables of n and k that it names are relative to it.

    **Returns:** a `FilmRecipe`, or a `SurfaceRecipe` where the recipe has `[scene.surface]` or the signal
    "brdf". Both have `path`, `files` and `scene()`, which builds the `Scene` or the `Surface`.

    **Raises:** DataError in one sentence: which key, what was expected, the nearest known key.
    """
    loaded = _load(Path(path))
    try:
        return checked(loaded, str(path))
    except ValueError as error:
        raise DataError(f"{path}: {error}") from None


def checked(loaded: dict[str, Any], path: str) -> FilmRecipe | SurfaceRecipe:
    """Return the recipe of parsed tables. Raises UsageError for the first wrong key, in one sentence."""
    data, scene = loaded.get("data"), loaded.get("scene")
    by_signal = isinstance(data, dict) and data.get("signal") == "brdf"
    if by_signal or (isinstance(scene, dict) and "surface" in scene):
        return SurfaceRecipe(path, _validated(loaded, surface.TABLES))
    return FilmRecipe(path, _validated(loaded, film.TABLES))


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


def _validated(loaded: dict[str, Any], tables: Mapping[str, type[BaseModel]]) -> Any:
    """Check a parsed recipe against the table of the key "", whose sub-tables `tables` lists by their keys.

    Raises UsageError: which key, what was expected, the nearest known one.
    """
    try:
        return tables[""].model_validate(loaded)
    except ValidationError as error:
        raise UsageError(_first_error(error, tables)) from None


def _is_branch(part: str) -> bool:
    """True for the name of the branch of a union that was tried, a part of the location of its errors."""
    return part[:1].isupper() or part in ("str", "float") or part.startswith(("list[", "constrained-"))


def _first_error(error: ValidationError, tables: Mapping[str, type[BaseModel]]) -> str:
    """One sentence: an unknown key or an infinity goes before the errors of each branch of a union."""
    errors = error.errors(include_url=False)
    clearest = (e for kind in ("extra_forbidden", "finite_number") for e in errors if e["type"] == kind)
    chosen = next(clearest, errors[0])
    if isinstance(chosen["input"], list):  # a number was expected, or a list, whose errors tell more
        of_lists = (e for e in errors if any(str(part).startswith("list[") for part in e["loc"]))
        chosen = next(of_lists, chosen)
    where = [str(part) for part in chosen["loc"] if not _is_branch(str(part))]
    if chosen["type"] == "extra_forbidden" and where[-1:] != [str(chosen["loc"][-1])]:
        where.append(str(chosen["loc"][-1]))  # a key of the user, as `Data`, is no branch
    key = ".".join(where)
    if chosen["type"] == "extra_forbidden":
        owner = next((part for part in reversed(where[:-1]) if not part.isdigit()), "")
        known = list(tables.get(owner, tables[""]).model_fields)
        return f"unknown key {key!r}{did_you_mean(where[-1], known)}; known here: {', '.join(known)}"
    if chosen["type"] == "missing":
        return f"{key} is missing"
    if chosen["type"] == "value_error":
        return f"{key}: {chosen.get('ctx', {}).get('error', chosen['msg'])}"
    return f"{key}: {chosen['msg'][0].lower()}{chosen['msg'][1:]}, got {chosen['input']!r}"
