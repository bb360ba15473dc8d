"""Figure of a measured spectrum."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.reporting.drawing import BLACK, BLUE, GREEN, ORANGE, marker_size, new_figure
from pellicle.reporting.measured_lines import abscissa, lines_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LABELS = {"R": "reflectance", "T": "transmittance", "counts": "counts", "psi-delta": "Ψ (degrees)"}


def draw(spectrum: Spectrum) -> Figure:
    """Draw the values against wavelength, with their errors; Ψ, Δ and the depolarisation in panels, Mueller
    elements at their places of the matrix, generalised Ψ above Δ.

    Values at one wavelength are drawn against the angle of incidence, or the azimuth of the sample.
    """
    if spectrum.ratios:
        return _ratios(spectrum)
    if spectrum.elements:
        return _matrix(spectrum)
    label = _LABELS[spectrum.signal] + ("" if spectrum.calibrated else " × unknown scale")
    panels = [(label, spectrum.values, spectrum.sigma)]
    if spectrum.delta is not None:
        panels.append(("Δ (degrees)", spectrum.delta, spectrum.delta_sigma))
    if spectrum.depolarisation is not None:
        panels.append(("depolarisation", spectrum.depolarisation, spectrum.depolarisation_sigma))
    figure = new_figure(7.0, 1.6 + 2.0 * len(panels))
    rows = figure.subplots(len(panels), sharex=True, squeeze=False)[:, 0]
    for axes, (name, values, errors) in zip(rows, panels, strict=True):
        _panel(axes, spectrum, values, errors)
        axes.set_ylabel(name)
        axes.margins(x=0.01)
    rows[-1].set_xlabel(abscissa(spectrum)[1])
    if rows[0].get_legend_handles_labels()[1]:
        rows[0].legend(frameon=False, markerscale=3, fontsize="small")
    figure.suptitle(_title(spectrum), fontsize="medium")
    return figure


def _matrix(spectrum: Spectrum) -> Figure:
    """Elements of a Mueller matrix at their places."""
    from pellicle.reporting import mueller_figure

    figure = new_figure(8.0, 6.0)
    axes = figure.subplots()
    x, label = abscissa(spectrum)
    about = spectrum.elements, x, lines_of(spectrum), spectrum.values, spectrum.sigma
    mueller_figure.draw_measured(axes, *about)
    axes.set_xlabel(label, labelpad=16)
    axes.set_ylabel("normalised element", labelpad=30)
    figure.suptitle(_title(spectrum), fontsize="medium")
    return figure


def _ratios(spectrum: Spectrum) -> Figure:
    """Generalised Ψ above Δ, a column for each ratio."""
    from pellicle.reporting import generalised_figure

    figure = new_figure(9.0, 5.0)
    generalised_figure.draw_measured(figure.subplots(), spectrum)
    figure.suptitle(_title(spectrum), fontsize="medium")
    return figure


def _title(spectrum: Spectrum) -> str:
    title = f"{spectrum.path} [{spectrum.name}]" if spectrum.name else spectrum.path
    return title.replace("$", r"\$")  # no mathematics in a file's name


def _panel(axes: Axes, spectrum: Spectrum, values: np.ndarray, errors: np.ndarray | None) -> None:
    """One panel, a colour for each angle of incidence and azimuth."""
    x, _ = abscissa(spectrum)
    colours = (BLACK, ORANGE, BLUE, GREEN)
    for i, (rows, name) in enumerate(lines_of(spectrum)):
        at, own, colour = x[rows], values[rows], colours[i % len(colours)]
        size = marker_size(rows.size)
        wraps = np.flatnonzero(np.abs(np.diff(own)) > 180) + 1 if values is spectrum.delta else []
        line = (np.insert(numbers, wraps, np.nan) for numbers in (at, own))  # no line from 360 to 0
        axes.plot(*line, ".-", color=colour, markersize=size, linewidth=0.6, label=name)
        if errors is not None:
            sigma = errors[rows]
            axes.fill_between(at, own - sigma, own + sigma, color=colour, alpha=0.2, linewidth=0)
