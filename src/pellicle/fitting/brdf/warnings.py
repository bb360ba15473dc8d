"""Warnings on a fit of BRDF samples: what the directions and the fitted numbers show."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pellicle.brdf.albedo import energy_warning
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.fitting.brdf.problem import in_plane
from pellicle.fitting.result import Estimate
from pellicle.materials import materials_in
from pellicle.scene.layers import medium
from pellicle.scene.surface import Surface

_STEEP, _TOLERANCE = 15.0, 0.5
"""Degrees from the normal: directions below the first see little of n, and within the second are one."""
_WEIGHTS = ("specular", "diffuse")
_THIN = 5.0
"""nm; n and k of a thinner film are not seen."""


def directions(samples: BrdfSamples, surface: Surface) -> list[str]:
    """Warnings on parameters that the directions of the samples cannot determine."""
    free = {leaf.key for leaf in surface.free_numbers()}
    incidences = np.unique(np.round(samples.theta_i / _TOLERANCE))
    steepest = float(max(samples.theta_i.max(initial=0), samples.theta_o.max(initial=0)))
    messages = []
    if steepest < _STEEP:
        messages.append(
            f"all directions are within {steepest:.0f} degrees of the normal: n and thickness trade"
        )
        if len(samples.channels) == 1:
            messages.append("one channel near the normal cannot tell one order of interference from the next")
    if len(incidences) == 1:
        messages.append("all light comes at one angle: other thicknesses may fit as well; measure at several")
    tilted = {"deviation", "azimuth"} <= free
    if tilted and in_plane(samples):
        messages.append("the samples lie in one plane: they cannot see the sign of a deviation out of it")
    elif tilted and np.ptp(samples.phi_i) < _TOLERANCE:
        messages.append("the surface was never turned: a deviation holds for this orientation alone")
    if {"base_n", "base_k"} <= free:
        messages.append(
            "base_n and base_k are both free and strongly correlated (0.95): fix them from a table"
        )
    return messages


def weights(parameters: Mapping[str, Estimate]) -> list[str]:
    """A sentence on weights of lobes that are fixed, for a fit that does not explain the samples."""
    fixed = [name for name, p in parameters.items() if name.split("_")[0] in _WEIGHTS and not p.free]
    if not fixed:
        return []
    each = " and ".join(f"{name} at {parameters[name].value:g}" for name in fixed)
    return [
        f"fixed: {each}; unless they are known, give them bounds, as in {fixed[0]} = {{ lower = 0, "
        "upper = 10 }"
    ]


def numbers(surface: Surface, parameters: Mapping[str, Estimate], fitted: Mapping[str, Any]) -> list[str]:
    """Warnings on the fitted numbers themselves."""
    messages = []
    depth = parameters.get("thickness")
    if depth is not None and depth.free and depth.value < _THIN:
        messages.append(
            f"thickness {depth.value:.2g} nm is next to none: n and k of so thin a film are not seen"
        )
    for name, p in parameters.items():
        if p.free and name.startswith("exponent") and p.value < 2:
            messages.append(f"{name} {p.value:.2f} is below 2: a second diffuse part rather than a lobe")
    if surface.model.startswith("granier-heidrich"):
        messages.append("the model's lobes are not normalised: specular is a weight and no albedo")
    media = [medium(value) for value in (surface.film, surface.base) if value is not None]
    messages += [sentence for material in materials_in(media) for sentence in material.warnings()]
    # over bands the colour of every direction of the quadrature would be an integral of its own
    brdf = (
        surface.brdf
        if surface.sensor is None
        else surface.brdf.for_thickness_up_to(float(fitted["thickness"]))
    )
    energy = energy_warning(brdf, fitted)
    return [*messages, energy] if energy else messages
