"""Light in plane layers by characteristic matrices, in NumPy: independent of pellicle's forward model.

F. Abelès, Ann. Phys. (Paris) 12, 596 (1950), as in H. A. Macleod, Thin-Film Optical Filters, chapter 2, with
n + ik and the time factor exp(−iωt). Every argument broadcasts: wavelengths, angles, indices and thicknesses.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np


class Amplitudes(NamedTuple):
    """Reflected amplitude, and transmitted and reflected power of one polarisation."""

    r: np.ndarray
    R: np.ndarray
    T: np.ndarray


def amplitudes(
    wavelength: Any, sine: Any, indices: Sequence[Any], thicknesses: Sequence[Any], polarisation: str
) -> Amplitudes:
    """Response of a stack to light of one polarisation, "s" or "p".

    **Arguments:** `wavelength` in nm; `sine`, n₀ sin θ₀ of the incident light; `indices` of the ambient, the
    layers and the substrate; `thicknesses` of the layers in nm. The amplitude r_p has the sign of r_s at
    normal incidence (tangential fields).
    """
    along = [np.sqrt(np.asarray(n, dtype=complex) ** 2 - sine**2) for n in indices]
    if polarisation == "s":
        admittance = along
    else:
        admittance = [np.asarray(n, dtype=complex) ** 2 / q for n, q in zip(indices, along, strict=True)]
    electric, magnetic = np.ones_like(admittance[-1]), admittance[-1]
    for q, eta, d in zip(along[-2:0:-1], admittance[-2:0:-1], thicknesses[::-1], strict=True):
        phase = 2 * np.pi * q * d / wavelength
        cosine, sine_of_phase = np.cos(phase), np.sin(phase)
        electric, magnetic = (
            electric * cosine - 1j * magnetic / eta * sine_of_phase,
            magnetic * cosine - 1j * eta * electric * sine_of_phase,
        )
    first, last = admittance[0], admittance[-1]
    total = first * electric + magnetic
    r = (first * electric - magnetic) / total
    return Amplitudes(r, np.abs(r) ** 2, 4 * np.real(first) * np.real(last) / np.abs(total) ** 2)


def power(
    wavelength: Any,
    sine: Any,
    indices: Sequence[Any],
    thicknesses: Sequence[Any],
    polarisation: str,
    *,
    plate_mm: float | None = None,
    collected: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """R and T of a stack; with `plate_mm` its substrate is a plate with air behind it, of whose reflected
    light a share is `collected`.

    Light between the faces of the plate adds as intensities (Macleod, section 2.14).
    """
    front = amplitudes(wavelength, sine, indices, thicknesses, polarisation)
    if plate_mm is None:
        return front.R, front.T
    plate = np.asarray(indices[-1], dtype=complex)
    # power has no meaning within an absorbing medium: k of a plate of glass is 1e-8 and counts in bulk only
    clear = [np.real(plate), *indices[-2:0:-1], indices[0]]
    inside = amplitudes(wavelength, sine, clear, thicknesses[::-1], polarisation)
    back = amplitudes(wavelength, sine, [np.real(plate), indices[0]], [], polarisation)
    depth = np.imag(np.sqrt(plate**2 - sine**2)) * plate_mm * 1e6
    passed = np.exp(-4 * np.pi * depth / wavelength)
    several = 1 - inside.R * back.R * passed**2
    reflected = front.R + collected * front.T * inside.T * back.R * passed**2 / several
    return reflected, front.T * back.T * passed / several


def stokes(wavelength: Any, sine: Any, indices: Sequence[Any], thicknesses: Sequence[Any]) -> np.ndarray:
    """Sums |r_s|² − |r_p|², Re and Im of 2 r_p* r_s, and |r_s|² + |r_p|², in the first axis.

    The sign of r_p is that of ellipsometry: Δ of bare silicon is near 180° at normal incidence.
    """
    s = amplitudes(wavelength, sine, indices, thicknesses, "s")
    p = amplitudes(wavelength, sine, indices, thicknesses, "p")
    cross = -2 * np.conj(p.r) * s.r
    return np.stack([s.R - p.R, np.real(cross), np.imag(cross), s.R + p.R])
