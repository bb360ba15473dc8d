"""Verbs of fitting: fit, posterior, and comparison of several descriptions."""

import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.measurement import Measurement, check_measurement
from pellicle.errors import UsageError
from pellicle.fitting import joint
from pellicle.fitting.brdf import fit as brdf
from pellicle.fitting.comparison import Comparison, best_explained
from pellicle.fitting.comparison import compare as compare_fits
from pellicle.fitting.film.fit import fit as fit_spectra
from pellicle.fitting.film.samples import shared_by_each
from pellicle.fitting.progress import Progress, quiet
from pellicle.fitting.result import Fit
from pellicle.fitting.robust_losses import LEAST_SQUARES
from pellicle.sampling.result import Posterior
from pellicle.sampling.sample import OF_A_FILM, STEPS, measured, sampled, subject_of
from pellicle.scene.common_range import covered
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface, check_scene, refuse


def fit(
    data: Measurement,
    scene: Scene | Surface | Sequence[Scene | Surface],
    *,
    shared: Sequence[str] | None = None,
    tolerance: float = 0.0,
    loss: str = "least-squares",
    residual: str | None = None,
    progress: Progress = quiet,
) -> Fit:
    """Fit the free parameters of `scene` to `data`, in float64.

    **Arguments:**

    - `data`: `Spectrum` or `Colours`, or a list of these, of one sample (a joint fit); or `BrdfSamples`, or a
      list; or a list of both kinds.
    - `scene`: `Scene`, or a list with one for each spectrum; `Surface` for `BrdfSamples`. Signal, angle and
      polarisation come from the data. For a list of both kinds it is a list too, of scenes and the surface:
      free numbers of one name, such as `thickness`, are then one.
    - `shared`: names of free numbers that the scenes have in common, as `["film.A", "film.B"]`: each scene is
      then that of a sample, with layers and a substrate of its own. Numbers of one sample alone have its name
      in front, `thin.film.thickness`: the scene's `sample`, else the stem of the file. Scenes with the same
      `sample` are of one sample.
    - `tolerance`: leave out effects that change the signal by less (see `pellicle.plan`); where the best fit
      turns out to be off by more, the fit is done again with every effect.
    - `loss`: "least-squares", or "huber" or "student-t" against outliers.
    - `residual`: what is compared of a BRDF (`Surface` only): "linear", "cosine", "log" or "cube-root". By
      default "linear" where the samples have a σ, else "cube-root".
    - `progress`: called with the name of a stage, the number of steps done and their total.

    **Returns:** `Fit`: parameters with errors, a status with a verdict, every rival minimum. `print(fit)` is
    short; `fit.report()` is the full report, `fit.plot()` the figure, `fit.save(folder)` writes both.

    **Raises:** UsageError where nothing is free, where the scenes of a joint fit are not of one sample and
    nothing is `shared`, for a shared name that is free in fewer than two samples or has two bounds, where an
    uncalibrated signal has a fixed scale, for an unknown loss or residual, and for too few samples;
    ValueError where materials have no data for more than half of the points; others are left out, with a
    warning.

    ```python
    >>> scene = pl.Scene(pl.Layer("SiO2", pl.Free(100, 1000)), "Si")
    >>> spectrum = pl.simulate(pl.Scene(pl.Layer("SiO2", 500.0), "Si"), noise=0.002)
    >>> fit = pl.fit(spectrum, scene)
    >>> round(fit["thickness"].value), fit.status.value
    (500, 'converged')

    ```
    """
    return fitted(data, scene, shared, tolerance, loss, residual, progress)


def fitted(
    data: Measurement,
    scene: Scene | Surface | Sequence[Scene | Surface],
    shared: Sequence[str] | None = None,
    tolerance: float = 0.0,
    loss: str = LEAST_SQUARES,
    residual: str | None = None,
    progress: Progress = quiet,
    explained: bool = True,
) -> Fit:
    """Fit as `fit` does; causes of a misfit are looked for where it is to be `explained`."""
    check_measurement(data)
    check_scene(scene, several=True)
    data, said = covered_by(data, scene)
    both: Any = data, scene
    if joint.of_both_kinds(scene) or isinstance(scene, Surface):
        refuse("several scenes", shared=shared)
    if joint.of_both_kinds(scene):
        return joint.fitted(both[0], both[1], tolerance, progress, loss, residual)[0]
    if isinstance(scene, Surface):
        return brdf.fitted(measured((BrdfSamples,), data), scene, tolerance, progress, loss, residual)[0]
    refuse("a Scene", residual=residual)
    films = measured(OF_A_FILM, data)
    options = {"shared": shared, "tolerance": tolerance, "loss": loss, "progress": progress}
    of_film = fit_spectra(films, both[1], **options, explained=explained)
    return replace(of_film, warnings=(*said, *of_film.warnings))


