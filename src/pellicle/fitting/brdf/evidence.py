"""Whether the samples call for a layer: four doubts, and the sentences that say so."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from pellicle.brdf.albedo import energy_warning
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.fitting.brdf.result import Baseline
from pellicle.fitting.result import Estimate, Rival
from pellicle.fitting.status import RIVAL, describe, limits_in_words
from pellicle.scene.surface import Surface

GAIN = 0.10
"""The held-out error must fall by more than this share against every baseline."""
FLATTEST = 2.0
"""A lobe of a smaller exponent is a second diffuse part."""
ROUGHEST = 0.7
"""The same for microfacets: α = √(2/(e + 2)) has as wide a lobe as an exponent e."""


class Evidence(NamedTuple):
    """Whether there is a layer, and in words why, or why not; `several` says that nothing but its thickness
    is in doubt, which is one of several."""

    layered: bool
    verdict: str
    several: bool = False


def weigh(
    parameters: Mapping[str, Estimate],
    rivals: tuple[Rival, ...],
    held_out: float,
    baselines: tuple[Baseline, ...],
) -> Evidence:
    """The rule: better than both baselines by `GAIN`, one thickness, and parameters that mean something."""
    others = _other_thickness(parameters, rivals)
    doubts = [*_none_at_all(parameters), *_no_better(held_out, baselines), *others, *_empty(parameters)]
    depth = parameters.get("thickness")
    if doubts == others and doubts and depth is not None and math.isfinite(depth.stderr):
        return Evidence(False, f"The samples do not decide the thickness of the layer: {others[0]}.", True)
    if doubts:
        return Evidence(False, f"No evidence of a layer: {'; '.join(doubts)}.")
    gains = " and ".join(f"{100 * (1 - held_out / b.held_out):.0f} % below {b.name}" for b in baselines)
    lead = f"{describe(depth)}. The" if depth is not None else "the"
    return Evidence(True, f"The samples call for a layer: {lead} held-out error is {gains}.")


def _none_at_all(parameters: Mapping[str, Estimate]) -> list[str]:
    depth = parameters.get("thickness")
    if depth is None or depth.lower != 0 or depth.upper_limit is None or depth.lower_limit is not None:
        return []
    return [f"a thickness of 0 fits as well, for it {limits_in_words(depth)}"]


def _no_better(held_out: float, baselines: tuple[Baseline, ...]) -> list[str]:
    found = []
    for b in baselines:
        if not held_out < (1 - GAIN) * b.held_out:
            ratio = held_out / b.held_out if b.held_out > 0 else math.inf
            how = f"{100 * (1 - ratio):.0f} % below" if ratio < 0.995 else f"{ratio:.2f} times that of"
            found.append(f"its held-out error is {how} {b.name}, and {100 * GAIN:.0f} % below is asked for")
    return found


def _other_thickness(parameters: Mapping[str, Estimate], rivals: tuple[Rival, ...]) -> list[str]:
    depth = parameters.get("thickness")
    if depth is None or not depth.free:
        return []
    if not math.isfinite(depth.stderr):
        return ["the thickness has no finite error"]
    for rival in rivals:
        other = rival.parameters.get("thickness", depth.value)
        if rival.delta_chi2 < RIVAL and abs(other - depth.value) > 3 * depth.stderr:
            return [f"{other:.4g} nm fits as well as {depth.value:.4g} nm (Δχ² {rival.delta_chi2:.1f})"]
    return []


def _empty(parameters: Mapping[str, Estimate]) -> list[str]:
    """Free numbers that mean nothing where they are."""
    found = []
    for name, p in parameters.items():
        key = name.split("_")[0]
        if not p.free:
            continue
        if key == "exponent" and p.value <= FLATTEST:
            found.append(f"{name} {p.value:.2f} is no lobe (above {FLATTEST:g} is asked for)")
        elif name == "roughness" and p.value >= ROUGHEST:
            found.append(f"roughness {p.value:.2f} is no lobe (below {ROUGHEST:g} is asked for)")
        elif name == "specular" and p.value == p.lower:
            found.append("the layered lobes have no weight")
        elif p.at_bound and (
            key in ("exponent", "n", "roughness") or (name == "deviation" and p.value > p.lower)
        ):
            found.append(f"{name} rests on its bound {p.value:g}")
    return found


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
    free = {leaf.key for leaf in surface.free_numbers()}
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
    keys = dict.fromkeys(leaf.key for leaf in surface.free_numbers() if leaf.free.prior is not None)
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
