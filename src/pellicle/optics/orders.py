"""The layer as a Fourier series in its round-trip phase: what an instrument damps order by order.

With a = r₁₂, β = r₂₃ e^{−Im φ}, ϕ = Re φ and γ = |aβ|²,

    |r|² = C₀ + 2 Re Σ_{m≥1} K q^{m−1} e^{imϕ} W_m,    q = −aβ,
    C₀ = |a|² + |1−a²|²|β|²/(1−γ),    K = β[(1−a²)ā − a|1−a²|²|β|²/(1−γ)],
    |t|² = |t₁₂t₂₃|² e^{−Im φ}/(1−γ) · [1 + 2 Re Σ q^m e^{imϕ} W_m].

W_m = 1 sums to Airy's formula. It converges for |q| < 1; what is left out after M orders is at
most 2|K||q|^M/(1−|q|) times the next window.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp

from pellicle.optics.elementary import sincos
from pellicle.optics.interface import fresnel, incident_factor, normal, normal_flux, transverse
from pellicle.optics.pair import Number, Pair, abs2, conj, imag, real

Window = Callable[[int], Any]
"""m → W_m, the factor that order m keeps."""


FWHM = 2.3548200450309493
"""Full width at half maximum of a normal distribution, in standard deviations: 2√(2 ln 2)."""


class AirySeries(NamedTuple):
    """What one polarisation's series is made of."""

    upper: Number  # r from the ambient at the layer's upper face
    lower: Number  # r from the layer at its lower face
    damping: Any  # e^{−Im φ}
    phase: Any  # ϕ = Re φ, radians
    direct: Any  # |t₁₂ t₂₃|² with the power factor into the substrate


def airy_series(
    ambient: Any, layer: Number, substrate: Number, phase: Any, angle: Any, polarisation: str
) -> AirySeries:
    """Arguments as for `film.film`; `phase` is k₀d = 2πd/λ, so that φ = 2 k₀d q₁."""
    a, q0 = transverse(ambient, angle)
    q1, q2 = normal(layer, a), normal(substrate, a)
    e0, e1, e2 = ambient * ambient, layer * layer, substrate * substrate
    if polarisation == "s":
        direct = 4 * abs2(q1) / abs2((q0 + q1) * (q1 + q2))
    else:
        direct = 4 * abs2(e1 * q1) / abs2((e1 * q0 + e0 * q1) * (e2 * q1 + e1 * q2))
    return AirySeries(
        upper=fresnel(ambient, q0, layer, q1, polarisation),
        lower=fresnel(layer, q1, substrate, q2, polarisation),
        damping=jnp.exp(-2 * phase * imag(q1)),
        phase=2 * phase * real(q1),
        direct=incident_factor(ambient, q0, polarisation) * direct * normal_flux(substrate, q2, polarisation),
    )


def reversed_series(b: AirySeries) -> AirySeries:
    """The same layer with the light coming from the substrate."""
    return b._replace(upper=-b.lower, lower=-b.upper)


def _series(first: Number, q: Number, phase, window: Window, count: int):
    """2 Re Σ_{m=1..count} first·q^{m−1} e^{imϕ} W_m."""
    sine, cosine = sincos(phase)
    turn = Pair(cosine, sine)
    term, step, total = first * turn, q * turn, 0.0
    for m in range(1, count + 1):
        total = total + real(term) * window(m)
        term = term * step
    return 2 * total


def reflectance(b: AirySeries, window: Window, count: int):
    """|r|² with `count` orders through the window."""
    beta = b.lower * b.damping
    into = 1 - b.upper * b.upper
    echo = abs2(into) * abs2(beta) / (1 - abs2(b.upper * beta))
    first = beta * (into * conj(b.upper) - b.upper * echo)
    return abs2(b.upper) + echo + _series(first, -(b.upper * beta), b.phase, window, count)


def transmittance(b: AirySeries, window: Window, count: int):
    """Power into the substrate with `count` orders through the window."""
    q = -(b.upper * b.lower * b.damping)
    return b.direct * b.damping / (1 - abs2(q)) * (1 + _series(q, q, b.phase, window, count))


def monochromatic(order: int) -> float:
    """The window of light of one wavelength on an even layer: every order is whole."""
    return 1.0


def gaussian(variance) -> Window:
    """W_m = exp(−m²σ²/2): the phase ϕ is blurred by a normal distribution of variance σ² (rad²)."""
    return lambda m: jnp.exp(-0.5 * m * m * variance)


def phase_variance(phase_slope, bandwidth, cosine_index, thickness_spread, wavelength):
    """Variance of the phase (rad²) seen by an instrument.

    `phase_slope` is ∂ϕ/∂λ (rad/nm) with the layer's dispersion in it (the group index: ϕ/λ alone is
    wrong by 0.01 in R for 2 µm of a dispersive film at 5 nm); `bandwidth` is the full width at half
    maximum (nm); `cosine_index` is Re q₁; `thickness_spread` a standard deviation (nm).
    """
    over_wavelength = phase_slope * (bandwidth / FWHM)
    over_thickness = 4 * jnp.pi / wavelength * cosine_index * thickness_spread
    return over_wavelength**2 + over_thickness**2
