"""Curves and colours as the page takes them, in JSON."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np

from pellicle.colour import lab, sensor
from pellicle.explorer.incidence import named
from pellicle.explorer.programs import Curve
from pellicle.explorer.sphere import to_linear_srgb
from pellicle.forward_model.plan import Plan
from pellicle.reporting.rendering_display import encode

_ORDINATES = {"Ψ": "Ψ (°)", "Δ": "Δ (°)", "R": "R (fraction)", "T": "T (fraction)"}
"""Labels of the ordinate of signals."""
_LISTED = 4
"""Number of angles above which the first and the last colour alone are listed in words."""


def plan_to_json(plan: Plan) -> list[dict[str, Any]]:
    """Convert the rows of a plan; their cost is not measured."""
    return [
        {
            "effect": row.effect,
            "choice": "on" if row.on else "off",
            "reason": row.why,
            "error": row.error_bound,
            "cost": None,
        }
        for row in plan.rows
    ]


def curve_to_json(curve: Curve) -> dict[str, Any]:
    """Convert a curve; 7 digits are more than a plot shows, None is a point without a value."""
    y = [float(f"{v:.7g}") if isfinite(v) else None for v in np.asarray(curve.y, float).tolist()]
    return {
        "label": curve.label,
        "signal": curve.signal,
        "setting": curve.setting,
        "ordinate": _ORDINATES.get(curve.signal),
        "x": [float(f"{v:.7g}") for v in np.asarray(curve.x, float).tolist()],
        "y": y,
    }


def colours_to_json(xyz: np.ndarray, angles: np.ndarray, light: str) -> dict[str, Any]:
    """Convert XYZ, (3,) or (angles, 3) at angles of incidence in degrees, of a `light` in words."""
    each = [
        {
            "hex": "#" + "".join(f"{round(255 * float(x)):02x}" for x in encode(to_linear_srgb(own))),
            "lab": np.asarray(lab(own, sensor().white)).round(2).tolist(),
        }
        for own in xyz.reshape(-1, 3)
    ]
    words = [
        ", ".join(f"{n} {x:.1f}" for n, x in zip(("L*", "a*", "b*"), own["lab"], strict=True)) for own in each
    ]
    text = f"{each[0]['hex']}: {light} under D65: {words[0]}"
    if len(each) > 1:
        rows = zip(angles.tolist(), each, words, strict=True)
        at = [f"{named(angle)} {own['hex']}: {numbers}" for angle, own, numbers in rows]
        listed = "; ".join(at) if len(at) <= _LISTED else f"{at[0]}; to {at[-1]}"
        text = f"{light} under D65 at each angle of incidence, from left to right: {listed}"
    return {**each[0], "each": [own["hex"] for own in each], "text": text}
