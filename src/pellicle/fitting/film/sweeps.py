"""Sweeps of a spectrum: rows that were measured one after the other at one angle of incidence.

A fit of the mean of sweeps takes their noise from the residuals. These do not show what moves a whole sweep
as a parameter does, such as a drift of the lamp or of the wavelengths. The sweeps do: each deviates from the
mean, and the linearised fit turns its deviation into steps of the parameters. Their experimental standard
deviation of the mean (GUM 4.2) replaces the stated noise where the two do not agree.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from pellicle.data.colours import Colours
from pellicle.data.repeated_sweeps import deviations
from pellicle.data.spectrum import Spectrum
from pellicle.fitting.covariance import Scaled
from pellicle.fitting.noise import integrated_time
from pellicle.fitting.normal_equations import by_singular_values
from pellicle.fitting.repeated_measurements import Agreement, RepeatedParameter, short
from pellicle.fitting.result import Estimate
from pellicle.fitting.reweighting import RankedMinima
from pellicle.scene.film import Light
from pellicle.scene.free import is_free

_SHORT = 5
"""Fewest points of a sweep, on average; rows that turn back more often are in no order."""


def sweeps(
    wavelength: Float[np.ndarray, " rows"],
    angle: Float[np.ndarray, " rows"],
    azimuth: Float[np.ndarray, " rows"] | None = None,
) -> list[Int[np.ndarray, " points"]]:
    """Positions of the rows of each sweep, in the order of measurement.

    A sweep goes one way along the wavelength at one angle, or along the angle at one wavelength where there
    are fewer wavelengths than angles; each `azimuth` of the sample has its own, but one wavelength at one
    angle has a sweep of azimuths. Rows in no order form one sweep, sorted.
    """
    if azimuth is not None and _count(azimuth) > 1:
        if _count(angle) == _count(wavelength) == 1:
            return sweeps(azimuth, angle)
        each = [np.flatnonzero(azimuth == value) for value in dict.fromkeys(azimuth.tolist())]
        return [rows[own] for rows in each for own in sweeps(wavelength[rows], angle[rows])]
    fixed, along = (angle, wavelength) if _count(angle) <= _count(wavelength) else (wavelength, angle)
    result = []
    for value in dict.fromkeys(fixed.tolist()):
        rows = np.flatnonzero(fixed == value)
        turns, way = [], 0.0
        for i, step in enumerate(np.sign(np.diff(along[rows])).tolist(), start=1):
            if way and step and step != way:
                turns.append(i)
                way = 0.0  # the next sweep may go either way
            else:
                way = way or step
        if len(rows) < _SHORT * (len(turns) + 1):
            result.append(rows[np.argsort(along[rows], kind="stable")])
        else:
            result.extend(np.split(rows, turns))
    return result


def sweeps_of(light: Light, rows: int) -> list[Int[np.ndarray, " points"]]:
    """Positions of the rows of each sweep, of a light whose first `rows` are measured."""
    angle: Any = 0.0 if is_free(light.angle) else light.angle  # a free one is the same for all
    turns = (angle, 0.0 if light.azimuth is None else light.azimuth)
    shape = np.shape(light.wavelength)
    return sweeps(np.asarray(light.wavelength)[:rows], *(np.broadcast_to(x, shape)[:rows] for x in turns))


def correlation_in_sweeps(
    residuals: Float[np.ndarray, "*pixels rows channels"], parts: Sequence[Int[np.ndarray, " points"]]
) -> Any:
    """Number of points of one channel whose residuals count as one: neighbours in a sweep, times the sweeps
    that have the same residuals, as angles have of one model's error. `parts` are the rows of each sweep."""
    total = 0.0
    for size in {len(part) for part in parts}:
        # those of one length have one estimate: each alone may be too short for it
        alike = np.stack([residuals[..., part, :] for part in parts if len(part) == size], axis=-2)
        count, among = alike.shape[-2], np.ones(1)
        if count > 1:
            among = count * np.mean(np.mean(alike, axis=-2) ** 2, axis=-2)
            among = np.clip(among / np.maximum(np.mean(alike**2, axis=(-3, -2)), 1e-300), 1.0, count)
        along = integrated_time(np.moveaxis(alike, -1, -3))
        total = total + np.mean(along * among, axis=-1) * alike.shape[-3] * count
    return total / residuals.shape[-2]


