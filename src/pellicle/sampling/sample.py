"""Sample the posterior of a fit's free parameters, from every minimum that the fit found."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple, TypeVar

import jax

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.colours import Colours
from pellicle.data.measurement import Measurement
from pellicle.data.spectrum import Spectrum
from pellicle.errors import UsageError
from pellicle.fitting import joint
from pellicle.fitting.brdf import fit as brdf
from pellicle.fitting.brdf.summary import BrdfMeasurements
from pellicle.fitting.conclusion import linearised
from pellicle.fitting.discrepancy import discrepancy
from pellicle.fitting.film import fit as spectra
from pellicle.fitting.film.colour_targets import arrays
from pellicle.fitting.film.summary import FilmMeasurements
from pellicle.fitting.progress import Progress
from pellicle.fitting.result import Fit, Status
from pellicle.fitting.reweighting import RankedMinima
from pellicle.sampling.density import fingerprint, log_density, systematics
from pellicle.sampling.ensemble import Subject, installed
from pellicle.sampling.modes import modes, sandwich_stretch
from pellicle.sampling.result import predictions
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface

Kind = TypeVar("Kind")


def subject_of(
    data: Measurement,
    scene: Scene | Surface | Sequence[Scene | Surface],
    tolerance: float,
    residual: str | None,
    progress: Progress,
) -> Subject:
    """Fit as `pellicle.fit` does, and return the posterior between the bounds, in float64.

    Priors are those of the `Free` parameters, uniform between the bounds by default; scale and offset, and
    the systematic effects of the scene's `uncertainty`, are integrated out.

    BRDF samples are taken to have normal errors in the unit of the `residual` (ρ, or its cube root): of the
    given σ, or of the rms of the best fit's residuals. Without a σ the draws are then stretched around their
    minimum to the covariance of the fit, in which each residual stands for its noise (HC3). Where residuals
    are correlated in neighbouring samples the samples count as fewer. A deviation and its azimuth are a
    direction, and all directions are as likely. The posterior assumes that there is a layer, also where the
    fit finds no evidence of one.

    **Raises:** as `fit` does, and UsageError without the sampler's packages.
    """
    installed()
    if isinstance(scene, Surface):
        fitted = _of_surface(data, scene, tolerance, residual, progress)
    elif joint.of_both_kinds(scene):
        fitted = _of_both_kinds(data, scene, tolerance, residual, progress)
    else:
        fitted = _of_film(data, scene, tolerance, progress)
    with jax.enable_x64(True):
        return _subject(fitted)


class _Fitted(NamedTuple):
    """A fit with its minima, the function from them to its measurements, the hash that identifies its
    posterior, and what the posterior assumes beyond the fit."""

    fit: Fit
    ranked: RankedMinima
    measurements: Callable[[RankedMinima], Any]
    identity: str
    assumption: str = ""


def _of_surface(
    data: Any, scene: Surface, tolerance: float, residual: str | None, progress: Progress
) -> _Fitted:
    measurements = measured((BrdfSamples,), data)
    fit, ranked = brdf.fitted(measurements, scene, tolerance, progress, residual=residual)
    unsure = fit.layer_test and not fit.layer_test.layered and fit.status is not Status.AMBIGUOUS
    rows = [measurements] if isinstance(measurements, BrdfSamples) else measurements
    compared = fit.layer_test.residual if fit.layer_test else ""
    numbers = dict(scene.numbers), tuple(scene.bands), scene.media
    identity = fingerprint([*_columns(rows), numbers], scene.model, compared, tolerance)
    assumption = "there is a layer" if unsure else ""
    return _Fitted(fit, ranked, partial(BrdfMeasurements, rows, scene), identity, assumption)


def _of_both_kinds(
    data: Any, scene: Any, tolerance: float, residual: str | None, progress: Progress
) -> _Fitted:
    fit, ranked = joint.fitted(data, scene, tolerance, progress, residual=residual)
    with jax.enable_x64(True):
        own = joint.apart(data, scene)
        surface = dict(own.surface.numbers), tuple(own.surface.bands), own.surface.media
        targets = spectra.measurements(own.films, own.scenes)
        known = [*map(arrays, targets), *_columns(own.samples), surface]
        identity = fingerprint(known, own.surface.model, residual, tolerance)
    return _Fitted(fit, ranked, partial(joint.together, own, targets), identity)


def _of_film(data: Any, scene: Any, tolerance: float, progress: Progress) -> _Fitted:
    measurements = measured(OF_A_FILM, data)
    fit, ranked = spectra.fitted(measurements, scene, tolerance, progress)
    with jax.enable_x64(True):
        targets = spectra.measurements(measurements, scene)
        identity = fingerprint([arrays(target) for target in targets], tolerance)
    return _Fitted(fit, ranked, partial(FilmMeasurements, spectra.listed(measurements), targets), identity)


def _columns(samples: Sequence[BrdfSamples]) -> list[tuple[Any, ...]]:
    return [(s.theta_i, s.phi_i, s.theta_o, s.phi_o, s.values, s.sigma) for s in samples]


def _subject(fitted: _Fitted) -> Subject:
    """Subject of sampling: the log posterior with its systematic effects, its minima and its predictions."""
    fit, ranked = fitted.fit, fitted.ranked.counted
    jacobian, covariance = linearised(ranked)
    residuals, problem = fitted.measurements(ranked).evidence(jacobian), ranked.problem.affine()
    shares = discrepancy(residuals, jacobian, ranked.minima.units[0]).evidence_shares
    channels = [view.channels for view in problem.views]
    effects = systematics(residuals, shares, channels, len(problem.parameters))
    mixture = modes(ranked, effects)
    slope = problem.coordinates.slope(problem.box, mixture.centre[0])
    return Subject(
        fit,
        tuple(p.name for p in problem.parameters),
        log_density(problem, effects),
        mixture,
        lambda units: problem.values_near(units, ranked.values),
        fitted.identity,
        max(view.independent for view in problem.views),
        lambda units, seed: predictions(problem, fit.parts, units, seed),
        fitted.assumption,
        sandwich_stretch(covariance, slope, mixture),
    )


OF_A_FILM = (Spectrum, Colours)
"""Kinds of data that a `Scene` explains."""


def measured(kinds: tuple[type[Kind], ...], data: Measurement) -> Kind | list[Kind]:
    """The data as one or a list of such kinds. Raises UsageError for another kind."""
    if isinstance(data, kinds):
        return data
    rows: list[Any] = [data] if isinstance(data, Spectrum | Colours | BrdfSamples) else list(data)
    if not all(isinstance(row, kinds) for row in rows):
        raise UsageError("BRDF samples need a Surface, and spectra and colours a Scene")
    return rows
