"""What the panels of all figures share: colours, line widths, sizes."""

from __future__ import annotations

import numpy as np

BLACK, ORANGE, BLUE, GREEN, GREY = "#000000", "#D55E00", "#0072B2", "#009E73", "#777777"
"""Okabe and Ito's colours, which the colour-blind tell apart."""
FITTED = {"color": ORANGE, "linewidth": 1.4}
GAP = 10
"""A step this many times the usual one is a gap in the data, which no line crosses."""


def marker_size(points: int) -> float:
    """The size (points) of a marker that leaves room between as many of them."""
    return float(np.clip(900 / max(points, 1), 1.5, 4.0))
