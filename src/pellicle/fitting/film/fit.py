"""Fit scenes to spectra and colours of one sample or several: scan, polish, rank minima, estimate errors."""

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeAlias

import jax

from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum
from pellicle.errors import DataError, UsageError
from pellicle.fitting import identifiability
from pellicle.fitting.assembly import Assembly, assemble
from pellicle.fitting.budget import budget, likely_cause
from pellicle.fitting.conclusion import ranked_minima
from pellicle.fitting.curves import Curve
from pellicle.fitting.discrepancy import Discrepancy
from pellicle.fitting.film import (
    backface,
    default_bounds,
    messages,
    parts,
    summary,
)
from pellicle.fitting.film.colour_measurements import measured_colours
from pellicle.fitting.film.colour_view import ColoursView
from pellicle.fitting.film.explanations import explanations
from pellicle.fitting.film.index_curves import IndexCurves, index_curves
from pellicle.fitting.film.problem import Target, make, measured, without_scale
from pellicle.fitting.film.samples import joined
from pellicle.fitting.film.search import search
from pellicle.fitting.film.summary import FilmMeasurements
from pellicle.fitting.film.sweeps import with_sweeps
from pellicle.fitting.minima import Minima
from pellicle.fitting.problem import Problem
from pellicle.fitting.progress import Progress, quiet
from pellicle.fitting.result import Estimate, Fit, Rival, Status
from pellicle.fitting.reweighting import RankedMinima
from pellicle.fitting.robust_losses import LEAST_SQUARES, ROBUST, check_loss
from pellicle.fitting.status import REFUSED, expanded, verdict
from pellicle.scene.film import Scene
from pellicle.scene.free import free_leaves, remembered

Film: TypeAlias = Spectrum | Colours | Sequence[Spectrum | Colours]
"""Measurements of one film."""


def fit(
    data: Film,
    scene: Scene | Sequence[Scene],
    *,
    shared: Sequence[str] | None = None,
    tolerance: float = 0.0,
    loss: str = LEAST_SQUARES,
    progress: Progress = quiet,
    explained: bool = True,
) -> Fit:
    """Fit the free parameters of `scene` to a spectrum or colours, in float64 whatever the caller's setting.

    The signal, and the polarisation and angle where the file has them, come from the data. A list
    of spectra and colours of one sample is fitted jointly: layers and substrate are shared, what is free of
    the light and the instrument is each one's own (`instrument.scale.R`). `scene` may then be a list
    too, of one scene for each, that differ in light, instrument and back face only; of a single scene,
    Ψ and Δ leave out scale and offset. With names of `shared` numbers each scene is that of a sample.

    With a `tolerance`, in the unit of each signal, effects that change less are left out (`pellicle.plan`);
    where the best fit turns out to lie beyond it, all of them are put back and the fit is done again.

    With the `loss` "huber" or "student-t" a few outliers hardly count; it is "least-squares" otherwise.

    Where the scene does not fit, usual mistakes are tried by refits, which compile programs of their own; not
    if it need not be `explained`. `progress` is called with a stage's name, how much is done and how much
    there is. Returns a `Fit`: best parameters with errors, rivals, a status and what was simulated.

    **Raises:** UsageError where nothing is free, where scenes are not of one sample, an uncalibrated
    signal is given a fixed scale or the loss is unknown; ValueError where a material has no data at a
    wavelength, naming it.
    """
    return fitted(data, scene, tolerance, progress, loss, shared, explained)[0]


