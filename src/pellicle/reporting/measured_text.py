"""Summaries of spectra, colours, cubes and BRDF samples: what was read from a file, as text and as JSON."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from jaxtyping import Float

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.colour_rows import MEANING
from pellicle.data.colours import Colours
from pellicle.data.cube import Cube
from pellicle.data.cubes.checks import sample
from pellicle.data.spectrum import Spectrum
from pellicle.reporting.json_record import left_out, strict, taken, versions
from pellicle.reporting.plain_text import described
from pellicle.reporting.quantities import colour_codes
from pellicle.signals.registry import KINDS

_MAD = 1.4826  # standard deviation over median absolute deviation, for normal noise


def describe(measured: Spectrum | Colours | Cube | BrdfSamples, notes: tuple[str, ...] | None = None) -> str:
    """Describe what was read: quantity, points, noise, and how the file was read.

    `notes` replace those of the data.
    """
    match measured:
        case Spectrum():
            noun, rows = "spectrum", _spectrum_rows(measured)
        case Colours():
            noun, rows = "colours", _colours_rows(measured)
        case BrdfSamples():
            noun, rows = "samples", _samples_rows(measured)
        case _:
            noun, rows = "cube", _cube_rows(measured)
    return described(measured.path or noun, rows, measured.notes if notes is None else notes)


def to_json(measured: Spectrum | Colours | Cube | BrdfSamples) -> dict[str, Any]:
    """Convert the summary to a dictionary; numbers that are unknown are None."""
    if isinstance(measured, Spectrum):
        errors = taken(measured, "sigma", "delta_sigma")
        record = {
            "schema": "pellicle.spectrum/1",
            **taken(measured, "path", "sha256", "name", "signal", "polarisation", "calibrated"),
            "folded": measured.kind.folded,
            "transmission": measured.transmission,
            "points": len(measured),
            "sweeps": len(measured.sweeps),
            "range_nm": measured.wavelength[[0, -1]],
            "angles_deg": _each(measured.angle),
            "azimuths_deg": _each(measured.azimuth),
            "values": {name: [x.min(), x.max()] for name, x in _values(measured).items()},
            "noise": {name: scatter(x) for name, x in _values(measured).items()},
            **{name: None if x is None else [x.min(), x.max()] for name, x in errors.items()},
            "declared": dict(measured.declared),
            **left_out(measured),
        }
    elif isinstance(measured, BrdfSamples):
        record = {
            "schema": "pellicle.brdf/1",
            **taken(measured, "path", "sha256", "channels"),
            "samples": len(measured),
            "values": dict(zip(measured.channels, _ends(measured.values), strict=True)),
            "angles_deg": {
                name: _ends(getattr(measured, name)[:, None])[0] for name in ("theta_i", "theta_o")
            },
        }
    else:
        record = _colours_record(measured) if isinstance(measured, Colours) else _cube_record(measured)
    return strict(record | {"notes": measured.notes, "versions": versions()})


def _spectrum_rows(spectrum: Spectrum) -> list[tuple[str, str]]:
    """Labels and texts of quantity, range, points, angles and noise."""
    nm, values = spectrum.wavelength, _values(spectrum)
    steps = np.diff(np.unique(nm))
    reach = f"{nm[0]:g} to {nm[-1]:g} nm, every {np.median(steps):.3g} nm" if steps.size else f"{nm[0]:g} nm"
    quantity = spectrum.kind.title + ("" if spectrum.calibrated else ", scale unknown")
    if not (spectrum.kind.ellipsometric or spectrum.kind.of_counts):
        quantity += f", {spectrum.polarisation} light"
    sizes = {name: scatter(x) for name, x in values.items()}
    seen = ", ".join(f"{size:.2g} ({name})" for name, size in sizes.items() if np.isfinite(size))
    given = "" if spectrum.sigma is None else f"given, {np.median(spectrum.sigma):.2g} in the median"
    noise = (given, f"neighbouring points scatter by {seen}" if seen else "")
    return [
        ("spectrum", spectrum.name),
        ("quantity", quantity),
        *((label, f"{x.min():.4g} to {x.max():.4g}") for label, x in values.items()),
        ("wavelength", f"{reach}, {len(spectrum)} points"),
        ("angle", _degrees(_each(spectrum.angle))),
        ("azimuth", _degrees(_each(spectrum.azimuth))),
        ("sweeps", f"{len(spectrum.sweeps)}, averaged" if spectrum.sweeps else ""),
        ("noise", "; ".join(text for text in noise if text)),
        *spectrum.declared,
    ]


def _ends(values: Float[np.ndarray, "samples channels"]) -> list[list[float]]:
    """Least and largest value of each channel."""
    return [[column.min(), column.max()] for column in values.T]


def _samples_rows(samples: BrdfSamples) -> list[tuple[str, str]]:
    """Labels and texts of samples of a BRDF."""
    known = "" if samples.sigma is None else f"given, {np.median(samples.sigma):.2g} 1/sr in the median"
    values = zip(samples.channels, _ends(samples.values), strict=True)
    return [
        ("quantity", "BRDF: a fit needs the recipe of its surface"),
        ("samples", f"{len(samples)} pairs of directions"),
        ("light", f"at {samples.theta_i.min():.4g} to {samples.theta_i.max():.4g}° from the normal"),
        ("viewer", f"at {samples.theta_o.min():.4g} to {samples.theta_o.max():.4g}° from the normal"),
        *((name, f"{low:.4g} to {high:.4g} 1/sr") for name, (low, high) in values),
        ("noise", known),
    ]


def scatter(values: Float[np.ndarray, " points"]) -> float:
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


def _degrees(angles: Iterable[float]) -> str:
    text = ", ".join(f"{angle:g}" for angle in angles)
    return f"{text} degrees" if text else ""


_COLOURS_SHOWN = 12
"""Colours that are listed."""


def _colours_rows(colours: Colours) -> list[tuple[str, str]]:
    """Labels and texts of the space, of each colour as `0.412 0.355 0.220  #695b38  at 45 degrees`, and of
    the noise."""
    light = f"{'transmitted' if colours.signal == 'T' else 'reflected'}, {colours.polarisation} light"
    codes, digits = colour_codes(colours, colours.values), 2 if colours.space == "lab" else 4
    lines = []
    for i, values in enumerate(colours.values[:_COLOURS_SHOWN]):
        angle = "" if colours.angle is None else f"  at {colours.angle[i]:g} degrees"
        lines.append(f"{' '.join(f'{x:.{digits}f}' for x in values)}  {codes[i]}{angle}")
    left = len(colours) - len(lines)
    lines += [f"and {left} more"] if left else []
    noise = f"{np.median(colours.noise):.2g} in the median"
    return [
        ("film", colours.name),
        ("quantity", f"{MEANING[colours.space]}, {len(colours)} colour{'s' * (len(colours) > 1)}, {light}"),
        *(("" if i else ", ".join(colours.channels), text) for i, text in enumerate(lines)),
        ("noise", f"usual one, {noise}" if colours.sigma is None else noise),
        ("white balance", "free" if colours.white_balance == "free" else ""),
    ]


def _colours_record(colours: Colours) -> dict[str, Any]:
    """Summary of colours; `display` are sRGB colours as #rrggbb."""
    nm = colours.sensor[0]
    columns = zip(colours.channels, colours.values.T, strict=True)
    return {
        "schema": "pellicle.colours/1",
        **taken(colours, "path", "sha256", "name"),
        "signal": colours.space,
        "transmitted": colours.signal == "T",
        "polarisation": colours.polarisation,
        "points": len(colours),
        "range_nm": [nm.min(), nm.max()],
        "angles_deg": [] if colours.angle is None else colours.angle,
        "values": {channel: [x.min(), x.max()] for channel, x in columns},
        "colours": colours.values,
        "sigma": colours.sigma,
        "display": colour_codes(colours, colours.values),
        **taken(colours, "white_balance", "gamma"),
    }


