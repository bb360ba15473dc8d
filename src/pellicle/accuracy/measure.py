"""Measurement of methods: each is compiled, timed in turn with the others, and compared with a reference."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np

from pellicle.accuracy.case import Case
from pellicle.accuracy.compiled import Program, compiled
from pellicle.accuracy.methods import METHODS, Method
from pellicle.accuracy.reference import reference_signal
from pellicle.errors import UsageError
from pellicle.fitting.progress import Progress

ROUNDS, SECONDS = 40, 15.0
"""Most rounds in which the methods are timed in turn, and about how long all of them may take together."""


@dataclass
class MethodResult:
    """Error and cost of one method.

    `error` is in the unit of the signal; `seconds` is the median time of one spectrum, colour or sample
    without compilation; `flops` is XLA's count for it, None if it has none. `pareto` is False where another
    method is both faster and more accurate.
    """

    name: str
    leaves_out: str
    error: float
    seconds: float
    compile_seconds: float
    flops: float | None
    pareto: bool = False


@dataclass
class MethodComparison:
    """Results of all methods of one case, the fastest first, and the methods that do not apply, with why.

    A `sample` is what one evaluation computes: a spectrum of `wavelengths` points, a colour, a BRDF.
    """

    reference: str
    tolerance: float
    unit: str
    wavelengths: int
    draws: int
    sample: str = "spectrum"
    results: list[MethodResult] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    interrupted: bool = False

    @property
    def within(self) -> bool:
        """True where any method meets the tolerance."""
        return any(result.error <= self.tolerance for result in self.results)

    @property
    def recommended(self) -> str | None:
        """Name of the fastest method within the tolerance, or of the most accurate where none is."""
        good = [result for result in self.results if result.error <= self.tolerance]
        if good:
            return min(good, key=lambda result: result.seconds).name
        return min(self.results, key=lambda result: result.error).name if self.results else None


def compare_methods(
    case: Case, reference: str, progress: Progress, methods: Sequence[Method] = METHODS
) -> MethodComparison:
    """Measure every method of simulating a case.

    **Raises:** UsageError for a `reference` that cannot compute the case and for a signal that is 0
    everywhere; ValueError where a material has no data at a wavelength.
    """
    truth = reference_signal(reference, case)
    known = truth.values[np.isfinite(truth.values)]
    if known.size == 0:
        raise UsageError("there is nothing to compute: the signal is not finite anywhere between the bounds")
    if not np.any(known):
        raise UsageError(
            f"there is nothing to compute: {case.plan.signal} is 0 everywhere between the bounds"
        )
    unit = "degrees" if case.in_degrees else case.plan.signal
    comparison = MethodComparison(truth.name, case.tolerance, unit, len(truth.wavelengths), len(truth.draws))

    def prepare(method: Method) -> Program | str:
        variant = method.variant(case)
        return variant if isinstance(variant, str) else compiled(case, variant)

    return measure(comparison, methods, prepare, lambda signal: truth.error(case, signal), progress)


@runtime_checkable
class Named(Protocol):
    """A method by its name and by what it leaves out."""

    @property
    def name(self) -> str: ...
    @property
    def leaves_out(self) -> str: ...


@dataclass
class _Run:
    """A method while it is measured."""

    method: Named
    program: Program
    error: float
    times: list[float] = field(default_factory=list)


def measure(
    comparison: MethodComparison,
    methods: Sequence[Any],
    prepare: Callable[[Any], Program | str],
    error: Callable[[np.ndarray], float],
    progress: Progress,
) -> MethodComparison:
    """Fill a comparison with the result of every method.

    `prepare` compiles a method or returns why it does not apply, `error` compares its signal with the
    reference. Ctrl-C ends the measurement and keeps its results so far.
    """
    runs: list[_Run] = []
    try:
        for done, method in enumerate(methods):
            progress(f"compile {method.name}", done, len(methods))
            program = prepare(method)
            if isinstance(program, str):
                comparison.left_out[method.name] = program
                continue
            runs.append(_Run(method, program, error(program.run())))
            runs[-1].times.append(program.seconds())
        _time_in_turns(runs, progress)
    except KeyboardInterrupt:
        comparison.interrupted = True
    results = [
        MethodResult(
            run.method.name,
            run.method.leaves_out,
            run.error,
            statistics.median(run.times),
            run.program.compile_seconds,
            run.program.flops,
        )
        for run in runs
        if run.times
    ]
    comparison.results = sorted(results, key=lambda result: result.seconds)
    mark_pareto(comparison.results)
    return comparison


def _time_in_turns(runs: list[_Run], progress: Progress) -> None:
    """Time the methods round after round, so that noise of the machine affects all of them."""
    began = time.perf_counter()
    for done in range(ROUNDS):
        if done > 4 and time.perf_counter() - began > SECONDS:
            break
        progress("rounds", done, ROUNDS)
        for run in runs:
            run.times.append(run.program.seconds())


def mark_pareto(results: Sequence[Any]) -> None:
    """Mark the results that no other one beats in error or time without being worse in the other."""
    for result in results:
        beaten = (
            other.error <= result.error
            and other.seconds <= result.seconds
            and (other.error < result.error or other.seconds < result.seconds)
            for other in results
        )
        result.pareto = not any(beaten)


@runtime_checkable
class Installable(Protocol):
    """A method that may need a package; `missing` names it where it is not installed."""

    @property
    def name(self) -> str: ...

    @property
    def missing(self) -> str | None: ...


Kind = TypeVar("Kind", bound=Installable)
Item = TypeVar("Item")


def within(items: Iterable[Item], seconds: float) -> Iterator[Item]:
    """Yield the first item, and further ones until `seconds` have passed since then."""
    began = time.perf_counter()
    for item in items:
        yield item
        if time.perf_counter() - began > seconds:
            return


def first_runs(
    methods: Sequence[Kind], run: Callable[[Kind], object], left_out: dict[str, str], progress: Progress
) -> Iterator[tuple[Kind, float]]:
    """Run every installed method once; yield it with the seconds that this takes, compilation included.

    The others go into `left_out`, with why.
    """
    for done, method in enumerate(methods):
        progress(f"compile {method.name}", done, len(methods))
        if method.missing:
            left_out[method.name] = f"{method.missing} is not installed"
            continue
        began = time.perf_counter()
        run(method)
        yield method, time.perf_counter() - began