def _count(values: np.ndarray) -> int:
    return len(np.unique(values))


def with_sweeps(
    data: Sequence[Spectrum | Colours],
    ranked: RankedMinima,
    jacobian: Scaled,
    parameters: Mapping[str, Estimate],
) -> tuple[dict[str, Estimate], list[str]]:
    """Estimates whose errors include the scatter between sweeps, and sentences on those that it enlarges."""
    result, sentences = dict(parameters), []
    if not any(isinstance(each, Spectrum) and each.sweeps for each in data):
        return result, []
    for view, (shifts, stated) in zip(ranked.problem.views, _steps(data, ranked, jacobian), strict=True):
        for name, own, noise in zip(jacobian.names, shifts.T, stated, strict=True):
            p = result[name]
            if len(own) < 2 or p.at_bound or not math.isfinite(p.stderr) or not noise > 0:
                continue
            each = (float(noise) * math.sqrt(len(own)),) * len(own)
            repeated = RepeatedParameter(name, p.unit, tuple(own.tolist()), each)
            if repeated.agreement is not Agreement.LARGER:
                continue
            more = repeated.sd_mean**2 - noise**2
            noise_error = math.sqrt(p.stderr_noise**2 + more)
            # Welch-Satterthwaite (GUM eq. G.2b) for the two parts of the noise
            parts = p.stderr_noise**4 / p.degrees_of_freedom + more**2 / repeated.freedom
            result[name] = replace(
                p,
                stderr=math.sqrt(p.stderr**2 + more),
                stderr_noise=noise_error,
                degrees_of_freedom=noise_error**4 / parts,
            )
            unit, of = f" {p.unit}" if p.unit else "", f" of {view.name}" if view.name else ""
            sentences.append(
                f"the sweeps{of} drift: {name} differs by {short(repeated.sd)}{unit} from one to the next, so"
                f" the noise error of their mean is {short(noise_error)}{unit}, where the residuals alone say"
                f" {short(p.stderr_noise)}{unit}"
            )
    return result, sentences


def _steps(
    data: Sequence[Spectrum | Colours], ranked: RankedMinima, jacobian: Scaled
) -> list[tuple[np.ndarray, np.ndarray]]:
    """For each spectrum the steps (sweeps, columns) of all parameters and nuisances that its sweeps make, and
    the standard error (columns,) that its noise contributes, in their own units."""
    inverse = jacobian.stretch @ by_singular_values(jacobian.jacobian)
    result, first = [], 0
    for spectrum, view, fit in zip(data, ranked.problem.views, ranked.fits, strict=True):
        gain = inverse @ jacobian.jacobian[first : first + view.points].T
        first += view.points
        if not isinstance(spectrum, Spectrum) or not spectrum.sweeps:
            result.append((np.zeros((0, len(gain))), np.zeros(len(gain))))
            continue
        apart = deviations(spectrum.sweeps)
        if (share := view.signal.share) is not None:
            shares = np.stack([share.measured(sweep) for sweep in spectrum.sweeps])
            apart = np.concatenate([apart, (shares - shares.mean(axis=0))[..., None]], axis=2)
        if view.data.frame is not None:
            apart = np.einsum("pij,spj->spi", np.asarray(view.data.frame)[: view.rows], apart)
        weight = np.asarray(view.data.weight)[: view.points] / math.sqrt(fit.variance)
        shifts = apart.reshape(len(apart), -1) * weight @ gain.T
        result.append((shifts, np.sqrt(np.sum(gain**2, axis=1))))
    return result
