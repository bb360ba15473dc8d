"""Evidence for a layer: held-out errors against baselines without one, and a meaningful layer."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from pellicle.fitting.result import Baseline, Estimate, Rival
from pellicle.fitting.status import RIVAL, describe, limits_in_words

GAIN = 0.10
"""The held-out error must fall by more than this share against every baseline."""
FLATTEST = 2.0
"""A lobe of a smaller exponent is a second diffuse part."""
ROUGHEST = 0.7
"""GGX roughness above which a lobe is none: α = √(2/(e + 2)) is as wide as an exponent e."""


class Evidence(NamedTuple):
    """Evidence for a layer, with reasons; `several`: one of several thicknesses, all else being clear."""

    layered: bool
    verdict: str
    several: bool = False


def evidence(
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
        return Evidence(False, f"The samples do not determine the thickness of the layer: {others[0]}.", True)
    if doubts:
        return Evidence(False, f"No evidence of a layer: {'; '.join(doubts)}.")
    gains = " and ".join(f"{100 * (1 - held_out / b.held_out):.0f} % below {b.name}" for b in baselines)
    lead = f"{describe(depth)}. The" if depth is not None else "the"
    return Evidence(True, f"Evidence of a layer: {lead} held-out error is {gains}.")


def _none_at_all(parameters: Mapping[str, Estimate]) -> list[str]:
    depth = parameters.get("thickness")
    if depth is None or depth.lower != 0 or depth.upper_limit is None or depth.lower_limit is not None:
        return []
    return [f"a thickness of 0 fits as well, for it {limits_in_words(depth)}"]


def _no_better(held_out: float, baselines: tuple[Baseline, ...]) -> list[str]:
    reasons = []
    for b in baselines:
        if not held_out < (1 - GAIN) * b.held_out:
            ratio = held_out / b.held_out if b.held_out > 0 else math.inf
            how = f"{100 * (1 - ratio):.0f} % below" if ratio < 0.995 else f"{ratio:.2f} times that of"
            reasons.append(
                f"its held-out error is {how} {b.name}, where at least {100 * GAIN:.0f} % below is required"
            )
    return reasons


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
    reasons = []
    for name, p in parameters.items():
        key = name.split("_")[0]
        if not p.free:
            continue
        if key == "exponent" and p.value <= FLATTEST:
            reasons.append(f"{name} {p.value:.2f} is no lobe (it must be above {FLATTEST:g})")
        elif name == "roughness" and p.value >= ROUGHEST:
            reasons.append(f"roughness {p.value:.2f} is no lobe (it must be below {ROUGHEST:g})")
        elif name == "specular" and p.value == p.lower:
            reasons.append("the layered lobes have no weight")
        elif p.at_bound and (
            key in ("exponent", "n", "roughness") or (name == "deviation" and p.value > p.lower)
        ):
            reasons.append(f"{name} rests on its bound {p.value:g}")
    return reasons
