"""Lobes around the mirror direction, Blinn-Phong and GGX microfacets with Smith's shadowing; their albedo.

The normal is z. Values and gradients are finite at the edge of a lobe, where both are zero. A parameter of a
BRDF is one number, or a map of samples, which broadcasts against directions.

Not all models are normalised, and some create energy: their directional albedo shows it. A lobe may be
narrower than any grid of directions. So the integral is split by a weight that is 1 where the half vector is
at the normal and falls off over `NARROW`: the narrow part is integrated over half vectors, in equal steps of
ln tan θ_h, in which a lobe has the same width whatever its roughness, and the rest over directions.
"""

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pellicle.brdf.directions import Vectors, cosine_to_half, direction, half_vector, reflect
from pellicle.optics.pair import sqrt

Parameters: TypeAlias = Mapping[str, Any]
"""Key → a number, or a map (...) that broadcasts with the directions. `n` and `k` of any medium
and `wavelengths` have a last axis of wavelengths, or are one number for all of them. `weights` (wavelengths,
channels) are the bands of a sensor; without them each wavelength is a channel."""

Evaluate: TypeAlias = Callable[[Parameters, Vectors, Vectors], Any]
"""(parameters, i, o) → (..., channels), without a test of the horizon."""


def column(samples: Any) -> Any:
    """Reshape a map (...) to (..., 1), so that it broadcasts with channels; return a number unchanged."""
    return samples if jnp.ndim(samples) == 0 else jnp.asarray(samples)[..., None]


def in_channels(parameters: Parameters, spectrum: Any) -> Any:
    """Weight a spectrum (..., wavelengths) by the bands of a sensor, `weights`, if there are any."""
    weights = parameters.get("weights")
    return spectrum if weights is None else spectrum @ weights


def weighted_sum(
    parameters: Parameters, lobes: Callable[[], Any], base: Callable[[], Any] | None = None
) -> Any:
    """Return specular · lobes + diffuse · base; a weight absent from the parameters leaves its term out.

    `base` None is a grey base, of value 1.
    """
    terms = [column(parameters["specular"]) * lobes()] if "specular" in parameters else []
    if "diffuse" in parameters:
        weight = column(parameters["diffuse"])
        terms.append(weight if base is None else weight * base())
    return sum(terms[1:], terms[0])


def power(cosine: Any, exponent: Any) -> Float[Array, "..."]:
    """Return cos₊^e: 0 with zero slope where the cosine is not positive."""
    positive = cosine > 0
    return jnp.where(positive, jnp.exp(exponent * jnp.log(jnp.where(positive, cosine, 1.0))), 0.0)


def cosine_to_mirror(i: Vectors, o: Vectors) -> Float[Array | np.ndarray, "..."]:
    """Return ⟨r, o⟩ with r the mirror direction of i."""
    return i[..., 2] * o[..., 2] - i[..., 0] * o[..., 0] - i[..., 1] * o[..., 1]


def blinn_phong(i: Vectors, o: Vectors, exponent: Any) -> Float[Array, "..."]:
    """Return ⟨n, h⟩₊^e, as published: 1 at the peak (J. F. Blinn, SIGGRAPH 1977)."""
    return power(half_vector(i, o)[..., 2], exponent)


def ggx(h: Vectors, alpha: Any) -> Float[Array, "..."]:
    """Return D(h) in 1/sr, the density of facets with normal h, so that ∫ D ⟨n, h⟩ dω = 1.

    `alpha` is the roughness, above 0. sin² θ is taken from the components of h: 1 − cos² θ would lose a
    narrow lobe in float32.

    **Source:** B. Walter et al. 2007.
    """
    square = alpha * alpha
    spread = square * h[..., 2] ** 2 + h[..., 0] ** 2 + h[..., 1] ** 2
    exists = spread > 0  # there is no half vector where i = −o
    return jnp.where(exists, square / (jnp.pi * jnp.where(exists, spread, 1.0) ** 2), 0.0)


def smith(i: Vectors, o: Vectors, alpha: Any) -> Float[Array, "..."]:
    """Return G₂/(4⟨i, n⟩⟨o, n⟩): Smith's height-correlated shadowing and masking of GGX, over its Jacobian.

    It is 0 where both directions are on or below the horizon.

    **Source:** E. Heitz, JCGT 3 (2014), eq. 99.
    """
    ci, co = i[..., 2], o[..., 2]
    square = alpha * alpha

    def projected_root(c):  # c √(1 + α² tan² θ)
        return sqrt(c * c + square * (1 - c * c))

    denominator = co * projected_root(ci) + ci * projected_root(co)
    positive = denominator > 0
    return jnp.where(positive, 0.5 / jnp.where(positive, denominator, 1.0), 0.0)


def microfacets(i: Vectors, o: Vectors, alpha: Any) -> Float[Array, "..."]:
    """Return D G₂/(4⟨i, n⟩⟨o, n⟩) in 1/sr, the BRDF of mirror-like GGX facets."""
    return ggx(half_vector(i, o), alpha) * smith(i, o, alpha)


