"""Fit a layered surface to BRDF samples, and the same samples without a layer: then judge."""

import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import jax
import numpy as np

from pellicle.data.brdf_samples import BrdfSamples, spread
from pellicle.effects.surface_plan import plan
from pellicle.errors import DataError, UsageError
from pellicle.fitting import identifiability
from pellicle.fitting.assembly import Assembly, assemble
from pellicle.fitting.brdf import summary
from pellicle.fitting.brdf.problem import incoherent, make, restricted, together, without_layer
from pellicle.fitting.brdf.search import FEW, SMOOTH, THOROUGH, Effort, search
from pellicle.fitting.brdf.summary import LayerEvidence
from pellicle.fitting.brdf.view import RESIDUALS
from pellicle.fitting.budget import budget
from pellicle.fitting.conclusion import common_rms, ranked_minima
from pellicle.fitting.minima import Minima, deviance_at, minima
from pellicle.fitting.problem import Problem
from pellicle.fitting.progress import Progress
from pellicle.fitting.result import Baseline, Estimate, Fit, LayerTest, Status
from pellicle.fitting.reweighting import RankedMinima
from pellicle.fitting.robust_losses import LEAST_SQUARES, check_loss
from pellicle.fitting.robust_losses import spread as bulk_spread
from pellicle.fitting.status import verdict
from pellicle.scene.surface import Surface, surface_view

HELD_OUT = 0.2
"""Share of the samples that no fit uses before the fits are compared."""
FEWEST = 20
_KEPT_EFFECTS = ("precision",)
"""A fit stops by differences below single precision, whatever its tolerance."""
_FLAT, _PLAIN = "the surface without interference", "two lobes without a layer"


def fitted(
    data: BrdfSamples | Sequence[BrdfSamples],
    surface: Surface,
    tolerance: float,
    progress: Progress,
    loss: str = LEAST_SQUARES,
    residual: str | None = None,
) -> tuple[Fit, RankedMinima]:
    """Fit the free numbers of `surface`, in float64 whatever the caller's setting.

    A list of samples of one surface is fitted jointly. `residual` names what is compared
    (`residuals.RESIDUALS`): by default `linear` over σ where all samples have one, else `cube-root`. The same
    samples are fitted without interference and with two lobes and no layer, all of them on four fifths of the
    samples and judged on the rest. `tolerance`, here relative, and `loss` are those of fits of spectra.

    **Returns:** the fit, and the ranked minima that it rests on.

    **Raises:** UsageError where nothing is free, a residual, a loss or the wavelengths do not match, or the
    samples are too few; DataError where all values are zero.
    """
    check_loss(loss)
    samples = [data] if isinstance(data, BrdfSamples) else list(data)
    if not samples:
        raise UsageError("there are no samples to fit: give some, or a list of them")
    name = residual or ("linear" if all(each.sigma is not None for each in samples) else "cube-root")
    if name not in RESIDUALS:
        raise UsageError(f"residual must be one of {', '.join(RESIDUALS)}, not {name!r}")
    if not surface.free_numbers():
        raise UsageError("nothing is free to fit: give bounds, as in thickness = { lower = 0, upper = 1000 }")
    for each in samples:
        check_channels(each, surface)
        if not np.any(each.values):
            raise DataError(f"{_place(each)}every value is zero: check how it was written")
    count = sum(len(each) for each in samples)
    if count < FEWEST:
        raise UsageError(
            f"{_place(samples[0])}{count} samples are too few to fit and to judge: give {FEWEST} or more"
        )
    stems = [Path(each.path).stem.replace(".", "_") for each in samples]
    names = stems if len(set(stems)) == len(stems) else [str(i + 1) for i in range(len(stems))]
    with jax.enable_x64(True):
        names = [""] if isinstance(data, BrdfSamples) else names
        return _fit(samples, names, surface, name, tolerance, loss, progress)


def check_channels(samples: BrdfSamples, surface: Surface) -> None:
    """Raise UsageError where samples have other channels than the surface."""
    if surface.channels != len(samples.channels):
        raise UsageError(
            f"{_place(samples)}{len(samples.channels)} channels ({', '.join(samples.channels)}) for"
            f" {surface.channels} of the surface: give wavelengths one for each, or a sensor"
        )


def _place(samples: BrdfSamples) -> str:
    return f"{samples.path}: " if samples.path else ""


