"""Attributes of a map's dataset."""

from __future__ import annotations

import json
import math
from importlib.metadata import version
from typing import Any

from pellicle.data.cube import Cube
from pellicle.forward_model.plan import Row
from pellicle.mapping.continuity import evidence, row
from pellicle.mapping.pixels.fit import PixelModel


def attributes(cube: Cube, model: PixelModel, recipe: str, preview: int) -> dict[str, Any]:
    """Attributes of a map's store: input, recipe, plan, free parameters with their units.

    `preview` is the distance of its pixels in the input.
    """
    rows = [row for view in model.problem.views for row in view.plan.rows]
    return {
        "title": "map of thin-film parameters",
        "source": f"pellicle {version('pellicle')}",
        "path": cube.path,
        "fingerprint": cube.fingerprint,
        "signal": cube.signal,
        "bands": cube.wavelength.size,
        "range_nm": [float(cube.wavelength[0]), float(cube.wavelength[-1])],
        "preview": preview,
        "recipe": recipe or str(model.scene),
        "notes": list(cube.notes),
        "parameters": {parameter.name: parameter.unit for parameter in model.parameters},
        "plan": json.dumps(list(map(_record, [*rows, row(None)]))),
    }


def with_evidence(dataset: Any) -> None:
    """State in the plan of a dataset what neighbours decided."""
    rows = [each for each in json.loads(dataset.attrs["plan"]) if each["effect"] != "neighbours"]
    dataset.attrs["plan"] = json.dumps([*rows, _record(row(evidence(dataset)))])


def _record(effect: Row) -> dict[str, Any]:
    """A row of a plan as in the record of a fit."""
    error = effect.error_bound if math.isfinite(effect.error_bound) else None
    return {"effect": effect.effect, "on": bool(effect.on), "why": effect.why, "error_bound": error}
