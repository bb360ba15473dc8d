"""A film on rough metal or glass: GGX microfacets with the Airy reflectance in place of Fresnel's.

Source: L. Belcour and P. Barla, ACM TOG 36(4), 65 (2017), as applied to tempered steel. The film may
absorb here, unlike theirs. It covers each facet, which is lit at ⟨i, h⟩.
"""

from __future__ import annotations

from pellicle.brdf import film_colour
from pellicle.brdf.broadcasting import Evaluate, column, weighted_sum
from pellicle.brdf.lobes import microfacets


def microfacet(colour: film_colour.Colour = film_colour.exact) -> Evaluate:
    """Return the BRDF specular · D G₂ R(⟨i, h⟩)/(4 cos θ_i cos θ_o) + diffuse, R the film's `colour`."""

    def evaluate(parameters, i, o):
        def lobes():
            return column(microfacets(i, o, parameters["roughness"])) * colour(parameters, i, o)

        return weighted_sum(parameters, lobes)

    return evaluate
