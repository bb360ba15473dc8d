"""Standard errors and status of spectra from their data and minima, by the conclusions of `pellicle.fit`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pellicle.fitting.batch import polish
from pellicle.fitting.batch.candidates import BatchSearch
from pellicle.fitting.batch.data import CODES, NO_DATA, BatchData, BatchFits, BatchMinima
from pellicle.fitting.batch.effects import LANES, BatchEffects, nodes
from pellicle.fitting.batch.local_models import LocalModels, thickness_nodes
from pellicle.fitting.conclusion import verdicts
from pellicle.fitting.covariance import Scaled
from pellicle.fitting.discrepancy import DOUBTFUL, Discrepancy, discrepancy
from pellicle.fitting.film.evidence import spectrum_evidence
from pellicle.fitting.film.parts import accuracy
from pellicle.fitting.film.problem import Measured, drifts, shortest_wavelength
from pellicle.fitting.film.summary import bounded_by_drift, unlimited
from pellicle.fitting.film.sweeps import sweeps
from pellicle.fitting.film.view import Local, SpectrumView
from pellicle.fitting.linear_system import Evidence
from pellicle.fitting.marginal import CLEAR, above_best, by_remaining, gains, left_weights, marginal, turnable
from pellicle.fitting.minima import Minima
from pellicle.fitting.misfit import misfit, other_material
from pellicle.fitting.noise import student
from pellicle.fitting.problem import Problem
from pellicle.fitting.reweighting import RankedMinima, linearised, ranked_by_factor
from pellicle.fitting.status import ORDER, RIVAL
from pellicle.scene.free import is_free

_Linear = tuple[SpectrumView, RankedMinima, Scaled, Evidence]
BLOCK = 1024
"""Spectra that are judged at once. With 512 the calls of NumPy cost 1 to 3 µs more for each spectrum; the
systems of equations of 2048 no longer stay in the cache."""


class Group(NamedTuple):
    """Spectra of which as many points were measured: their indices, the measured rows of each (spectra,
    rows), None where all are, and the sweeps of those rows."""

    spectra: np.ndarray
    rows: np.ndarray | None
    parts: list[np.ndarray]

    def chunks(self, size: int) -> Iterator[Group]:
        """The group in parts of `size` spectra."""
        for first in range(0, len(self.spectra), size):
            own = slice(first, first + size)
            yield Group(self.spectra[own], None if self.rows is None else self.rows[own], self.parts)

    def of(self, which: np.ndarray) -> Group:
        """Some spectra of the group, by their positions, as if they were all."""
        rows = None if self.rows is None else self.rows[which]
        return Group(np.arange(len(which)), rows, self.parts)

    def measured(self, x: np.ndarray) -> np.ndarray:
        """Arrays of its spectra (spectra, rows, ...) at their measured rows."""
        if self.rows is None:
            return x
        return np.take_along_axis(x, self.rows.reshape(*self.rows.shape, *[1] * (x.ndim - 2)), axis=1)


def groups(view: SpectrumView, weight: np.ndarray, known: np.ndarray) -> list[Group]:
    """Groups of the spectra that are `known` (spectra,); `weight` (spectra, points) is 0 where nothing was
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
        spectra = np.flatnonzero(known)[which.ravel() == value]
        count = int(measured[spectra[0]].sum())
        rows = np.argsort(~measured[spectra], axis=1, kind="stable")[:, :count]
        parts = sweeps(wavelength[rows[0]], angle[rows[0]])
        result.append(Group(spectra, None if count == view.rows else rows, parts))
    return result


