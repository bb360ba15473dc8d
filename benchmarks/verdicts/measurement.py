"""Simulated measurements: a stack of layers, an instrument, and the flaws of both."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from media import Index, air, bruggeman, cauchy, scaled, with_resonance
from transfer_matrix import power, stokes

FWHM = 2 * math.sqrt(2 * math.log(2))
"""Full width at half maximum of a normal distribution of standard deviation 1."""


@dataclass(frozen=True)
class Stack:
    """Layers from the air down, each an index and a thickness in nm; `film` is the one that is asked for."""

    layers: tuple[tuple[Index, float], ...]
    substrate: Index
    film: int = 0
    plate_mm: float | None = None

    @property
    def thickness(self) -> float:
        """Mean thickness of the film in nm."""
        return self.layers[self.film][1]


@dataclass(frozen=True)
class View:
    """What is measured: the signal ("R", "T", "psi-delta") at each wavelength (nm) and angle (degrees)."""

    signal: str
    wavelength: np.ndarray
    angle: np.ndarray
    polarisation: str = "unpolarised"

    @property
    def position(self) -> np.ndarray:
        """Wavelengths mapped to −1 to 1."""
        low, high = self.wavelength.min(), self.wavelength.max()
        return (2 * self.wavelength - low - high) / (high - low)


@dataclass(frozen=True)
class Conditions:
    """Everything that a measurement has and its scene does not know; the defaults are none of it."""

    shift: float = 0.0  # true minus stated wavelength, nm
    stretch: float = 0.0  # the same at the ends of the range, with opposite signs, nm
    slit: float = 0.0  # base of half a triangular window, its FWHM, nm
    slit_shape: str = "triangle"
    roughness: float = 0.0  # rms height of the upper face, nm
    spread: float = 0.0  # standard deviation of the thickness over the spot, a wedge, nm
    cone: float = 0.0  # half angle, degrees
    angle_error: float = 0.0  # true minus stated angle, degrees
    film_factor: float = 1.0  # of the film's index
    substrate_factor: float = 1.0
    interlayer: Index | None = None
    interlayer_nm: float = 0.0
    overlayer_nm: float = 0.0  # of index 1.5, on the upper face
    pores: float = 0.0  # share of air in the film
    absorption: tuple[float, float, float] | None = None  # strength, energy and width of a resonance, eV
    stray: float = 0.0
    nonlinearity: float = 0.0
    drift: float = 0.0  # amplitude of the gain's drift, with `drift_shape`
    drift_shape: tuple[float, ...] = ()
    step: float = 0.0  # of the gain, at `step_at` nm
    step_at: float = 0.0
    factor: float = 1.0
    offset: float = 0.0
    psi_offset: float = 0.0
    delta_offset: float = 0.0
    depolarisation: float = 0.0
    spikes: tuple[tuple[int, float], ...] = ()  # row and height in standard deviations of the noise
    reverse: bool = False  # values in the wrong order of wavelengths
    reference: Index | None = None  # bare substrate relative to which R is recorded
    collected: float = 1.0  # share of the light from the back face
    convention: str = ""  # of Δ, as "360 - delta"

    def __str__(self) -> str:
        said = [(f.name, getattr(self, f.name)) for f in fields(self) if getattr(self, f.name) != f.default]
        return ", ".join(
            f"{name} {_short(value)}" for name, value in said if name not in ("interlayer", "reference")
        )


def _short(value: Any) -> str:
    if isinstance(value, tuple):
        return "(" + " ".join(_short(x) for x in value) + ")"
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def seen(stack: Stack, conditions: Conditions, bandwidth: float, view: View) -> np.ndarray:
    """Signal without noise: R or T (points,), or N, C and S (3, points), as an instrument measures it.

    `bandwidth` in nm is that of the instrument's normal window, as its scene describes it. Slit, thickness
    spread and cone average intensities.
    """
    wavelength = view.wavelength + conditions.shift + conditions.stretch * view.position
    offsets, weights = _window(bandwidth, conditions)
    depths, depth_weights = np.polynomial.legendre.leggauss(15 if conditions.spread else 1)
    angles, angle_weights = _rays(view, conditions)
    nm = (wavelength + offsets[:, None])[:, None, None, :]
    d = (math.sqrt(3) * conditions.spread * depths)[:, None, None]
    theta = np.deg2rad(view.angle + conditions.angle_error + angles[:, None])
    values = _intensities(_flawed(stack, conditions), nm, d, np.sin(theta), view, conditions.collected)
    mean = np.einsum("...abcw,a,b,c->...w", values, weights, depth_weights / 2, angle_weights)
    return mean[:3] / mean[3] if view.signal == "psi-delta" else mean


def _window(bandwidth: float, conditions: Conditions) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights over the spectrometer's window in nm."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    if conditions.slit and conditions.slit_shape == "triangle":
        half = conditions.slit * (nodes + 1) / 2
        share = weights * (1 - (nodes + 1) / 2)
        both = np.concatenate([share, share])
        return np.concatenate([-half, half]), both / both.sum()
    if conditions.slit:
        return conditions.slit * nodes / 2, weights / 2
    if bandwidth:
        nodes, weights = np.polynomial.hermite_e.hermegauss(15)
        return nodes * bandwidth / FWHM, weights / weights.sum()
    return np.zeros(1), np.ones(1)


def _rays(view: View, conditions: Conditions) -> tuple[np.ndarray, np.ndarray]:
    """Angles in degrees relative to the axis, and weights, over a round pupil that is evenly lit."""
    if not conditions.cone:
        return np.zeros(1), np.ones(1)
    if np.all(view.angle == 0):
        nodes, weights = np.polynomial.legendre.leggauss(8)
        share = (nodes + 1) / 2  # of the pupil's area
        return conditions.cone * np.sqrt(share), weights / 2
    k = np.arange(1, 10)
    weights = np.sin(np.pi * k / 10) ** 2  # of the pupil's chords: Gauss-Chebyshev of the second kind
    return conditions.cone * np.cos(np.pi * k / 10), weights / weights.sum()


def _flawed(stack: Stack, conditions: Conditions) -> Stack:
    """The stack with the flaws of the sample, whose film keeps its mean thickness."""
    layers = list(stack.layers)
    index, thickness = layers[stack.film]
    if conditions.film_factor != 1:
        index = scaled(index, conditions.film_factor)
    if conditions.pores:
        index = bruggeman(index, air, conditions.pores)
    if conditions.absorption is not None:
        index = with_resonance(index, *conditions.absorption)
    layers[stack.film] = index, thickness
    if conditions.interlayer is not None:
        layers.append((conditions.interlayer, conditions.interlayer_nm))
    film = stack.film
    if conditions.roughness:
        # normal heights, as 12 slices of a mixture with air from −2.5 to 2.5 standard deviations
        above, depth = layers[0]
        edge = 2.5 * conditions.roughness
        shares = [0.5 * (1 + math.erf((2 * i + 1 - 12) / 12 * 2.5 / math.sqrt(2))) for i in range(12)]
        slices = [(bruggeman(air, above, share), edge / 6) for share in shares]
        layers[:1] = [*slices, (above, depth - edge)]
        film += 12
    if conditions.overlayer_nm:
        layers.insert(0, (cauchy(1.5, 0.0), conditions.overlayer_nm))
        film += 1
    factor = conditions.substrate_factor
    substrate = stack.substrate if factor == 1 else scaled(stack.substrate, factor)
    return Stack(tuple(layers), substrate, film, stack.plate_mm)


def _intensities(
    stack: Stack, nm: np.ndarray, deeper: np.ndarray, sine: np.ndarray, view: View, collected: float
) -> np.ndarray:
    """R, T or the four Stokes sums; axes: window, thickness, ray, point."""
    indices = [1.0 + 0j, *(index(nm) for index, _ in stack.layers), stack.substrate(nm)]
    thicknesses: list[Any] = [thickness for _, thickness in stack.layers]
    thicknesses[stack.film] = thicknesses[stack.film] + deeper
    if view.signal == "psi-delta":
        return stokes(nm, sine, indices, thicknesses)
    which = 0 if view.signal == "R" else 1
    letters = {"unpolarised": "sp", "s": "s", "p": "p"}[view.polarisation]
    if not np.any(sine):
        letters = "s"  # s and p are the same
    plate = {"plate_mm": stack.plate_mm, "collected": collected}
    values = [power(nm, sine, indices, thicknesses, p, **plate)[which] for p in letters]
    return np.mean(values, axis=0)


def recorded_power(signal: np.ndarray, conditions: Conditions, view: View) -> np.ndarray:
    """R or T as the instrument records it, without noise and spikes."""
    x, c = view.position, conditions
    signal = (signal + c.stray * signal.mean()) / (1 + c.stray)
    signal = signal * (1 - c.nonlinearity * signal) / (1 - c.nonlinearity)
    if c.drift:
        shape = np.polynomial.chebyshev.chebval(x, c.drift_shape)
        signal = signal * (1 + c.drift * shape / np.abs(shape).max())
    signal = np.where(view.wavelength > c.step_at, 1 + c.step, 1.0) * signal
    signal = c.factor * signal + c.offset
    if c.reference is not None:
        sine = np.sin(np.deg2rad(view.angle))
        signal = signal / power(view.wavelength, sine, [1.0, c.reference(view.wavelength)], [], "s")[0]
    return signal[::-1] if c.reverse else signal


def recorded_angles(ncs: np.ndarray, conditions: Conditions) -> np.ndarray:
    """Ψ and Δ in degrees, (2, points), as an instrument that assumes polarised light computes them."""
    kept = 1 - conditions.depolarisation
    n, c, s = kept * ncs
    psi = 0.5 * np.arccos(np.clip(n, -1, 1))
    # without depolarisation tan Δ = S/C; with it, an analyser's cosine: C over sin 2Ψ of the depolarised N
    plain = np.arctan2(s, c)
    if conditions.depolarisation:
        cosine = c / np.maximum(np.sin(2 * psi), 1e-12)
        plain = np.sign(s) * np.arccos(np.clip(cosine, -1, 1))
    psi = np.rad2deg(psi) + conditions.psi_offset
    delta = np.rad2deg(plain) + conditions.delta_offset
    if conditions.reverse:
        psi, delta = psi[::-1], delta[::-1]
    conventions = {"360 - delta": 360 - delta, "180 - delta": 180 - delta}
    return np.stack([psi, conventions.get(conditions.convention, delta)])