_BANDS_SHOWN = 6
"""Wavelengths at which the text shows the median spectrum."""


def _cube_rows(cube: Cube) -> list[tuple[str, str]]:
    """Labels and texts of quantity, pixels, bands and values, which are of a sample of the pixels."""
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
        ("angle", "" if cube.angle is None else _degrees(cube.angle)),
    ]
    for name, values in seen.items():
        missing = np.mean(~np.isfinite(values))
        lacks = f", {100 * missing:.2g} % missing" if missing else ""
        rows.append((name, f"{np.nanmin(values):.4g} to {np.nanmax(values):.4g}{lacks}"))
    for name, middle in _medians(cube, seen).items():
        rows.append((f"median {name}", ", ".join(f"{middle[i]:.3g} at {nm[i]:g} nm" for i in some)))
    return rows


def _cube_record(cube: Cube) -> dict[str, Any]:
    """Summary of a cube; values are of a sample of the pixels."""
    seen = _sample(cube)
    return {
        "schema": "pellicle.cube/1",
        **taken(cube, "path", "fingerprint", "signal", "polarisation", "calibrated"),
        "pixels": dict(zip(cube.dims, cube.shape, strict=True)),
        "pixels_used": int(np.prod(cube.shape) if cube.mask is None else cube.mask.sum()),
        "points": cube.points,
        "bands": cube.wavelength.size,
        "range_nm": cube.wavelength[[0, -1]],
        "angles_deg": [] if cube.angle is None else cube.angle,
        "values": {name: [np.nanmin(x), np.nanmax(x)] for name, x in seen.items()},
        "missing": {name: np.mean(~np.isfinite(x)) for name, x in seen.items()},
        "median": _medians(cube, seen),
        "wavelength_nm": cube.wavelength,
        "units": cube.units,
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
