"""Rendering of a ball under a film, from the film's colours against the cosine of the angle of incidence."""

from __future__ import annotations

from functools import cache
from io import BytesIO
from typing import NamedTuple

import numpy as np
from PIL import Image

from pellicle.colour import sensor
from pellicle.colour.spaces import SRGB_WHITE, TO_SRGB, adaptation
from pellicle.explorer.programs import COSINES
from pellicle.reporting.rendering_display import display, exposure
from pellicle.simulation.environment import studio
from pellicle.simulation.sphere import Sphere, sphere

WHITE_PERCENTILE = 97.0
"""Percentile of the luminance that is shown as white: a mirrored lamp covers 2 % of a ball."""
BACKGROUND = 0.06
"""sRGB value around the ball."""


class _Lookup(NamedTuple):
    """Pixels of a ball, the rows of the table of colours around each, and the radiance that each mirrors."""

    pixels: Sphere
    row: np.ndarray
    share: np.ndarray
    seen: np.ndarray


@cache
def _lookup(size: int) -> _Lookup:
    pixels = sphere(size)
    position = np.clip(pixels.cosine * COSINES - 1, 0.0, COSINES - 1.0)
    row = np.minimum(position.astype(int), COSINES - 2)
    seen = studio().radiance(pixels.mirrored())[:, None]
    return _Lookup(pixels, row, (position - row)[:, None], seen)


def to_linear_srgb(xyz: np.ndarray) -> np.ndarray:
    """Convert XYZ (..., 3) under D65, observer 1931, to linear sRGB, not clipped."""
    return xyz @ (TO_SRGB @ adaptation(sensor().white, SRGB_WHITE)).T


def ball_rendering(xyz: np.ndarray, size: int) -> bytes:
    """Draw a ball that reflects the XYZ (`COSINES`, 3) of a film as a PNG of `size` × `size` pixels."""
    table, at = to_linear_srgb(xyz), _lookup(size)
    colour = (1 - at.share) * table[at.row] + at.share * table[at.row + 1]
    rendering = at.pixels.rendering(colour * at.seen)
    return png(display(rendering, exposure(rendering, percentile=WHITE_PERCENTILE), BACKGROUND))


def png(image: np.ndarray) -> bytes:
    """Encode sRGB values (rows, columns, 3), 0 to 1, as a PNG."""
    buffer = BytesIO()
    Image.fromarray(np.rint(255 * np.clip(image, 0.0, 1.0)).astype(np.uint8)).save(
        buffer, "PNG", compress_level=1
    )
    return buffer.getvalue()
