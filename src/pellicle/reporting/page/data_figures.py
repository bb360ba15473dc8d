"""Interactive figures of a fit: data, model and residuals of each part, and of several fits of one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.fitting.curves import BrdfCurve, ColourCurve, Curve
from pellicle.reporting import brdf_figure, fitted_colours, intensity_figure, measured_lines
from pellicle.reporting.generalised_figure import NAMES, weighted_delta
from pellicle.reporting.page.figure import (
    Column,
    Panel,
    Trace,
    band,
    figure,
    line,
    markers,
    thinning,
)

if TYPE_CHECKING:
    from pellicle.fitting.result import Fit, Part, Rival

CHANNELS = "var(--red)", "var(--green)", "var(--blue)", "var(--fourth)"
_LINES = "var(--fit)", "var(--blue)", "var(--green)", "var(--fourth)"


def label(rival: Rival, fit: Fit) -> str:
    """`thickness 242.87 nm`: the leading parameter of the fit, with a rival's value."""
    name = next(iter([name for name in fit.parameters if name in rival.parameters] or rival.parameters))
    unit = fit.parameters[name].unit if name in fit.parameters else ""
    return f"{name} {rival.parameters[name]:.5g} {unit}".rstrip()


def of_part(fit: Fit, number: int) -> dict[str, Any]:
    """Data, model and residuals of one part, with those of rivals."""
    part = fit.parts[number]
    kind = type(part.curve)
    abscissa, panels, columns, axis = _KINDS[kind](part)
    rivals = []
    for rival in fit.rivals:
        if number < len(rival.curves):
            own = replace(part, curve=rival.curves[number])
            rivals.append((f"rival: {escape(label(rival, fit))}", _KINDS[kind](own)[1]))
    caption = _caption(part)
    return figure(f"data-{number}", caption, abscissa, panels, columns, rivals, axis)


def of_candidates(best: Fit, others: Sequence[tuple[str, Fit]], number: int) -> dict[str, Any]:
    """Data, model and residuals of one part of the best fit, with those of other fits of the same data."""
    part = best.parts[number]
    kind = type(part.curve)
    abscissa, panels, columns, axis = _KINDS[kind](part)
    curves = [(escape(name), _KINDS[kind](other.parts[number])[1]) for name, other in others]
    return figure(f"data-{number}", _caption(part), abscissa, panels, columns, curves, axis)


def _caption(part: Part) -> str:
    name = f"{part.name}: " if part.name else ""
    size = part.samples.values.size if isinstance(part.curve, BrdfCurve) else 0
    step = thinning(size) if size else thinning(len(getattr(part.curve, "wavelength", ())))
    thinned = f" One point of {step} is drawn; the CSV file has them all." if step > 1 else ""
    unit = " degrees" if isinstance(part.curve, Curve) and part.curve.delta_data is not None else ""
    about = f"{name}data, fit and residuals (data − fit). The rms residual is {part.rms:.3g}{unit}.{thinned}"
    return about if name else f"D{about[1:]}"


_Drawn = tuple[str, list[Panel], list[Column], dict[str, Any]]


def _spectrum(part: Part) -> _Drawn:
    curve = part.spectral
    if part.spectrum.ratios:
        return _generalised(part)
    if part.spectrum.elements:
        return _mueller(part)
    if curve.delta_data is not None:
        return _psi_delta(part)
    x, abscissa = measured_lines.abscissa(part.spectrum)
    lines = measured_lines.lines_of(part.spectrum)
    order = np.argsort(x, kind="stable")[:: thinning(x.size)]
    of_model, bands, residuals = [], [], []
    for i, (points, setting) in enumerate(lines):
        strokes = measured_lines.unbroken(x, points)
        name = "fit" if setting is None else f"fit, {setting}"
        trace = line(x, curve.model, strokes, name, _LINES[i % len(_LINES)])
        of_model.append(trace | {"showlegend": len(lines) <= measured_lines.MOST_NAMED})
        bands += [band(x[own], -curve.sigma[own], curve.sigma[own], "±σ", "var(--band)") for own in strokes]
        residuals.append(line(x, curve.residual, strokes, "residual", "var(--data)") | {"showlegend": False})
    bands = [trace | {"showlegend": not i} for i, trace in enumerate(bands)]
    of_data = markers(x[order], curve.data[order], "data", "var(--data)")
    panels = [
        Panel(intensity_figure.quantity(part.spectrum), 300, [of_data], of_model),
        Panel("data − fit", 130, bands, residuals),
    ]
    columns = [
        Column(abscissa, x[order]),
        *_settings(part, order, abscissa),
        Column("data", curve.data[order]),
        Column("fit", curve.model[order]),
        Column("residual", curve.residual[order]),
        Column("sigma", curve.sigma[order]),
    ]
    return abscissa, panels, columns, {}


