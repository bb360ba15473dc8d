"""A layered RGB BRDF by interference of two Phong lobes (X. Granier and W. Heidrich, Pacific Graphics 2002).

Light is reflected at the upper boundary, whose normal n₀ is z, or refracted, mirrored at the lower one,
whose normal n₁ is tilted, and refracted out; both lobes interfere. Equation numbers are those of the
paper. Where it is ambiguous, the reading that is consistent with the rest of it is taken:

- i and o point away from the surface; t_i and t_o are **both** their refractions downward (with one
  of them upward eq. 3 would cancel the phase), so that eq. 10's lobe is ⟨r_ti, −t_o⟩.
- Eq. 10 is null where ⟨−t_i, n₁⟩, ⟨−t_o, n₁⟩ or ⟨r_ti, −t_o⟩ is not positive: light reaches the lower
  boundary from within the layer. The paper's "always true" for parallel boundaries is wrong: two rays on
  one side at 88° are null for an index below √2.
- Eq. 9 with t_o is Schlick's formula at the angle inside the layer, as published. It differs from 1 − F
  of light that leaves, and reciprocity fails. The reciprocal variant has F at the half vector in R and
  (1 − F(i))(1 − F(o)) in T.
- Eq. 14, the average refracted cosine, is 0.835 at n = 1.5, where the paper prints .85; eq. 15 takes 1.
- The lower boundary reflects everything without a phase shift; the lobes are not normalised.

Energy can exceed one, so the weights are not albedos (`pellicle.brdf.lobes` computes it).
"""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import jax.numpy as jnp

from pellicle.brdf import lobes
from pellicle.brdf.directions import Vectors, cosine_inside, cosine_to_half, direction
from pellicle.brdf.lobes import Evaluate, Parameters, column, in_channels, weighted_sum
from pellicle.optics.pair import sqrt
from pellicle.optics.special import sincos


class Paths(NamedTuple):
    """Cosines along both paths, reflected and through the layer, each (..., 1) or per channel (..., 3)."""

    i: Any  # ⟨i, n₀⟩
    o: Any  # ⟨o, n₀⟩
    half: Any  # ⟨i, h⟩
    inside_i: Any  # ⟨t_i, −n₀⟩
    inside_o: Any  # ⟨t_o, −n₀⟩
    mirror: Any  # ⟨r_i, o⟩
    lower: Any  # ⟨r_ti, −t_o⟩, 0 where light does not reach the lower boundary


class Amplitudes(NamedTuple):
    """√R and √T of eqs. 6 and 10, and the phase Φ of eq. 3 in radians, per channel."""

    reflected: Any
    transmitted: Any
    phase: Any


Fresnel: TypeAlias = Callable[[Paths, Any], tuple[Any, Any]]
"""(cosines, index) → F, and the transmitted factor of eq. 10 over (1 − f)²."""

Combine: TypeAlias = Callable[[Amplitudes], Any]
"""Sum of both lobes, with or without interference."""


def paths(i: Vectors, o: Vectors, n: Any, normal: Any = None) -> Paths:
    """Return the cosines for a layer of index n ≥ 1 (scalar or per channel) over a boundary of this normal.

    `normal` None means parallel boundaries. With u = −t_i and w = −t_o the lobe of eq. 10 is
    ⟨r_ti, w⟩ = 2⟨u, n₁⟩⟨w, n₁⟩ − ⟨u, w⟩.
    """
    (xi, yi, zi), (xo, yo, zo) = ((v[..., 0:1], v[..., 1:2], v[..., 2:3]) for v in (i, o))
    down_i, down_o = cosine_inside(zi, n), cosine_inside(zo, n)
    toward_i, toward_o = down_i, down_o
    if normal is not None:
        x, y, z = (normal[..., k : k + 1] for k in range(3))
        toward_i, toward_o = (xi * x + yi * y) / n + down_i * z, (xo * x + yo * y) / n + down_o * z
    cosine_between = (xi * xo + yi * yo) / (n * n) + down_i * down_o
    reached = (toward_i > 0) & (toward_o > 0)
    return Paths(
        i=zi,
        o=zo,
        half=cosine_to_half(i, o)[..., None],
        inside_i=down_i,
        inside_o=down_o,
        mirror=lobes.cosine_to_mirror(i, o)[..., None],
        lower=jnp.where(reached, 2 * toward_i * toward_o - cosine_between, 0.0),
    )


def normal_reflectance(n: Any) -> Any:
    """Return f of eq. 8, from air."""
    return ((1 - n) / (1 + n)) ** 2


def schlick(cosine: Any, n: Any) -> Any:
    """Return F of eq. 7."""
    f = normal_reflectance(n)
    return f + (1 - f) * (1 - cosine) ** 5


