"""Placement of labels beside points so that none overlaps another, a point or the edge of the axes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Annotation

DISTANCES = (6.0, 11.0, 18.0, 27.0, 38.0, 51.0, 66.0, 83.0)
"""Distances of a label from its point, in 1/72 inch, in the order in which they are tried."""
LEADER = 11.0
"""Distance from which a line joins a label to its point."""
RADIUS = 4.0
"""Half the width of the square that a point keeps free, in 1/72 inch."""
_DIRECTIONS = np.deg2rad([0, 180, 40, -40, 140, -140, 65, -65, 115, -115, 90, -90])


class Label(NamedTuple):
    """Text of a point (x, y), in the units of the axes, and its colour."""

    text: str
    x: float
    y: float
    colour: str


def place_labels(axes: Axes, labels: Sequence[Label], fontsize: str = "x-small") -> list[Annotation]:
    """Write each label beside its point, at the nearest place that is free of labels, points and lines.

    Places lie in twelve directions at rising distances; points in the densest crowd choose first. Where no
    place is free the one with the least overlap is taken. The places are computed in pixels, so limits,
    scales and the size of the axes must be final.
    """
    figure: Any = axes.get_figure(root=True)
    renderer, scale = figure.canvas.get_renderer(), figure.dpi / 72
    at = axes.transData.transform([(label.x, label.y) for label in labels])
    frame = np.array(axes.get_window_extent(renderer).padded(-scale).extents)
    marks = np.hstack([at - RADIUS * scale, at + RADIUS * scale])
    distance = np.linalg.norm(at[:, None] - at, axis=-1)
    crowd = np.sort(distance, axis=1)[:, :4].sum(axis=1)
    taken = [box for line in axes.lines for box in _along(axes.transData.transform(line.get_xydata()), scale)]
    notes = {}
    for k in np.argsort(crowd, kind="stable"):
        size = _size(axes, labels[k].text, fontsize, renderer)
        obstacles = np.array([*np.delete(marks, k, axis=0), *taken]).reshape(-1, 4)
        away, box = min(
            _places(at[k], size, scale), key=lambda place: (_overlap(place[1], obstacles, frame), place[0])
        )
        taken.append(box)
        notes[k] = axes.annotate(
            labels[k].text,
            (labels[k].x, labels[k].y),
            tuple((box[:2] - at[k]) / scale),
            textcoords="offset points",
            fontsize=fontsize,
            color=labels[k].colour,
            arrowprops=_leader(box, at[k], labels[k].colour) if away >= LEADER else None,
        )
        notes[k].set_in_layout(False)  # or the layout would make room for labels that already fit
    return [notes[k] for k in range(len(labels))]


def _along(line: np.ndarray, scale: float) -> np.ndarray:
    """Small boxes along a line of pixels, which labels avoid; none along an axhline."""
    steps = np.linspace(0.0, 1.0, 40)[:, None]
    if len(line) < 2 or not np.all(np.isfinite(line)):
        return np.empty((0, 4))
    at = np.concatenate([one + steps * (other - one) for one, other in pairwise(line)])
    return np.hstack([at - 1.5 * scale, at + 1.5 * scale])


def _size(axes: Axes, text: str, fontsize: str, renderer: Any) -> np.ndarray:
    """Width and height of a text in pixels."""
    probe = axes.annotate(text, (0.5, 0.5), xycoords="axes fraction", fontsize=fontsize)
    box = probe.get_window_extent(renderer)
    probe.remove()
    return np.array([box.width, box.height])


def _places(point: np.ndarray, size: np.ndarray, scale: float) -> Iterator[tuple[float, np.ndarray]]:
    """Boxes (left, bottom, right, top) of a label around a point, the nearest first, with their distances."""
    for away in DISTANCES:
        for angle in _DIRECTIONS:
            towards = np.array([np.cos(angle), np.sin(angle)])
            anchor = np.array([np.sign(np.round(towards[0], 9)), towards[1]])  # the box lies beside the point
            corner = point + away * scale * towards + size * (anchor - 1) / 2
            yield away, np.concatenate([corner, corner + size])


def _overlap(box: np.ndarray, others: np.ndarray, frame: np.ndarray) -> float:
    """Area (pixels) of a box that other boxes cover, and what of it lies outside the frame."""
    low, high = np.maximum(box[:2], others[:, :2]), np.minimum(box[2:], others[:, 2:])
    inside = np.clip(np.minimum(box[2:], frame[2:]) - np.maximum(box[:2], frame[:2]), 0, None)
    return float(
        np.prod(np.clip(high - low, 0, None), axis=1).sum() + np.prod(box[2:] - box[:2]) - np.prod(inside)
    )


def _leader(box: np.ndarray, point: np.ndarray, colour: str) -> dict[str, Any]:
    """A thin line from the nearest place of the box to the point."""
    nearest = (np.clip(point, box[:2], box[2:]) - box[:2]) / (box[2:] - box[:2])
    return {
        "arrowstyle": "-",
        "linewidth": 0.5,
        "color": colour,
        "alpha": 0.6,
        "shrinkA": 0.5,
        "shrinkB": 3.0,
        "relpos": tuple(nearest),
    }
