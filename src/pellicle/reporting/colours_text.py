"""Summary of measured colours: what was read from their file, as text and as JSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from pellicle.data.colours import Colours
from pellicle.reporting.fitted_colours import display
from pellicle.reporting.json_record import number, versions
from pellicle.reporting.plain_text import facts

SCHEMA = "pellicle.colours/1"
_QUANTITIES = {
    "srgb": "display values of sRGB",
    "rgb": "channels of a camera",
    "xyz": "CIE XYZ",
    "lab": "CIE 1976 L*, a*, b*",
}
_SHOWN = 12
"""Colours that are listed."""


def describe(colours: Colours, notes: tuple[str, ...] | None = None) -> str:
    """Describe what was read: the space, each colour with its angle, the noise and how the file was read.

    `notes` replace those of the colours.
    """
    light = f"{'transmitted' if colours.signal == 'T' else 'reflected'}, {colours.polarisation} light"
    plural = "s" * (len(colours) > 1)
    rows = [
        ("film", colours.name),
        ("quantity", f"{_QUANTITIES[colours.space]}, {len(colours)} colour{plural}, {light}"),
        *(("" if i else ", ".join(colours.channels), text) for i, text in enumerate(_listed(colours))),
        ("noise", _noise(colours)),
        ("white balance", "free" if colours.white_balance == "free" else ""),
        *((" " if i else "read", note) for i, note in enumerate(colours.notes if notes is None else notes)),
    ]
    return "\n".join([colours.path or "colours", *facts([row for row in rows if row[1]]), ""])


def to_json(colours: Colours) -> dict[str, Any]:
    """Convert the summary to a dictionary. `display` are sRGB colours as #rrggbb."""
    nm = colours.sensor[0]
    return {
        "schema": SCHEMA,
        "path": colours.path,
        "sha256": colours.sha256,
        "name": colours.name,
        "signal": colours.space,
        "transmitted": colours.signal == "T",
        "polarisation": colours.polarisation,
        "points": len(colours),
        "range_nm": [number(nm.min()), number(nm.max())],
        "angles_deg": [] if colours.angle is None else [number(x) for x in colours.angle],
        "values": {
            channel: [number(x.min()), number(x.max())]
            for channel, x in zip(colours.channels, colours.values.T, strict=True)
        },
        "colours": [[number(x) for x in row] for row in colours.values],
        "sigma": None if colours.sigma is None else [[number(x) for x in row] for row in colours.sigma],
        "display": [_code(row) for row in display(colours, colours.values)],
        "white_balance": colours.white_balance,
        "gamma": number(colours.gamma),
        "notes": list(colours.notes),
        "versions": versions(),
    }


def _listed(colours: Colours) -> list[str]:
    """A line for each colour, `0.412 0.355 0.220  #695b38  at 45 degrees`."""
    shown = display(colours, colours.values)
    digits = 2 if colours.space == "lab" else 4
    lines = []
    for i, values in enumerate(colours.values[:_SHOWN]):
        angle = "" if colours.angle is None else f"  at {colours.angle[i]:g} degrees"
        numbers = " ".join(f"{x:.{digits}f}" for x in values)
        lines.append(f"{numbers}  {_code(shown[i])}{angle}")
    left = len(colours) - len(lines)
    return [*lines, f"and {left} more"] if left else lines


def _code(shown: np.ndarray) -> str:
    return "#" + "".join(f"{int(x):02x}" for x in np.round(255 * np.clip(shown, 0, 1)))


def _noise(colours: Colours) -> str:
    size = f"{np.median(colours.noise):.2g} in the median"
    return f"usual one, {size}" if colours.sigma is None else size
