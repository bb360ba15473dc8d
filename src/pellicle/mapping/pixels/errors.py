"""Standard errors and status of pixels from their data and minima, by the rules of `pellicle.fit`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np

from pellicle.fitting.covariance import Scaled, errors
from pellicle.fitting.discrepancy import DOUBTFUL, Evidence, discrepancy
from pellicle.fitting.film.evidence import LEAST_NOISE, SCATTER_OF_NOISE
from pellicle.fitting.film.form import Local
from pellicle.fitting.film.parts import accuracy
from pellicle.fitting.film.problem import shortest_wavelength
from pellicle.fitting.film.sweeps import correlation_in_sweeps, sweeps
from pellicle.fitting.film.targets import Measured
from pellicle.fitting.film.view import SpectrumView
from pellicle.fitting.misfit import misfit, other_material
from pellicle.fitting.noise import DRIFT_CORRELATION, NoiseEstimate, noise_of, short_range_noise, student
from pellicle.fitting.problem import NoiseGroup, Problem
from pellicle.fitting.robust_losses import median
from pellicle.fitting.status import ORDER, RIVAL, judged, outside
from pellicle.mapping.pixels.data import PixelData, PixelMinima
from pellicle.mapping.pixels.effects import PixelEffects, nodes, of_pixels
from pellicle.mapping.pixels.limits import PixelLimits, evidence_factor
from pellicle.mapping.pixels.local_models import Nuisances
from pellicle.mapping.pixels.results import CODES, NO_DATA, PixelFits
from pellicle.scene.free import is_free

BLOCK = 1024
"""Pixels that are judged at once. With 512 the calls of NumPy cost 1 to 3 µs more for each pixel; the systems
of equations of 2048 no longer stay in the cache."""
_PROFILED = 4096
"""Pixels whose profiles are computed together: few of them need one, and programs take hundreds at a time."""


class Group(NamedTuple):
    """Pixels of which as many points were measured: their indices, the measured rows of each (pixels, rows),
    and the sweeps of those rows."""

    pixels: np.ndarray
    rows: np.ndarray
    parts: list[np.ndarray]

    def chunks(self, size: int) -> Iterator[Group]:
        """The group in parts of `size` pixels."""
        for first in range(0, len(self.pixels), size):
            own = slice(first, first + size)
            yield Group(self.pixels[own], self.rows[own], self.parts)


def groups(view: SpectrumView, weight: np.ndarray, known: np.ndarray) -> list[Group]:
    """Groups of the pixels that are `known` (pixels,); `weight` (pixels, points) is 0 where nothing was
    measured. Those of a view of several sweeps have measured the same points."""
    light = view.scene.light
    measured: Any = np.all((weight > 0).reshape(-1, view.rows, view.channels), axis=2)
    known = known & np.any(measured, axis=1)
    wavelength = np.asarray(light.wavelength)[: view.rows]
    own = 0.0 if is_free(light.angle) else light.angle  # a free one is the same for all
    angle = np.broadcast_to(own, np.shape(light.wavelength))[: view.rows]
    several = len(sweeps(wavelength, angle)) > 1
    keys = measured if several else measured.sum(axis=1)[:, None]
    _, which = np.unique(keys[known], axis=0, return_inverse=True)
    result = []
    for value in range(which.max(initial=-1) + 1):
        pixels = np.flatnonzero(known)[which.ravel() == value]
        count = int(measured[pixels[0]].sum())
        rows = np.argsort(~measured[pixels], axis=1, kind="stable")[:, :count]
        result.append(Group(pixels, rows, sweeps(wavelength[rows[0]], angle[rows[0]])))
    return result


class Taken:
    """The measured rows of arrays (pixels, points, ...) as (pixels, rows, channels, ...)."""

    def __init__(self, group: Group, view: SpectrumView):
        self._rows, self._view = group.rows, view
        self._all = group.rows.shape[1] == view.rows

    def __call__(self, x: np.ndarray) -> np.ndarray:
        view = self._view
        rows = x.reshape(len(x), view.rows, -1, *x.shape[2:])
        if self._all:
            return rows
        return np.take_along_axis(rows, self._rows.reshape(*self._rows.shape, *[1] * (rows.ndim - 2)), axis=1)


class _Judged(NamedTuple):
    """Noise and discrepancy of pixels, each (pixels, ...), before their limits.

    `covariance` is that of the parameters by the noise, `systematic` the variance that effects add, in the
    parameters' own units; `flat` the sides (pixels, 2) on which a scan of the thickness is flat.
    """

    noise: NoiseEstimate
    covariance: np.ndarray
    systematic: np.ndarray
    flat: np.ndarray
    misfit: np.ndarray
    evidence_share: np.ndarray
    rms: np.ndarray


class PixelErrors:
    """Errors and status of pixels, as `pellicle.fit` has them of one spectrum.

    Left out is what few pixels need: default bounds are not widened, and a plan is not refined.
    """

    def __init__(self, problem: Problem, target: Measured, calibrated: bool):
        self.target, self.calibrated = target, calibrated
        [self.view] = problem.views
        self.parameters = problem.parameters
        self.lower = np.array([p.lower for p in self.parameters])
        self.upper = np.array([p.upper for p in self.parameters])
        self.box = jax.device_get(problem.box)
        self.nuisances = Nuisances(self.view, target.scene)
        self.limits = PixelLimits(problem, target.scene, self.nuisances)
        middle = 0.5 * (self.lower + self.upper)
        table = None
        if len(self.parameters) == 1 and problem.thickness_axis is not None:
            table = nodes(self.lower[0], self.upper[0], shortest_wavelength(problem))
        self.effects = PixelEffects(self.view, middle, target.scene, table)

    def fits(self, data: PixelData, minima: PixelMinima) -> PixelFits:
        """Errors and status of pixels by their data and minima."""
        pixels, orders, count = minima.values.shape
        number, quality = np.full((pixels, count), np.nan), np.full(pixels, np.nan)
        result = PixelFits(
            values=number,
            stderr=number.copy(),
            stderr_noise=number.copy(),
            status=np.full(pixels, CODES[NO_DATA], np.uint8),
            minima=np.full(minima.values.shape, np.nan),
            delta_chi2=np.full((pixels, orders), np.inf),
            chi2_reduced=quality,
            rms=quality.copy(),
        )
        known = np.isfinite(minima.deviance[:, 0])
        for group in groups(self.view, data.weight, known):
            for part in group.chunks(_PROFILED):
                for column, own in zip(result, self._fits(data, minima, part), strict=True):
                    column[part.pixels] = own
        return result

    def _fits(self, data: PixelData, minima: PixelMinima, group: Group) -> PixelFits:
        who = group.pixels
        chunks = [self._judged(data, minima, chunk) for chunk in group.chunks(BLOCK)]
        state = jax.tree_util.tree_map(_joined, *chunks)
        noise, values = state.noise, minima.values[who, 0]
        counted = 1 / noise.variance(self.view.noise)
        arrays = self.limits.arrays(data, who, noise)._replace(independent_fraction=counted)
        noise_sd, converged = self.limits.stderr(
            arrays, values, state.covariance, state.flat, ~state.misfit, minima.converged[who, 0]
        )
        stderr = np.sqrt(noise_sd**2 + state.systematic)
        deviance = self._reweighted(minima, who, noise)
        above = state.evidence_share[:, None] * np.maximum(deviance - deviance[:, :1], 0.0)
        delta = above / student(noise.effective_freedom(self.view.noise), RIVAL)[:, None] ** 2
        delta = np.where(np.isfinite(deviance), delta, np.inf)
        rivals = minima.values[who, 1:]
        status = self._status(values, stderr, converged, state.misfit, rivals, delta[:, 1:])
        chi2 = noise.chi2 / noise.freedom
        return PixelFits(values, stderr, noise_sd, status, minima.values[who], delta, chi2, state.rms)

    def _status(self, values, stderr, converged, misfit, rivals, delta_chi2) -> np.ndarray:
        """Codes of the status (pixels,); `rivals` (pixels, orders, parameters) are other minima, `delta_chi2`
        (pixels, orders) how much worse they are, infinite where there are none."""
        # the leading parameter first
        order = sorted(range(len(self.parameters)), key=lambda i: self.parameters[i].key != "thickness")
        own = [i for i in order if not self.parameters[i].name.startswith("instrument.")]
        about = [(self.parameters[i], values[:, i]) for i in own]
        resting = [p.on_bound(x) & ~p.on_natural_bound(x) for p, x in about]
        close = (delta_chi2 < RIVAL) & outside(values, stderr, rivals).any(axis=2)
        verdicts = judged(
            [p.name for p, _ in about],
            [p.limits is not None for p, _ in about],
            *(values[:, own], stderr[:, own], np.reshape(resting, (len(own), len(values))).T),
            converged=converged,
            misfit=misfit,
            ambiguous=close.any(axis=1),
        )
        return np.array([CODES[str(status)] for status in ORDER], np.uint8)[verdicts.position]

    def _judged(self, data: PixelData, minima: PixelMinima, group: Group) -> _Judged:
        view, who = self.view, group.pixels
        values, count = minima.values[who, 0], len(self.parameters)
        taken = Taken(group, view)
        residual, empty = data.values[who] - minima.model[who], np.zeros(0)
        noise = self._noise(group, taken(data.weight[who] * residual))
        pixels = data.of(who)._replace(weight=data.weight[who] * noise.scale[:, :1])
        at = Local(
            *(minima.signal[who], minima.slope[who], minima.model[who]),
            *(minima.gain[who], minima.offset[who], empty, empty),
        )
        jacobian, scaled = self._scaled(pixels, at, values, noise)
        noise_errors = errors(scaled)
        effects = self.effects.changes(of_pixels(view, pixels.frame), at, values)
        effects = [replace(e, change=taken(e.change.reshape(len(who), -1))) for e in effects]
        columns = taken(jacobian)[:, :, : view.measured_channels]
        evidence = self._evidence(group, taken, pixels, residual, noise)._replace(
            jacobian=columns, effects=effects
        )
        discrepancies = discrepancy([evidence], scaled, minima.units[who, 0], contributions=False)
        largest = accuracy(view, self.calibrated, taken(pixels.values)[..., 0])
        wrong = misfit(discrepancies, discrepancies.remaining[0], largest)
        doubtful = np.flatnonzero((discrepancies.remaining[0].ratio > DOUBTFUL) & ~wrong)
        if len(doubtful):
            units = minima.units[who, 0][doubtful]
            again = discrepancy([evidence.of(doubtful)], scaled.of(doubtful), units)
            wrong[doubtful] = other_material(again.contributions) >= 0
        return _Judged(
            noise=noise,
            covariance=noise_errors.covariance[:, :count, :count],
            systematic=np.maximum(discrepancies.variance - noise_errors.variance, 0.0)[:, :count],
            flat=self.limits.flat_sides(data, minima, who, noise, ~wrong),
            misfit=wrong,
            evidence_share=discrepancies.evidence_share,
            rms=_rms(taken(residual)),
        )

    def _scaled(
        self, pixels: PixelData, at: Local, values: np.ndarray, noise: NoiseEstimate
    ) -> tuple[np.ndarray, Scaled]:
        """The Jacobian (pixels, points, columns) in the unit of the data, and the scaled one."""
        view, span = self.view, self.upper - self.lower
        flat, prior_sd = self.nuisances.columns(at, pixels.level)
        steep = at.gain[:, : view.points, None] * at.slope[:, : view.points] * span
        jacobian = np.concatenate([steep, flat], axis=2)
        stretch = np.concatenate([np.broadcast_to(span, values.shape), prior_sd], axis=1)
        known = stretch.shape[1]
        own = pixels.weight / np.sqrt(noise.variance(view.noise))[:, None]
        priors = np.diag(np.concatenate([self.box.prior_weight * span, np.ones(flat.shape[2])]))
        priors = np.broadcast_to(priors, (len(values), known, known))
        pull = np.zeros(stretch.shape)
        pull[:, : len(span)] = self.box.prior_rows(values)
        rows = np.concatenate([jacobian * own[..., None], priors], axis=1)
        names = tuple(p.name for p in self.parameters) + ("",) * prior_sd.shape[1]
        return jacobian, Scaled(rows, stretch[..., None] * np.eye(known), names, pull)

    def _noise(self, group: Group, residual: np.ndarray) -> NoiseEstimate:
        """Noise by the weighted residuals (pixels, rows, channels). Of three channels of ellipsometry two
        are independent."""
        pixels, rows, channels = residual.shape
        independent = min(channels, 2) * rows
        of_all = NoiseGroup(tuple(range(channels)), self.view.noise.known, independent)
        used = len(self.parameters) + self.nuisances.count
        freedom = np.full(pixels, max(independent - used, 1.0))
        return noise_of(residual, [of_all], freedom, correlation_in_sweeps(residual, group.parts))

    def _reweighted(self, minima: PixelMinima, who: np.ndarray, noise: NoiseEstimate) -> np.ndarray:
        """Deviances (pixels, orders) with the weights and the effective points of the ranking."""
        factor = evidence_factor(noise, self.view)
        deviance, misfit = minima.deviance[who], minima.misfit[who]
        with np.errstate(invalid="ignore"):
            return np.where(np.isfinite(deviance), deviance + (factor[:, None] - 1) * misfit, np.inf)

    def _evidence(
        self, group: Group, taken: Taken, pixels: PixelData, residual: np.ndarray, noise: NoiseEstimate
    ) -> Evidence:
        """Residuals and their noise: see `fitting.film.evidence`."""
        kind, keep = self.view.noise, self.view.measured_channels
        left, sigma = taken(residual)[..., :keep], 1 / taken(pixels.weight)[..., :keep]
        weights = np.sqrt(noise.fraction(kind))[:, None, None] / sigma
        least, typical = LEAST_NOISE * pixels.level, median(sigma, (1, 2))

        def short(which: np.ndarray) -> np.ndarray:
            return short_range_noise(left[which], group.parts, least[which])

        given = kind.known and not kind.drifting
        own = typical if given else short(np.arange(len(left)))
        if not kind.known:
            own = np.minimum(own, typical)
            sigma = np.broadcast_to(own[:, None, None], sigma.shape)
        return Evidence(
            residual=left,
            jacobian=left[..., None],
            sigma=sigma,
            noise=own,
            weights=weights,
            effects=[],
            correlation=lambda rest: correlation_in_sweeps(rest, group.parts),
            least=DRIFT_CORRELATION if kind.drifting else 1.0,
            uncertain=0.0 if kind.known else SCATTER_OF_NOISE / left.shape[1] ** 0.5,
            exact_noise=short if given else None,
        )


def _joined(*pieces: Any) -> Any:
    """Arrays of several chunks of pixels one after the other; a number is the same in all."""
    return np.concatenate(pieces) if np.ndim(pieces[0]) else pieces[0]


def _rms(residual: np.ndarray) -> np.ndarray:
    """rms of residuals (pixels, rows, channels) in the unit of the signal: see `SpectrumView.rms`."""
    rows, channels = residual.shape[1:]
    if channels == 1:
        return np.sqrt(np.mean(residual**2, axis=(1, 2)))
    return np.rad2deg(np.sqrt(np.sum(residual**2, axis=(1, 2)) / (2 * rows))) / 2
