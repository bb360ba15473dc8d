"""Summary of a fit of BRDF samples: parts, misfit, limits, fixed numbers, warnings, evidence for a layer."""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from pellicle.brdf.albedo import albedos, energy_warning
from pellicle.brdf.film_colour import node_count
from pellicle.brdf.models import model
from pellicle.data.brdf_samples import BrdfSamples
from pellicle.fitting.brdf.problem import in_plane
from pellicle.fitting.brdf.systematic_effects import systematic_effects
from pellicle.fitting.brdf.view import SamplesView
from pellicle.fitting.covariance import Scaled
from pellicle.fitting.curves import BrdfCurve, Deferred
from pellicle.fitting.discrepancy import Discrepancy
from pellicle.fitting.linear_system import Evidence
from pellicle.fitting.misfit import Accuracy, misfit
from pellicle.fitting.problem import Problem
from pellicle.fitting.profile_likelihood import Limits
from pellicle.fitting.result import Baseline, Estimate, Part, Rival
from pellicle.fitting.reweighting import RankedMinima
from pellicle.fitting.status import RIVAL, expanded, limits_in_words
from pellicle.fitting.tied_numbers import TiedNumber
from pellicle.materials import materials_in
from pellicle.programs.cache import kept
from pellicle.scene.layers import medium
from pellicle.scene.surface import Surface

_STRUCTURED = 0.1
"""Share of independent samples below which residuals without a given σ are not noise."""
_LARGE = 0.05
"""Share of the range of the compared data above which residuals are large: models of surfaces are rough."""


class BrdfMeasurements(NamedTuple):
    """BRDF samples, the surface that is to explain them, and the ranked minima of their fit."""

    samples: list[BrdfSamples]
    surface: Surface
    ranked: RankedMinima

    def evidence(self, at: RankedMinima, jacobian: Scaled) -> list[Evidence]:
        """Residuals of each view in units of its noise, and what may explain them `at` a minimum."""
        problem, fits, result = at.problem, at.fits, []
        views = problem.views
        blocks = jacobian.blocks([view.independent for view in views], [fit.variance for fit in fits])
        for view, fit, block in zip(views, fits, blocks, strict=True):
            residual = view.residuals(fit.at)
            columns, one = block.reshape(*residual.shape, -1), np.ones(residual.shape)
            weights = math.sqrt(view.data.independent_fraction) * one
            values = problem.seen_by(view, at.values)
            effects = systematic_effects(view, values, fit.at, self.surface)
            about = residual, columns, one, 1.0, weights, effects, view.correlation_length
            result.append(Evidence(*about, unit=view.unit()))
        return result

    def parts(self, discrepancy: Discrepancy) -> tuple[Part, ...]:
        """One part for each set of samples, in their order."""
        views = zip(self.samples, self.ranked.problem.views, self.ranked.fits, strict=True)
        return tuple(
            Part(
                name=view.name,
                data=each,
                curve=_curve(view, fit.at),
                plan=view.plan,
                rms=view.rms(fit.at),
                chi2_reduced=fit.chi2 / fit.freedom,
                effective_points=view.independent / fit.length,
                sigma_from="given" if view.noise.given else "residuals",
            )
            for each, view, fit in views
        )

    def missed(self, parts: tuple[Part, ...], discrepancy: Discrepancy) -> list[Part]:
        """The parts that the surface does not explain: residuals are large, and not noise."""
        missed, fits = [], self.ranked.fits
        rows = zip(parts, self.ranked.problem.views, fits, discrepancy.remaining, strict=True)
        for part, view, fit, left in rows:
            large = _LARGE * view.span()
            if view.noise.given:
                wrong = misfit(discrepancy, left, Accuracy(largest=large))
            else:
                wrong = 1 / fit.length < _STRUCTURED and view.rms(fit.at) > large
            missed += [part] if wrong else []
        return missed

    def fixed(self) -> list[Estimate]:
        """Every fixed number, one for each channel where they differ: the mean over its band with a
        sensor."""
        numbers, bands, result = self.surface.fixed_numbers(), self.surface.bands, []
        for about in self.surface.brdf.parameters:
            if about.key not in numbers:
                continue
            value = numbers[about.key]
            value = value @ bands.weights if value.size > 1 else value
            names = [about.key]
            if value.ndim:
                letters = ("r", "g", "b") if value.size == 3 else range(1, value.size + 1)
                names = [f"{about.key}_{letter}" for letter in letters]
            result += [
                Estimate(name, x, 0.0, about.unit, x, x, False)
                for name, x in zip(names, np.ravel(value).tolist(), strict=True)
            ]
        return result

    def tied(self) -> list[TiedNumber]:
        """None: numbers of a surface are not tied."""
        return []

    def amended(self, _: tuple[Part, ...], limits: Limits) -> Limits:
        """Limits without an azimuth where there is no tilt: an azimuth has no bounds to lie beside."""
        coordinates = self.ranked.problem.coordinates
        if coordinates.tilt is None:
            return limits
        deviation, azimuth = coordinates.tilt
        upright = not np.isnan(limits.upper[deviation]) or not np.isfinite(limits.stderr[deviation])
        one_sided = np.isnan(limits.lower[azimuth]) != np.isnan(limits.upper[azimuth])
        if not upright and (coordinates.folded or not one_sided):
            return limits
        turn = np.arange(len(limits.stderr)) == azimuth
        return Limits(*(np.where(turn, x, own) for x, own in zip(Limits(math.inf), limits, strict=True)))


def _curve(view: SamplesView, at: Any) -> BrdfCurve:
    return BrdfCurve(np.asarray(at.model)[: view.rows], view.compared(at))


