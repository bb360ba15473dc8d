"""Pellicle and the other programs in turn on the files of a case, in a process of their own.

The first call of pellicle is timed in two new processes: one with an empty cache of compiled programs, one
with the cache that the first has filled. The second process then fits a few files as it does before programs
pay (`programs.cache.kept`), and every file with every program, in turns, with all programs compiled.
The other programs get the least effort (starts, or size of the population) with which they find the right
answer in 95 % of the files; the search for it is not timed.
"""

from __future__ import annotations

import os
import statistics
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, NamedTuple

import jax
import numpy as np

from whole_fits.cases import Case, cases, measurement
from whole_fits.competitors import COMPETITORS, Competitor, polished
from whole_fits.problem import Problem

Array = np.ndarray
RIGHT_CHI2 = 4.0
"""An answer is right where χ², with the simulated noise as σ, is at most this much above the minimum that is
reached from the true values: within two standard errors. In pellicle the drift of a lamp has a prior, which
moves the minimum of soap films by up to 2; otherwise right answers agree within 0.1."""
FEWEST_RIGHT = 0.95
TUNING_FILES = 20
_EARLY = 6
"""Files of the first calls of a process."""
PELLICLE, SEARCH = "pl.fit", "its search"


class Time(NamedTuple):
    """Processor time of all threads, and wall time (s)."""

    processor: float
    wall: float


class Result(NamedTuple):
    """One program on all files: median time, effort, and how many of the files it fitted right."""

    name: str
    time: Time
    effort: str
    right: int
    files: int

    @property
    def succeeds(self) -> bool:
        return self.right >= FEWEST_RIGHT * self.files


class Compared(NamedTuple):
    """The results of a case, those of `pl.fit` and of its search first, the first calls of `pl.fit` with
    an empty and with a filled cache, and the median of the few calls after it."""

    case: str
    target: float
    rows: int
    compiles: Time
    loads: Time
    early: Time
    results: list[Result]


def timed(run: Callable[[], Any]) -> tuple[Time, Any]:
    """The time of one call, and what it returns."""
    processor, wall = time.process_time(), time.perf_counter()
    answer = run()
    return Time(time.process_time() - processor, time.perf_counter() - wall), answer


def compared(chosen: int, files: int | None) -> Compared:
    """Compare the programs on a case, in new processes."""
    case = cases()[chosen]
    with tempfile.TemporaryDirectory() as folder:
        compiles = _in_new_process(first_call, chosen, folder)
        loads, early, results = _in_new_process(all_files, chosen, folder, files or case.files)
    [view] = case.points[:1]
    rows = view.size * (2 if case.scene.light.signal == "psi-delta" else 1)
    return Compared(case.name, case.target, rows, compiles, loads, early, results)


def _in_new_process(function: Callable[..., Any], *arguments: Any) -> Any:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(function, *arguments).result()


def first_call(chosen: int, folder: str) -> Time:
    """Time of the first fit of a process."""
    _start(folder)
    case = cases()[chosen]
    return timed(lambda: _by_pellicle(case, measurement(case, 0).spectrum))[0]


def all_files(chosen: int, folder: str, files: int) -> tuple[Time, Time, list[Result]]:
    """The first call of pellicle with a filled cache, the few after it, and all programs on all files."""
    from pellicle.programs import cache

    loads, case = first_call(chosen, folder), cases()[chosen]
    measured = [measurement(case, seed) for seed in range(files)]
    early = [timed(lambda one=one: _by_pellicle(case, one.spectrum))[0] for one in measured[1:_EARLY]]
    with cache.compiled_at_once():
        _by_pellicle(case, measured[0].spectrum)
    problems = [Problem(case, one) for one in measured]
    least = [_chi2(problem, polished(problem, problem.truth)) for problem in problems]
    efforts = [_least_effort(each, problems, least) for each in COMPETITORS]
    _search(case, measured[0].spectrum)  # loads what a first fit has not loaded
    names = PELLICLE, SEARCH, *(each.name for each in COMPETITORS)
    times, right = {name: [] for name in names}, dict.fromkeys(names, 0)
    for seed, (one, problem) in enumerate(zip(measured, problems, strict=True)):
        runs = {
            PELLICLE: lambda one=one: _by_pellicle(case, one.spectrum),
            SEARCH: lambda one=one: _search(case, one.spectrum),
        }
        for each, effort in zip(COMPETITORS, efforts, strict=True):
            runs[each.name] = lambda each=each, effort=effort, p=problem, s=seed: each.find(p, effort, s)
        for name, run in runs.items():
            spent, answer = timed(run)
            times[name].append(spent)
            ours = name in (PELLICLE, SEARCH)
            unit = (answer - problem.lower) / problem.width if ours else answer
            right[name] += bool(_chi2(problem, unit) < least[seed] + RIGHT_CHI2)
    words = ["", "", *(f"{n} {each.unit}" for n, each in zip(efforts, COMPETITORS, strict=True))]
    medians = [_median(times[name]) for name in names]
    return (
        loads,
        _median(early),
        [
            Result(name, spent, word, right[name], files)
            for name, spent, word in zip(names, medians, words, strict=True)
        ],
    )


def _median(times: list[Time]) -> Time:
    return Time(*(statistics.median(column) for column in zip(*times, strict=True)))


def _start(folder: str) -> None:
    from pellicle.cli import session

    jax.config.update("jax_platforms", "cpu")
    os.environ[session.CACHE_VARIABLE] = folder
    session.start()


def _by_pellicle(case: Case, spectrum: Any) -> Array:
    import pellicle as pl

    fit = pl.fit(spectrum, case.scene)
    return np.array([fit[name].value for name in case.limits])


def _search(case: Case, spectrum: Any) -> Array:
    """The best values by the part of a fit that the other programs do: scan and polish."""
    from pellicle.fitting.film.fit import measurements
    from pellicle.fitting.film.problem import make
    from pellicle.fitting.film.search import search
    from pellicle.fitting.progress import quiet

    with jax.enable_x64(True):
        problem = make(*measurements(spectrum, case.scene))
        best = np.asarray(problem.values(search(problem, quiet).units[0]))
    values = {p.name: value for p, value in zip(problem.parameters, best, strict=True)}
    return np.array([values[name] for name in case.limits])


def _chi2(problem: Problem, unit: Array) -> float:
    return float(problem.chi2(unit[None])[0])


def _least_effort(competitor: Competitor, problems: list[Problem], least: list[float]) -> int:
    """The least effort that succeeds on the first files, or else the greatest."""
    some = list(zip(problems, least, strict=True))[:TUNING_FILES]
    allowed = len(some) - FEWEST_RIGHT * len(some) + 1e-9
    for effort in competitor.efforts:
        wrong = 0
        for seed, (problem, best) in enumerate(some):
            wrong += _chi2(problem, competitor.find(problem, effort, seed)) >= best + RIGHT_CHI2
            if wrong > allowed:
                break
        else:
            return effort
    return competitor.efforts[-1]
