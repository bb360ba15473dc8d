"""Standard errors and status of pixels from their data and minima, by the rules of `pellicle.fit`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pellicle.fitting.misfit import DOUBTFUL, Accuracy, beyond_accuracy
from pellicle.fitting.noise import DRIFT_CORRELATION
from pellicle.fitting.problem import Problem
from pellicle.fitting.spectra.evidence import LEAST_NOISE, SCATTER_OF_NOISE
from pellicle.fitting.spectra.nuisance import offset_prior, scale_prior
from pellicle.fitting.spectra.parts import LARGEST_ANGLES, LARGEST_DRIFT, LARGEST_POWER
from pellicle.fitting.spectra.problem import shortest_wavelength
from pellicle.fitting.spectra.search import thickness_grid
from pellicle.fitting.spectra.summary import FEWEST_FRINGES
from pellicle.fitting.spectra.targets import Measured, drifts
from pellicle.fitting.spectra.view import Local
from pellicle.fitting.status import RIVAL
from pellicle.mapping.pixels import profiles
from pellicle.mapping.pixels.covariance import noise_covariance, solve
from pellicle.mapping.pixels.discrepancy import PixelEvidence, discrepancy, other_material
from pellicle.mapping.pixels.effects import PixelEffects, columns, nodes, of_pixels
from pellicle.mapping.pixels.groups import Group, Taken, groups
from pellicle.mapping.pixels.local_models import PixelArrays, deviances, in_lanes, locals_of, padded
from pellicle.mapping.pixels.minima import PixelData, PixelMinima
from pellicle.mapping.pixels.noise import PixelNoise, correlation, noise_of, short_range_noise, students
from pellicle.mapping.pixels.results import CODES, NO_DATA, PixelFits
from pellicle.mapping.pixels.status import judge
from pellicle.scene.instrument import Drift

_REFITS = 4
"""Steps of Gauss and Newton of the other parameters where a profile holds one."""


class PixelErrors:
    """Errors and status of pixels, as `pellicle.fit` has them of one spectrum.

    Left out is what few pixels need: default bounds are not widened, a plan is not refined, and limits beside
    a bound that physics sets are those of the covariance.
    """

    def __init__(self, problem: Problem, target: Measured, calibrated: bool):
        self.target, self.calibrated = target, calibrated
        [self.view] = problem.views
        self.parameters = problem.parameters
        self.lower = np.array([p.lower for p in self.parameters])
        self.upper = np.array([p.upper for p in self.parameters])
        self.prior_mean = np.asarray(problem.box.prior_mean)
        self.prior_weight = np.asarray(problem.box.prior_weight)
        self.natural = profiles.natural_bounds([p.natural for p in self.parameters])
        self.position = np.asarray(self.view.data.position)[: self.view.points]
        self.nuisances: list[tuple[np.ndarray, np.ndarray, bool]] = []
        for number, prior, on_signal in (
            (self.target.scene.instrument.scale, scale_prior, True),
            (self.target.scene.instrument.offset, offset_prior, False),
        ):
            if isinstance(number, Drift):
                basis = np.polynomial.chebyshev.chebvander(self.position, number.degree)
                self.nuisances.append((basis, prior(number)[1], on_signal))
        self.linear = sum(len(sd) for _, sd, _ in self.nuisances)
        self.depth = problem.thickness_axis
        if self.depth is not None:
            p = self.parameters[self.depth]
            self.grid = p.lower + thickness_grid(problem, 1) * (p.upper - p.lower)
        middle = 0.5 * (self.lower + self.upper)
        table = None
        if len(self.parameters) == 1 and self.depth is not None:
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
            for chunk in group.chunks():
                for column, own in zip(result, self._chunk(data, minima, chunk), strict=True):
                    column[chunk.pixels] = own
        return result

    def _chunk(self, data: PixelData, minima: PixelMinima, group: Group) -> PixelFits:
        view, kind, who = self.view, self.view.noise, group.pixels
        values, units = minima.values[who, 0], minima.units[who, 0]
        taken = Taken(group, view)
        weight = data.weight[who]
        noise = noise_of(
            taken(weight * (data.values[who] - minima.model[who])),
            group.parts,
            kind,
            len(self.parameters) + self.linear,
        )
        weight = weight * noise.scale[:, None]
        frame = None if data.frame is None else data.frame[who]
        arrays = padded(view, PixelArrays(data.values[who], weight, noise.fraction, data.level[who], frame))
        empty = np.zeros(0)
        signal, slope, model = minima.signal[who], minima.slope[who], minima.model[who]
        at = Local(signal, slope, model, minima.gain[who], minima.offset[who], empty, empty)
        residual = data.values[who] - at.model
        # the scaled Jacobian
        flat, prior_sd = self._nuisance_columns(at, data.level[who])
        steep = at.gain[:, : view.points, None] * at.slope[:, : view.points] * (self.upper - self.lower)
        jacobian = np.concatenate([steep, flat], axis=2)
        span = np.broadcast_to(self.upper - self.lower, values.shape)
        stretch = np.concatenate([span, prior_sd], axis=1)
        prior = np.concatenate([self.prior_weight * span, np.ones(prior_sd.shape)], axis=1)
        own, _ = noise_covariance(jacobian * weight[..., None], noise.variance, prior)
        own = own * stretch[:, :, None] * stretch[:, None, :]
        # systematic effects
        evidence, effects = self._evidence(
            group, taken, at, arrays, frame, residual, jacobian, weight, noise, prior, values, units
        )
        found = discrepancy(evidence)
        misfit = self._misfit(evidence, effects, found, taken(data.values[who])[..., 0], kind.drifting)
        converged = minima.converged[who, 0]
        noise_sd, converged = self._limits(minima, who, arrays, noise, own, values, at, converged, ~misfit)
        count = len(self.parameters)
        variance = np.einsum("pii->pi", found.covariance) + found.shift**2
        variance = (variance * stretch**2)[:, :count]
        more = np.maximum(variance - np.einsum("pii->pi", own)[:, :count], 0.0)
        stderr = np.sqrt(noise_sd**2 + more)
        deviance = self._reweighted(minima, who, noise)
        above = deviance - deviance[:, :1]
        above = found.evidence_share[:, None] * np.maximum(above, 0.0)
        delta = above / students(noise.student_freedom, RIVAL)[:, None] ** 2
        delta = np.where(np.isfinite(deviance), delta, np.inf)
        status = judge(
            self.parameters, values, stderr, converged, misfit, minima.values[who, 1:], delta[:, 1:]
        )
        rms = self._rms(taken(residual), arrays)
        return PixelFits(
            values, stderr, noise_sd, status, minima.values[who], delta, noise.chi2 / noise.freedom, rms
        )

    def _reweighted(self, minima: PixelMinima, who: np.ndarray, noise: PixelNoise) -> np.ndarray:
        """Deviances (pixels, orders) with the weights and the effective points of the ranking."""
        square = noise.scale**2 * noise.fraction / float(self.target.independent_fraction)
        deviance, misfit = minima.deviance[who], minima.misfit[who]
        with np.errstate(invalid="ignore"):
            return np.where(np.isfinite(deviance), deviance + (square[:, None] - 1) * misfit, np.inf)

    def _nuisance_columns(self, at: Local, level: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Columns (pixels, points, nuisances) in steps of their priors, and those steps."""
        points, flat, steps = self.view.points, [], []
        for basis, sd, on_signal in self.nuisances:
            curve = (at.gain if on_signal else at.offset)[:, :points]
            numbers = curve @ np.linalg.pinv(basis).T
            own = sd * (np.abs(numbers[:, :1]) if on_signal else level[:, None])
            column = basis * own[:, None]
            flat.append(column * at.signal[:, :points, None] if on_signal else column)
            steps.append(own)
        if not flat:
            return np.zeros((len(level), points, 0)), np.zeros((len(level), 0))
        return np.concatenate(flat, axis=2), np.concatenate(steps, axis=1)

    def _evidence(
        self, group, taken, at, arrays, frame, residual, jacobian, weight, noise, prior, values, units
    ):
        view, kind, keep = self.view, self.view.noise, self.view.measured_channels
        pixels, known = len(values), jacobian.shape[2]
        left = taken(residual)[..., :keep]
        sigma = 1 / taken(weight)[..., :keep]
        median = np.median(sigma, axis=(1, 2))
        counted, middle = median**2 / noise.fraction, median
        least = LEAST_NOISE * arrays.level

        def short(which: np.ndarray) -> np.ndarray:
            return short_range_noise(left[which], group.parts, least[which])

        given = kind.known and not kind.drifting
        own = median if given else short(np.arange(pixels))
        if not kind.known:
            own = middle = np.minimum(own, median)
            sigma = np.broadcast_to(own[:, None, None], sigma.shape)
        effects = self.effects.changes(of_pixels(view, frame), at, values)
        parts = [
            taken(jacobian)[:, :, :keep].reshape(pixels, -1, known),
            columns([taken(e.change.reshape(pixels, -1)) for e in effects], pixels, left[0].size),
        ]
        both = np.concatenate(parts, axis=2)
        extra = len(effects)
        # terms of a lamp that a pixel has too few fringes for are zero
        count = np.any(parts[1] != 0, axis=1).sum(axis=1)
        pull = np.zeros((pixels, known + extra))
        pull[:, : values.shape[1]] = (values - self.prior_mean) * self.prior_weight
        lower, upper = np.full((2, pixels, known + extra), [[[-np.inf]], [[np.inf]]])
        lower[:, : values.shape[1]], upper[:, : values.shape[1]] = -units, 1 - units
        for i, effect in enumerate(effects):
            if effect.positive or effect.power == 2:
                lower[:, known + i] = 0.0
        evidence = PixelEvidence(
            residual=left,
            columns=both,
            sigma=sigma,
            noise=own,
            counted=counted,
            prior=np.concatenate([prior, np.ones((pixels, extra))], axis=1),
            pull=pull,
            lower=lower,
            upper=upper,
            known=known,
            count=count,
            correlation=lambda rest: correlation(rest, group.parts),
            least=DRIFT_CORRELATION if kind.drifting else 1.0,
            uncertain=0.0 if kind.known else SCATTER_OF_NOISE / left.shape[1] ** 0.5,
            middle=middle,
            short=short if given else None,
        )
        return evidence, effects

    def _misfit(self, evidence, effects, found, values, drifting) -> np.ndarray:
        """Pixels that the scene does not explain: see `fitting.misfit`."""
        if self.view.channels > 1:
            accuracy = Accuracy(largest=LARGEST_ANGLES)
        elif drifting:
            accuracy = Accuracy(weighted=LARGEST_DRIFT)
        else:
            largest = LARGEST_POWER if self.calibrated else np.inf
            accuracy = Accuracy(largest, np.ptp(values, axis=1))
        misfit = found.implausible | beyond_accuracy(found.remaining, accuracy)
        doubtful = np.flatnonzero((found.remaining.ratio > DOUBTFUL) & ~misfit)
        if len(doubtful) and effects:
            misfit[doubtful] = other_material(replace(evidence, noise=found.noise).of(doubtful), effects)
        return misfit

    def _limits(self, minima, who, arrays, noise, covariance, values, at, converged, usable):
        """Standard errors (pixels, parameters) of the noise alone."""
        count = values.shape[1]
        counted = arrays._replace(independent_fraction=1 / noise.variance)
        around = profiles.Around(
            values,
            self.lower,
            self.upper,
            covariance[:, :count, :count],
            self.natural,
            lambda which, points: self._deviance(counted, which, points),
            lambda which, axis, points: self._refitted(counted, which, axis, points),
        )
        flat = {}
        if self.depth is not None and minima.profile.shape[1] > 1:
            square = noise.scale**2 * noise.fraction / float(self.target.independent_fraction)
            rise = profiles.resampled(self.grid, minima.thickness, minima.profile[who])
            rise = rise * (square / students(noise.student_freedom, RIVAL) ** 2)[:, None]
            rise = rise - np.minimum(rise.min(axis=1), 0.0)[:, None]
            sides = profiles.flat_sides(self.grid, rise, values[:, self.depth])
            doubtful = np.flatnonzero(sides.any(axis=1) & usable)
            if count == 1 and len(doubtful):
                # what the scan predicts near a node is not exact: the nodes themselves
                points = np.concatenate([np.tile(self.grid, (len(doubtful), 1)), values[doubtful]], axis=1)
                exact = self._deviance(arrays, doubtful, points[..., None])
                rise = (exact - exact.min(axis=1)[:, None])[:, :-1]
                rise = rise / students(noise.student_freedom[doubtful], RIVAL)[:, None] ** 2
                sides[doubtful] = profiles.flat_sides(self.grid, rise, values[doubtful, 0])
            flat[self.depth] = sides
        result = profiles.errors(around, flat, usable)
        # on a plateau, as of an opaque film, a solver has no point to settle at
        depths = [i for i, p in enumerate(self.parameters) if p.key == "thickness"]
        converged = converged | (usable & np.isinf(result[:, depths]).any(axis=1))
        lost = ~converged & usable
        result[lost] = profiles.by_curvature(around)[lost]
        scene = self.target.scene
        if drifts(scene) and len(scene.layers) == 1 and self.depth is not None:
            rows = slice(self.view.rows)
            # a layer without numbers of its own has one index at all pixels
            some = slice(1) if count == 1 else slice(None)
            layer = locals_of(self.view, _of(arrays, np.arange(len(values))[some]), values[some])[0].layer
            index = layer[:, 0, rows] / np.asarray(self.view.scene.light.wavelength)[rows]
            thinnest = FEWEST_FRINGES / np.maximum(np.ptp(2 * index, axis=1), 1e-12)
            result[values[:, self.depth] < thinnest, self.depth] = np.inf
        return result, converged

    def _deviance(self, arrays: PixelArrays, which: np.ndarray, at: np.ndarray) -> np.ndarray:
        own = _of(arrays, which)
        value = in_lanes(deviances, self.view, own, at).value
        return value + np.sum(((at - self.prior_mean) * self.prior_weight) ** 2, axis=-1)

    def _refitted(
        self, arrays: PixelArrays, which: np.ndarray, axis: np.ndarray, at: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Least deviance with one parameter held and the others refitted, and where it is."""
        if at.shape[1] == 1:
            return self._deviance(arrays, which, at[:, None])[:, 0], at
        own, span = _of(arrays, which), self.upper - self.lower
        held = np.arange(at.shape[1]) == axis[:, None]
        best, best_at = np.full(len(at), np.inf), at.copy()
        for _ in range(_REFITS + 1):
            local, deviance = locals_of(self.view, own, at)
            deviance = deviance + np.sum(((at - self.prior_mean) * self.prior_weight) ** 2, axis=-1)
            better = deviance < best
            best[better], best_at[better] = deviance[better], at[better]
            weight = own.weight * np.sqrt(own.independent_fraction)[:, None]
            flat, _ = self._nuisance_columns(local, own.level)
            steep = local.gain[..., None] * local.slope * span
            rows = np.concatenate([steep[:, : self.view.points], flat], axis=2)
            rows = rows * weight[:, : self.view.points, None]
            data = ((own.values - local.model) * weight)[:, : self.view.points]
            matrix = np.swapaxes(rows, 1, 2) @ rows
            right = np.einsum("pnc,pn->pc", rows, data)
            prior = np.concatenate([self.prior_weight * span, np.ones(flat.shape[2])])
            matrix = matrix + np.diag(prior**2)
            right[:, : at.shape[1]] -= prior[: at.shape[1]] * (at - self.prior_mean) * self.prior_weight
            kept = np.concatenate([~held, np.ones((len(at), flat.shape[2]), bool)], axis=1)
            matrix = np.where(kept[:, :, None] & kept[:, None, :], matrix, np.eye(kept.shape[1]))
            step = solve(matrix, np.where(kept, right, 0.0))[:, : at.shape[1]] * span
            # half of the step after one that was too long
            step = np.where(better[:, None], step, 0.5 * (best_at - at) * ~held)
            at = np.clip(at + step, self.lower, self.upper)
        return best, best_at

    def _rms(self, residual: np.ndarray, arrays: PixelArrays) -> np.ndarray:
        """rms in the unit of the signal: see `SpectrumView.rms`."""
        rows, channels = residual.shape[1:]
        if channels == 1:
            return np.sqrt(np.mean(residual**2, axis=(1, 2)))
        return np.rad2deg(np.sqrt(np.sum(residual**2, axis=(1, 2)) / (2 * rows))) / 2


def _of(arrays: PixelArrays, which: np.ndarray) -> PixelArrays:
    return PixelArrays(*(None if x is None else x[which] for x in arrays))