def _schlick_complement(c: Any) -> Any:
    """Return (1 − F)/(1 − f) = 1 − (1 − c)⁵, without cancellation at grazing incidence."""
    return c * (5 - c * (10 - c * (10 - c * (5 - c))))


def published(p: Paths, n: Any) -> tuple[Any, Any]:
    """Return F and (1 − F(i)) T(t_o) of eqs. 6 and 10, the latter over (1 − f)²."""
    return schlick(p.i, n), _schlick_complement(p.i) * _schlick_complement(p.inside_o)


def reciprocal(p: Paths, n: Any) -> tuple[Any, Any]:
    """Return F and (1 − F(i))(1 − F(o)), symmetric in i and o, the latter over (1 − f)²."""
    return schlick(p.half, n), _schlick_complement(p.i) * _schlick_complement(p.o)


def amplitudes(parameters: Parameters, i: Vectors, o: Vectors, fresnel: Fresnel = published) -> Amplitudes:
    """Return √R, √T and Φ, as products of roots: √(lobe^e) itself has no slope at the edge of the lobe."""
    n = parameters["n"]
    tilted = "deviation" in parameters
    p = paths(i, o, n, direction(parameters["deviation"], parameters["azimuth"]) if tilted else None)
    F, passed = fresnel(p, n)
    e0, e1 = column(parameters["exponent_reflection"]), column(parameters["exponent_transmission"])
    per_wavelength = jnp.pi * n * column(parameters["thickness"]) / parameters["wavelengths"]
    return Amplitudes(
        reflected=sqrt(F) * lobes.power(p.mirror, 0.5 * e0),
        transmitted=(1 - normal_reflectance(n)) * sqrt(passed) * lobes.power(p.lower, 0.5 * e1),
        phase=per_wavelength * (p.inside_i + p.inside_o),
    )


def interfering(a: Amplitudes) -> Any:
    """Return R + T + 2 cos 2Φ √(RT), eq. 5, as (√R − √T)² + 4 √R √T cos² Φ, which is never negative."""
    cosine = sincos(a.phase)[1]
    return (a.reflected - a.transmitted) ** 2 + 4 * a.reflected * a.transmitted * cosine * cosine


def incoherent(a: Amplitudes) -> Any:
    """Return R + T, without interference."""
    return a.reflected * a.reflected + a.transmitted * a.transmitted


def diffuse_reflectance(n: Any) -> Any:
    """Return R_d of eq. 12, exactly the cosine-weighted average of Schlick's F over the hemisphere.

    It is 1/21 at n = 1 and 0.0857 at n = 1.5, where Fresnel's formula gives 0.0918.
    """
    return (21 * (n * n + 1) - 38 * n) / (21 * (1 + n) ** 2)


def diffuse_transmittance(n: Any) -> Any:
    """Return T_d = 1 − R_d of eq. 13."""
    return 80 / 21 * n / (1 + n) ** 2


def layered_diffuse(parameters: Parameters, combine: Combine = interfering) -> Any:
    """Return ρ_d of eqs. 11 and 16 per channel; 1 without interference."""
    n = parameters["n"]
    phase = 2 * jnp.pi * n * column(parameters["thickness"]) / parameters["wavelengths"]
    amplitudes_at = Amplitudes(sqrt(diffuse_reflectance(n)), sqrt(diffuse_transmittance(n)), phase)
    return in_channels(parameters, combine(amplitudes_at))


def _lobes(parameters: Parameters, i: Vectors, o: Vectors, fresnel: Fresnel, combine: Combine) -> Any:
    return in_channels(parameters, combine(amplitudes(parameters, i, o, fresnel)))


def specular(fresnel: Fresnel = published, combine: Combine = interfering) -> Evaluate:
    """Return the Phong-like BRDF over a grey diffuse base: specular · (eq. 5) + diffuse."""

    return lambda values, i, o: weighted_sum(values, lambda: _lobes(values, i, o, fresnel, combine))


def diffuse(combine: Combine = interfering) -> Evaluate:
    """Return the diffuse BRDF alone: diffuse · ρ_d, independent of the directions."""

    def evaluate(parameters, i, o):
        zeros = jnp.zeros_like(i[..., 2:3] * o[..., 2:3])
        return column(parameters["diffuse"]) * layered_diffuse(parameters, combine) + zeros

    return evaluate


def full(fresnel: Fresnel = published, combine: Combine = interfering) -> Evaluate:
    """Return specular · (eq. 5) + diffuse · ρ_d (eq. 16), as in the paper's figures 3 and 5."""

    def evaluate(parameters, i, o):
        base = lambda: layered_diffuse(parameters, combine)  # noqa: E731
        return weighted_sum(parameters, lambda: _lobes(parameters, i, o, fresnel, combine), base)

    return evaluate
