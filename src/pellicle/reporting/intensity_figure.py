"""Panels of a fit of reflectances or transmittances, and their residuals, against wavelength or angle."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pellicle.reporting.drawing import ABOVE, BLACK, BLUE, GREY
from pellicle.reporting.measured_lines import abscissa, data_and_fit, lines_of, unbroken

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pellicle.data.spectrum import Spectrum
    from pellicle.fitting.result import Part

_SIGNALS = {"R": "reflectance", "T": "transmittance"}


def quantity(spectrum: Spectrum) -> str:
    """Label of the values: `reflectance`, or `T × unknown scale` of an uncalibrated instrument."""
    kind = _SIGNALS.get(spectrum.signal) or str(spectrum.signal)
    return kind if spectrum.calibrated else f"{kind} × unknown scale"


def intensity(axes: Axes, part: Part) -> None:
    """Draw R or T of data and model, one line for each angle and azimuth."""
    data_and_fit(axes, part.spectrum, part.spectral.data, part.spectral.model)
    axes.set_ylabel(quantity(part.spectrum))
    axes.legend(frameon=False, markerscale=3)


def residuals(axes: Axes, part: Part) -> None:
    """Draw data − model beside ±σ."""
    x, label = abscissa(part.spectrum)
    curve = part.spectral
    for i, (line, _) in enumerate(lines_of(part.spectrum)):
        for points in unbroken(x, line):
            sigma = curve.sigma[points]
            hidden = "_" if i or points[0] != line[0] else "±σ"
            axes.fill_between(x[points], -sigma, sigma, color=BLUE, alpha=0.2, lw=0, label=hidden)
            axes.plot(x[points], curve.residual[points], color=BLACK, linewidth=0.8)
    axes.axhline(0, color=GREY, linewidth=0.6)
    axes.set(xlabel=label, ylabel="data − fit")
    axes.legend(**ABOVE, fontsize="small")