def two_lobes(parameters: Any, i: Vectors, o: Vectors) -> Any:
    """BRDF (samples, channels) of a diffuse part and two lobes of GGX microfacets with Schlick's Fresnel.

    Each part has its own colour: `lobe_1`, `lobe_2` and `diffuse` are (channels,); `roughness_1`,
    `roughness_2` and `normal`, the reflectance at normal incidence, are numbers. `i` and `o` are unit vectors
    (samples, 3).
    """
    edge = (1 - cosine_to_half(i, o)) ** 5
    fresnel = parameters["normal"] + (1 - parameters["normal"]) * edge
    rough, smooth = (
        parameters[f"lobe_{k}"] * (microfacets(i, o, parameters[f"roughness_{k}"]) * fresnel)[:, None]
        for k in (1, 2)
    )
    return rough + smooth + parameters["diffuse"] + jnp.zeros_like(i[:, :1])


ANGLES = (0.0, 30.0, 60.0, 80.0)
"""Angles of incidence (degrees) at which `max_albedo` evaluates the albedo."""
NARROW = 0.1
"""Angle (radians) of the half vector from the normal where both integrals have an equal share: lobes wider
than that are resolved by the grid of directions."""
_DECADES = -6.0, 2.0
"""Range of lg tan θ_h: a lobe of α = 1e-4 has 1e-4 of its light below the first."""


def directional_albedo(
    brdf: Callable, parameters: Parameters, theta: Any, phi: Any = 0.0, *, rings: int = 128, spokes: int = 256
) -> Float[Array, " channels"]:
    """Return ∫ ρ cos θ_o dω_o, the reflected fraction of light from one direction, by channel.

    The quadrature over directions is one over the disc of sin θ, Gauss-Legendre in sin² θ and equal steps in
    azimuth; it resolves lobes around any direction wider than about a degree. That over half vectors resolves
    lobes around the mirror direction of any width. Above one the BRDF creates energy.

    **Arguments:** `brdf` is a `Model` or any function (parameters, i, o) → (..., channels); `theta` and
    `phi` are the polar angle and azimuth of the light in degrees; `rings` and `spokes` count the nodes.

    >>> from pellicle.brdf.models import model
    >>> grey = {"thickness": 0.0, "n": 1.5, "diffuse": 0.1}
    >>> directional_albedo(model("granier-heidrich-diffuse"), grey, 30.0).round(2).tolist()
    [0.49, 0.49, 0.49]
    """
    light, azimuth = direction(theta, phi), np.arange(spokes) * (360 / spokes)
    node, weight = np.polynomial.legendre.leggauss(rings)
    polar = np.rad2deg(np.arcsin(np.sqrt(0.5 + 0.5 * node)))[:, None]
    o = direction(polar, azimuth)
    i = jnp.broadcast_to(light, o.shape)
    values = brdf(parameters, i, o) * (1 - _narrow(half_vector(i, o)))[..., None]
    wide = (np.pi / 2) * jnp.tensordot(jnp.asarray(weight, values.dtype), values.mean(axis=1), axes=1)

    step = np.log(10) * (_DECADES[1] - _DECADES[0]) / (rings - 1)
    tilt = np.arctan(10 ** np.linspace(*_DECADES, rings))[:, None]
    h = direction(np.rad2deg(tilt), azimuth)
    i = jnp.broadcast_to(light, h.shape)
    o, across = reflect(i, h), jnp.sum(i * h, axis=-1)
    # dω_o = 4 ⟨i, h⟩ dω_h, and dω_h = sin² θ cos θ d(ln tan θ) dφ
    measure = 4 * jnp.maximum(across, 0.0) * jnp.maximum(o[..., 2], 0.0) * _narrow(h)
    values = brdf(parameters, i, o) * measure[..., None]
    rows = jnp.asarray(np.sin(tilt[:, 0]) ** 2 * np.cos(tilt[:, 0]), values.dtype)
    return wide + 2 * np.pi * step * jnp.tensordot(rows, values.mean(axis=1), axes=1)


def _narrow(h: Any) -> Any:
    """Share of the integral over half vectors at each half vector."""
    tangent = (h[..., 0] ** 2 + h[..., 1] ** 2) / jnp.maximum(h[..., 2] ** 2, 1e-12)
    return 1 / (1 + (tangent / NARROW**2) ** 2)


def max_albedo(brdf: Callable, parameters: Parameters) -> float:
    """Return the largest directional albedo over `ANGLES` and channels; above 1, energy is created."""
    albedo = jax.jit(jax.vmap(lambda theta: directional_albedo(brdf, parameters, theta)))
    return float(jnp.max(albedo(jnp.asarray(ANGLES))))


def energy_warning(brdf: Callable, parameters: Parameters) -> str | None:
    """Return a warning with the largest albedo if the BRDF creates energy, else None."""
    albedo = max_albedo(brdf, parameters)
    if albedo <= 1.005:  # the error of the quadrature, for lobes beside the mirror direction
        return None
    return (
        f"the BRDF creates energy: it reflects up to {albedo:.2f} times the incident light, "
        "so its weights are not albedos"
    )
