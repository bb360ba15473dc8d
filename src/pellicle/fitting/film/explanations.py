"""Explanations of a misfit: usual mistakes tried as refits, and words on those that explain the data."""

import math
from collections.abc import Callable, Iterable, Sequence
from logging import getLogger
from typing import Any, NamedTuple

import numpy as np

from pellicle.errors import DataError
from pellicle.fitting.discrepancy import Contribution
from pellicle.fitting.film import mistakes
from pellicle.fitting.film.mistakes import Mistake
from pellicle.fitting.film.other_readings import Data, folded, readings
from pellicle.fitting.film.parameters import thickness_name
from pellicle.fitting.film.problem import Measured, Target, make
from pellicle.fitting.film.search import search
from pellicle.fitting.linear_system import huber_roots
from pellicle.fitting.minima import minima
from pellicle.fitting.noise import short_range_noise
from pellicle.fitting.problem import Problem
from pellicle.fitting.progress import Progress, quiet
from pellicle.fitting.result import Estimate, Fit, Status
from pellicle.fitting.reweighting import RankedMinima
from pellicle.fitting.status import RIVAL, describe

log = getLogger(__name__)

_NO_FIT = (Status.FAILED, Status.NOT_CONVERGED, Status.MISFIT)
_NOISE, _CLEARLY = 1.5, 0.3
"""Residuals in units of the noise up to which they are noise, and the share of them, in amplitude, that a
mistake which is named may leave."""
_COMPILED, _POINTS = 3, 0.15
"""Most refits that compile a program of their own, and the share of the residuals that an effect explains at
least that points to one beside what explains the data already."""
_STARTS, _REFINED, _FALLS, _NAMED = 6, 7, 0.8, 3
"""Minima from which a number is followed; steps of successive parabolas that refine it from its grid, if the
deviance has fallen to that share; most mistakes that are named where data do not tell them apart."""


class Tried(NamedTuple):
    """A mistake at a value: targets and data without it, the deviance of the best minimum, and the residuals
    there in units of the noise."""

    mistake: Mistake
    value: Any
    targets: list[Any]
    data: Data
    deviance: float = math.inf
    excess: float = math.inf


def explanations(
    data: Data,
    targets: list[Target],
    fit: Fit,
    ranked: RankedMinima,
    rows: Sequence[Contribution],
    measure: Callable[[Data], list[Target]],
    refit: Callable[[Data, list[Target]], Fit],
    progress: Progress,
) -> tuple[list[str], frozenset[str]]:
    """Sentences on the usual mistakes that would explain data that misfit, and the effects that do not.

    `rows` are the systematic effects of the fit, `measure` the targets of other data, and `refit` fits them.
    """
    every = [target for target in targets if isinstance(target, Measured)]
    if len(every) < len(targets):  # the residuals of colours are too few
        return [], frozenset()
    lead, trials = next(p for p in fit.parameters.values() if p.free), _Trials(data, ranked, progress)
    layers = range(len(targets[0].scene.layers))
    depth = next((i for i in layers if thickness_name(targets[0].scene, i) == lead.name), None)
    trials.read(readings(data, [part.rms for part in fit.parts]), measure)
    if not trials.explained:
        trials.all_of([*mistakes.of_light(every), *mistakes.of_media(every, depth)], every)
        trials.all_of(_pointed_to(mistakes.of_structure(every), rows, trials.explained), every, True)
    # within 0 to 180 degrees 360 - delta may be delta whose sign was not measured
    if all(x.data is not data for x in trials.explained):
        trials.read(folded(data), measure)
    before = _excess(ranked.problem, ranked.minima.units[0])
    found: list[tuple[Tried, Fit]] = []
    likely = [x for x in trials.done if x.excess < max(_NOISE, _CLEARLY * before)]
    points = sum(view.rows for view in ranked.problem.views)
    for x in sorted(likely, key=lambda x: x.excess)[:_NAMED]:
        if found and points * (x.excess**2 / found[0][0].excess ** 2 - 1) > 2 * RIVAL:
            break
        if (again := refit(x.data, x.targets)).status not in _NO_FIT:
            found.append((x, again))
    found.sort(key=lambda pair: _index_alone(pair[0]))
    named = {name for x, _ in found for name in x.mistake.effects}
    refuted = {name for x in trials.done for name in x.mistake.effects} - named
    own = None if depth is None else targets[0].scene.layers[depth]
    sentences = [_sentence(x, again, lead, own) for x, again in found]
    if len(found) > 1:
        sentences = [f"the data do not tell {len(found)} mistakes apart: {'; or '.join(sentences)}"]
    return [*sentences, *_disagreement(ranked, trials)], frozenset(refuted)


def _pointed_to(
    every: Iterable[Mistake], rows: Sequence[Contribution], explained: list[Tried]
) -> list[Mistake]:
    """The few mistakes to which those effects point that explain most of the residuals; where something
    explains the data, only those that act alike and explain some."""
    alike = {name for x in explained for name in x.mistake.effects}
    effects = [(row.effect.name, row.explains) for row in rows]
    shares = [
        (max((x for name, x in effects if name.startswith(mistake.effects)), default=0.0), mistake)
        for mistake in every
        if not explained or alike & {*mistake.effects}
    ]
    shares.sort(key=lambda pair: -pair[0])
    return [mistake for share, mistake in shares[:_COMPILED] if share > _POINTS or not explained]


