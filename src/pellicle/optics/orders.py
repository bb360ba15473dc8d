"""Airy's formula as a Fourier series in the round-trip phase, damped order by order by an instrument.

With a = r₁₂, β = r₂₃ e^{−Im φ}, ϕ = Re φ and γ = |aβ|²,

    |r|² = C₀ + 2 Re Σ_{m≥1} K q^{m−1} e^{imϕ} W_m,    q = −aβ,
    C₀ = |a|² + |1−a²|²|β|²/(1−γ),    K = β[(1−a²)ā − a|1−a²|²|β|²/(1−γ)],
    |t|² = |t₁₂t₂₃|² e^{−Im φ}/(1−γ) · [1 + 2 Re Σ q^m e^{imϕ} W_m].

With W_m = 1 the sum is Airy's formula. It converges for |q| < 1. After M orders, the rest is at most
2|K||q|^M/(1−|q|) times the next window factor.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp

from pellicle.optics.anisotropy import Index, seen_by, tangential_permittivity
from pellicle.optics.interface import fresnel, incident_factor, normal, normal_flux, transverse
from pellicle.optics.pair import Number, Pair, abs2, conj, imag, namespace, real
from pellicle.optics.special import sincos

Window = Callable[[int], Any]
"""m → W_m, the factor by which order m is damped."""


FWHM = 2.3548200450309493
"""Full width at half maximum of a normal distribution, in standard deviations: 2√(2 ln 2)."""


class AirySeries(NamedTuple):
    """Coefficients of the series for one polarisation."""

    upper: Number  # r from the ambient at the layer's upper face
    lower: Number  # r from the layer at its lower face
    damping: Any  # e^{−Im φ}
    phase: Any  # ϕ = Re φ, radians
    direct: Any  # |t₁₂ t₂₃|² with the power factor into the substrate


def airy_series(
    ambient: Index, layer: Index, substrate: Index, phase: Any, angle: Any, polarisation: str
) -> AirySeries:
    """Return the series of one layer; arguments as for `film.film`, with φ = 2 k₀d q₁."""
    ambient, layer, substrate = (seen_by(n, polarisation) for n in (ambient, layer, substrate))
    a, q0 = transverse(ambient, angle)
    q1, q2 = normal(layer, a), normal(substrate, a)
    e0, e1, e2 = map(tangential_permittivity, (ambient, layer, substrate))
    if polarisation == "s":
        direct = 4 * abs2(q1) / abs2((q0 + q1) * (q1 + q2))
    else:
        direct = 4 * abs2(e1 * q1) / abs2((e1 * q0 + e0 * q1) * (e2 * q1 + e1 * q2))
    flux = incident_factor(ambient, q0, polarisation) * direct * normal_flux(substrate, q2, polarisation)
    return AirySeries(
        upper=fresnel(ambient, q0, layer, q1, polarisation),
        lower=fresnel(layer, q1, substrate, q2, polarisation),
        damping=namespace(phase, q1).exp(-2 * phase * imag(q1)),
        phase=2 * phase * real(q1),
        direct=flux,
    )


def reversed_series(series: AirySeries) -> AirySeries:
    """Return the series of the same layer for light from the substrate."""
    return series._replace(upper=-series.lower, lower=-series.upper)


def _damped_sum(first: Number, q: Number, phase: Any, window: Window, count: int) -> Any:
    """Return 2 Re Σ_{m=1..count} first·q^{m−1} e^{imϕ} W_m."""
    sine, cosine = sincos(phase)
    rotation = Pair(cosine, sine)
    term, step, total = first * rotation, q * rotation, 0.0
    for m in range(1, count + 1):
        total = total + real(term) * window(m)
        term = term * step
    return 2 * total


def _not_returned(gamma: Any) -> Any:
    """1 − γ, above 0 where a layer between equal media returns all light at grazing incidence."""
    return jnp.maximum(1 - gamma, jnp.finfo(gamma.dtype).eps)


def reflectance(series: AirySeries, window: Window, count: int) -> Any:
    """Return |r|² with `count` orders damped by `window`."""
    beta = series.lower * series.damping
    into = 1 - series.upper * series.upper
    echo = abs2(into) * abs2(beta) / _not_returned(abs2(series.upper * beta))
    first = beta * (into * conj(series.upper) - series.upper * echo)
    orders = _damped_sum(first, -(series.upper * beta), series.phase, window, count)
    return abs2(series.upper) + echo + orders


def transmittance(series: AirySeries, window: Window, count: int) -> Any:
    """Return the power into the substrate with `count` orders damped by `window`."""
    q = -(series.upper * series.lower * series.damping)
    orders = _damped_sum(q, q, series.phase, window, count)
    return series.direct * series.damping / _not_returned(abs2(q)) * (1 + orders)


def monochromatic(order: int) -> float:
    """Return 1: the window of monochromatic light on a uniform layer damps no order."""
    return 1.0


def gaussian(variance: Any) -> Window:
    """Return W_m = exp(−m²σ²/2), for a phase ϕ blurred by a normal distribution of variance σ² (rad²)."""
    return lambda m: jnp.exp(-0.5 * m * m * variance)


def phase_variance(
    phase_slope: Any, bandwidth: Any, cosine_index: Any, thickness_spread: Any, wavelength: Any
) -> Any:
    """Return the variance (rad²) of the round-trip phase over a bandwidth and a non-uniform thickness.

    **Arguments:** `phase_slope` is ∂ϕ/∂λ (rad/nm) including the layer's dispersion (the group index:
    ϕ/λ alone is wrong by 0.01 in R for 2 µm of a dispersive film at 5 nm); `bandwidth` the full width at
    half maximum (nm); `cosine_index` Re q₁; `thickness_spread` a standard deviation (nm); `wavelength` in
    nm.
    """
    over_wavelength = phase_slope * (bandwidth / FWHM)
    over_thickness = 4 * jnp.pi / wavelength * cosine_index * thickness_spread
    return over_wavelength**2 + over_thickness**2