def covered_by(data: Any, *scenes: Any) -> tuple[Any, list[str]]:
    """Measurements without the points that a medium does not cover, and what was left out.

    Each of `scenes` is one for all measurements, or a list of one for each.
    """
    rows = list(data) if isinstance(data, list | tuple) else [data]
    own = [x if isinstance(x, Sequence) and len(x) == len(rows) else [x] * len(rows) for x in scenes]
    kept = [covered(row, seen) for row, *seen in zip(rows, *own, strict=True)]
    said = [new.notes[-1] for old, new in zip(rows, kept, strict=True) if new is not old]
    return (kept if isinstance(data, list | tuple) else kept[0]), said


def sample(
    data: Measurement,
    scene: Scene | Surface | Sequence[Scene | Surface],
    *,
    walkers: int | None = None,
    steps: int = STEPS,
    seed: int = 0,
    shared: Sequence[str] | None = None,
    chain: str | os.PathLike[str] | None = None,
    tolerance: float = 0.0,
    residual: str | None = None,
    progress: Progress = quiet,
) -> Posterior:
    """Fit as `pellicle.fit` does, then sample the posterior of the free parameters, in float64.

    Priors are those of the `Free` parameters, uniform between the bounds by default. Walkers start in every
    minimum of the fit in proportion to its share.

    **Arguments:**

    - `data`, `scene`, `shared`, `tolerance`, `residual`, `progress`: as in `pellicle.fit`.
    - `walkers`: number of walkers, two for each free parameter at least.
    - `steps`: most steps; the chain ends before that where it is 50 autocorrelation times long and passes
      its checks. 20000 by default.
    - `seed` of the chain.
    - `chain`: file in which the chain is kept as it grows; an interrupted run continues from it.

    **Returns:** `Posterior`: draws, marginals, modes with their mass, and the checks of the chain.

    **Raises:** as `pellicle.fit` does; UsageError for too few walkers, or more than fit into memory;
    DataError for the chain of another problem.
    """
    began = time.perf_counter()
    check_measurement(data)
    check_scene(scene, several=True)
    if not isinstance(scene, Surface):
        refuse("a Scene", residual=residual)
    if joint.of_both_kinds(scene) or isinstance(scene, Surface):
        refuse("several scenes", shared=shared)
    data, _ = covered_by(data, scene)
    subject = subject_of(data, scene, tolerance, residual, progress, shared)
    return sampled(subject, walkers, steps, seed, chain, progress, began)


def compare(
    data: Measurement | Mapping[str, Fit],
    scenes: Mapping[str, Scene | Surface | Sequence[Scene | Surface]] | None = None,
    *,
    shared: Sequence[str] | None = None,
    tolerance: float = 0.0,
    residual: str | None = None,
    progress: Progress = quiet,
) -> Comparison:
    """Fit several scenes to the same data, or take fits of the same data, and compare them by their evidence.

    The evidence Z is the likelihood with the systematic effects integrated out, averaged over the bounds of
    the free parameters; AIC and BIC are given too.

    **Arguments:**

    - `data`: as in `pellicle.fit`; or fits already made, by name, and no scenes.
    - `scenes`: two or more descriptions by name, each as `pellicle.fit` takes it.
    - `shared`: names of free numbers that the samples have in common, as in `pellicle.fit`. A description
      that lacks some of them shares the others.
    - `tolerance`, `residual`, `progress`: as in `pellicle.fit`.

    **Returns:** `Comparison`: each candidate with its fit and criteria, the `best`, `probabilities`, and a
    verdict.

    **Raises:** UsageError for fewer than two scenes, for fits of different data, and as `pellicle.fit` does.
    """
    if isinstance(data, Mapping):
        if scenes is not None or not all(isinstance(own, Fit) for own in data.values()):
            raise UsageError("give data and scenes, or fits by name alone: compare({'oxide': fit, ...})")
        return compare_fits(data)
    if not isinstance(scenes, Mapping):
        raise UsageError("`scenes` must have names, as in {'oxide': scene, 'nitride': other}")
    own = shared_by_each(scenes, shared)
    measured, _ = covered_by(data, *scenes.values())

    def of(name: str, explained: bool) -> Fit:
        options = own[name], tolerance, LEAST_SQUARES, residual, progress, explained
        return fitted(measured, scenes[name], *options)

    return best_explained(scenes, of)
