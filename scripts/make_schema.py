"""Write the JSON schema of recipes, for editors that complete and check TOML.

Run `python scripts/make_schema.py`. It uses the pydantic models of film and surface recipes.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic.json_schema import models_json_schema

from pellicle.recipes.schema import RecipeTable, SurfaceRecipeTable

SCHEMA = Path(__file__).resolve().parents[1] / "docs" / "recipe.schema.json"


def schema() -> dict[str, Any]:
    """Return one schema for both kinds of recipe."""
    kinds = (RecipeTable, SurfaceRecipeTable)
    schemas, definitions = models_json_schema([(kind, "validation") for kind in kinds])
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A recipe of pellicle",
        "anyOf": [schemas[kind, "validation"] for kind in kinds],
        "$defs": definitions["$defs"],
    }


def main() -> None:
    SCHEMA.write_text(json.dumps(schema(), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