def _held_out(whole: Problem, effort: Effort, loss: str, progress: Progress) -> tuple[Minima, float]:
    """Minima on four fifths of the samples, spread over each file, and the best one's error on the rest: of
    their bulk for a robust loss."""
    out = [spread(view.rows, max(1, round(HELD_OUT * view.rows))) for view in whole.views]
    rest = [np.setdiff1d(np.arange(view.rows), rows) for view, rows in zip(whole.views, out, strict=True)]
    result, judging = search(restricted(whole, rest), effort, progress), restricted(whole, out)
    judging = judging._replace(box=judging.box._replace(prior_weight=np.zeros(len(judging.parameters))))
    pairs = list(zip(judging.views, out, strict=True))
    if loss != LEAST_SQUARES:
        values = np.asarray(judging.values(result.units[0]))
        rows = [v.residuals(v.local(judging.seen_by(v, values)))[own].ravel() for v, own in pairs]
        return result, bulk_spread(np.concatenate(rows))
    [chi2] = deviance_at(judging, result.units[:1])
    return result, float(np.sqrt(chi2 / sum(rows.size * view.channels for view, rows in pairs)))


def _fit(
    samples: list[BrdfSamples],
    names: list[str],
    surface: Surface,
    residual: str,
    tolerance: float,
    loss: str,
    progress: Progress,
) -> tuple[Fit, RankedMinima]:
    began, errors = time.perf_counter(), {}
    kept = {"most": THOROUGH.starts, "followed": 1}

    def build(allowed: float) -> Problem:
        plans = [plan(surface_view(surface, each, len(each)), allowed, _KEPT_EFFECTS) for each in samples]
        return make(samples, names, surface, plans, residual)

    def searched(problem: Problem) -> Minima:
        result, errors["layer"] = _held_out(problem, THOROUGH, loss, progress)
        _, errors[_FLAT] = _held_out(incoherent(problem), SMOOTH, loss, progress)
        _, errors[_PLAIN] = _held_out(without_layer(problem), FEW, loss, progress)
        return minima(problem, result.units, progress, **kept)

    ranked, notes = ranked_minima(build, searched, tolerance, loss, **kept)
    judged = assemble(partial(summary.BrdfMeasurements, samples, surface), ranked, began, near=True)
    ranked = judged.best.ranked
    baselines = tuple(Baseline(name, errors[name]) for name in (_FLAT, _PLAIN))
    status, parameters = judged.conclusion.status, judged.conclusion.parameters
    layer = summary.evidence(parameters, judged.conclusion.rivals, errors["layer"], baselines)
    if not layer.layered and not layer.several:
        parameters = summary.without_layer_error(parameters)
        status = status if status in (Status.NOT_CONVERGED, Status.MISFIT) else Status.NOT_IDENTIFIABLE
    rms = common_rms([view.independent for view in ranked.problem.views], [part.rms for part in judged.parts])
    result = judged.fit(
        status=status,
        verdict=_verdict(judged, layer, status, parameters, rms),
        parameters=parameters,
        rivals=summary.with_curves(judged.conclusion.rivals, ranked.problem),
        rms=rms,
        budget=budget(judged.best.discrepancy, ranked.problem.parameters),
        warnings=(*notes, *_warnings(samples, surface, judged, status, parameters)),
        scene=surface,
        layer_test=LayerTest(layer.layered, errors["layer"], baselines, residual),
    )
    return result, ranked


def _verdict(
    judged: Assembly, layer: LayerEvidence, status: Status, parameters: dict[str, Estimate], rms: float
) -> str:
    """The verdict on the surface, with the evidence of a layer in front."""
    of_lead = identifiability.naming(next(iter(parameters)), judged.conclusion.correlated)
    if not layer.layered:
        return layer.verdict
    if status is Status.CONVERGED:
        return " ".join([layer.verdict, *(f"But {correlation}." for correlation in of_lead[:1])])
    return verdict(status, parameters, judged.conclusion.rivals, rms, trading=of_lead)


def _warnings(
    samples: list[BrdfSamples],
    surface: Surface,
    judged: Assembly,
    status: Status,
    parameters: dict[str, Estimate],
) -> list[str]:
    """Warnings on weights, directions, numbers and what the data do not determine."""
    form, values = judged.best.ranked.problem.views[0].form, judged.best.ranked.values
    numbers = {k: np.asarray(x) for k, x in form.numbers(values, surface.fixed_numbers()).items()}
    of_misfit = [*summary.weight_warnings(parameters), *summary.model_warnings(surface)]
    return [
        *(of_misfit if status is Status.MISFIT else ()),
        *summary.direction_warnings(together(samples), surface),
        *summary.number_warnings(surface, parameters, numbers),
        *identifiability.bounded(parameters, ()),
        *judged.conclusion.correlated,
    ]
