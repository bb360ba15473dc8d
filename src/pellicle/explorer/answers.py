"""Answers to the page: curves of models, data and fits, and colours as JSON, a ball under a film as a PNG."""

from collections.abc import Collection, Mapping, Sequence
from functools import cache, lru_cache
from math import isfinite
from typing import Any

import numpy as np

from pellicle.colour import lab, sensor
from pellicle.colour.spaces import srgb_matrix
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.spectrum import Spectrum
from pellicle.explorer.controls import Control
from pellicle.explorer.programs import COSINES, MOST, Curve, measured_angles, named, thinned
from pellicle.fitting.curves import Curve as FittedCurve
from pellicle.fitting.result import Fit
from pellicle.forward_model.plan import Plan
from pellicle.reporting import fit_text
from pellicle.reporting.json_record import taken
from pellicle.reporting.page.fit_pages import TONES
from pellicle.reporting.plotly_figure import numbers
from pellicle.reporting.renderings import display, encode, exposure, png
from pellicle.signals.base import Quantity
from pellicle.simulation.environment import Sphere, sphere, studio

WHITE_PERCENTILE = 97.0
"""Percentile of the luminance that is shown as white: a mirrored lamp covers 2 % of a ball."""
BACKGROUND = 0.06
"""sRGB value around the ball."""


@cache
def _lit(size: int) -> tuple[Sphere, np.ndarray]:
    """Pixels of a ball, and the radiance (pixels, 1) that each mirrors."""
    pixels = sphere(size)
    return pixels, studio().radiance(pixels.mirrored())[:, None]


def to_linear_srgb(xyz: np.ndarray) -> np.ndarray:
    """Convert XYZ (..., 3) under D65, observer 1931, to linear sRGB, not clipped."""
    return xyz @ srgb_matrix(sensor().white).T


def ball_rendering(xyz: np.ndarray, size: int) -> bytes:
    """Draw a ball that reflects the XYZ (`COSINES`, 3) of a film as a PNG of `size` × `size` pixels."""
    pixels, seen = _lit(size)
    colour = pixels.interpolated(np.arange(1, COSINES + 1) / COSINES, to_linear_srgb(xyz))
    rendering = pixels.rendering(colour * seen)
    return png(display(rendering, exposure(rendering, percentile=WHITE_PERCENTILE), BACKGROUND))


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
    return {
        **taken(curve, "label", "signal", "setting"),
        "ordinate": _ORDINATES.get(curve.signal),
        "x": _abscissa(np.asarray(curve.x, float).tobytes()),
        "y": numbers(curve.y, 7),
    }


@lru_cache(maxsize=64)  # curves of a view share one
def _abscissa(content: bytes) -> list[float | None]:
    return numbers(np.frombuffer(content), 7)


def colours_to_json(xyz: np.ndarray, angles: np.ndarray, light: str) -> dict[str, Any]:
    """Convert XYZ, (3,) or (angles, 3) at angles of incidence in degrees, of a `light` in words."""
    colours = [
        {
            "hex": "#" + "".join(f"{round(255 * float(x)):02x}" for x in encode(to_linear_srgb(own))),
            "lab": np.asarray(lab(own, sensor().white)).round(2).tolist(),
        }
        for own in xyz.reshape(-1, 3)
    ]
    words = ["L* {:.1f}, a* {:.1f}, b* {:.1f}".format(*own["lab"]) for own in colours]
    text = f"{colours[0]['hex']}: {light} under D65: {words[0]}"
    if len(colours) > 1:
        rows = zip(angles.tolist(), colours, words, strict=True)
        words_at = [f"{named(angle)} {own['hex']}: {numbers}" for angle, own, numbers in rows]
        listed = "; ".join(words_at) if len(words_at) <= _LISTED else f"{words_at[0]}; to {words_at[-1]}"
        text = f"{light} under D65 at each angle of incidence, from left to right: {listed}"
    return {**colours[0], "each": [own["hex"] for own in colours], "text": text}


def fit_to_json(fit: Fit, controls: Collection[Control]) -> dict[str, Any]:
    """Convert a fit: values of controls and their errors, of the noise and of 95 %, verdict and report."""
    values, errors = {}, {}
    for control in controls:
        estimate = fit.parameters.get(control.name)
        if estimate is not None and estimate.free:
            values[control.name] = min(max(estimate.value, control.lower), control.upper)
            both = {"noise": estimate.stderr_noise, "expanded": estimate.expanded}
            errors[control.name] = {name: x if isfinite(x) else None for name, x in both.items()}
    return {
        "values": values,
        "errors": errors,
        "status": str(fit.status),
        "tone": TONES[fit.status],
        "verdict": fit.verdict.replace("`", ""),
        "warnings": [warning.replace("`", "") for warning in fit.warnings],
        "summary": fit_text.report(fit).replace("`", ""),
    }


