"""A film on rough metal or glass: GGX microfacets with the Airy reflectance in place of Fresnel's.

(L. Belcour and P. Barla, ACM TOG 36(4), 65 (2017), as told for tempered steel.) The film may absorb,
where theirs may not; it lies on each facet, which sees light at ⟨i, h⟩.
"""

from __future__ import annotations

from collections.abc import Callable

from pellicle.brdf import film_colour
from pellicle.brdf.broadcasting import column, weighted_sum
from pellicle.brdf.lobes import microfacets


def microfacet(colour: Callable = film_colour.exact) -> Callable:
    """specular · D G₂ R(⟨i, h⟩)/(4 cos θ_i cos θ_o) + diffuse, with R the film's RGB reflectance."""

    def evaluate(parameters, i, o):
        def lobes():
            return column(microfacets(i, o, parameters["roughness"])) * colour(parameters, i, o)

        return weighted_sum(parameters, lobes)

    return evaluate
