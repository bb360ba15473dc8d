"""What a recipe describes, read before anything heavy is imported."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path


def describes_surface(path: str | os.PathLike[str]) -> bool:
    """Whether a recipe is one of a surface; False for what cannot be read, which others tell better."""
    try:
        loaded = tomllib.loads(Path(path).read_text("utf-8"))
    except (OSError, ValueError):
        return False
    data, scene = loaded.get("data"), loaded.get("scene")
    named = isinstance(data, dict) and data.get("signal") == "brdf"
    return named or (isinstance(scene, dict) and "surface" in scene)
