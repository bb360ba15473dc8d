"""Panels of measured data, and of data, fit and residuals."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum
from pellicle.fitting.curves import Curve
from pellicle.fitting.result import Part
from pellicle.reporting.drawable import SERIES, Band, Line, Panel, Place, Section, Style, Table, stroke
from pellicle.reporting.quantities import Quantity, abscissa, colours_of, display, lines_of, quantities

MOST_NAMED = 8
"""Most lines, one for each angle and azimuth, that get a label."""
_SHIFT = 0.12
"""Distance of the markers of two channels of one colour."""


def fitted(part: Part) -> Section:
    """Data, fit and residuals of one part of a fit, with the table of their numbers."""
    columns = quantities(part.data, part.curve)
    x, label = abscissa(part.data)
    if isinstance(part.data, Spectrum):
        rows = _spectrum(part.data, columns, x)
    elif isinstance(part.data, Colours):
        rows = _colours(part, columns, x)
    else:
        rows = _samples(part.data, columns, x)
    return Section(label, rows, part.name, _table(part, columns, x, label))


def _table(part: Part, columns: Sequence[Quantity], x: np.ndarray, label: str) -> Table:
    """Abscissa, angles, data and fit in the order of the abscissa; of a single quantity residual and σ."""
    order = np.argsort(x, kind="stable")
    table = {label: x[order]}
    for name in ("angle", "azimuth"):
        setting = getattr(part.data, name, None)
        if setting is not None and not label.startswith(name):
            table[f"{name} (degrees)"] = setting[order]
    for q in columns:
        assert q.model is not None
        table |= {q.label: q.data[order], f"fit of {q.label}": q.model[order]}
    if isinstance(part.data, Spectrum) and len(columns) == 1:
        known = {"residual": columns[0].residual, "sigma": columns[0].sigma}
        table |= {name: values[order] for name, values in known.items() if values is not None}
    return Table(table)


def measured(spectrum: Spectrum) -> Section:
    """Measured values with their errors, a line for each angle of incidence and azimuth."""
    columns = quantities(spectrum)
    x, label = abscissa(spectrum)
    settings, panels = lines_of(spectrum), []
    for q in columns:
        lines, bands = _left_out(spectrum, q), []
        for j, (rows, name) in enumerate(settings):
            colour = "residual" if name is None else SERIES[j % len(SERIES)]
            drawn = stroke(x, q.data, rows, q.turns)
            lines.append(Line(*drawn, "", colour, width=0.6))
            lines.append(Line(*drawn, name or "", colour, "point", listed=j < MOST_NAMED))
            if q.sigma is not None:
                at, low = stroke(x, q.data - q.sigma, rows)
                bands.append(Band(at, low, stroke(x, q.data + q.sigma, rows)[1], "±σ", colour, listed=False))
        panels.append(_values(q, lines, bands, "above" if q is columns[0] else ""))
    return Section(label, _in_rows(spectrum, columns, panels))


def compared(spectrum: Spectrum, curves: Mapping[str, Curve]) -> Section:
    """Data with the curves of a few models by their names, and the residuals of each."""
    x, label = abscissa(spectrum)
    every = {name: quantities(spectrum, curve) for name, curve in curves.items()}
    first, missed, panels = next(iter(every.values())), [], []
    table = {label: x}
    for i, q in enumerate(first):
        lines = [Line(x, q.data, "data", "points", "point")]
        table[q.label] = q.data
        for number, (name, columns) in enumerate(every.items()):
            about = {"colour": SERIES[number % len(SERIES)], "width": 1.2, "model": True}
            model, residual = columns[i].model, columns[i].missed
            assert model is not None
            assert residual is not None
            table[f"{q.label} of {name}"] = model
            for rows, _ in lines_of(spectrum):
                style: Any = {"style": "dashed" if number else "solid"}
                lines.append(Line(*stroke(x, model, rows, q.turns), name, **about, **style))
                style = {"style": q.drawn[2], "listed": False}
                missed.append(Line(*stroke(x, residual, rows), name, **about, **style))
        panels.append([_values(q, lines, [], "" if i else "above")])
    degrees = " (degrees)" if "degrees" in first[0].label else ""
    rest = Panel(f"data − model{degrees}", missed, height=1.5, zero=True)
    return Section(label, [*panels, [rest]], table=Table(table))


def _spectrum(spectrum: Spectrum, columns: Sequence[Quantity], x: np.ndarray) -> list[list[Panel]]:
    """A panel for each quantity, and one for the residuals of all."""
    settings, panels = lines_of(spectrum), []
    for q in columns:
        assert q.model is not None
        lines = [*_left_out(spectrum, q), Line(x, q.data, "data", "points", "point")]
        for j, (rows, setting) in enumerate(settings):
            name = "fit" if setting is None else f"fit, {setting}"
            dashed = j // len(SERIES) % 2
            style: Any = {"style": "dashed" if dashed else "solid", "width": 0.9 if q.place else 1.4}
            style |= {"listed": len(settings) <= MOST_NAMED, "model": True}
            lines.append(Line(*stroke(x, q.model, rows, q.turns), name, SERIES[j % len(SERIES)], **style))
        panels.append(_values(q, lines, [], "inside" if q is columns[0] else ""))
    return [*_in_rows(spectrum, columns, panels), [_residuals(spectrum, columns, x)]]


def _left_out(spectrum: Spectrum, q: Quantity) -> list[Line]:
    """Grey points that are left out, those near the range of the others."""
    if (points := spectrum.left_out) is None:
        return []
    low, high = float(np.min(q.data)), float(np.max(q.data))
    near = np.abs(points.values - (low + high) / 2) < 0.75 * (high - low)
    grey = Line(points.wavelength[near], points.values[near], points.reason, "#BBBBBB", "point")
    return [grey] if near.any() else []


def _values(q: Quantity, lines: list[Line], bands: list[Band], legend: Place) -> Panel:
    """A panel of data; in a grid it has a title, and at least the least range of its quantity."""
    if q.place is None:
        height = {"psi": 2.2, "delta": 2.2, "depolarisation": 1.5}.get(q.name, 3.0)
        return Panel(q.label, lines, bands, height, legend=legend)
    shown = np.concatenate([q.data, *([] if q.model is None else [q.model])])
    low, high = float(np.min(shown)), float(np.max(shown))
    room = 0.56 * max(high - low, q.smallest)
    bottom, top = (low + high) / 2 - room, (low + high) / 2 + room
    if q.name.startswith("psi"):  # never negative
        bottom = max(bottom, -0.04 * (high + q.smallest))
    height = 1.1 if q.title == q.label else 2.0
    return Panel(q.label, lines, bands, height, q.title, "above" if legend else "", limits=(bottom, top))


def _in_rows(spectrum: Spectrum, columns: Sequence[Quantity], panels: Sequence[Panel]) -> list[list[Panel]]:
    """The panels in rows: one below the other, or at their places of the grid of the signal, where what was
    not measured stays empty."""
    if not (titles := spectrum.kind.grid):
        return [[panel] for panel in panels]
    placed = {q.place: panel for q, panel in zip(columns, panels, strict=True)}
    return [
        [placed.get((i, j)) or Panel("", height=1.1, title=title) for j, title in enumerate(row)]
        for i, row in enumerate(titles)
    ]


def _residuals(spectrum: Spectrum, columns: Sequence[Quantity], x: np.ndarray) -> Panel:
    """Data − fit of all quantities; of a single one beside ±σ."""
    shown = [q for q in columns if q.missed is not None]
    lines, bands = [], []
    for q in shown:
        assert q.missed is not None
        name, colour, style = q.drawn
        for rows, _ in lines_of(spectrum):
            drawn = stroke(x, q.missed, rows)
            lines.append(Line(*drawn, name, colour, style, 0.8, listed=len(shown) > 1, model=True))
            if len(shown) == 1 and q.sigma is not None:
                at, low = stroke(x, -q.sigma, rows)
                bands.append(Band(at, low, -low, "±σ"))
    degrees = " (degrees)" if "degrees" in columns[0].label else ""
    height = 1.3 if len(shown) == 1 else 1.5
    return Panel(f"data − fit{degrees}", lines, bands, height, legend="above", zero=True)


def _colours(part: Part, columns: Sequence[Quantity], x: np.ndarray) -> list[list[Panel]]:
    """Patches of data above those of the fit, the values of each channel, and residuals in σ."""
    colours, curve = colours_of(part)
    angle = colours.angle
    values, residuals = _channels(columns, [x + _SHIFT * (c - 1) for c in range(len(columns))], "circle")
    differences = () if curve.difference is None else curve.difference
    ticks = [f"{i:g}" for i in x] if angle is None else [f"{degrees:g}°" for degrees in angle]
    axis = {"span": (0.5, len(x) + 0.5), "ticks": ticks}
    image = np.stack([display(colours, patches) for patches in (curve.data, curve.model)])
    sigma = [Band(np.array(axis["span"]), np.full(2, -1.0), np.ones(2), "±σ")]
    return [
        [Panel("", height=1.6, image=image, captions=[f"ΔE {delta:.2g}" for delta in differences], **axis)],
        [Panel(f"{colours.space}", values, height=2.0, legend="above", **axis)],
        [Panel("(data − fit) / σ", residuals, sigma, legend="above", zero=True, **axis)],
    ]


def _samples(samples: BrdfSamples, columns: Sequence[Quantity], x: np.ndarray) -> list[list[Panel]]:
    """Samples and model, on a logarithmic axis if the model is positive (a lobe spans decades); residuals."""
    values, residuals = _channels(columns, [x] * len(columns), "point")
    lowest = min(line.y.min() for line in values[1::2])
    scale = "log" if lowest > 0 else "linear"
    # noise of samples that are nearly 0 would take the axis down by many decades
    limits = (lowest / 2, 2 * max(line.y.max() for line in values)) if lowest > 0 else None
    label = "residual (1/sr)" if samples.sigma is None else "residual / σ"
    values = [*values[::2], *values[1::2]]  # the model above all samples
    return [
        [Panel("BRDF (1/sr)", values, height=3.0, legend="inside", scale=scale, limits=limits)],
        [Panel(label, residuals, zero=True)],
    ]


def _channels(
    columns: Sequence[Quantity], abscissae: Sequence[np.ndarray], style: Style
) -> tuple[list[Line], list[Line]]:
    """Markers of data and fit of each channel in turn, and those of its residuals."""
    values, residuals = [], []
    for q, x in zip(columns, abscissae, strict=True):
        assert q.model is not None
        assert q.missed is not None
        name, colour, _ = q.drawn
        values.append(Line(x, q.data, f"data {name}", colour, "ring"))
        values.append(Line(x, q.model, f"fit {name}", colour, "cross", model=True))
        residuals.append(Line(x, q.missed, name, colour, style, listed=False, model=True))
    return values, residuals