def fitted(
    data: Film,
    scene: Scene | Sequence[Scene],
    tolerance: float,
    progress: Progress,
    loss: str = LEAST_SQUARES,
    shared: Sequence[str] | None = None,
    explained: bool = True,
) -> tuple[Fit, RankedMinima]:
    """The result of `fit`, and the ranked minima that it rests on."""
    check_loss(loss)
    with jax.enable_x64(True):
        targets = measurements(data, scene, shared)
        spectra = listed(data)
        fit, ranked, discrepancy = _fit(spectra, targets, tolerance, loss, progress)
        if loss == LEAST_SQUARES and (spikes := summary.spikes(ranked)):
            robust = _fit(spectra, targets, tolerance, ROBUST, progress)[0]
            lead = next(p for p in robust.parameters.values() if p.free)
            gives = f"{expanded(lead)} ({robust.status})"
            remark = f'{spikes}: `loss="{ROBUST}"` lets them count less, and gives {lead.name} {gives}'
            fit = replace(fit, warnings=(remark, *fit.warnings))
        if fit.status not in REFUSED:
            return fit, ranked
        if not explained or targets[0].scene.sample is not None:  # mistakes are those of one sample
            causes = likely_cause(discrepancy, ranked.problem.parameters)
            return replace(fit, warnings=(*causes, *fit.warnings)), ranked

        def measure(other: list[Spectrum | Colours]) -> list[Target]:
            return measurements(other[0] if isinstance(data, Spectrum | Colours) else other, scene)

        def refit(other: list[Spectrum | Colours], changed: list[Target]) -> Fit:
            return _fit(other, changed, tolerance, loss, quiet, False)[0]

        rows = discrepancy.contributions
        targets = default_bounds.measured_within(targets, ranked, ranked.problem.parameters)
        said, refuted = explanations(spectra, targets, fit, ranked, rows, measure, refit, progress)
        causes = said or likely_cause(discrepancy, ranked.problem.parameters, refuted)
        return replace(fit, warnings=(*causes, *fit.warnings)), ranked


def listed(data: Film) -> list[Spectrum | Colours]:
    """The measurements as a list."""
    return [data] if isinstance(data, Spectrum | Colours) else list(data)


def measurements(
    data: Film, scene: Scene | Sequence[Scene], shared: Sequence[str] | None = None
) -> list[Target]:
    """The numbers and the scene of each spectrum and of colours. Raises UsageError as `fit` does."""
    spectra = listed(data)
    if not spectra:
        raise UsageError("there is no spectrum to fit: give one, or a list of some")
    for own in spectra:
        if isinstance(own, Spectrum) and not own.ellipsometric and len(own) < 2:
            raise DataError(f"{own.path}: holds one point of {own.signal}; a fit needs a spectrum")
    scenes = [scene] * len(spectra) if isinstance(scene, Scene) else list(scene)
    if not all(isinstance(each, Scene) for each in scenes):
        raise UsageError(f"`scene` must be a Scene, a Surface or a list of scenes, not {scene!r}")
    if len(scenes) != len(spectra):
        raise UsageError(f"{len(spectra)} spectra need as many scenes, or one for all, not {len(scenes)}")
    if isinstance(scene, Scene) and len(spectra) > 1:
        scenes = [without_scale(scene, s) for s in spectra]
    names = [""] if isinstance(data, Spectrum | Colours) else labels(spectra)
    scenes = joined(scenes, names, shared)
    targets = [
        measured_colours(own, seen, name) if isinstance(own, Colours) else measured(own, seen, name)
        for own, seen, name in zip(spectra, scenes, names, strict=True)
    ]
    for target in targets:
        check_free(target.scene)
    return targets


@remembered
def check_free(scene: Scene) -> None:
    """Raise UsageError where a scene has nothing to fit."""
    if not free_leaves(scene):
        raise UsageError(
            "nothing is free to fit: give bounds to the thickness, as in `thickness=Free(10, 3000)`, or in a "
            "recipe thickness = { lower = 10, upper = 3000 }"
        )


def labels(spectra: Sequence[Spectrum | Colours]) -> list[str]:
    """Unique names of spectra, without dots: files' stems, else with the names of spectra within a file (or
    with their signals), else numbered.

    Where a name would read as a parameter's it is numbered.
    """
    kinds = [s.space if isinstance(s, Colours) else s.signal for s in spectra]
    stems = [Path(s.path).stem.replace(".", "_") or kind for s, kind in zip(spectra, kinds, strict=True)]
    pairs = list(zip(stems, spectra, strict=True))
    own = [f"{stem}-{s.name}".replace(".", "_") if s.name else stem for stem, s in pairs]
    signals = [f"{stem}-{kind}" for stem, kind in zip(stems, kinds, strict=True)]
    numbers = [f"{stem}-{i}" for i, stem in enumerate(stems, start=1)]
    for names in (stems, own, signals):
        if len(set(names)) == len(names) and "thickness" not in names:
            return names
    return numbers


