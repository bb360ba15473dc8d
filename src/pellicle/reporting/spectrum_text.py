"""Summary of a measured spectrum: what was read from its file, as text and as JSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.reporting.json_record import number, versions
from pellicle.reporting.plain_text import facts

SCHEMA = "pellicle.spectrum/1"
QUANTITIES = {
    "R": "reflectance R",
    "T": "transmittance T",
    "psi-delta": "ellipsometry, psi and delta",
    "mueller": "normalised elements of a Mueller matrix",
    "generalised-psi-delta": "generalised ellipsometry, psi and delta of ratios",
    "counts": "raw counts",
}
_MAD = 1.4826  # standard deviation over median absolute deviation, for normal noise


def describe(spectrum: Spectrum, notes: tuple[str, ...] | None = None) -> str:
    """Describe what was read: quantity, range, points, angles, noise, and how the file was read.

    `notes` replace those of the spectrum.
    """
    nm, angles = spectrum.wavelength, _each(spectrum.angle)
    azimuths = _each(spectrum.azimuth)
    steps = np.diff(np.unique(nm))
    reach = f"{nm[0]:g} to {nm[-1]:g} nm, every {np.median(steps):.3g} nm" if steps.size else f"{nm[0]:g} nm"
    quantity = QUANTITIES[spectrum.signal] + ("" if spectrum.calibrated else ", scale unknown")
    if not spectrum.ellipsometric and spectrum.signal != "counts":
        quantity += f", {spectrum.polarisation} light"
    rows = [
        ("spectrum", spectrum.name),
        ("quantity", quantity),
        *((label, _span(values)) for label, values in _values(spectrum).items()),
        ("wavelength", f"{reach}, {len(spectrum)} points"),
        ("angle", ", ".join(f"{angle:g}" for angle in angles) + " degrees" if angles else ""),
        ("azimuth", ", ".join(f"{azimuth:g}" for azimuth in azimuths) + " degrees" if azimuths else ""),
        ("sweeps", f"{len(spectrum.sweeps)}, averaged" if spectrum.sweeps else ""),
        ("noise", _noise_text(spectrum)),
        *spectrum.declared,
        *((" " if i else "read", note) for i, note in enumerate(spectrum.notes if notes is None else notes)),
    ]
    return "\n".join([spectrum.path or "spectrum", *facts([row for row in rows if row[1]]), ""])


def to_json(spectrum: Spectrum) -> dict[str, Any]:
    """Convert the summary to a dictionary; numbers that are unknown are None."""
    low, high = (float(x) for x in spectrum.wavelength[[0, -1]])
    stated = {
        name: None if errors is None else [number(errors.min()), number(errors.max())]
        for name, errors in (("sigma", spectrum.sigma), ("delta_sigma", spectrum.delta_sigma))
    }
    return {
        "schema": SCHEMA,
        "path": spectrum.path,
        "sha256": spectrum.sha256,
        "name": spectrum.name,
        "signal": spectrum.signal,
        "polarisation": spectrum.polarisation,
        "calibrated": spectrum.calibrated,
        "folded": spectrum.folded,
        "points": len(spectrum),
        "sweeps": len(spectrum.sweeps),
        "range_nm": [low, high],
        "angles_deg": _each(spectrum.angle),
        "azimuths_deg": _each(spectrum.azimuth),
        "values": {name: [number(x.min()), number(x.max())] for name, x in _values(spectrum).items()},
        "noise": {name: number(scatter(x)) for name, x in _values(spectrum).items()},
        **stated,
        "declared": dict(spectrum.declared),
        "notes": list(spectrum.notes),
        "versions": versions(),
    }


def scatter(values: np.ndarray) -> float:
    """Noise of a point, from second differences of neighbours; NaN for fewer than 5 points.

    A smooth signal cancels: of independent noise σ, y₋ − 2y + y₊ has the standard deviation √6 σ.
    """
    if values.size < 5:
        return float("nan")
    return float(_MAD * np.median(np.abs(np.diff(values, 2))) / np.sqrt(6))


def _values(spectrum: Spectrum) -> dict[str, np.ndarray]:
    """Measured values by name; of several angles and azimuths in the order of the first."""
    order = slice(None)
    if spectrum.setting is not None:
        order = np.lexsort((spectrum.wavelength, spectrum.setting))  # neighbours are of one angle
    if spectrum.ratios and spectrum.delta is not None:
        each = ("psi", spectrum.values), ("delta", spectrum.delta)
        return {
            f"{angle}_{ratio}": own[order, i]
            for i, ratio in enumerate(spectrum.ratios)
            for angle, own in each
        }
    if spectrum.elements:
        return dict(zip(spectrum.elements, spectrum.values[order].T, strict=True))
    if spectrum.delta is None:
        return {"values": spectrum.values[order]}
    found = {"psi": spectrum.values[order], "delta": spectrum.delta[order]}
    if spectrum.depolarisation is not None:
        found["depolarisation"] = spectrum.depolarisation[order]
    return found


def _each(values: np.ndarray | None) -> list[float]:
    """Each angle or azimuth once."""
    return [] if values is None else [float(value) for value in np.unique(values)]


def _span(values: np.ndarray) -> str:
    return f"{values.min():.4g} to {values.max():.4g}"


def _noise_text(spectrum: Spectrum) -> str:
    sizes = {name: scatter(values) for name, values in _values(spectrum).items()}
    seen = ", ".join(f"{size:.2g} ({name})" for name, size in sizes.items() if np.isfinite(size))
    given = "" if spectrum.sigma is None else f"given, {np.median(spectrum.sigma):.2g} in the median"
    return "; ".join(
        text for text in (given, f"neighbouring points scatter by {seen}" if seen else "") if text
    )
