"""What the reader should know before using the numbers: what these samples cannot decide."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pellicle.brdf.albedo import energy_warning
from pellicle.fitting.result import Estimate
from pellicle.io.samples import BrdfSamples
from pellicle.surfaces.surface import Surface

_STEEP = 15.0
_TOLERANCE = 0.5
_THIN = 5.0
_ON = 1e-6


def in_plane(samples: BrdfSamples) -> bool:
    """Whether light, eye and normal always lie in one plane."""
    away = np.deg2rad(samples.phi_i[:, None] - np.array([0.0, 1.0]) * samples.phi_i[0])
    lit = (samples.theta_i > _TOLERANCE) & (samples.theta_o > _TOLERANCE)
    across = np.sin(np.deg2rad(samples.phi_o - samples.phi_i))[lit]
    turned = np.sin(away[:, 1])[samples.theta_i > _TOLERANCE]
    return bool(np.all(np.abs(across) < 0.01) and np.all(np.abs(turned) < 0.01))


def directions(samples: BrdfSamples, surface: Surface) -> list[str]:
    """What the directions cannot decide."""
    free = {leaf.key for leaf in surface.leaves()}
    incidences = np.unique(np.round(samples.theta_i / _TOLERANCE))
    steepest = float(max(samples.theta_i.max(initial=0), samples.theta_o.max(initial=0)))
    told = []
    if steepest < _STEEP:
        told.append(f"all directions are within {steepest:.0f} degrees of the normal: n and thickness trade")
        if len(samples.channels) == 1:
            told.append("one channel near the normal cannot tell one order of interference from the next")
    if len(incidences) == 1:
        told.append("all light comes at one angle: other thicknesses may fit as well; measure at several")
    tilted = {"deviation", "azimuth"} <= free
    if tilted and in_plane(samples):
        told.append("the samples lie in one plane: they cannot see the sign of a deviation out of it")
    elif tilted and np.ptp(samples.phi_i) < _TOLERANCE:
        told.append("the surface was never turned: a deviation holds for this orientation alone")
    if {"base_n", "base_k"} <= free:
        told.append("base_n and base_k are both free and trade (correlation 0.95): fix them from a table")
    return told


def priors(surface: Surface) -> list[str]:
    """Which priors the fit left aside."""
    keys = dict.fromkeys(leaf.key for leaf in surface.leaves() if leaf.free.prior is not None)
    return [f"the prior of {key} counts in a posterior only: a fit of a surface takes none" for key in keys]


def numbers(surface: Surface, parameters: Mapping[str, Estimate], fitted: Mapping[str, Any]) -> list[str]:
    """What the fitted numbers themselves give away."""
    told = []
    depth = parameters.get("thickness")
    if depth is not None and depth.free and depth.value < _THIN:
        told.append(f"thickness {depth.value:.2g} nm is next to none: n and k of so thin a film are not seen")
    for name, p in parameters.items():
        if p.free and name.startswith("exponent") and p.value < 2:
            told.append(f"{name} {p.value:.2f} is below 2: a second diffuse part rather than a lobe")
    if surface.model.startswith("granier-heidrich"):
        told.append("the model's lobes are not normalised: specular is a weight and no albedo")
    energy = energy_warning(surface.brdf, fitted)
    return [*told, energy] if energy else told