def _settings(part: Part, rows: np.ndarray, abscissa: str) -> list[Column]:
    """Columns of the angle of incidence and of the azimuth, as far as the data have them beside the
    abscissa."""
    each = ("angle", part.spectrum.angle), ("azimuth", part.spectrum.azimuth)
    return [
        Column(f"{name} (degrees)", own[rows])
        for name, own in each
        if own is not None and not abscissa.startswith(name)
    ]


def _psi_delta(part: Part) -> _Drawn:
    curve = part.spectral
    assert curve.delta_data is not None
    assert curve.delta_model is not None
    x, abscissa = measured_lines.abscissa(part.spectrum)
    quantities = [
        ("Ψ (degrees)", curve.data, curve.model, False),
        ("Δ (degrees)", curve.delta_data, curve.delta_model, True),
    ]
    if curve.depolarisation_data is not None and curve.depolarisation_model is not None:
        quantities.append(("depolarisation", curve.depolarisation_data, curve.depolarisation_model, False))
    lines = measured_lines.lines_of(part.spectrum)
    panels = []
    for number, (title, data, model, turns) in enumerate(quantities):
        of_model = []
        for i, (points, setting) in enumerate(lines):
            name = "fit" if setting is None else f"fit, {setting}"
            strokes = measured_lines.unbroken(x, points, model if turns else None)
            trace = line(x, model, strokes, name, _LINES[i % len(_LINES)])
            shown = not number and len(lines) <= measured_lines.MOST_NAMED
            of_model.append(trace | {"showlegend": shown})
        of_data = markers(x, data, "data", "var(--data)") | {"showlegend": not number}
        panels.append(Panel(title, 190, [of_data], of_model))
    residuals: list[Trace] = []
    for points, _ in lines:
        for name, values, colour, dash in (
            ("residual of Ψ", curve.residual, "var(--data)", "solid"),
            ("residual of Δ", curve.delta_residual, "var(--green)", "dot"),
        ):
            strokes = measured_lines.unbroken(x, points)
            trace = line(x, values, strokes, name, colour) | {"showlegend": len(residuals) < 2}
            trace["line"] = {"color": colour, "width": 1.5, "dash": dash}
            residuals.append(trace)
    panels.append(Panel("data − fit (°)", 130, [], residuals))
    order = np.argsort(x, kind="stable")[:: thinning(x.size)]
    columns = [Column(abscissa, x[order])]
    columns += _settings(part, order, abscissa)
    for title, data, model, _ in quantities:
        columns += [Column(title, data[order]), Column(f"fit of {title}", model[order])]
    return abscissa, panels, columns, {}


def _generalised(part: Part) -> _Drawn:
    """Panels of Ψ and of Δ for each ratio, and one for all residuals."""
    curve, spectrum = part.spectral, part.spectrum
    assert curve.delta_data is not None
    assert curve.delta_model is not None
    x, abscissa = measured_lines.abscissa(spectrum)
    lines = measured_lines.lines_of(spectrum)
    order = np.argsort(x, kind="stable")[:: thinning(x.size)]
    panels, residuals = [], []
    columns = [Column(abscissa, x[order]), *_settings(part, order, abscissa)]
    for i, ratio in enumerate(spectrum.ratios):
        for sign, data, model, residual in (
            ("Ψ", curve.data, curve.model, curve.residual),
            ("Δ", curve.delta_data, curve.delta_model, weighted_delta(part)),
        ):
            own, fitted, title = data[:, i], model[:, i], f"{sign} {NAMES[ratio]} (degrees)"
            of_model = []
            for j, (points, setting) in enumerate(lines):
                strokes = measured_lines.unbroken(x, points, fitted if sign == "Δ" else None)
                label = "fit" if setting is None else f"fit, {setting}"
                trace = line(x, fitted, strokes, label, _LINES[j % len(_LINES)])
                of_model.append(trace | {"showlegend": not panels})
                strokes = measured_lines.unbroken(x, points)
                colour = CHANNELS[(2 * i + (sign == "Δ")) % len(CHANNELS)]
                missed = line(x, residual[:, i], strokes, f"{sign} {NAMES[ratio]}", colour)
                residuals.append(missed | {"showlegend": False})
            of_data = markers(x, own, "data", "var(--data)") | {"showlegend": not panels}
            panels.append(Panel(title, 110, [of_data], of_model))
            columns += [Column(title, own[order]), Column(f"fit of {title}", fitted[order])]
    panels.append(Panel("data − fit (°; Δ × ½ sin 2Ψ)", 130, [], residuals))
    return abscissa, panels, columns, {}


