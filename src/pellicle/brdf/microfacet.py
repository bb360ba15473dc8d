"""A film on rough metal or glass: GGX microfacets with the Airy reflectance in place of Fresnel's.

Source: L. Belcour and P. Barla, ACM TOG 36(4), 65 (2017), as applied to tempered steel. The film may
absorb here, unlike theirs. It covers each facet, which is lit at ⟨i, h⟩.
"""

from __future__ import annotations

from typing import Any

from pellicle.brdf import film_colour, multiple_scattering
from pellicle.brdf.broadcasting import Evaluate, Parameters, column, weighted_sum
from pellicle.brdf.lobes import microfacets


def microfacet(colour: film_colour.Colour = film_colour.exact) -> Evaluate:
    """Return the BRDF specular · D G₂ R(⟨i, h⟩)/(4 cos θ_i cos θ_o) + diffuse, R the film's `colour`.

    With `multiple_scattering` the light reflected more than once between facets is added to the lobe.
    """

    def evaluate(parameters, i, o):
        return weighted_sum(parameters, lambda: film_lobes(parameters, i, o, colour))

    return evaluate


def film_lobes(parameters: Parameters, i: Any, o: Any, colour: film_colour.Colour) -> Any:
    """Return the BRDF of facets under a film, without weights."""
    once = column(microfacets(i, o, parameters["roughness"])) * colour(parameters, i, o)
    if "multiple_scattering" not in parameters:
        return once
    return once + multiple_scattering.lobe(parameters, i, o, colour)