def _fit(
    data: list[Spectrum | Colours],
    targets: list[Target],
    tolerance: float,
    loss: str,
    progress: Progress,
    other_curves: bool = True,
) -> tuple[Fit, RankedMinima, Discrepancy]:
    began = time.perf_counter()
    targets, ranked, wider = _searched(targets, tolerance, loss, progress)
    progress("errors", 0, 1)
    measured_by = partial(FilmMeasurements, data, targets)
    judged = assemble(measured_by, ranked, began, scans=summary.scans, binding=wider.binding)
    curves = index_curves(judged, targets) if other_curves else None
    judged = judged if curves is None else curves.applied(judged)
    films, ranked = judged.best.data, judged.best.ranked
    parameters, drifts = with_sweeps(data, ranked, judged.best.jacobian, judged.conclusion.parameters)
    rivals, colours = judged.conclusion.rivals, any(isinstance(x, ColoursView) for x in ranked.problem.views)
    dark = summary.opaque(targets, ranked)
    unclear = [
        *drifts,
        *summary.unexplained_depolarisation(data, targets, ranked.problem.views),
        # the few residuals of colours have a cause in any case, where they are noise
        *(
            likely_cause(judged.best.discrepancy, ranked.problem.parameters)
            if judged.conclusion.status not in REFUSED and (judged.missed or not colours)
            else []
        ),
        *default_bounds.remarks(ranked, wider.binding),
        *([] if curves is None else curves.remark),
        *identifiability.bounded(parameters, dark),
        *judged.conclusion.correlated,
    ]
    fit = judged.fit(
        verdict=_verdict(films, judged, parameters, rivals, dark, curves),
        parameters=parameters,
        rivals=parts.with_curves(rivals, judged.parts, ranked),
        probability=judged.conclusion.probability or (1.0 if colours else None),
        rms=parts.together(judged.parts),
        warnings=(*wider.warnings, *summary.warnings(films, unclear)),
        profile=next(iter(judged.scans.values()), None),
        budget=budget(judged.best.discrepancy, ranked.problem.parameters),
        scene=targets[0].scene if len(targets) == 1 else tuple(target.scene for target in targets),
    )
    return fit, ranked, judged.best.discrepancy


def _searched(
    targets: list[Target], tolerance: float, loss: str, progress: Progress
) -> tuple[list[Target], RankedMinima, default_bounds.Wider]:
    """Ranked minima within bounds that are widened where the data want it: the targets with these bounds,
    and what was done, with all warnings."""

    def build(allowed: float) -> Problem:
        problem = make(*targets, tolerance=allowed)
        messages.log_problem(targets, problem)
        return problem

    ranked, warnings = ranked_minima(build, lambda problem: search(problem, progress), tolerance, loss)
    wider = default_bounds.wider(targets, ranked, tolerance, loss, progress)
    if wider.parameters != ranked.problem.parameters:
        targets = default_bounds.measured_within(targets, ranked, wider.parameters)

        def again(problem: Problem) -> Minima:
            return default_bounds.joined(problem, search(problem, progress), wider.values)

        ranked, warnings = ranked_minima(build, again, tolerance, loss)
    return targets, ranked, wider._replace(warnings=(*warnings, *wider.warnings))


def _verdict(
    films: FilmMeasurements,
    judged: Assembly,
    parameters: dict[str, Estimate],
    rivals: tuple[Rival, ...],
    dark: frozenset[str],
    curves: IndexCurves | None,
) -> str:
    """The verdict, whether there is a film at all, and what the back face does."""
    worst = judged.worst
    pairs = zip(films.structures, judged.parts, strict=True)
    structure = next(structure for structure, part in pairs if part.name == worst.name)
    lead = next(p for p in parameters.values() if p.free)
    sentence = (curves.verdict(judged.conclusion.status, lead, judged.parts) if curves else "") or verdict(
        judged.conclusion.status,
        parameters,
        rivals,
        worst.rms,
        worst.name or "the data",
        " degrees" if isinstance(worst.curve, Curve) and worst.curve.delta_data is not None else "",
        structure.place if structure else "",
        dark,
        [] if curves else identifiability.naming(next(iter(parameters)), judged.conclusion.correlated),
        "n and k" if curves and not curves.depth else "",
    )
    # within the errors for other curves many an index is that of the substrate
    unneeded = not curves or judged.conclusion.status is Status.NOT_IDENTIFIABLE
    return (
        sentence
        + (films.unneeded(judged.parts) if unneeded else "")
        + backface.sentence(backface.comparison(films.targets, films.ranked))
    )
