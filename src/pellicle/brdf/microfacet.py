"""A film on rough metal or glass: GGX microfacets with the Airy reflectance in place of Fresnel's.

Source: L. Belcour and P. Barla, ACM TOG 36(4), 65 (2017), as applied to tempered steel. The film may
absorb here, unlike theirs. It covers each facet, which is lit at ⟨i, h⟩.

**Multiple scattering** is a lobe beside that of single reflections: C. Kulla and A. Conty, "Revisiting
Physically Based Shading at Imageworks", SIGGRAPH course 2017. Their lobe (1 − E(i))(1 − E(o))/(π(1 − Ē))
returns what a single reflection by mirror-like facets loses, where E is its directional albedo and Ē the mean
of E. The colour F̄² Ē/(1 − F̄(1 − Ē)) counts the reflections of the mean F̄ of the film's colour
(Fdez-Agüera's form of theirs): all of them have the same colour, whatever their angle. A white surface then
returns all light, within 5e-4 for α from 0.003 to 1.

**A clear coat** has a lobe of its own: light is reflected at its upper face, or refracted, reflected by the
facets under the film, and refracted out (A. Weidlich and A. Wilkie, "Arbitrarily layered micro-facet
surfaces", GRAPHITE 2007). The coat is clear and much thicker than the film, so that both lobes add as
intensities. Rays are refracted at the mean plane of its face and transmitted by Fresnel's factor there;
radiance falls by n² on its way out, which their paper leaves out. The film's ambient is the coat. Light that
the face sends back to the film is left out: 4 % of the film's light near the normal for n = 1.5, and all of
it beyond the critical angle, where rough facets send a part.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np

from pellicle.brdf import film_colour
from pellicle.brdf.directions import Vectors, cosine_inside, cosine_to_half
from pellicle.brdf.film_colour import Colour, clenshaw
from pellicle.brdf.lobes import Evaluate, Parameters, column, microfacets, weighted_sum
from pellicle.optics.pair import sqrt


def microfacet(colour: film_colour.Colour = film_colour.exact) -> Evaluate:
    """Return the BRDF specular · D G₂ R(⟨i, h⟩)/(4 cos θ_i cos θ_o) + diffuse, R the film's `colour`.

    With `multiple_scattering` the light reflected more than once between facets is added to the lobe.
    """

    return lambda parameters, i, o: weighted_sum(parameters, lambda: film_lobes(parameters, i, o, colour))


def film_lobes(parameters: Parameters, i: Vectors, o: Vectors, colour: film_colour.Colour) -> Any:
    """Return the BRDF of facets under a film, without weights."""
    once = column(microfacets(i, o, parameters["roughness"])) * colour(parameters, i, o)
    if "multiple_scattering" not in parameters:
        return once
    return once + multiple_scattering_lobe(parameters, i, o, colour)


_LOSS = np.array(
    [
        (0.18623, 0.21441, 0.04861, 0.01358, 0.00201, -0.00322, -0.00211),
        (0.18848, 0.20496, 0.08327, 0.01931, 0.01177, -0.00802, -0.00388),
        (-0.06091, 0.00304, 0.01867, 0.04136, 0.00756, -0.00511, -0.00377),
        (-0.05018, -0.03782, 0.02868, 0.02778, 0.01497, -0.00519, -0.00309),
        (-0.02258, -0.00917, 0.00379, 0.03185, 0.01012, -0.00249, -0.00251),
        (-0.00104, -0.02763, 0.00921, 0.01619, 0.01184, -0.00219, -0.00181),
        (-0.00141, -0.00572, -0.0036, 0.01542, 0.00637, -0.00096, -0.00113),
        (0.00322, -0.00859, 0.00203, 0.00547, 0.0052, -0.00076, -0.00075),
        (-0.00058, 0.00132, -0.00258, 0.00445, 0.00203, -0.00052, -0.00029),
        (0.00061, -0.00089, 0.00024, 0.00082, 0.00106, -0.00024, -0.00019),
        (-0.00042, 0.00097, -0.00075, 0.00059, 0.00027, -0.00023, 1e-05),
    ]
)
"""Chebyshev coefficients of 1 − E in 2√(μ/(μ + α)) − 1 and 2α − 1, by `scripts/derive_ggx_albedo.py`."""
_LEAST = 1e-6
"""Loss below which there is none: the error of the polynomial for nearly smooth facets."""
_NODE, _WEIGHT = (np.polynomial.legendre.leggauss(24)[k] for k in (0, 1))
_COSINE, _SHARE = 0.5 * (_NODE + 1), 0.5 * (_NODE + 1) * _WEIGHT
"""Cosines of angles over the hemisphere, and their shares of light from all of it."""


def loss(cosine: Any, alpha: Any) -> Any:
    """Return 1 − E(μ): the light from a cosine that single reflections by mirror-like facets lose."""
    cosine = jnp.maximum(cosine, 0.0)
    both = cosine + alpha
    x = 2 * sqrt(cosine / jnp.where(both > 0, both, 1.0)) - 1
    powers = [jnp.ones_like(alpha), 2 * alpha - 1]
    while len(powers) < _LOSS.shape[1]:
        powers.append(2 * powers[1] * powers[-1] - powers[-2])
    series = jnp.stack(powers, axis=-1) @ jnp.asarray(_LOSS.T, x.dtype)
    return jnp.maximum(clenshaw(jnp.moveaxis(series, -1, 0), 2 * x), _LEAST)


def mean_loss(alpha: Any) -> Any:
    """Return 1 − Ē, the mean of `loss` over light from the whole hemisphere."""
    cosine, share = (jnp.asarray(x, alpha.dtype) for x in (_COSINE, _SHARE))
    return loss(cosine, alpha[..., None]) @ share


def mean_colour(parameters: Parameters, colour: Colour, dtype: Any) -> Any:
    """Return F̄, the mean of the film's colour over light from the whole hemisphere, (..., channels)."""
    sine = np.sqrt(1 - _COSINE**2)
    # a map of thicknesses has its own mean at each point
    axes = (-1, *(1,) * jnp.ndim(parameters["thickness"]), 3)
    i, o = (
        jnp.asarray(np.stack([side * sine, 0 * sine, _COSINE], axis=-1).reshape(axes), dtype)
        for side in (1, -1)
    )
    values = colour(parameters, i, o)
    if jnp.ndim(values) < len(axes):  # at normal incidence on all facets
        return values
    return jnp.tensordot(jnp.asarray(_SHARE, values.dtype), values, axes=1)


