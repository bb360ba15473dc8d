"""Registry of methods: what each of them leaves out, and its error and time once measured.

A method computes a signal, a colour, a BRDF, the fit of a simulated spectrum, or intervals of its numbers.
The modules of a kind list their methods: `film_methods`, `colour_methods` (and `rendering.renderer_methods`),
`surface`, `cost` for solvers, `intervals` (and `sampling.sampled_intervals`). Every method is compiled, timed
in turn with the others, and compared with a reference. Solvers are run on simulated data sets with known true
values, whose deviance every one of them minimises.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.accuracy.case import Case, Program, Variant, compiled
from pellicle.fitting.film.problem import Measured, make
from pellicle.fitting.problem import Form, Problem
from pellicle.fitting.progress import Progress
from pellicle.fitting.report_methods import PlotMixin
from pellicle.scene.film import Scene, with_wavelength
from pellicle.scene.free import free_leaves

ROUNDS, SECONDS = 40, 15.0
"""Most rounds in which the methods are timed in turn, and about how long all of them may take together."""

SAMPLES = {"forward": "spectrum", "colour": "colour", "brdf": "sample"}
"""Result of one evaluation of a method, for each kind of method."""


@dataclass(frozen=True)
class Method:
    """A method by its name and by what it leaves out.

    `apply` takes what methods of its kind are applied to, and returns its answer, or why it does not apply:

    - "forward": a `Case` → its `Variant`;
    - "colour": `Films` → a `Program`;
    - "brdf": a view of a surface and a tolerance → a `Plan`;
    - "inverse": a `DataSet` → the best point of the unit cube, (parameters,);
    - "interval": the ranked minima of a fit → lower and upper ends in the unit cube, (parameters,) each.

    `double` is False for single precision. `missing` names a package that the method needs and that is not
    installed.
    """

    name: str
    leaves_out: str
    apply: Callable[..., Any]
    double: bool = True
    missing: str | None = None


@dataclass
class Result:
    """Error and cost of one method.

    `error` is in the unit of the signal; of a fit it is the mean over the data sets of the largest error of
    any parameter relative to its bounds, of intervals the distance of their coverage from 95 %. `seconds` is
    the median time of one spectrum, colour, sample, fit, or of the intervals after a fit, without
    compilation. `pareto` is False where another method is both faster and more accurate.

    `details`, by the kind of the method:

    - a signal, colour or BRDF: `flops`, XLA's count for one sample, None if it has none;
    - a fit: `median_error`; `failures`, the data sets in which the solver stopped more than Δχ² = 6 (a rival)
    above the minimum reached from the true values; `datasets`; - intervals: `coverage`, the share of true
    values inside them, and its binomial standard deviation `doubt`; `width`, their median width relative to
    the bounds; `datasets`.
    """

    name: str
    leaves_out: str
    error: float
    seconds: float
    compile_seconds: float
    details: dict[str, Any] = field(default_factory=dict)
    pareto: bool = False

    def record(self) -> dict[str, Any]:
        """All numbers in one dictionary, an infinite error as None."""
        numbers = asdict(self)
        numbers |= numbers.pop("details")
        return numbers | {"error": self.error if math.isfinite(self.error) else None}


@dataclass
class Comparison:
    """Results of all methods of one kind, the fastest first, and the methods that do not apply, with why.

    Of signals: the name of the `reference`, the `tolerance` in the `unit` of errors, and numbers of
    `wavelengths` (or angles, or pairs of directions) and `draws` between the bounds. Of fits and intervals:
    the `noise` of the simulated spectra and the number that was `requested`, of which the time limit may
    allow fewer.
    """

    kind: str
    reference: str = ""
    tolerance: float = math.inf
    unit: str = ""
    wavelengths: int = 0
    draws: int = 0
    noise: float = math.nan
    requested: int = 0
    results: list[Result] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    interrupted: bool = False

    @property
    def sample(self) -> str:
        """Result of one evaluation: a spectrum, a colour, a sample of a BRDF."""
        return SAMPLES[self.kind]

    @property
    def within(self) -> bool:
        """True where any method meets the tolerance."""
        return any(result.error <= self.tolerance for result in self.results)

    @property
    def recommended(self) -> str | None:
        """Name of the fastest method within the tolerance, or of the most accurate where none is.

        Of solvers it is the fastest among those that failed least, of intervals the fastest whose coverage is
        95 % within two of its standard deviations.
        """

        def rank(result: Result) -> tuple[float, float]:
            details = result.details
            if self.kind == "inverse":
                return details["failures"] / details["datasets"], result.seconds
            if self.kind == "interval":
                return result.error > 2 * details["doubt"], result.seconds
            good = result.error <= self.tolerance
            return not good, result.seconds if good else result.error

        return min(self.results, key=rank).name if self.results else None

    def finish(self, results: Iterable[Result]) -> Comparison:
        """Add the results, sorted by their time, and mark those that no other one beats."""
        self.results = sorted(results, key=lambda result: result.seconds)
        mark_pareto(self.results)
        return self


@dataclass
class Cost(PlotMixin):
    """Accuracy against time for a film or a surface, a comparison for each kind of method.

    Of a film, `methods` compares simulations (or integrations of its colours), `solvers` fits, and
    `intervals` their errors; `no_solvers` says why nothing was fitted. Of a surface, `colours` compares
    colours of its film, or `no_colours` says why it has none, and `values` its BRDF.
    """

    methods: Comparison | None = None
    solvers: Comparison | None = None
    intervals: Comparison | None = None
    colours: Comparison | None = None
    values: Comparison | None = None
    no_solvers: str = ""
    no_colours: str = ""

    @property
    def parts(self) -> list[Comparison]:
        """The comparisons that there are, in the order of their tables."""
        every = (self.methods, self.solvers, self.intervals, self.colours, self.values)
        return [part for part in every if part is not None]

    @property
    def interrupted(self) -> bool:
        """True where Ctrl-C ended the measurement."""
        return any(part.interrupted for part in self.parts)


def mark_pareto(results: Sequence[Result]) -> None:
    """Mark the results that no other one beats in error or time without being worse in the other."""
    figures = np.array([(result.error, result.seconds) for result in results]).reshape(-1, 2)
    for result, own in zip(results, figures, strict=True):
        beaten = np.all(figures <= own, axis=1) & np.any(figures < own, axis=1)
        result.pareto = not beaten.any()


@dataclass
class _Run:
    """A method while it is measured: its times, and its error or its scores on data sets."""

    method: Method
    compile_seconds: float
    times: list[float] = field(default_factory=list)
    error: float = math.nan
    scores: list[Any] = field(default_factory=list)

    def result(self, error: float, compile_seconds: float, details: dict[str, Any]) -> Result:
        about = self.method.name, self.method.leaves_out, error
        return Result(*about, statistics.median(self.times), max(compile_seconds, 0.0), details)


def measure(
    comparison: Comparison,
    methods: Sequence[Method],
    prepare: Callable[[Method], Program | str],
    error: Callable[[np.ndarray], float],
    progress: Progress,
) -> Comparison:
    """Fill a comparison of signals with the result of every method.

    `prepare` compiles a method or returns why it does not apply, `error` compares its signal with the
    reference. Ctrl-C ends the measurement and keeps its results so far.
    """
    runs: list[tuple[_Run, Program]] = []
    try:
        for done, method in enumerate(methods):
            progress(f"compile {method.name}", done, len(methods))
            program = prepare(method)
            if isinstance(program, str):
                comparison.left_out[method.name] = program
                continue
            runs.append((_Run(method, program.compile_seconds, error=error(program.run())), program))
            runs[-1][0].times.append(program.seconds())
        began = time.perf_counter()
        for done in range(ROUNDS):  # in turns, so that noise of the machine affects all of them
            if done > 4 and time.perf_counter() - began > SECONDS:
                break
            progress("rounds", done, ROUNDS)
            for run, program in runs:
                run.times.append(program.seconds())
    except KeyboardInterrupt:
        comparison.interrupted = True
    return comparison.finish(
        run.result(run.error, run.compile_seconds, {"flops": program.flops})
        for run, program in runs
        if run.times
    )


def measure_on_data(
    comparison: Comparison,
    methods: Sequence[Method],
    data: Sequence[DataSet],
    prepare: Callable[[DataSet], tuple[Any, Callable[[Any], Any]]],
    summary: Callable[[list[Any]], tuple[float, dict[str, Any]]],
    progress: Progress,
    time_limit: float = math.inf,
) -> Comparison:
    """Fill a comparison of solvers or intervals with the result of every method that is installed.

    `prepare` returns what methods are applied to for a data set, whose computation is not timed, and the
    function that scores an answer. `summary` turns all scores of a method into its error and details. No data
    set begins later than `time_limit` seconds after the methods are compiled. Ctrl-C ends this and keeps the
    results so far.
    """
    runs: list[_Run] = []
    stage = "intervals" if comparison.kind == "interval" else "data sets"
    try:
        first, _ = prepare(data[0])
        for done, method in enumerate(methods):
            progress(f"compile {method.name}", done, len(methods))
            if method.missing:
                comparison.left_out[method.name] = f"{method.missing} is not installed"
                continue
            began = time.perf_counter()
            method.apply(first)
            runs.append(_Run(method, time.perf_counter() - began))
        began_all = time.perf_counter()
        for done, one in enumerate(data):
            if done and time.perf_counter() - began_all > time_limit:
                break
            progress(stage, done, len(data))
            problem, score = prepare(one)
            for run in runs:
                began = time.perf_counter()
                answer = run.method.apply(problem)
                run.times.append(time.perf_counter() - began)
                run.scores.append(score(answer))
    except KeyboardInterrupt:
        comparison.interrupted = True
    results = []
    for run in runs:
        if run.scores:
            error, details = summary(run.scores)
            compiling = run.compile_seconds - statistics.median(run.times)
            results.append(run.result(error, compiling, details | {"datasets": len(run.times)}))
    return comparison.finish(results)


class DataSet(NamedTuple):
    """A data set to fit, with its true values and start values in the unit cube of the bounds."""

    problem: Problem
    truth: np.ndarray
    start: np.ndarray

    @property
    def program(self) -> tuple[Any, ...]:
        """Arguments of the functions below, the form of the spectrum first (static)."""
        (view,) = self.problem.views
        return view.form, view.arrays, self.problem.box


def data_sets(case: Case, scene: Scene, noise: float, count: int, seed: int = 0) -> list[DataSet]:
    """`count` data sets of a case, with true values uniform between the bounds and normal noise.

    `scene` is that of the case with the scale and offset of its instrument, which are fitted where they are
    free. `noise` is the standard deviation of every point in the unit of the signal; for ellipsometry it is
    in degrees of Ψ, and that of N, C and S twice as large on their sphere.
    """
    scene = with_wavelength(scene, case.wavelength)
    free = [leaf for _, leaf in free_leaves(case.scene)]
    low, high = np.array([f.lower for f in free]), np.array([f.upper for f in free])
    start = (np.array([f.start for f in free]) - low) / (high - low)
    random = np.random.default_rng(seed)
    units = random.uniform(size=(count, len(free)))
    clean = compiled(case._replace(draws=low + units * (high - low)), Variant(case.plan, case.scene)).run()
    sigma = float(np.deg2rad(2 * noise)) if case.in_degrees else noise
    noisy = clean + random.normal(0.0, sigma, clean.shape)
    channels = clean.shape[1] // len(case.wavelength)
    noisy = noisy.reshape(count, -1, channels) if channels > 1 else noisy
    kind = scene.light.kind.seen_in(scene, False)
    nm, sigmas = case.wavelength, np.full(len(case.wavelength), sigma)
    return [
        DataSet(make(Measured(scene, nm, values, sigmas, kind)), unit, start)
        for values, unit in zip(noisy, units, strict=True)
    ]


def residual(form: Form, arrays: Any, box: Any, unit: Any) -> Any:
    """Weighted residuals at one point of the unit cube, with those of the priors."""
    values = box.lower + unit * (box.upper - box.lower)
    return jnp.concatenate([form.explain(arrays, list(values)).residual, box.prior_rows(values)])


def deviance(form: Form, arrays: Any, box: Any, unit: Any) -> Any:
    """Deviance (−2 ln evidence) at one point of the unit cube."""
    values = box.lower + unit * (box.upper - box.lower)
    return form.explain(arrays, list(values)).deviance + jnp.sum(box.prior_rows(values) ** 2)


@partial(jax.jit, static_argnums=0)
def deviances(form: Form, arrays: Any, box: Any, units: Any) -> Any:
    """Deviance at points (points, parameters)."""
    return jax.vmap(lambda unit: deviance(form, arrays, box, unit))(units)


@partial(jax.jit, static_argnums=0)
def deviance_and_slope(form: Form, arrays: Any, box: Any, unit: Any) -> Any:
    """Deviance at one point, and its gradient by forward mode."""
    value, push = jax.linearize(lambda u: deviance(form, arrays, box, u), unit)
    return value, jax.vmap(push)(jnp.eye(len(unit)))