def _mueller(part: Part) -> _Drawn:
    """A panel for each element of a Mueller matrix, and one for all residuals."""
    curve, spectrum = part.spectral, part.spectrum
    x, abscissa = measured_lines.abscissa(spectrum)
    lines = measured_lines.lines_of(spectrum)
    panels, residuals = [], []
    for column, name in enumerate(spectrum.elements):
        of_model = []
        for i, (points, setting) in enumerate(lines):
            label = "fit" if setting is None else f"fit, {setting}"
            strokes = measured_lines.unbroken(x, points)
            trace = line(x, curve.model[:, column], strokes, label, _LINES[i % len(_LINES)])
            of_model.append(trace | {"showlegend": not column})
            own = line(x, curve.residual[:, column], strokes, name, CHANNELS[column % len(CHANNELS)])
            residuals.append(own | {"showlegend": False})
        of_data = markers(x, curve.data[:, column], "data", "var(--data)") | {"showlegend": not column}
        panels.append(Panel(name, 110, [of_data], of_model))
    panels.append(Panel("data − fit", 130, [], residuals))
    order = np.argsort(x, kind="stable")[:: thinning(x.size)]
    columns = [Column(abscissa, x[order])]
    columns += _settings(part, order, abscissa)
    for i, name in enumerate(spectrum.elements):
        columns += [Column(name, curve.data[order, i]), Column(f"fit of {name}", curve.model[order, i])]
    return abscissa, panels, columns, {}


def _samples(part: Part) -> _Drawn:
    samples, model = part.samples, part.curve.model
    angle = brdf_figure.half_angle(samples)
    order = np.argsort(angle, kind="stable")[:: thinning(samples.values.size)]
    one = 1.0 if samples.sigma is None else samples.sigma
    residual = (samples.values - model) / one
    data, fitted, missed = [], [], []
    for c, name in enumerate(samples.channels):
        colour = CHANNELS[c % len(CHANNELS)]
        own = f" {escape(name)}"
        data.append(markers(angle[order], samples.values[order, c], f"data{own}", colour, "circle-open"))
        fitted.append(markers(angle[order], model[order, c], f"fit{own}", colour, "x-thin-open"))
        missed.append(markers(angle[order], residual[order, c], own, colour) | {"showlegend": False})
    positive = min(samples.values.min(), model.min()) > 0
    panels = [
        Panel("BRDF (1/sr)", 320, data, fitted, {"type": "log", "dtick": "D2"} if positive else {}),
        Panel("residual (1/sr)" if samples.sigma is None else "residual / σ", 140, [], missed),
    ]
    columns = [Column("half angle (degrees)", angle[order])]
    for c, name in enumerate(samples.channels):
        columns += [Column(name, samples.values[order, c]), Column(f"fit of {name}", model[order, c])]
    return "half angle (degrees)", panels, columns, {}


def _colours(part: Part) -> _Drawn:
    data, curve = fitted_colours.colours_of(part)
    at = np.arange(1.0, len(data) + 1) if data.angle is None else data.angle
    abscissa = "number of the colour" if data.angle is None else "angle of incidence (degrees)"
    measured, fitted, missed = [], [], []
    for c, name in enumerate(data.channels):
        colour = CHANNELS[c]
        measured.append(markers(at, curve.data[:, c], f"data {name}", colour))
        fitted.append(markers(at, curve.model[:, c], f"fit {name}", colour, "x-thin-open"))
        scaled = curve.residual[:, c] / curve.sigma[:, c]
        missed.append(markers(at, scaled, name, colour) | {"showlegend": False})
    panels = [
        Panel(f"{data.space}", 240, measured, fitted),
        Panel("(data − fit) / σ", 130, [], missed),
    ]
    columns = [Column(abscissa, at)]
    for c, name in enumerate(data.channels):
        columns += [Column(name, curve.data[:, c]), Column(f"fit of {name}", curve.model[:, c])]
    return abscissa, panels, columns, {}


_KINDS = {Curve: _spectrum, BrdfCurve: _samples, ColourCurve: _colours}
"""Panels of a part, by the kind of its curve."""
