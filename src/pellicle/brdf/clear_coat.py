"""A clear coat over a film on rough metal or glass: two lobes of GGX microfacets, one of each.

Light is reflected at the coat's upper face, or refracted, reflected by the facets under the film, and
refracted out: A. Weidlich and A. Wilkie, "Arbitrarily layered micro-facet surfaces", GRAPHITE 2007. The coat
is clear and much thicker than the film, so that both lobes add as intensities. Rays are refracted at the mean
plane of its face and transmitted by Fresnel's factor there; radiance falls by n² on its way out, which their
paper leaves out. The film's ambient is the coat. Light that the face sends back to the film is left out: 4 %
of the film's light near the normal for n = 1.5, and all of it beyond the critical angle, where rough facets
send a part.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from pellicle.brdf import film_colour
from pellicle.brdf.broadcasting import Evaluate, Parameters, column
from pellicle.brdf.directions import cosine_inside, cosine_to_half
from pellicle.brdf.lobes import microfacets
from pellicle.brdf.microfacet import film_lobes


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


def _below(parameters: Parameters, i: Any, o: Any, colour: film_colour.Colour) -> Any:
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