class _Trials:
    """Searches with one mistake mended in each; those of the fit's own parameters start from its minima."""

    def __init__(self, data: Data, ranked: RankedMinima, progress: Progress):
        self.data, self.progress, self.done = data, progress, list[Tried]()
        self.static = ranked.problem.static
        self.parameters, self.starts = ranked.problem.parameters, ranked.minima.units[:_STARTS]

    @property
    def explained(self) -> list[Tried]:
        return [x for x in self.done if x.excess < _NOISE and not _index_alone(x)]

    def one(self, trial: Tried, compiled: bool = False) -> None:
        self.done.append(self._searched(trial, True, compiled))
        about = trial.mistake.stage, trial.value, self.done[-1].excess
        log.info("%s (%s): residuals are %.3g times the noise", *about)

    def read(self, others: Iterable[tuple[str, str, Data]], measure: Callable[[Data], list[Target]]) -> None:
        """Try other readings of the data."""
        for words, remedy, other in others:
            self.one(Tried(Mistake(words, remedy, (), lambda t, _: t), 0.0, measure(other), other), True)

    def all_of(self, every: Iterable[Mistake], targets: list[Measured], compiled: bool = False) -> None:
        """Try mistakes at their values, of a number of which there is a grid at the best; those of another
        program where it may be `compiled`."""
        for mistake in every:
            self.progress(mistake.stage, 0, 1)
            numbers = isinstance(mistake.values, np.ndarray)
            for value in [self._best(mistake, targets)] if numbers else mistake.values:
                try:
                    changed = [mistake.change(target, value) for target in targets]
                    self.one(Tried(mistake, value, changed, self.data), compiled)
                except DataError:  # of a material that is not known at these wavelengths
                    continue

    def _best(self, mistake: Mistake, targets: list[Measured]) -> float:
        """The number of a mistake at which the deviance is least, by successive parabolas."""
        known: dict[float, float] = {}
        values = np.asarray(mistake.values, dtype=float)
        first, last, todo = values[0], values[-1], values.tolist()
        middle = todo[len(todo) // 2]  # nothing changes there
        for _ in range(len(todo) + _REFINED):
            if not todo:
                best = min(known, key=lambda x: known[x])
                if known[best] > _FALLS * known[middle]:
                    break
                near = sorted((x for x in known if known[x] < math.inf), key=lambda x: abs(x - best))[:3]
                if len(near) < 3:
                    break
                bend, slope, _ = np.polyfit(np.array(near) - best, [known[x] for x in near], 2)
                reach = max(abs(x - best) for x in near)
                step = np.clip(-slope / (2 * bend), -reach, reach) if bend > 0 else reach / 2
                todo = [np.clip(best + step, first, last)]
            x = float(todo.pop(0))
            if x in known:
                break
            try:
                changed = [mistake.change(target, x) for target in targets]
                known[x] = self._searched(Tried(mistake, x, changed, self.data), False).deviance
            except DataError:  # wavelengths beyond the table of a material
                known[x] = math.inf
        return min(known, key=lambda x: known[x])

    def _searched(self, trial: Tried, thorough: bool, compiled: bool = False) -> Tried:
        problem = make(*trial.targets)
        if problem.static != self.static and not compiled:
            return trial
        starts = [self.starts] if problem.parameters == self.parameters else []
        if thorough or not starts:
            starts.append(search(problem, quiet, quick=True).units)
        found = minima(problem, np.concatenate(starts))
        return trial._replace(deviance=float(found.deviance[0]), excess=_excess(problem, found.units[0]))


def _index_alone(x: Tried) -> bool:
    """True for an index of another size, which no material needs to have: other mistakes come before it."""
    return x.mistake.words.startswith("an index of")


def _excess(problem: Problem, unit: np.ndarray) -> float:
    """Residuals at a point of the unit cube, in units of the noise of neighbouring points."""
    values, squares = np.asarray(problem.values(unit)), []
    for view in problem.views:
        residual = view.residuals(view.local(problem.seen_by(view, values)))
        left = residual / short_range_noise(residual, view.sweeps, 1e-9)
        squares.append(float(np.mean((huber_roots(left[None])[0] * left) ** 2)))
    return math.sqrt(np.average(squares, weights=[view.rows for view in problem.views]))


def _sentence(x: Tried, again: Fit, lead: Estimate, own: Any) -> str:
    """A sentence on a mistake, what the leading number is without it, and what states that."""
    scene, mistake = x.targets[0].scene, x.mistake
    at = [
        i
        for i, layer in enumerate(scene.layers)
        if own and getattr(layer, "thickness", None) is own.thickness
    ]
    value = again.parameters[thickness_name(scene, at[0]) if at else lead.name]
    numbers = [p.value for p in again.parameters.values() if mistake.key and mistake.key in p.name]
    number = numbers[0] if numbers else x.value
    change = abs(value.value / lead.value - 1) if lead.value else math.inf
    stays = f", within {100 * change:.1g} % of the best fit" if change < 0.01 else ""
    words, remedy = (text.format(number) for text in (mistake.words, mistake.remedy))
    return f"with {words} it would fit, with {describe(value)}{stays}: {remedy}"


def _disagreement(ranked: RankedMinima, trials: _Trials) -> list[str]:
    """A sentence on files of a joint fit that each explain themselves with a thickness of their own."""
    problem, axis, each = ranked.problem, ranked.problem.thickness_axis, []
    for view in problem.views if len(problem.views) > 1 and axis is not None else ():
        views = tuple(v if v is view else v.reweighted(0.0, 1.0) for v in problem.views)
        alone = problem._replace(views=views)
        found = minima(alone, np.concatenate([trials.starts, search(alone, quiet, quick=True).units]))
        if _excess(problem._replace(views=(view,)), found.units[0]) > _NOISE:
            return []
        each.append(f"{view.name} alone gives {np.asarray(problem.values(found.units[0]))[axis]:.4g} nm")
    return (
        [f"the files disagree: {', '.join(each)}; is it the same spot, and is each calibrated?"]
        if each
        else []
    )
