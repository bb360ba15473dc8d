"""Fit a layered surface to samples of a BRDF, and the same samples without one: then judge."""

from __future__ import annotations

import dataclasses
import math
import time
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.data.brdf_samples import BrdfSamples, spread
from pellicle.effects.plan import Plan
from pellicle.effects.surface import exact
from pellicle.errors import UsageError
from pellicle.fitting import identifiability
from pellicle.fitting.brdf import evidence
from pellicle.fitting.brdf.baselines import plain
from pellicle.fitting.brdf.coordinates import coordinates
from pellicle.fitting.brdf.estimates import Local, by_curvature, by_profile, estimates, local, rivals, scaled
from pellicle.fitting.brdf.neighbourhood import NATURAL
from pellicle.fitting.brdf.problem import Form, Problem, chi_squares, data, seeing
from pellicle.fitting.brdf.residuals import RESIDUALS
from pellicle.fitting.brdf.result import Baseline, BrdfFit
from pellicle.fitting.brdf.search import FEW, SMOOTH, THOROUGH, Effort, Minima, polish, search, settle
from pellicle.fitting.result import Estimate, Rival, Status
from pellicle.fitting.spectra.search import Progress, quiet
from pellicle.fitting.status import judge, misfits, verdict
from pellicle.scene.surface import Surface, nonzero_numbers, surface_view
from pellicle.simulation.surface import composed

HELD_OUT = 0.2
"""The share of the samples that no fit sees until it is judged."""
FEWEST = 20
_FLAT, _PLAIN = "the surface without interference", "two lobes without a layer"


def fit_brdf(
    samples: BrdfSamples, surface: Surface, *, residual: str | None = None, progress: Progress = quiet
) -> BrdfFit:
    """Fit the free numbers of `surface`, in float64 whatever the caller's setting.

    `residual` names what is compared (`residuals.RESIDUALS`): by default `linear` over σ where the
    samples have one, else `cube-root`. The same samples are fitted without interference and with two
    lobes and no layer, all of them on four fifths of the samples and judged on the rest.

    **Raises:** UsageError where nothing is free, a residual or the wavelengths do not match, or the
    samples are too few.
    """
    return fitted(samples, surface, residual, progress)[0]


class Found(NamedTuple):
    """What a fit rests on: its problem, the minima, and what is around the best one."""

    problem: Problem
    minima: Minima
    at: Local


def fitted(
    samples: BrdfSamples, surface: Surface, residual: str | None, progress: Progress
) -> tuple[BrdfFit, Found]:
    """What `fit_brdf` returns, and what it rests on, for whoever goes on from there."""
    name = residual or ("linear" if samples.sigma is not None else "cube-root")
    if name not in RESIDUALS:
        raise UsageError(f"residual must be one of {', '.join(RESIDUALS)}, not {name!r}")
    _check(samples, surface)
    with jax.enable_x64(True):
        return _fit(samples, surface, name, progress)


def _check(samples: BrdfSamples, surface: Surface) -> None:
    where = f"{samples.path}: " if samples.path else ""
    if not surface.free_numbers():
        raise UsageError("nothing is free to fit: give bounds, as in thickness = { lower = 0, upper = 1000 }")
    if surface.channels != len(samples.channels):
        raise UsageError(
            f"{where}{len(samples.channels)} channels ({', '.join(samples.channels)}) for"
            f" {surface.channels} wavelengths: give wavelengths one for each"
        )
    if len(samples) < FEWEST:
        raise UsageError(
            f"{where}{len(samples)} samples are too few to fit and to judge: give {FEWEST} or more"
        )


def problem(samples: BrdfSamples, surface: Surface, residual: str, evaluate: Any) -> Problem:
    """The problem of fitting `surface`, by `evaluate`, to the samples."""
    leaves = surface.free_numbers()
    steep = tuple(leaf for leaf in leaves if not leaf.parameter.linear)
    linear = [leaf for leaf in leaves if leaf.parameter.linear]
    chosen, box = coordinates(steep, evidence.in_plane(samples))
    form = Form(evaluate, chosen, tuple(leaf.key for leaf in linear), False, residual)
    most = np.array([leaf.free.upper for leaf in linear])
    fixed = {key: x for key, x in nonzero_numbers(surface).items() if key in surface.fixed_numbers()}
    return Problem(form, data(samples, residual), fixed, box, most, len(samples))


class Split(NamedTuple):
    """The rows that are fitted and those that judge, and how many numbers the latter are."""

    fitted: np.ndarray
    judging: np.ndarray
    size: int


def _split(samples: BrdfSamples) -> Split:
    """Four fifths to fit, spread over the file, and the rest to judge."""
    out = spread(len(samples), max(1, round(HELD_OUT * len(samples))))
    return Split(np.setdiff1d(np.arange(len(samples)), out), out, out.size * len(samples.channels))


