"""Climbing a ladder: every rung compiled, run in turns with the others, and set against the reference."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np

from pellicle.accuracy.case import Case
from pellicle.accuracy.compiled import Program, compiled
from pellicle.accuracy.methods import FORWARD, Rung
from pellicle.accuracy.reference import Reference, reference
from pellicle.errors import UsageError

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how much is done and how much there is."""

ROUNDS, SECONDS = 40, 15.0
"""Most rounds in which the rungs take turns, and about how long all of them together may take."""


@dataclass
class MethodResult:
    """What a rung costs and how far off it is.

    `error` is in the signal's unit; `seconds` is the median time of one spectrum, colour or sample,
    compilation apart; `flops` is XLA's count for it.
    """

    name: str
    leaves_out: str
    error: float
    seconds: float
    compile_seconds: float
    flops: float | None
    pareto: bool = False


@dataclass
class Ladder:
    """The forward rungs of one case, the fastest first, and those that make no sense for it, with why.

    A `sample` is what one evaluation gives: a spectrum of so many wavelengths, a colour, a BRDF.
    """

    reference: str
    tolerance: float
    unit: str
    wavelengths: int
    draws: int
    sample: str = "spectrum"
    rungs: list[MethodResult] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    interrupted: bool = False

    @property
    def within(self) -> bool:
        """Whether any rung meets the tolerance."""
        return any(rung.error <= self.tolerance for rung in self.rungs)

    @property
    def recommended(self) -> str | None:
        """The fastest rung within the tolerance, or the most accurate where none is."""
        good = [rung for rung in self.rungs if rung.error <= self.tolerance]
        if good:
            return min(good, key=lambda rung: rung.seconds).name
        return min(self.rungs, key=lambda rung: rung.error).name if self.rungs else None


def climb(case: Case, against: str, progress: Progress, rungs: Sequence[Rung] = FORWARD) -> Ladder:
    """Measure every rung of a case.

    Raises UsageError for a reference that the case cannot be computed with, ValueError where a material
    has no data at a wavelength.
    """
    truth = reference(against, case)
    _check(truth, case)
    unit = "degrees" if case.ellipsometric else case.plan.signal
    ladder = Ladder(truth.name, case.tolerance, unit, len(truth.wavelengths), len(truth.draws))

    def prepare(rung: Rung) -> Program | str:
        way = rung.way(case)
        return way if isinstance(way, str) else compiled(case, way)

    return measured(ladder, rungs, prepare, lambda answer: truth.error(case, answer), progress)


@runtime_checkable
class Named(Protocol):
    """A rung by its name, and what it leaves out."""

    @property
    def name(self) -> str: ...
    @property
    def leaves_out(self) -> str: ...


def measured(
    ladder: Ladder,
    rungs: Sequence[Any],
    prepare: Callable[[Any], Program | str],
    error: Callable[[np.ndarray], float],
    progress: Progress,
) -> Ladder:
    """The ladder with every rung measured: its program, or why there is none, by `prepare`, and the error
    of its answer. Ctrl-C ends it, and keeps what was measured."""
    runs: list[_Run] = []
    try:
        _compile(ladder, rungs, prepare, error, runs, progress)
        _take_turns(runs, progress)
    except KeyboardInterrupt:
        ladder.interrupted = True
    ladder.rungs = sorted((run.standing() for run in runs if run.times), key=lambda rung: rung.seconds)
    mark_pareto(ladder.rungs)
    return ladder


def _check(truth: Reference, case: Case) -> None:
    """UsageError where there is no signal to be wrong about."""
    known = truth.values[np.isfinite(truth.values)]
    if known.size == 0:
        raise UsageError("there is nothing to compute: the signal is no number anywhere between the bounds")
    if not np.any(known):
        raise UsageError(
            f"there is nothing to compute: {case.plan.signal} is 0 everywhere between the bounds"
        )


@dataclass
class _Run:
    """A rung while it is measured."""

    rung: Named
    program: Program
    error: float
    times: list[float] = field(default_factory=list)

    def standing(self) -> MethodResult:
        program = self.program
        return MethodResult(
            self.rung.name,
            self.rung.leaves_out,
            self.error,
            statistics.median(self.times),
            program.compile_seconds,
            program.flops,
        )


def _compile(
    ladder: Ladder,
    rungs: Sequence[Any],
    prepare: Callable[[Any], Program | str],
    error: Callable[[np.ndarray], float],
    runs: list[_Run],
    progress: Progress,
) -> None:
    """Compile and run each rung once. It counts as measured from then on."""
    for done, rung in enumerate(rungs):
        progress(f"compile {rung.name}", done, len(rungs))
        program = prepare(rung)
        if isinstance(program, str):
            ladder.left_out[rung.name] = program
            continue
        runs.append(_Run(rung, program, error(program.run())))
        runs[-1].times.append(program.seconds())


def _take_turns(runs: list[_Run], progress: Progress) -> None:
    """Time the rungs round after round, so that a noisy machine is noisy for all."""
    began = time.perf_counter()
    for done in range(ROUNDS):
        if done > 4 and time.perf_counter() - began > SECONDS:
            break
        progress("rounds", done, ROUNDS)
        for run in runs:
            run.times.append(run.program.seconds())


def mark_pareto(rungs: Sequence[Any]) -> None:
    """Mark the rungs that no other beats in error or time without being worse in the other."""
    for rung in rungs:
        beaten = (
            other.error <= rung.error
            and other.seconds <= rung.seconds
            and (other.error < rung.error or other.seconds < rung.seconds)
            for other in rungs
        )
        rung.pareto = not any(beaten)


@runtime_checkable
class Entrant(Protocol):
    """Something with a name; `missing` is a package that it needs and that is not installed."""

    @property
    def name(self) -> str: ...

    @property
    def missing(self) -> str | None: ...


Kind = TypeVar("Kind", bound=Entrant)


def entrants(
    given: Sequence[Kind], first: Callable[[Kind], object], left_out: dict[str, str], progress: Progress
) -> Iterator[tuple[Kind, float]]:
    """Each that can take part, with the seconds of its `first` use, compilation included.

    The others go into `left_out`, with why.
    """
    for done, one in enumerate(given):
        progress(f"compile {one.name}", done, len(given))
        if one.missing:
            left_out[one.name] = f"{one.missing} is not installed"
            continue
        began = time.perf_counter()
        first(one)
        yield one, time.perf_counter() - began
