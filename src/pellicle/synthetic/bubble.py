"""A soap bubble that drains: a spherical film between equal media, its front and its back seen at once.

A line of sight crosses the film in front and at the back at one angle, and is mirrored along further chords
within. Its thickness depends on the height.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pellicle.errors import UsageError
from pellicle.optics.pair import to_complex
from pellicle.synthetic.environment import Environment
from pellicle.synthetic.film_spectra import Stack, linear_srgb, spectra
from pellicle.synthetic.sphere import Rendering, sphere

CROSSINGS = 4
"""Crossings of the film on one line of sight: a further one has less than 1 % of the light up to 80°."""
LOWEST = np.deg2rad(172.0)
"""Angle from the top beyond which the film has one thickness: at the bottom the profile rises without end."""


def drained_thickness(angle: Any, top: float) -> Any:
    """Thickness (nm) of a bubble's film at an angle (radians) from its top, where it is `top` nm thick.

    Liquid between two immobile surfaces flows down a sphere of radius R by ∂d/∂t + ∂(sin²θ ρg d³/12η)/∂θ /
    (R sin θ) = 0. Its similarity solution, d = f(θ)/√t, is
    f/f(0) = √(4/3 ∫₀^θ sin^⅓ dφ) / sin^⅔ θ: the film thins everywhere in proportion.
    """
    from scipy.special import beta, betainc  # slow to import

    angle = np.clip(angle, 1e-6, LOWEST)
    half = 0.5 * beta(2 / 3, 0.5) * betainc(2 / 3, 0.5, np.sin(angle) ** 2)  # of sin^⅓ from 0 to θ or π − θ
    integral = np.where(angle <= np.pi / 2, half, beta(2 / 3, 0.5) - half)
    return top * np.sqrt(4 / 3 * integral) / np.sin(angle) ** (2 / 3)


def bubble(films: Stack, top: float, environment: Environment, size: int) -> Rendering:
    """Render a bubble whose film is `top` nm thick at its top, size × size pixels.

    **Raises:** UsageError where the media on both sides differ.
    """
    if np.max(np.abs(to_complex(films.ambient) - to_complex(films.substrate))) > 1e-3:
        raise UsageError("a bubble has the same medium on both sides: make the substrate that of the ambient")
    pixels = sphere(size)
    angle = np.arccos(pixels.cosine)
    step = np.pi - 2 * angle  # along the sphere, from one crossing to the next
    linear = np.zeros((len(angle), 3))
    passed = np.ones((2, 1, 1))
    for crossing in range(CROSSINGS):
        along = angle + crossing * step
        height = np.sin(along) * pixels.outward[:, 1]
        nm = drained_thickness(np.arccos(np.clip(height, -1.0, 1.0)), top)
        found = spectra(films, nm, pixels.cosine)
        if crossing == 0:
            linear += linear_srgb(films, found.reflected) * environment.radiance(pixels.mirrored())[:, None]
            passed = found.transmitted
            continue
        seen = environment.radiance(pixels.deflected(-(crossing - 1) * step))
        linear += linear_srgb(films, passed * found.transmitted) * seen[:, None]
        passed = passed * found.reflected
    return pixels.rendering(linear)
