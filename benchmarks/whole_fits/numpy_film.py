"""Reflection and transmission of a coherent stack in NumPy, for many candidates in one call.

The recursion of Fresnel amplitudes from the substrate up (Airy's formula, applied layer by layer) equals the
product of characteristic matrices and takes fewer operations. Arrays are (candidates, points).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

Array = np.ndarray


class Amplitudes(NamedTuple):
    """Fresnel amplitudes of one polarisation, and the transmitted power for incident power 1."""

    r: Any
    power: Any
    reverse: Any  # reflection amplitude from the substrate's side


def phase_factor(phase: Array) -> Array:
    """exp(i phase); sine and cosine of real numbers are five times as fast as a complex exponential."""
    if np.iscomplexobj(phase):
        return np.exp(1j * phase)
    factor = np.empty(phase.shape, complex)
    np.cos(phase, out=factor.real)
    np.sin(phase, out=factor.imag)
    return factor


def amplitudes(
    wavelength: Array,
    layers: Sequence[tuple[Any, Any]],
    substrate: Any,
    sine: Any = 0.0,
    p: bool = False,
    transmission: bool = False,
) -> Amplitudes:
    """Amplitudes of layers ((index, thickness in nm) from the top) in air on `substrate`.

    `sine` is that of the angle of incidence. In p light the amplitude is that of the magnetic field, whose
    sign at normal incidence is opposite to that of the electric field in s light.
    """
    media = [1.0, *(index for index, _ in layers), substrate]
    q = [np.sqrt(n * n - sine * sine) for n in media]  # real for real indices: nothing is totally reflected
    admittance = [n * n / one for n, one in zip(media, q, strict=True)] if p else q
    turns = [  # of one passage down and up
        phase_factor(4 * np.pi / wavelength * one * depth)
        for one, (_, depth) in zip(q[1:-1], layers, strict=True)
    ]
    faces = [(up - down) / (up + down) for up, down in itertools.pairwise(admittance)]
    faces = [-face for face in faces] if p else faces
    r = faces[-1]
    for face, turn in zip(reversed(faces[:-1]), reversed(turns), strict=True):
        inner = r * turn
        r = (face + inner) / (1 + face * inner)
    if not transmission:
        return Amplitudes(r, None, None)
    # downwards: the reflection of what lies above, seen from below, and the transmitted power
    above, power = -faces[0], np.real(admittance[-1]) * np.abs(1 + faces[0]) ** 2
    for face, turn in zip(faces[1:], turns, strict=True):
        inner = above * turn
        below = 1 - inner * face
        power = power * np.abs(turn) * np.abs(1 + face) ** 2 / (below.real**2 + below.imag**2)
        above = (inner - face) / below
    return Amplitudes(r, power / np.real(admittance[0]), above)


def reflectance(wavelength: Array, layers: Sequence[tuple[Any, Any]], substrate: Any) -> Array:
    """R at normal incidence."""
    r = amplitudes(wavelength, layers, substrate).r
    return r.real**2 + r.imag**2


def plate_transmittance(wavelength: Array, layers: Sequence[tuple[Any, Any]], plate: Any) -> Array:
    """T at normal incidence of layers on a transparent plate whose back face adds incoherent light."""
    film = amplitudes(wavelength, layers, plate, transmission=True)
    back = ((plate - 1) / (plate + 1)) ** 2
    return film.power * (1 - back) / (1 - back * np.abs(film.reverse) ** 2)


def psi_delta(
    wavelength: Array, layers: Sequence[tuple[Any, Any]], substrate: Any, angle: Array
) -> tuple[Array, Array]:
    """Ψ and Δ in degrees, Δ from 0 to 360: 180 for a bare transparent substrate below Brewster's angle."""
    sine = np.sin(np.deg2rad(angle))
    s, p = (amplitudes(wavelength, layers, substrate, sine, p).r for p in (False, True))
    ratio = p / s
    return np.rad2deg(np.arctan(np.abs(ratio))), np.rad2deg(-np.angle(ratio)) % 360
