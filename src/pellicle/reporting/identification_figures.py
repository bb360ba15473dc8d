"""Figures of an identification: data with the curves of hypotheses, residuals, and the evidence of each."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.fitting.curves import Curve
from pellicle.identification.conclusion import DECIDED
from pellicle.identification.hypothesis import Hypothesis, Identification
from pellicle.reporting.data_panels import compared
from pellicle.reporting.drawable import SERIES, Line, Panel, Section, Style
from pellicle.reporting.matplotlib_figure import draw as drawn
from pellicle.reporting.plotly_figure import figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = 12
"""Excluded hypotheses in a report, a page and a figure."""


def file_names(found: Identification) -> list[str]:
    """Name of each file without its folder."""
    return [x.path.replace("\\", "/").rsplit("/", 1)[-1] or "spectrum" for x in found.data]


def draw(found: Identification) -> Figure:
    """Draw each spectrum with the curves of hypotheses and their residuals, and the evidence of all."""
    wrapped = textwrap.wrap(found.verdict.replace(" ± ", "\u00a0±\u00a0"), 108, break_on_hyphens=False)
    title = f"{textwrap.shorten(' and '.join(file_names(found)), 70)}: {found.status}"
    spectra = [_section(found, i) for i in range(len(found.data))]
    return drawn([*spectra, evidence(found)], "\n".join([title, *wrapped]))


def of_spectrum(found: Identification, number: int) -> dict[str, Any]:
    """Data, curves and residuals of one spectrum for a page, with the curve of each hypothesis."""
    spectrum = found.data[number]
    rivals = [
        (x.name, compared(spectrum, {x.name: _curve(found, x, number)}).panels) for x in _hypotheses(found)
    ]
    left = "hypotheses that are left" if found.hypotheses else "nearest hypothesis"
    caption = (
        f"{file_names(found)[number]}: data with the {left}, and residuals (data − model) without the"
        " systematic effects that the evidence allows for."
    )
    return figure(f"data-{number}", caption, _section(found, number), rivals)


def evidence_figure(found: Identification) -> dict[str, Any]:
    """Evidence of the hypotheses for a page; a click on one shows its curve."""
    section = evidence(found)
    rivals = [
        (x.name, [Panel("", [Line(np.array([i]), np.array([y]), "", "rival", "ring", 18, model=True)])])
        for i, (x, y) in enumerate(zip(_hypotheses(found), _below(found), strict=True), 1)
    ]
    caption = (
        "Evidence of each hypothesis, by its number in the table: ln Z below that of the best, linear below"
        f" {DECIDED:g} and logarithmic above, where a hypothesis is excluded."
    )
    return figure("evidence", caption, section, rivals)


def evidence(found: Identification) -> Section:
    """Evidence of the hypotheses in their order, below that of the best."""
    every, below, count = _hypotheses(found), _below(found), len(found.hypotheses)
    numbers = np.arange(1.0, len(every) + 1)
    span = 0.4, len(every) + 0.6
    lines = [Line(np.array(span), np.full(2, DECIDED), f"excluded above {DECIDED:g}", "blue", "dotted", 0.8)]
    groups: tuple[tuple[str, slice, str, Style], ...] = (
        ("left", slice(0, count), "fit", "circle"),
        ("excluded", slice(count, None), "rival", "diamond"),
    )
    for name, own, colour, style in groups:
        if numbers[own].size:
            rows = list(zip(every[own], below[own], numbers[own], strict=True))
            hints = [f"{x.name}: Δ ln Z {-y:.3g}" for x, y, _ in rows]
            links = [{"rival": int(number) - 1} for *_, number in rows]
            about: Any = {"hints": hints, "links": links}
            lines.append(Line(numbers[own], below[own], name, colour, style, **about))
    top = max(10 * DECIDED, float(below.max()))
    panel = Panel(
        "−Δ ln Z",
        lines,
        height=1.9,
        legend="above",
        scale="symlog",
        threshold=DECIDED,
        limits=(-1.0, 2 * top),
        span=span,
        ticks=[f"{i:g}" for i in numbers],
        key=[f"{i:g} {textwrap.shorten(x.name, 32)}" for i, x in zip(numbers, every, strict=True)],
    )
    return Section("hypothesis", [[panel]])


def _section(found: Identification, number: int) -> Section:
    """One spectrum with the hypotheses that are left, or with the nearest, as many as there are colours."""
    shown = (found.hypotheses or found.excluded[:1])[: len(SERIES)]
    return compared(found.data[number], {x.name: _curve(found, x, number) for x in shown})


def _hypotheses(found: Identification) -> tuple[Hypothesis, ...]:
    return (*found.hypotheses, *found.excluded[:SHOWN])


def _below(found: Identification) -> np.ndarray:
    """ln Z of each hypothesis below that of the best, at least 0."""
    values = np.array([x.ln_z for x in _hypotheses(found)])
    return values.max() - values


def _curve(found: Identification, x: Hypothesis, number: int) -> Curve:
    """Data and model of one spectrum; the index of layers is not in it."""
    spectrum, columns, none = found.data[number], x.curves[number], np.zeros(0)
    return Curve(
        spectrum.wavelength,
        spectrum.values,
        np.zeros(len(spectrum)),
        columns[:, 0],
        *(none, none, none, none),
        delta_data=spectrum.delta,
        delta_model=columns[:, 1] if columns.shape[1] > 1 else None,
    )