def data_curves(spectra: Sequence[Spectrum], against_angle: bool = False) -> list[Curve]:
    """Return the curves of spectra, one for each angle of incidence if they are measured at several.

    Of more than `MOST` angles some are left out. With `against_angle` there is one curve against the angle,
    and spectra at several wavelengths have none.
    """
    every, curves = measured_angles(spectra), []
    for spectrum in spectra:
        columns = {q.symbol: q.measured(spectrum) for q in _drawn(spectrum)}
        curves += _curves(spectrum, columns, every, against_angle)
    return curves


def fitted_curves(fit: Fit, against_angle: bool = False) -> list[Curve]:
    """Return the fitted signal of each spectrum, with its scale and offset, as `data_curves` does data."""
    every = measured_angles([part.spectrum for part in fit.parts])
    curves = []
    for part in fit.parts:
        model = part.curve
        if isinstance(model, FittedCurve) and np.ndim(model.model) == 1:
            columns = {q.symbol: q.curve(model)[1] for q in _drawn(part.spectrum)}
            curves += _curves(part.spectrum, columns, every, against_angle)
    return curves


def _drawn(spectrum: Spectrum) -> list[Quantity]:
    return [quantity for quantity in spectrum.kind.quantities if quantity.array != "depolarisation"]


def _curves(
    spectrum: Spectrum, columns: Mapping[str, np.ndarray], every: np.ndarray, against_angle: bool
) -> list[Curve]:
    """Curves of the `columns` of a spectrum by their labels; `every` has the angles of all spectra."""
    if against_angle:
        if spectrum.angle is None or np.ptp(spectrum.wavelength) > 0:
            return []
        rows = np.argsort(spectrum.angle, kind="stable")
        drawn = [(rows, spectrum.angle, "")]
    elif spectrum.angle is None or len(every) < 2:  # one angle has no name
        drawn = [(np.arange(len(spectrum)), spectrum.wavelength, "")]
    else:
        by_angle = [(np.flatnonzero(spectrum.angle == angle), named(angle)) for angle in thinned(every)]
        drawn = [(rows, spectrum.wavelength, setting) for rows, setting in by_angle if rows.size]
    return [
        Curve(label, x[rows], np.asarray(values)[rows], setting, spectrum.name)
        for rows, x, setting in drawn
        for label, values in columns.items()
    ]


def samples_text(samples: BrdfSamples, drawn: int) -> list[str]:
    """Sentences on BRDF samples that were read, of which some are drawn."""
    about = f"{samples.path}: BRDF, {len(samples)} samples of {', '.join(samples.channels)}"
    fewer = [f"{drawn} samples are drawn, spread over the file; a fit uses all of them"]
    return [about, *samples.notes, *(fewer if drawn < len(samples) else [])]


def data_text(spectra: Sequence[Spectrum]) -> list[str]:
    """Sentences on what was read."""
    sentences = []
    for spectrum in spectra:
        nm, angles = spectrum.wavelength, measured_angles([spectrum])
        across = f"from {nm.min():g} to {nm.max():g} nm" if np.ptp(nm) > 0 else f"at {nm[0]:g} nm"
        listed = ", ".join(f"{angle:g}" for angle in angles)
        if len(angles) > MOST:
            listed = f"{len(angles)} angles from {angles[0]:g} to {angles[-1]:g}"
        about = f"{spectrum.signal}, {len(nm)} points {across}{f', at {listed}°' if listed else ''}"
        sentences += [f"{spectrum.path}: {about}", *spectrum.notes]
    count = len(measured_angles(spectra))
    if count > MOST and any(np.ptp(spectrum.wavelength) > 0 for spectrum in spectra):
        sentences.append(f"data at {MOST} of {count} angles of incidence are drawn; a fit uses all of them")
    return list(dict.fromkeys(sentences))


def cut_ranges(spectra: Sequence[Spectrum]) -> list[list[float]]:
    """Ranges of wavelengths in nm below and above the data that are used, whose points are left out."""
    used = np.concatenate([spectrum.wavelength for spectrum in spectra])
    out = [spectrum.left_out.wavelength for spectrum in spectra if spectrum.left_out is not None]
    every = np.concatenate([used, *out])
    ends = [[every.min(), used.min()], [used.max(), every.max()]]
    return [[float(low), float(high)] for low, high in ends if high > low]
