"""Summaries of spectra, colours and cubes: what was read from a file, as text and as JSON."""

from typing import Any

import numpy as np

from pellicle.data.colours import Colours
from pellicle.data.cube import Cube
from pellicle.data.cubes.sampled_checks import sample
from pellicle.data.spectrum import Spectrum
from pellicle.reporting.fitted_colours import display
from pellicle.reporting.json_record import number, versions
from pellicle.reporting.plain_text import facts
from pellicle.signals.registry import KINDS

SPECTRUM_SCHEMA = "pellicle.spectrum/1"
_MAD = 1.4826  # standard deviation over median absolute deviation, for normal noise


def describe(measured: Spectrum | Colours | Cube, notes: tuple[str, ...] | None = None) -> str:
    """Describe what was read: quantity, points, noise, and how the file was read.

    `notes` replace those of the data.
    """
    if isinstance(measured, Spectrum):
        return describe_spectrum(measured, notes)
    return (
        describe_colours(measured, notes) if isinstance(measured, Colours) else describe_cube(measured, notes)
    )


def to_json(measured: Spectrum | Colours | Cube) -> dict[str, Any]:
    """Convert the summary to a dictionary; numbers that are unknown are None."""
    if isinstance(measured, Spectrum):
        return spectrum_json(measured)
    return colours_json(measured) if isinstance(measured, Colours) else cube_json(measured)


def describe_spectrum(spectrum: Spectrum, notes: tuple[str, ...] | None = None) -> str:
    """Describe what was read: quantity, range, points, angles, noise, and how the file was read.

    `notes` replace those of the spectrum.
    """
    nm, angles = spectrum.wavelength, _each(spectrum.angle)
    azimuths = _each(spectrum.azimuth)
    steps = np.diff(np.unique(nm))
    reach = f"{nm[0]:g} to {nm[-1]:g} nm, every {np.median(steps):.3g} nm" if steps.size else f"{nm[0]:g} nm"
    quantity = spectrum.kind.title + ("" if spectrum.calibrated else ", scale unknown")
    if not (spectrum.kind.ellipsometric or spectrum.kind.of_counts):
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


def spectrum_json(spectrum: Spectrum) -> dict[str, Any]:
    """Convert the summary to a dictionary; numbers that are unknown are None."""
    low, high = (float(x) for x in spectrum.wavelength[[0, -1]])
    stated = {
        name: None if errors is None else [number(errors.min()), number(errors.max())]
        for name, errors in (("sigma", spectrum.sigma), ("delta_sigma", spectrum.delta_sigma))
    }
    return {
        "schema": SPECTRUM_SCHEMA,
        "path": spectrum.path,
        "sha256": spectrum.sha256,
        "name": spectrum.name,
        "signal": spectrum.signal,
        "polarisation": spectrum.polarisation,
        "calibrated": spectrum.calibrated,
        "folded": spectrum.kind.folded,
        "transmission": spectrum.transmission,
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
    kind = spectrum.kind
    if not (kind.parts or kind.degrees):
        return {"values": spectrum.values[order]}
    return {quantity.name: quantity.measured(spectrum)[order] for quantity in kind.quantities}


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


COLOURS_SCHEMA = "pellicle.colours/1"
_SPACES = {
    "srgb": "display values of sRGB",
    "rgb": "channels of a camera",
    "xyz": "CIE XYZ",
    "lab": "CIE 1976 L*, a*, b*",
}
_COLOURS_SHOWN = 12
"""Colours that are listed."""


def describe_colours(colours: Colours, notes: tuple[str, ...] | None = None) -> str:
    """Describe what was read: the space, each colour with its angle, the noise and how the file was read.

    `notes` replace those of the colours.
    """
    light = f"{'transmitted' if colours.signal == 'T' else 'reflected'}, {colours.polarisation} light"
    plural = "s" * (len(colours) > 1)
    rows = [
        ("film", colours.name),
        ("quantity", f"{_SPACES[colours.space]}, {len(colours)} colour{plural}, {light}"),
        *(("" if i else ", ".join(colours.channels), text) for i, text in enumerate(_listed(colours))),
        ("noise", _colour_noise(colours)),
        ("white balance", "free" if colours.white_balance == "free" else ""),
        *((" " if i else "read", note) for i, note in enumerate(colours.notes if notes is None else notes)),
    ]
    return "\n".join([colours.path or "colours", *facts([row for row in rows if row[1]]), ""])


def colours_json(colours: Colours) -> dict[str, Any]:
    """Convert the summary to a dictionary. `display` are sRGB colours as #rrggbb."""
    nm = colours.sensor[0]
    return {
        "schema": COLOURS_SCHEMA,
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
    for i, values in enumerate(colours.values[:_COLOURS_SHOWN]):
        angle = "" if colours.angle is None else f"  at {colours.angle[i]:g} degrees"
        numbers = " ".join(f"{x:.{digits}f}" for x in values)
        lines.append(f"{numbers}  {_code(shown[i])}{angle}")
    left = len(colours) - len(lines)
    return [*lines, f"and {left} more"] if left else lines


def _code(shown: np.ndarray) -> str:
    return "#" + "".join(f"{int(x):02x}" for x in np.round(255 * np.clip(shown, 0, 1)))


def _colour_noise(colours: Colours) -> str:
    size = f"{np.median(colours.noise):.2g} in the median"
    return f"usual one, {size}" if colours.sigma is None else size


CUBE_SCHEMA = "pellicle.cube/1"
_BANDS_SHOWN = 6
"""Wavelengths at which the text shows the median spectrum."""


def describe_cube(cube: Cube, notes: tuple[str, ...] | None = None) -> str:
    """Describe what was read: quantity, pixels, bands, values, and how the file was read.

    `notes` replace those of the cube. Values are of a sample of the pixels.
    """
    seen, nm = _sample(cube), cube.wavelength
    kind = KINDS[cube.signal]()
    quantity = kind.title + ("" if cube.calibrated else ", scale unknown")
    if not kind.ellipsometric:
        quantity += f", {cube.polarisation} light"
    pixels = ", ".join(f"{dim} {n}" for dim, n in zip(cube.dims, cube.shape, strict=True))
    some = np.unique(np.linspace(0, nm.size - 1, _BANDS_SHOWN).round().astype(int))
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


def cube_json(cube: Cube) -> dict[str, Any]:
    """Convert the summary to a dictionary; values are of a sample of the pixels."""
    seen = _sample(cube)
    low, high = (float(x) for x in cube.wavelength[[0, -1]])
    return {
        "schema": CUBE_SCHEMA,
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
    sampled = sample({n: cube.arrays[n] for n in names if n in cube.arrays}, len(cube.dims))
    return {names[name]: values for name, values in sampled.items()}


def _medians(cube: Cube, seen: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Median over the pixels, and over the angles where there are several."""
    if cube.angle is not None and cube.angle.size > 1:
        return {}
    return {name: np.nanmedian(x.reshape(len(x), -1), axis=0) for name, x in seen.items()}


def _value_row(name: str, values: np.ndarray) -> tuple[str, str]:
    missing = np.mean(~np.isfinite(values))
    text = f"{np.nanmin(values):.4g} to {np.nanmax(values):.4g}"
    return name, text + (f", {100 * missing:.2g} % missing" if missing else "")
