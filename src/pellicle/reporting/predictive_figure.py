"""Figure of a posterior's predictions: data over the bands of models and of repeated measurements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum
from pellicle.reporting.drawable import Band, Line, Panel, Place, Section, stroke
from pellicle.reporting.matplotlib_figure import draw
from pellicle.reporting.quantities import abscissa, lines_of
from pellicle.sampling.result import Prediction

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HALF = 0.15
"""Half the width of the band of a single colour, of which one follows at 1 from another."""
_NARROW = 0.02
"""Half the width of the band of another single point, as a share of its abscissa."""


class _Places(NamedTuple):
    """Abscissae (points,) and their label, the indices of the points that each band joins, and the axis."""

    x: np.ndarray
    label: str
    rows: Sequence[np.ndarray]
    axis: dict[str, Any]
    legend: Place = "inside"


def draw_predictions(predictions: Sequence[Prediction]) -> Figure:
    """Draw each data set over the bands of 95 % of the model's curves and of repeated measurements.

    A band joins points of one angle and azimuth; at one wavelength it goes along the angle of incidence.
    Each colour has its own.
    """
    sections = []
    for p in predictions:
        places = _places(p)
        bands: list[Band] = []
        for draws, opacity, name in ((p.noisy, 0.25, "repeated measurements"), (p.model, 0.8, "model")):
            if p.wraps:  # draws beyond 0 or 360 degrees stay beside the data
                draws = p.data + np.mod(draws - p.data + 180.0, 360.0) - 180.0
            low, high = np.quantile(draws, [0.025, 0.975], axis=0)
            for number, rows in enumerate(places.rows):
                x, low_here, high_here = _joined(places.x, low, high, rows, p)
                named = "" if number else f"{name}, 95 %"
                bands.append(Band(x, low_here, high_here, named, "fit", opacity, listed=not number))
        data = [Line(places.x, p.data, "data", "residual", "point")]
        scale = "log" if p.decades else "linear"
        panel = Panel(p.label, data, bands, 3.0, legend=places.legend, scale=scale, **places.axis)
        sections.append(Section(places.label, [[panel]]))
    return draw(sections, "")


def _places(p: Prediction) -> _Places:
    if isinstance(p.measured, Spectrum):
        x, label = abscissa(p.measured)
        return _Places(x, label, [rows for rows, _ in lines_of(p.measured)], {})
    if isinstance(p.measured, Colours):
        x, label = abscissa(p.measured)
        angle = p.measured.angle
        ticks = [f"{i:g}" for i in x] if angle is None else [f"{degrees:g}°" for degrees in angle]
        axis = {"span": (0.5, len(x) + 0.5), "ticks": ticks}
        return _Places(x, label, list(np.arange(len(x))[:, None]), axis, "above")
    x = p.axis.values
    return _Places(x, p.axis.label, [np.argsort(x, kind="stable")], {})


def _joined(
    x: np.ndarray, low: np.ndarray, high: np.ndarray, rows: np.ndarray, p: Prediction
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Abscissae and limits of a band through points, which is as a box at a single one."""
    if len(rows) == 1:
        at = float(x[rows[0]])
        half = _HALF if isinstance(p.measured, Colours) else max(_NARROW * abs(at), _NARROW)
        return np.array([at - half, at + half]), np.repeat(low[rows], 2), np.repeat(high[rows], 2)
    along, _ = stroke(x, p.data, rows, p.wraps)
    there = np.isfinite(along)
    limits = np.full((2, len(along)), np.nan)
    limits[:, there] = low[rows], high[rows]
    return along, limits[0], limits[1]