def multiple_scattering_lobe(parameters: Parameters, i: Vectors, o: Vectors, colour: Colour) -> Any:
    """Return the BRDF of light reflected more than once, times the parameter `multiple_scattering`."""
    alpha = jnp.asarray(parameters["roughness"], i.dtype)
    lost = mean_loss(alpha)
    shape = loss(i[..., 2], alpha) * loss(o[..., 2], alpha) / (jnp.pi * lost)
    mean, lost = mean_colour(parameters, colour, i.dtype), column(lost)
    coloured = mean * mean * (1 - lost) / (1 - mean * lost)
    return column(parameters["multiple_scattering"] * shape) * coloured


def clear_coat(colour: film_colour.Colour = film_colour.exact) -> Evaluate:
    """Return the BRDF specular · T(i) T(o) f(i', o')/n² + coat · F(⟨i, h⟩) m(i, o) + diffuse.

    f is that of `microfacet` along the refracted directions i' and o' in the coat, with the film's `colour`,
    and m the lobe of mirror-like facets.
    """

    def evaluate(parameters, i, o):
        terms = []
        if "specular" in parameters:
            terms.append(column(parameters["specular"]) * _below(parameters, i, o, colour))
        if "coat" in parameters:
            face = fresnel(cosine_to_half(i, o), parameters["coat_n"])
            lobe = face * microfacets(i, o, parameters["coat_roughness"])
            terms.append(column(parameters["coat"]) * column(lobe))
        if "diffuse" in parameters:
            terms.append(column(parameters["diffuse"]))
        return sum(terms[1:], terms[0])

    return evaluate


def _below(parameters: Parameters, i: Vectors, o: Vectors, colour: film_colour.Colour) -> Any:
    """The film's lobe as seen through the coat."""
    n = parameters["coat_n"]
    inner_i, inner_o = (
        jnp.concatenate([v[..., :2] / n, cosine_inside(v[..., 2:], n)], axis=-1) for v in (i, o)
    )
    passed = (1 - fresnel(i[..., 2], n)) * (1 - fresnel(o[..., 2], n)) / (n * n)
    return column(passed) * film_lobes({**parameters, "ambient_n": n}, inner_i, inner_o, colour)


def fresnel(cosine: Any, n: Any) -> Any:
    """Return the unpolarised reflectance of a clear face of relative index n > 1 from outside."""
    inside = cosine_inside(cosine, n)
    s = (cosine - n * inside) / (cosine + n * inside)
    p = (n * cosine - inside) / (n * cosine + inside)
    return 0.5 * (s * s + p * p)