def with_curves(rivals: tuple[Rival, ...], problem: Problem) -> tuple[Rival, ...]:
    """The rivals with the curve of each set of samples there, computed when it is first read."""

    def curves(rival: Rival) -> tuple[BrdfCurve, ...]:
        values = np.array(list(rival.parameters.values()))
        return tuple(_curve(view, view.local(problem.seen_by(view, values))) for view in problem.views)

    deferred = [Deferred(len(problem.views), partial(curves, rival)) for rival in rivals]
    return tuple(replace(rival, curves=own) for rival, own in zip(rivals, deferred, strict=True))


def without_layer_error(parameters: dict[str, Estimate]) -> dict[str, Estimate]:
    """Without evidence of a layer its thickness has no finite error, and no lower limit."""
    depth = parameters.get("thickness")
    if depth is None or not depth.free:
        return parameters
    return {**parameters, "thickness": replace(depth, stderr=math.inf, lower_limit=None)}


_STEEP, _TOLERANCE = 15.0, 0.5
"""Degrees from the normal: directions below the first see little of n, and within the second are one."""
_WEIGHTS = ("specular", "diffuse")
_THIN = 5.0
"""nm; n and k of a thinner film are not seen."""


def direction_warnings(samples: BrdfSamples, surface: Surface) -> list[str]:
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


def weight_warnings(parameters: Mapping[str, Estimate]) -> list[str]:
    """A sentence on weights of lobes that are fixed, for a fit that does not explain the samples."""
    fixed = {name: p for name, p in parameters.items() if name.split("_")[0] in _WEIGHTS and not p.free}
    listed = " and ".join(f"{name} at {p.value:g}" for name, p in fixed.items())
    unless = "unless they are known, give them bounds, as in"
    return [f"fixed: {listed}; {unless} {name} = {{ lower = 0, upper = 10 }}" for name in list(fixed)[:1]]


_NEXT = {
    "granier-heidrich": ("granier-heidrich-full", "has the layered diffuse part, too"),
    "granier-heidrich-reciprocal": ("granier-heidrich-full", "has the layered diffuse part, too"),
    "granier-heidrich-diffuse": ("granier-heidrich-full", "has both lobes, too"),
    "granier-heidrich-full": ("microfacet-film", "has facets of one normal and a base that may absorb"),
    "blinn-phong-film-published": ("blinn-phong-film", "has the right phase"),
    "blinn-phong-film": ("microfacet-film", "has GGX facets and a base that may absorb"),
    "microfacet-film": ("clear-coat-film", "has a second lobe, of a clear coat"),
}
"""The model to try after another that does not explain the samples, and what it has."""


def model_warnings(surface: Surface) -> list[str]:
    """A sentence on the model to try next, for a fit that does not explain the samples."""
    if surface.model not in _NEXT:
        return []
    name, why = _NEXT[surface.model]
    return [f'if {surface.model} does not explain the samples, try model = "{name}", which {why}']


class Albedo(NamedTuple):
    """Directional albedo, (angles, channels)."""

    value: Any


@partial(kept, calls="few")
def _albedo(static: tuple[str, int], numbers: dict[str, Any]) -> Albedo:
    name, nodes = static
    return Albedo(albedos(model(name).by_nodes(nodes), numbers))


def number_warnings(
    surface: Surface, parameters: Mapping[str, Estimate], fitted: Mapping[str, Any]
) -> list[str]:
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
    nodes = node_count(float(fitted["thickness"])) if surface.sensor is not None else 0
    energy = energy_warning(_albedo((surface.model, nodes), dict(fitted)).value)
    return [*messages, energy] if energy else messages


GAIN = 0.10
"""The held-out error must fall by more than this share against every baseline."""
FLATTEST = 2.0
"""A lobe of a smaller exponent is a second diffuse part."""
ROUGHEST = 0.7
"""GGX roughness above which a lobe is none: α = √(2/(e + 2)) is as wide as an exponent e."""


class LayerEvidence(NamedTuple):
    """Evidence for a layer, with reasons; `several`: one of several thicknesses, all else being clear."""

    layered: bool
    verdict: str
    several: bool = False


def evidence(
    parameters: Mapping[str, Estimate],
    rivals: tuple[Rival, ...],
    held_out: float,
    baselines: tuple[Baseline, ...],
) -> LayerEvidence:
    """The rule: better than both baselines by `GAIN`, one thickness, and parameters that mean something."""
    doubts, depth = [], parameters.get("thickness")
    if depth and depth.lower == 0 and depth.upper_limit is not None and depth.lower_limit is None:
        doubts.append(f"a thickness of 0 fits as well, for it {limits_in_words(depth)}")
    for b in baselines:
        if not held_out < (1 - GAIN) * b.held_out:
            ratio = held_out / b.held_out if b.held_out > 0 else math.inf
            how = f"{100 * (1 - ratio):.0f} % below" if ratio < 0.995 else f"{ratio:.2f} times that of"
            doubts.append(
                f"its held-out error is {how} {b.name}, where at least {100 * GAIN:.0f} % below is required"
            )
    others = _other_thickness(depth, rivals) if depth and depth.free else []
    doubts += [*others, *_empty(parameters)]
    if doubts == others and doubts and depth and math.isfinite(depth.stderr):
        words = f"The samples do not determine the thickness of the layer: {others[0]}."
        return LayerEvidence(False, words, True)
    if doubts:
        return LayerEvidence(False, f"No evidence of a layer: {'; '.join(doubts)}.")
    gains = " and ".join(f"{100 * (1 - held_out / b.held_out):.0f} % below {b.name}" for b in baselines)
    lead = f"{depth.name} {expanded(depth)}. The" if depth else "the"
    return LayerEvidence(True, f"Evidence of a layer: {lead} held-out error is {gains}.")


def _other_thickness(depth: Estimate, rivals: tuple[Rival, ...]) -> list[str]:
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