def _rate(whole: Problem, split: Split, effort: Effort, progress: Progress) -> tuple[Minima, float]:
    """Minima on the fitted rows, and the best one's error on the others."""
    minima = search(seeing(whole, split.fitted), effort, progress)
    [chi2] = chi_squares(*seeing(whole, split.judging).program, minima.units[:1])
    return minima, float(np.sqrt(chi2 / split.size))


def _fit(samples: BrdfSamples, surface: Surface, residual: str, progress: Progress) -> tuple[BrdfFit, Found]:
    began = time.perf_counter()
    split, brdf = _split(samples), surface.brdf
    plan = exact(surface_view(surface, samples, len(samples)))
    whole = problem(samples, surface, residual, composed(plan.static_key, surface.model))
    flat = whole._replace(form=whole.form._replace(evaluate=brdf.incoherent))
    minima, held_out = _rate(whole, split, THOROUGH, progress)
    baselines = (
        Baseline(_FLAT, _rate(flat, split, SMOOTH, progress)[1]),
        Baseline(_PLAIN, _rate(plain(whole), split, FEW, progress)[1]),
    )
    minima = settle(whole, polish(whole, minima.units, THOROUGH, progress), progress)
    found = Found(whole, minima, local(whole, minima.units[0], samples.sigma is not None))
    return _report(samples, surface, plan, found, held_out, baselines, began), found


def judged(
    surface: Surface, whole: Problem, minima: Minima, at: Local, others: tuple[Rival, ...], sigma_known: bool
) -> tuple[Status, dict[str, Estimate]]:
    """What the fit of the layer says of itself, not yet weighed against the baselines, and its numbers."""
    converged, misfit = bool(minima.converged[0]), _misses(at, sigma_known)
    usable = converged and not misfit
    known = by_profile(surface, whole, at, others) if usable else by_curvature(surface, at)
    parameters = estimates(surface, whole, at, known)
    status = judge(
        converged=converged,
        misfit=misfit,
        parameters=parameters,
        rivals=others,
        natural=frozenset(name for name in NATURAL & parameters.keys() if parameters[name].value == 0),
    )
    return status, parameters


def _misses(at: Local, sigma_known: bool) -> bool:
    return misfits(
        chi2_reduced=at.chi2_reduced,
        sigma_known=sigma_known,
        drifting=False,
        effective_share=1 / at.length,
        rms=float(np.sqrt(np.mean(at.residuals**2))),
        span=at.span,
        calibrated=False,
    )


def _unlayered(parameters: dict[str, Estimate]) -> dict[str, Estimate]:
    """Without evidence of a layer its thickness has no finite error, and none that it must have."""
    depth = parameters.get("thickness")
    if depth is None or not depth.free:
        return parameters
    unseen = dataclasses.replace(depth, stderr=math.inf, lower_limit=None)
    return {**parameters, "thickness": unseen}


def _report(
    samples: BrdfSamples,
    surface: Surface,
    plan: Plan,
    found: Found,
    held_out: float,
    baselines: tuple[Baseline, ...],
    began: float,
) -> BrdfFit:
    whole, minima, at = found
    others = rivals(whole, minima, at)
    status, parameters = judged(surface, whole, minima, at, others, samples.sigma is not None)
    layer = evidence.weigh(parameters, others, held_out, baselines)
    rms = float(np.sqrt(np.mean(at.residuals**2)))
    trading = identifiability.trades(scaled(surface, at), parameters)
    if not layer.layered and not layer.several:
        parameters = _unlayered(parameters)
        status = status if status in (Status.NOT_CONVERGED, Status.MISFIT) else Status.NOT_IDENTIFIABLE
    of_lead = identifiability.of(next(iter(parameters)), trading)
    sentence = verdict(status, parameters, others, rms, trading=of_lead)
    if not layer.layered:
        sentence = layer.verdict
    elif status is Status.CONVERGED:
        sentence = " ".join([layer.verdict, *(f"But {trade}." for trade in of_lead[:1])])
    fitted = surface.fixed_numbers() | {key: np.asarray(value) for key, value in at.parameters.items()}
    return BrdfFit(
        samples=samples,
        surface=surface,
        residual=whole.form.residual,
        status=status,
        verdict=sentence,
        layered=layer.layered,
        parameters=parameters,
        rivals=others,
        baselines=baselines,
        held_out=held_out,
        chi2_reduced=at.chi2_reduced if samples.sigma is not None else 1.0,
        rms=rms,
        effective_points=at.residuals.size / at.length,
        correlation_names=at.names,
        correlation=at.correlation,
        plan=plan,
        warnings=(
            *evidence.directions(samples, surface),
            *evidence.priors(surface),
            *evidence.numbers(surface, parameters, fitted),
            *identifiability.bounded(parameters, ()),
            *trading,
        ),
        model=at.model,
        seconds=time.perf_counter() - began,
    )
