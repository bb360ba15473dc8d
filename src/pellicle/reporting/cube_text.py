"""Summary of a cube of spectra: what was read from its file, as text and as JSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from pellicle.data.cube import Cube
from pellicle.data.cubes.sampled_checks import sample
from pellicle.reporting.json_record import number, versions
from pellicle.reporting.plain_text import facts
from pellicle.reporting.spectrum_text import QUANTITIES

SCHEMA = "pellicle.cube/1"
_SHOWN = 6
"""Wavelengths at which the text shows the median spectrum."""


def describe(cube: Cube, notes: tuple[str, ...] | None = None) -> str:
    """Describe what was read: quantity, pixels, bands, values, and how the file was read.

    `notes` replace those of the cube. Values are of a sample of the pixels.
    """
    seen, nm = _sample(cube), cube.wavelength
    quantity = QUANTITIES[cube.signal] + ("" if cube.calibrated else ", scale unknown")
    if cube.signal != "psi-delta":
        quantity += f", {cube.polarisation} light"
    pixels = ", ".join(f"{dim} {n}" for dim, n in zip(cube.dims, cube.shape, strict=True))
    some = np.unique(np.linspace(0, nm.size - 1, _SHOWN).round().astype(int))
    rows = [
        ("quantity", quantity),
        ("pixels", pixels + ("" if cube.mask is None else f"; {int(cube.mask.sum())} used")),
        ("wavelength", f"{nm[0]:g} to {nm[-1]:g} nm, {nm.size} bands"),
        ("angle", "" if cube.angle is None else ", ".join(f"{a:g}" for a in cube.angle) + " degrees"),
        *(_value_row(name, values) for name, values in seen.items()),
        *(
            (f"median {name}", ", ".join(f"{middle[i]:.3g} at {nm[i]:g} nm" for i in some))
            for name, middle in _medians(cube, seen).items()
        ),
        *((" " if i else "read", note) for i, note in enumerate(cube.notes if notes is None else notes)),
    ]
    return "\n".join([cube.path or "cube", *facts([row for row in rows if row[1]]), ""])


def to_json(cube: Cube) -> dict[str, Any]:
    """Convert the summary to a dictionary; values are of a sample of the pixels."""
    seen = _sample(cube)
    low, high = (float(x) for x in cube.wavelength[[0, -1]])
    return {
        "schema": SCHEMA,
        "path": cube.path,
        "fingerprint": cube.fingerprint,
        "signal": cube.signal,
        "polarisation": cube.polarisation,
        "calibrated": cube.calibrated,
        "pixels": dict(zip(cube.dims, cube.shape, strict=True)),
        "pixels_used": int(np.prod(cube.shape) if cube.mask is None else cube.mask.sum()),
        "points": cube.points,
        "bands": int(cube.wavelength.size),
        "range_nm": [low, high],
        "angles_deg": [] if cube.angle is None else [float(angle) for angle in cube.angle],
        "values": {name: [number(np.nanmin(x)), number(np.nanmax(x))] for name, x in seen.items()},
        "missing": {name: number(np.mean(~np.isfinite(x))) for name, x in seen.items()},
        "median": {name: [number(x) for x in middle] for name, middle in _medians(cube, seen).items()},
        "wavelength_nm": [float(x) for x in cube.wavelength],
        "units": dict(cube.units),
        "notes": list(cube.notes),
        "versions": versions(),
    }


def _sample(cube: Cube) -> dict[str, np.ndarray]:
    """Sampled values by name, psi and delta of ellipsometry."""
    names = {"values": "psi" if "delta" in cube.arrays else "values", "delta": "delta"}
    found = sample({n: cube.arrays[n] for n in names if n in cube.arrays}, len(cube.dims))
    return {names[name]: values for name, values in found.items()}


def _medians(cube: Cube, seen: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Median over the pixels, and over the angles where there are several."""
    if cube.angle is not None and cube.angle.size > 1:
        return {}
    return {name: np.nanmedian(x.reshape(len(x), -1), axis=0) for name, x in seen.items()}


def _value_row(name: str, values: np.ndarray) -> tuple[str, str]:
    missing = np.mean(~np.isfinite(values))
    text = f"{np.nanmin(values):.4g} to {np.nanmax(values):.4g}"
    return name, text + (f", {100 * missing:.2g} % missing" if missing else "")
