"""Display of renderings of spheres: one exposure, colours outside sRGB, and the background."""

import jax
import numpy as np

from pellicle.colour import srgb
from pellicle.colour.spaces import LUMINANCE, into_srgb
from pellicle.simulation.environment import Rendering

_srgb = jax.jit(srgb)  # compiled one by one its operations take 0.3 s
WHITE_PERCENTILE = 99.5
"""Percentile of the luminance that is shown as white: lamps are brighter than what they light."""


def exposure(*renderings: Rendering, percentile: float = WHITE_PERCENTILE) -> float:
    """Factor, of two digits, that shows this percentile of the spheres' luminance as white."""
    luminance = np.concatenate([(p.linear @ LUMINANCE)[p.coverage > 0.5] for p in renderings])
    white = np.percentile(luminance, percentile)
    return float(f"{1 / white:.2g}") if white > 0 else 1.0


def display(rendering: Rendering, factor: float | None = None, background: float = 1.0) -> np.ndarray:
    """Convert a rendering to sRGB (size, size, 3), multiplied by an exposure (its own if None).

    Colours outside sRGB, and brighter than white, are mixed with grey by `into_srgb`. `background` is the
    sRGB value around the sphere.
    """
    factor = exposure(rendering) if factor is None else factor
    shown = encode(factor * rendering.linear)
    share = rendering.coverage[..., None]
    return share * shown + (1 - share) * background


def encode(linear: np.ndarray) -> np.ndarray:
    """Convert linear sRGB (..., 3) to display values, colours outside as `into_srgb` says."""
    return np.asarray(_srgb(into_srgb(linear)))
