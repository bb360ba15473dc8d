"""Summary of a fit of BRDF samples: parts, misfit, limits, fixed numbers."""

from __future__ import annotations

import dataclasses
import math
from functools import partial
from typing import Any

import numpy as np

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.fitting.brdf.view import SamplesView
from pellicle.fitting.covariance import Scaled
from pellicle.fitting.curves import BrdfCurve, Deferred
from pellicle.fitting.discrepancy import Evidence
from pellicle.fitting.problem import Problem
from pellicle.fitting.profile_likelihood import Limits
from pellicle.fitting.result import Estimate, Part, Rival
from pellicle.fitting.reweighting import RankedMinima, ViewFit
from pellicle.scene.surface import Surface

_FAR = 4.0
"""Reduced χ² on a given σ above which residuals are not noise."""
_STRUCTURED = 0.1
"""Share of independent samples below which residuals without a given σ are not noise."""
_LARGE = 0.05
"""Share of the range of the compared data above which residuals are large: models of surfaces are rough."""


def parts(samples: list[BrdfSamples], ranked: RankedMinima) -> tuple[Part, ...]:
    """One part for each set of samples, in their order."""
    views = zip(samples, ranked.problem.views, ranked.fits, strict=True)
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


def _curve(view: SamplesView, at: Any) -> BrdfCurve:
    return BrdfCurve(np.asarray(at.model)[: view.rows], view.compared(at))


def with_curves(rivals: tuple[Rival, ...], problem: Problem) -> tuple[Rival, ...]:
    """The rivals with the curve of each set of samples there, computed when it is first read."""

    def curves(rival: Rival) -> tuple[BrdfCurve, ...]:
        values = np.array(list(rival.parameters.values()))
        return tuple(_curve(view, view.local(problem.seen_by(view, values))) for view in problem.views)

    count = len(problem.views)
    return tuple(
        dataclasses.replace(rival, curves=Deferred(count, partial(curves, rival))) for rival in rivals
    )


def misses(view: SamplesView, fit: ViewFit) -> bool:
    """True where the surface does not explain the samples of a view: residuals are large, and not noise."""
    structured = fit.chi2 / fit.freedom > _FAR if view.noise.given else 1 / fit.length < _STRUCTURED
    return bool(structured and view.rms(fit.at) > _LARGE * view.span())


def evidence(ranked: RankedMinima, jacobian: Scaled) -> list[Evidence]:
    """Residuals of each view in units of its noise, without effects: models of surfaces know none."""
    views, fits, result = ranked.problem.views, ranked.fits, []
    blocks = jacobian.blocks([view.independent for view in views], [fit.variance for fit in fits])
    for view, fit, block in zip(views, fits, blocks, strict=True):
        residual = view.residuals(fit.at)
        columns = block.reshape(*residual.shape, -1)
        one = np.ones(residual.shape)
        weights = math.sqrt(view.samples.independent_fraction) * one
        result.append(Evidence(residual, columns, one, 1.0, weights, (), view.correlation_length))
    return result


def amended(problem: Problem, limits: list[Limits]) -> list[Limits]:
    """Limits without an azimuth where there is no tilt: an azimuth has no bounds to lie beside."""
    if problem.coordinates.tilt is None:
        return limits
    deviation, azimuth = problem.coordinates.tilt
    tilt, turn = limits[deviation], limits[azimuth]
    upright = tilt.upper is not None or not math.isfinite(tilt.stderr)
    one_sided = (turn.lower is None) != (turn.upper is None)
    unknown = upright or (one_sided and not problem.coordinates.folded)
    return [Limits(math.inf) if unknown and at == azimuth else each for at, each in enumerate(limits)]


def fixed(surface: Surface) -> list[Estimate]:
    """Every fixed number, one for each channel where they differ: the mean over its band with a sensor."""
    numbers, result = surface.fixed_numbers(), []
    for about in surface.brdf.parameters:
        if about.key not in numbers:
            continue
        value = numbers[about.key]
        value = value @ surface.bands.weights if value.size > 1 else value
        names = [about.key]
        if value.ndim:
            letters = ("r", "g", "b") if value.size == 3 else range(1, value.size + 1)
            names = [f"{about.key}_{letter}" for letter in letters]
        result += [
            Estimate(name, x, 0.0, about.unit, x, x, False)
            for name, x in zip(names, np.ravel(value).tolist(), strict=True)
        ]
    return result


def without_layer_error(parameters: dict[str, Estimate]) -> dict[str, Estimate]:
    """Without evidence of a layer its thickness has no finite error, and no lower limit."""
    depth = parameters.get("thickness")
    if depth is None or not depth.free:
        return parameters
    return {**parameters, "thickness": dataclasses.replace(depth, stderr=math.inf, lower_limit=None)}