class BatchErrors:
    """Errors and status of spectra, as `pellicle.fit` has them of one spectrum.

    Left out is what few spectra need: default bounds are not widened, and a plan is not refined.
    """

    def __init__(self, problem: Problem, target: Measured, calibrated: bool, search: BatchSearch):
        self.problem, self.scene, self.calibrated = problem, target.scene, calibrated
        self.search = search
        [self.view] = problem.views
        lower, upper = np.array([(p.lower, p.upper) for p in problem.parameters]).T
        depth, table = problem.thickness_axis, None
        self.grid = np.zeros(0) if depth is None else thickness_nodes(problem)
        if len(lower) == 1 and depth is not None:
            table = nodes(lower[0], upper[0], shortest_wavelength(problem))
        middle, lanes = 0.5 * (lower + upper), min(search.rows, LANES)
        self.effects = BatchEffects(self.view, middle, self.scene, table, lanes)

    def fits(self, data: BatchData, minima: BatchMinima) -> BatchFits:
        """Errors and status of spectra by their data and minima."""
        spectra, orders, count = minima.values.shape
        value, stderr, noise = np.full((3, spectra, count), np.nan)
        (chi2, rms), status = np.full((2, spectra), np.nan), np.full(spectra, CODES[NO_DATA], np.uint8)
        every, above = np.full(minima.values.shape, np.nan), np.full((spectra, orders), np.inf)
        result = BatchFits(value, stderr, noise, status, every, above, chi2, rms)
        known = np.isfinite(minima.deviance[:, 0])
        for group in groups(self.view, data.weight, known):
            for part in group.chunks(BLOCK):
                found = self._fits(data, minima, part)
                turned = np.flatnonzero(found.delta_chi2.min(axis=1) <= -CLEAR)
                if len(turned):
                    who, which = part.spectra[turned], np.argmin(found.delta_chi2[turned], axis=1)
                    led = _led_by(self.search, data, minima, who, which)
                    again = self._fits(data.of(who), led, part.of(turned))
                    better = again.delta_chi2.min(axis=1) > -CLEAR
                    for column, own in zip(found, again, strict=True):
                        column[turned[better]] = own[better]
                for column, own in zip(result, found, strict=True):
                    column[part.spectra] = own
        order = np.argsort(result.delta_chi2[:, 1:], axis=1, kind="stable") + 1
        rows, order = np.arange(spectra)[:, None], np.pad(order, [(0, 0), (1, 0)])
        delta = np.maximum(result.delta_chi2[rows, order], 0.0)
        return result._replace(minima=result.minima[rows, order], delta_chi2=delta)

    def far(self, data: BatchData, minima: BatchMinima) -> np.ndarray:
        """Signs (spectra, rows, channels) of residuals that are outliers of their spectrum with the effects
        allowed for, else 0; NaN where nothing was measured."""
        result = np.full((len(data.values), self.view.rows, self.view.channels), np.nan)
        for group in groups(self.view, data.weight, np.isfinite(minima.deviance[:, 0])):
            _, ranked, jacobian, evidence = self._linear(data, minima, group)
            units = ranked.minima.units[:, 0]
            [left] = discrepancy([evidence], jacobian, units, contributions=False).remaining
            rows = np.arange(self.view.rows)[None] if group.rows is None else group.rows
            result[group.spectra[:, None], rows, : left.far.shape[-1]] = left.far
        return result

    def responses(self, data: BatchData, units: np.ndarray) -> np.ndarray:
        """Changes (spectra, effects, parameters) of the parameters, in their own units, by one standard
        uncertainty of each effect, at points `units` (spectra, parameters) near minima; 0 without data."""
        best = polish.in_rows(polish.at_best, self.search.static, self.search.common, data, units)
        curves = {name: getattr(best, name) for name in ("model", "signal", "gain", "offset", "slope")}
        points = best.units, self.problem.values(best.units), best.deviance, best.misfit
        names = "units", "values", "deviance", "misfit"
        minima = BatchMinima(
            converged=np.ones((len(units), 1), bool),
            profile=np.zeros((len(units), 0)),
            thickness=self.search.thickness,
            **{name: np.asarray(x)[:, None] for name, x in zip(names, points, strict=True)},
            **curves,
        )
        result = np.zeros((len(units), 0, units.shape[1]))
        for group in groups(self.view, data.weight, np.isfinite(best.deviance)):
            for part in group.chunks(BLOCK):
                _, ranked, jacobian, evidence = self._linear(data, minima, part)
                found = discrepancy([evidence], jacobian, ranked.minima.units[:, 0]).contributions
                if not result.size and found:
                    result = np.zeros((len(units), len(found), units.shape[1]))
                for i, effect in enumerate(found):
                    result[part.spectra, i] = effect.changes[:, : units.shape[1]]
        return np.where(np.isfinite(result), result, 0.0)

    def _fits(self, data: BatchData, minima: BatchMinima, group: Group) -> BatchFits:
        """Fits of a group; the first minimum of a spectrum is its answer, even if another is better."""
        linear = whole, ranked, jacobian, evidence = self._linear(data, minima, group)
        [view], [fit], who = ranked.searched.views, ranked.fits, group.spectra
        units = ranked.minima.units[:, 0]
        systematic = discrepancy([evidence], jacobian, units, contributions=False)
        [remaining] = systematic.remaining
        wrong = misfit(systematic, remaining, accuracy(view, self.calibrated, np.asarray(view.data.values)))
        doubtful = np.flatnonzero((remaining.ratio > DOUBTFUL) & ~wrong)
        if len(doubtful):
            again = discrepancy([evidence.of(doubtful)], jacobian.of(doubtful), units[doubtful])
            wrong[doubtful] = other_material(again.contributions) >= 0
        counted = by_remaining(ranked, systematic)
        covariance, models = linearised(counted)[1], LocalModels(self.problem, whole, counted)
        numbers = verdicts(
            *(ranked, covariance, systematic),
            self._above(data, minima, group, linear, systematic),
            lambda: models.neighbourhood(covariance.covariance),
            self._flat_sides(minima, who, gains(systematic)[0], models, ~wrong),
            misfit=wrong,
            amend=lambda limits: self._amended(limits, ranked, models, systematic.errors.covariance),
        )
        return BatchFits(
            values=ranked.values,
            stderr=numbers.limits.stderr,
            stderr_noise=numbers.noise.stderr,
            status=np.array([CODES[str(status)] for status in ORDER], np.uint8)[numbers.status.position],
            minima=minima.values[who],
            delta_chi2=numbers.delta_chi2,
            chi2_reduced=ranked.chi2_reduced,
            rms=view.rms(fit.at.model),
        )

    def _linear(self, data: BatchData, minima: BatchMinima, group: Group) -> _Linear:
        """The view of the spectra of a group at all points, and their ranked minima with the Jacobian and the
        evidence at the first."""
        whole, every, view, at = self._seen(data, minima, group)
        who, problem = group.spectra, self.problem._replace(views=(view,))
        candidates = Minima(minima.units[who], minima.deviance[who], minima.converged[who])
        ranked = ranked_by_factor(problem, candidates, minima.misfit[who], at)
        [after], [fit] = ranked.problem.views, ranked.fits
        jacobian = linearised(ranked)[0]
        effects = [
            replace(effect, change=group.measured(effect.change))
            for effect in self.effects.changes(whole, every, ranked.values)
        ]
        [block] = jacobian.blocks([view.points], [fit.variance])
        return whole, ranked, jacobian, spectrum_evidence(after, at, block, effects)

    def _above(
        self, data: BatchData, minima: BatchMinima, group: Group, linear: _Linear, allowed: Discrepancy
    ) -> np.ndarray:
        """Δχ² (spectra, minima) of the minima, with the effects integrated out where they may turn it."""
        _, ranked, jacobian, evidence = linear
        above = above_best(ranked, allowed)
        near = turnable(above, allowed) & ranked.minima.converged & (np.arange(above.shape[1]) > 0)
        of, position = np.nonzero(near)
        if len(of):
            [weights], who = left_weights([evidence], allowed), group.spectra[of]
            left = [weights[of]], allowed.total[of]
            best = marginal([evidence.of(of)], jacobian.of(of), ranked.minima.units[of, 0], *left)
            rivals = _led_by(self.search, data, minima, who, position)
            _, _, slopes, there = self._linear(data.of(who), rivals, group.of(of))
            rise = marginal([there], slopes, rivals.units[:, 0], *left).deviance - best.deviance
            wider = np.broadcast_to(student(ranked.freedom, RIVAL), len(above))[of]
            above[of, position] = rise / wider**2
        return above

    def _seen(
        self, data: BatchData, minima: BatchMinima, group: Group
    ) -> tuple[SpectrumView, Local, SpectrumView, Local]:
        """The view of the spectra of a group with its best models at all points, and at those measured."""
        view, own = self.view, data.of(group.spectra)
        arrays = view.data._replace(
            values=own.values,
            weight=own.weight,
            position=np.asarray(view.data.position)[: view.points],
            level=own.level,
            frame=own.frame,
        )
        whole = replace(view, data=arrays)
        names, unused = Local._fields[:5], np.zeros(0)
        curves = {name: getattr(minima, name)[group.spectra] for name in names}
        every = Local(**curves, layer=unused, layer_slope=unused)
        if group.rows is None:
            return whole, every, replace(whole, sweeps=group.parts), every

        def measured(x: Any) -> np.ndarray:
            rows = x.reshape(len(own.values), view.rows, -1, *x.shape[2:])
            return group.measured(rows).reshape(len(x), -1, *x.shape[2:])

        position = np.broadcast_to(arrays.position, own.values.shape)
        few = arrays._replace(
            values=measured(own.values), weight=measured(own.weight), position=measured(position)
        )
        if own.frame is not None:
            few = few._replace(frame=group.measured(own.frame))
        seen = replace(whole, data=few, points=few.values.shape[1], sweeps=group.parts)
        return whole, every, seen, every._replace(**{name: measured(x) for name, x in curves.items()})

    def _flat_sides(
        self,
        minima: BatchMinima,
        who: np.ndarray,
        gain: np.ndarray,
        models: LocalModels,
        usable: np.ndarray,
    ) -> dict[int, np.ndarray]:
        """On which sides (spectra, 2) of the best thickness the misfit, times a `gain` (spectra,), never
        rises, or only to a plateau."""
        depth = self.problem.thickness_axis
        if depth is None or minima.profile.shape[1] < 2:
            return {}
        scan = gain[:, None] * _resampled(self.grid, minima.thickness, minima.profile[who])
        return {depth: models.flat_sides(depth, self.grid, scan, usable)}

    def _amended(self, limits: Any, ranked: RankedMinima, models: LocalModels, covariance: np.ndarray) -> Any:
        """Limits by what a drift of scale and offset could imitate, and of layers that are not needed."""
        if len(self.scene.layers) != 1 or self.problem.thickness_axis is None:
            return limits
        if drifts(self.scene):
            limits = bounded_by_drift(limits, ranked, models.thinnest()[..., None])
        count = limits.stderr.shape[-1]
        return unlimited(limits, ranked, models.unneeded(covariance[:, :count, :count]))


