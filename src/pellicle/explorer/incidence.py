"""Angles of incidence of a film in the explorer: a curve for each of several, or one curve against them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.errors import UsageError
from pellicle.scene.film import Light
from pellicle.scene.free import Free

MOST = 12
"""Most angles of which each has a curve."""
_POINTS, _STEEPEST = 201, 85.0
"""Points of a curve against the angle, and the end of its abscissa where one angle is stated (degrees)."""


def light_angles(light: Light, count: int) -> np.ndarray:
    """Return the angles of a light that has several, (angles,) in degrees and rising; none for one number.

    They are drawn at a `count` of wavelengths.

    Raises UsageError where not every wavelength is seen at each angle, and for more than `MOST` angles at
    several wavelengths.
    """
    if isinstance(light.angle, Free) or not np.ndim(light.angle):
        return np.zeros(0)
    angles = np.unique(np.asarray(light.angle, float))
    if light.wavelength is not None and np.shape(light.wavelength) == np.shape(light.angle):
        pairs = np.unique(np.stack([light.wavelength, light.angle]), axis=1).shape[1]
        if pairs != len(angles) * len(np.unique(light.wavelength)):
            raise UsageError(
                "the explorer draws every wavelength at each angle of incidence: give the scene one angle, or"
                " the same angles at each wavelength"
            )
    if len(angles) > MOST and count > 1:
        raise UsageError(
            f"the explorer draws a curve for each of up to {MOST} angles of incidence, and the scene has"
            f" {len(angles)}: give it fewer, or one wavelength"
        )
    return angles


def measured_angles(spectra: Sequence[Spectrum]) -> np.ndarray:
    """Return every angle that spectra state, (angles,) in degrees and rising."""
    stated = [spectrum.angle for spectrum in spectra if spectrum.angle is not None]
    return np.unique(np.concatenate(stated)) if stated else np.zeros(0)


def asked_angles(given: Any) -> np.ndarray:
    """Check the angles of a request, which are returned rising and each once. Raises UsageError."""
    expected = f"the angles of incidence must be 1 to {MOST} numbers from 0 to 90, such as 65, 70, 75"
    if not isinstance(given, list | tuple) or not 1 <= len(given) <= MOST:
        raise UsageError(expected)
    if not all(isinstance(x, int | float) and not isinstance(x, bool) and 0 <= x <= 90 for x in given):
        raise UsageError(expected)
    return np.unique(np.asarray(given, float))


def thinned(angles: np.ndarray) -> np.ndarray:
    """Return at most `MOST` of the angles, the first and the last among them."""
    if len(angles) <= MOST:
        return angles
    return angles[np.unique(np.linspace(0, len(angles) - 1, MOST).round().astype(int))]


def abscissa(angles: np.ndarray) -> np.ndarray:
    """Return the angles of a curve against the angle: from the first to the last of several, else 0 to 85."""
    first, last = (angles[0], angles[-1]) if len(angles) > 1 else (0.0, _STEEPEST)
    return np.linspace(first, max(last, *angles), _POINTS)


def named(angle: float) -> str:
    """Return the name of a curve at this angle, such as `65°`."""
    return f"{angle:g}°"
