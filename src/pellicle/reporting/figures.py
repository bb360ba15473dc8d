"""Figures of fits, spectra and predictions by Matplotlib, and of fits with their rivals by Plotly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.fitting.curves import Curve
from pellicle.fitting.result import Fit, Part, Rival
from pellicle.fitting.status import RIVAL
from pellicle.reporting import data_panels, fit_panels
from pellicle.reporting.drawable import Band, Line, Panel, Section
from pellicle.reporting.matplotlib_figure import draw
from pellicle.reporting.plotly_figure import figure, thinning
from pellicle.sampling.result import Prediction

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_fit(fit: Fit) -> Figure:
    """Draw data, fit and residuals of each part, misfit against thickness, n and k, and graded layers."""
    return draw(fit_panels.sections(fit), fit_panels.title(fit))


def draw_spectrum(spectrum: Spectrum) -> Figure:
    """Draw the values against wavelength, with their errors; Ψ, Δ and the depolarisation in panels, Mueller
    elements at their places of the matrix, generalised Ψ above Δ.

    Values at one wavelength are drawn against the angle of incidence, or the azimuth of the sample.
    """
    title = f"{spectrum.path} [{spectrum.name}]" if spectrum.name else spectrum.path
    return draw([data_panels.measured(spectrum)], title)


def draw_predictions(predictions: Sequence[Prediction]) -> Figure:
    """Draw each data set over the bands of 95 % of the model's curves and of repeated measurements."""
    return draw([_prediction(prediction) for prediction in predictions], "")


def _prediction(prediction: Prediction) -> Section:
    order = np.argsort(prediction.axis.values, kind="stable")
    x, bands = prediction.axis.values[order], []
    for draws, opacity, name in (
        (prediction.noisy, 0.25, "repeated measurements"),
        (prediction.model, 0.8, "model"),
    ):
        low, high = np.quantile(draws, [0.025, 0.975], axis=0)[:, order]
        bands.append(Band(x, low, high, f"{name}, 95 %", "fit", opacity))
    data = [Line(x, prediction.data[order], "data", "residual", "point")]
    scale = "log" if prediction.decades else "linear"
    panel = Panel(prediction.label, data, bands, 3.0, legend="inside", scale=scale)
    return Section(prediction.axis.label, [[panel]])


def rival_label(rival: Rival, fit: Fit) -> str:
    """`thickness 242.87 nm`: the leading parameter of the fit, with a rival's value."""
    name = next(iter([name for name in fit.parameters if name in rival.parameters] or rival.parameters))
    unit = fit.parameters[name].unit if name in fit.parameters else ""
    return f"{name} {rival.parameters[name]:.5g} {unit}".rstrip()


def of_part(fit: Fit, number: int) -> dict[str, Any]:
    """Data, model and residuals of one part, with those of rivals."""
    part = fit.parts[number]
    rivals = [
        (f"rival: {rival_label(rival, fit)}", replace(part, curve=rival.curves[number]))
        for rival in fit.rivals
        if number < len(rival.curves)
    ]
    return _of_parts(part, rivals, number)


def of_candidates(best: Fit, others: Sequence[tuple[str, Fit]], number: int) -> dict[str, Any]:
    """Data, model and residuals of one part of the best fit, with those of other fits of the same data."""
    return _of_parts(best.parts[number], [(name, fit.parts[number]) for name, fit in others], number)


def _of_parts(part: Part, others: Sequence[tuple[str, Part]], number: int) -> dict[str, Any]:
    rivals = [(name, data_panels.fitted(other).panels) for name, other in others]
    return figure(f"data-{number}", _caption(part), data_panels.fitted(part), rivals)


def _caption(part: Part) -> str:
    name = f"{part.name}: " if part.name else ""
    step = thinning(len(part.curve.model))
    thinned = f" One point of {step} is drawn; the CSV file has them all." if step > 1 else ""
    unit = " degrees" if isinstance(part.curve, Curve) and part.curve.delta_data is not None else ""
    about = f"{name}data, fit and residuals (data − fit). The rms residual is {part.rms:.3g}{unit}.{thinned}"
    return about if name else f"D{about[1:]}"


def of_misfit(fit: Fit) -> dict[str, Any] | None:
    """Δχ² against thickness with the minima; None where no thickness was scanned."""
    section = fit_panels.misfit(fit)
    if section is None:
        return None
    assert fit.profile is not None
    rivals = [
        (f"rival: {rival_label(rival, fit)}", [fit_panels.rival_place(fit, rival)]) for rival in fit.rivals
    ]
    count = max(len(section.table.columns["misfit"]) - 1, 0)
    searched = section.abscissa.partition("searched ")[2].removesuffix(")")
    caption = (
        f"Misfit Δχ² against thickness, searched from {searched} nm,"
        f" linear below {RIVAL:g} and logarithmic above. Its minima are the best fit and"
        f" {count or 'no'} rival{'s' * (count != 1)}."
    )
    drawn = figure("misfit", caption, replace(section, abscissa="thickness (nm)"), rivals)
    for trace in (trace for own in drawn["rivals"] for trace in own):
        trace["marker"] |= {"size": 18, "line": {"width": 3}}
        trace["hoverinfo"] = "skip"
    return drawn


def of_index(fit: Fit) -> dict[str, Any] | None:
    """n and k of the layer with the bands of their standard errors; None where both are known."""
    section = fit_panels.index(fit)
    if section is None:
        return None
    rivals = []
    for rival in fit.rivals:
        pairs = zip(fit.parts, rival.curves, strict=False)
        parts = tuple(replace(part, curve=curve) for part, curve in pairs)
        other = fit_panels.index_panels(replace(fit, parts=parts)) if rival.curves else []
        rivals.append((f"rival: {rival_label(rival, fit)}", other[: len(section.rows)]))
    size = len(fit.index.wavelength)
    caption = f"n and k of the layer at {size} wavelengths, with bands of ± one standard error."
    return figure("index", caption, section, rivals)