def _led_by(
    search: BatchSearch, data: BatchData, minima: BatchMinima, who: np.ndarray, which: np.ndarray
) -> BatchMinima:
    """Minima of the spectra `who` with those at positions `which` in front, after a step to them."""
    own = {name: np.array(x[who]) for name, x in minima._asdict().items() if name != "thickness"}
    rows, pair = np.arange(len(who))[:, None], np.stack([np.zeros_like(which), which], axis=1)
    for name in ("values", "units", "deviance", "misfit", "converged"):
        own[name][rows, pair] = own[name][rows, pair[:, ::-1]]
    about = search.static, search.common, data.of(who)
    units = polish.in_rows(polish.at_best, *about, own["units"][:, 0]).units
    best = polish.in_rows(polish.at_best, *about, units)
    own |= {name: getattr(best, name) for name in ("model", "signal", "gain", "offset", "slope")}
    own["profile"] += (minima.deviance[who, 0] - best.deviance)[:, None]
    first = units, search.problem.values(units), best.deviance, best.misfit
    for name, x in zip(("units", "values", "deviance", "misfit"), first, strict=True):
        own[name][:, 0] = x
    return BatchMinima(thickness=minima.thickness, **own)


def _resampled(grid: np.ndarray, thickness: np.ndarray, profile: np.ndarray) -> np.ndarray:
    """A scan (spectra, nodes) against thickness at the values of another grid, linearly."""
    at = np.clip(np.searchsorted(thickness, grid) - 1, 0, len(thickness) - 2)
    share = np.clip((grid - thickness[at]) / (thickness[at + 1] - thickness[at]), 0.0, 1.0)
    return profile[:, at] * (1 - share) + profile[:, at + 1] * share
