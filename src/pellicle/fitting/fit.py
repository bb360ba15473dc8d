"""Fit a scene to a spectrum: scan, polish, compare, and say how sure the answer is."""

from __future__ import annotations

import math
import time
from typing import Any

import equinox as eqx
import jax
import numpy as np

from pellicle.errors import UsageError
from pellicle.fitting import backface, noise, summary
from pellicle.fitting.problem import Problem, make
from pellicle.fitting.result import Fit
from pellicle.fitting.search import Progress, quiet, search
from pellicle.fitting.status import judge, misfits, verdict
from pellicle.fitting.uncertainty import errors
from pellicle.fitting.weigh import Noise, Weighed, weigh
from pellicle.io.spectrum import Spectrum
from pellicle.scene import Drift, Light, Scene, free_leaves


def fit(data: Spectrum, scene: Scene, *, progress: Progress = quiet) -> Fit:
    """Fit the free parameters of `scene` to one spectrum, in float64 whatever the caller's setting.

    The signal, and the polarisation and angle where the file has them, come from the spectrum.
    `progress` is called with a stage's name, how much is done and how much there is. Returns a
    `Fit`: best parameters with errors, rivals, a status and what was simulated.

    **Raises:** UsageError where nothing is free, or an uncalibrated signal is given a fixed scale;
    ValueError where a material has no data at a wavelength, naming it.
    """
    drifts = [x for x in (scene.instrument.scale, scene.instrument.offset) if isinstance(x, Drift)]
    check_free(scene)
    if not data.calibrated and scene.instrument.scale not in drifts:
        raise UsageError(
            f"{data.path}: an uncalibrated intensity needs a free scale: add --scale slow, or --scale free"
        )
    if data.delta is not None:
        _check_ellipsometry(data, scene, drifts)
    with jax.enable_x64(True):
        return _fit(data, seen_as(scene, data), progress)


def _check_ellipsometry(data: Spectrum, scene: Scene, drifts: list[Drift]) -> None:
    if drifts or scene.instrument.scale != 1.0 or scene.instrument.offset != 0.0:
        raise UsageError(f"{data.path}: Ψ and Δ have no scale and no offset: leave both out")
    if scene.substrate.back is not None:
        raise UsageError(f"{data.path}: ellipsometry of a plate's back face is not simulated: leave back out")
    if data.angle is None and not free_leaves(scene.light) and not np.any(scene.light.angle):
        raise UsageError(
            f"{data.path}: ellipsometry needs its angle of incidence: add --angle 70, say, angle = 70 under "
            "[data] in a recipe, or a column angle_deg"
        )


def check_free(scene: Scene) -> None:
    """UsageError where a scene has nothing to fit."""
    if not free_leaves(scene):
        raise UsageError(
            "nothing is free to fit: give bounds to the thickness, as in --thickness 10:3000, or in a recipe "
            "thickness = { lower = 10, upper = 3000 }"
        )


def seen_as(scene: Scene, data: Spectrum) -> Scene:
    """The scene looked at as the spectrum was: its signal, wavelengths, polarisation and angles."""
    angle: Any = scene.light.angle
    if data.angle is not None:
        angle = float(data.angle[0]) if np.ptp(data.angle) == 0 else data.angle
    stated = data.polarisation != "unpolarised"
    polarisation = data.polarisation if stated else scene.light.polarisation
    return eqx.tree_at(lambda s: s.light, scene, Light(data.wavelength, angle, data.signal, polarisation))


def _fit(data: Spectrum, scene: Scene, progress: Progress) -> Fit:
    began = time.perf_counter()
    source = Noise(given=data.sigma is not None, drifting=data.sigma is None and summary.drifts(scene))
    problem = make(
        scene,
        data.wavelength,
        _values(data),
        _sigma(data, source),
        1 / noise.DRIFT_CORRELATION if source.drifting else 1.0,
    )
    weighed = weigh(problem, search(problem, progress), source)
    return _report(data, scene, weighed, summary.profile(problem, weighed), source, began)


def _values(data: Spectrum) -> np.ndarray:
    """What is fitted: fractions, or N, C, S (points, 3) for ellipsometry, which have no wrap-around."""
    if data.delta is None:
        return data.values
    psi, delta = 2 * np.deg2rad(data.values), np.deg2rad(data.delta)
    return np.stack([np.cos(psi), np.sin(psi) * np.cos(delta), np.sin(psi) * np.sin(delta)], -1)


def _sigma(data: Spectrum, source: Noise) -> np.ndarray:
    """σ of each point: given, the model's own error, or a guess that the residuals will replace.

    On the sphere of N, C, S an error of Ψ moves a point by 2σ_Ψ and one of Δ by sin(2Ψ) σ_Δ; their
    mean square serves for all directions.
    """
    if data.sigma is not None and data.delta is not None:
        across = data.sigma if data.delta_sigma is None else data.delta_sigma
        along = np.sin(2 * np.deg2rad(data.values)) * across
        return np.deg2rad(np.sqrt(0.5 * ((2 * data.sigma) ** 2 + along**2)))
    if data.sigma is not None:
        return data.sigma
    if data.delta is not None:
        return np.full(len(data), 0.01)
    if source.drifting:
        return noise.drifting_sigma(data.values)
    guess = max(0.01 * float(np.ptp(data.values)), float(np.median(noise.local_noise(data.values))), 1e-12)
    return np.full(len(data), guess)


def _size(data: Spectrum, problem: Problem, weighed: Weighed) -> tuple[float, float]:
    """rms of the residuals, and the signal's span. For ellipsometry the rms is in degrees of Ψ: half the
    distance on the sphere, in each of its two directions."""
    residual = (problem.data.values - np.asarray(weighed.at.model))[: problem.points]
    values = problem.data.values[: problem.points].reshape(problem.rows, problem.channels)
    span = float(np.max(np.ptp(values, axis=0)))
    if data.delta is None:
        return float(np.sqrt(np.mean(residual**2))), span
    return float(np.rad2deg(np.sqrt(residual @ residual / (2 * problem.rows))) / 2), span


def _report(data: Spectrum, scene: Scene, weighed: Weighed, profile, source: Noise, began: float) -> Fit:
    problem = weighed.problem
    found = errors(problem, weighed.at, weighed.variance)
    parameters = summary.estimates(scene, weighed, found, profile)
    others = summary.rivals(weighed)
    curve = summary.curve(problem, weighed, found)
    rms, span = _size(data, problem, weighed)
    misfit = misfits(
        chi2_reduced=weighed.chi2_reduced,
        sigma_known=source.given,
        drifting=source.drifting,
        effective_share=1 / weighed.length,
        rms=rms if data.delta is None else math.radians(2 * rms),
        span=span,
        calibrated=data.calibrated,
    )
    plate = backface.rms_without(scene, weighed) if problem.plan.on("back-face") else None
    natural = frozenset(p.name for p in problem.parameters if p.natural_lower)
    status = judge(
        converged=bool(weighed.minima.converged[0]),
        misfit=misfit,
        parameters=parameters,
        rivals=others,
        natural=natural,
    )
    return Fit(
        spectrum=data,
        status=status,
        verdict=verdict(status, parameters, others, rms) + backface.told(rms, plate),
        parameters=parameters,
        rivals=others,
        chi2_reduced=weighed.chi2_reduced,
        rms=rms,
        effective_points=summary.effective_points(problem, weighed),
        correlation_names=found.names,
        correlation=found.correlation,
        plan=problem.plan,
        warnings=summary.warnings(scene, weighed, found),
        curve=curve,
        profile=profile,
        seconds=time.perf_counter() - began,
    )
