"""Matplotlib figures of fits, spectra and predictions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.reporting import data_panels, fit_panels
from pellicle.reporting.drawable import Band, Line, Panel, Section
from pellicle.reporting.matplotlib_figure import draw

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pellicle.fitting.result import Fit
    from pellicle.sampling.result import Prediction


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
