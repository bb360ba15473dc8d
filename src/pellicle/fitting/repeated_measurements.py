"""Fits of repeated measurements: their scatter, compared with the errors that the fits state.

The Guide to the expression of uncertainty in measurement (JCGM 100:2008, GUM) numbers the equations.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from logging import getLogger

import numpy as np

from pellicle.errors import UsageError
from pellicle.fitting.report_methods import ReportMixin
from pellicle.fitting.result import Estimate, Fit, Status
from pellicle.fitting.status import describe

log = getLogger(__name__)

LEVEL, _PERCENT = 0.95, "95 %"
"""Level of confidence of the expanded uncertainty."""
UNLIKELY = 0.01
"""Probability of χ², on either side, below which scatter and stated errors do not agree."""
_UNUSABLE = (Status.FAILED, Status.NOT_CONVERGED, Status.MISFIT)
_NEARER = 5.0
"""A rival so many times nearer to the other repeats than the best minimum is the one they share."""


_FEWEST, _FAR = 4, 5.0
"""Repeats of which one can be told from the others, and its least distance from them in their scatter."""


class Agreement(StrEnum):
    """Scatter of repeats against their stated noise errors."""

    AGREES = "agrees"
    LARGER = "larger"
    SMALLER = "smaller"


_WORDS = {
    Agreement.AGREES: "the stated noise error agrees with the scatter",
    Agreement.LARGER: "the stated noise error is too small",
    Agreement.SMALLER: "the repeats scatter less than the stated error;"
    " the remainder is common to all of them",
}


@dataclass(frozen=True)
class RepeatedParameter:
    """One parameter in repeated measurements.

    - `values` and `noise`, the standard errors of the noise that the fits state, one for each repeat.
    - `common`: the standard error from effects that all repeats share, which no scatter shows (type B).
    """

    name: str
    unit: str
    values: tuple[float, ...]
    noise: tuple[float, ...]
    common: float = 0.0

    @property
    def mean(self) -> float:
        """Arithmetic mean (GUM eq. 3)."""
        return float(np.mean(self.values))

    @property
    def sd(self) -> float:
        """Experimental standard deviation of one value (GUM eq. 4)."""
        return float(np.std(self.values, ddof=1))

    @property
    def sd_mean(self) -> float:
        """Experimental standard deviation of the mean (GUM eq. 5): the type A standard uncertainty."""
        return self.sd / math.sqrt(len(self.values))

    @property
    def freedom(self) -> int:
        """Degrees of freedom of `sd` and `sd_mean`."""
        return len(self.values) - 1

    @property
    def sd_uncertainty(self) -> float:
        """Relative standard uncertainty of `sd` itself, from the few values it rests on (GUM table E.1)."""
        n = len(self.values)
        c4 = math.sqrt(2 / (n - 1)) * math.exp(math.lgamma(n / 2) - math.lgamma((n - 1) / 2))
        return math.sqrt(1 / c4**2 - 1)

    @property
    def stated(self) -> float:
        """Root mean square of the stated noise errors."""
        return float(np.sqrt(np.mean(np.square(self.noise))))

    @property
    def chi2(self) -> float:
        """χ² of the values about their mean weighted by the stated noise errors, on `freedom`."""
        values, weights = np.array(self.values), 1 / np.square(self.noise)
        return float(np.sum(weights * (values - np.average(values, weights=weights)) ** 2))

    @property
    def ratio(self) -> float:
        """Scatter over the stated noise errors, √(χ² / degrees of freedom): the Birge ratio (R. Birge 1932,
        Phys. Rev. 40, 207)."""
        return math.sqrt(self.chi2 / self.freedom)

    @property
    def probability(self) -> float:
        """Probability that noise as stated gives at least this χ²."""
        from scipy.special import chdtrc  # slow to import

        return float(chdtrc(self.freedom, self.chi2))

    @property
    def agreement(self) -> Agreement:
        """Agreement of the scatter with the stated noise errors."""
        if self.probability < UNLIKELY:
            return Agreement.LARGER
        return Agreement.SMALLER if self.probability > 1 - UNLIKELY else Agreement.AGREES

    @property
    def shared(self) -> float:
        """Standard error of type B: `common`, and where the scatter is too small for the stated noise errors,
        also their remainder, which all repeats have in common as they have a misfit of the scene."""
        hidden = max(self.stated**2 - self.sd**2, 0.0) if self.agreement is Agreement.SMALLER else 0.0
        return math.hypot(self.common, math.sqrt(hidden))

    @property
    def stderr(self) -> float:
        """Combined standard uncertainty of the mean, of types A and B (GUM eq. 10)."""
        return math.hypot(self.sd_mean, self.shared)

    @property
    def effective_freedom(self) -> float:
        """Effective degrees of freedom of `stderr` (GUM eq. G.2b); type B has infinitely many."""
        return self.freedom * (self.stderr / self.sd_mean) ** 4 if self.sd_mean else math.inf

    @property
    def coverage_factor(self) -> float:
        """Factor of `stderr` for a level of 95 %: a quantile of the t distribution (GUM eq. G.1d)."""
        from scipy.special import ndtri, stdtrit

        level = (1 + LEVEL) / 2
        few = math.isfinite(self.effective_freedom)
        return float(stdtrit(self.effective_freedom, level) if few else ndtri(level))

    @property
    def expanded(self) -> float:
        """Expanded uncertainty of the mean at 95 %."""
        return self.coverage_factor * self.stderr


@dataclass(frozen=True)
class Repeat:
    """One repeat: its files, the status of its fit, and the reason why it is left out, if it is."""

    path: str
    status: Status
    left_out: str = ""


@dataclass(frozen=True, repr=False)
class Repeats(ReportMixin):
    """Fits of repeated measurements of one sample: their scatter against the errors that they state.

    `parameters` are the free ones with a finite error in two repeats or more, the leading one first. Those on
    a bound are not compared: `uncompared` are the names of the others.
    """

    repeats: tuple[Repeat, ...]
    parameters: dict[str, RepeatedParameter]
    uncompared: tuple[str, ...]
    warnings: tuple[str, ...]

    @property
    def verdict(self) -> str:
        """Mean of the leading parameter, its scatter, and whether the stated noise error agrees with it."""
        p = next(iter(self.parameters.values()))
        unit = f" {p.unit}" if p.unit else ""
        mean = describe(Estimate(p.name, p.mean, p.sd_mean, p.unit, -math.inf, math.inf, True))
        times = f"{short(p.ratio)} times the stated noise error of {short(p.stated)}{unit}"
        sentence = f"{len(p.values)} repeats: {mean} (mean and its standard deviation)."
        sentence += f" They scatter by {short(p.sd)}{unit}, {times}:"
        whole = math.hypot(p.stated, p.common)
        sentence += f" {_WORDS[p.agreement]}"
        if p.agreement is Agreement.LARGER and p.common and p.sd <= whole:
            sentence += f", though the whole stated error, {short(whole)}{unit}, covers the scatter"
        sentence += "."
        if p.shared:
            sentence += (
                f" With {short(p.shared)}{unit} from effects that all repeats share, the mean is known to"
                f" ± {short(p.expanded)}{unit} ({_PERCENT}, coverage factor {p.coverage_factor:.3g})."
            )
        else:
            sentence += f" At {_PERCENT} the mean is repeatable within ± {short(p.expanded)}{unit}."
        return sentence

    def __getitem__(self, name: str) -> RepeatedParameter:
        return self.parameters[name]

    def __str__(self) -> str:
        return "\n".join([self.verdict, *self.warnings])

    __repr__ = __str__


def repeats(fits: Sequence[Fit]) -> Repeats:
    """Compare the scatter of repeated measurements with the errors that their fits state.

    Repeats are measurements of one spot of one sample, fitted with one scene. What differs from one to the
    next is noise; an effect that they share moves all values alike and remains beside their scatter.

    **Arguments:** `fits`: two or more. Those that did not converge or do not explain their data, and copies
    of an earlier one, are named and left out.

    **Returns:** `Repeats`: for each free parameter the mean, the experimental standard deviation, and χ² of
    the values against the stated noise errors; a verdict.

    **Raises:** UsageError where fewer than two fits are usable, or none of their parameters has an error.

    **Source:** JCGM 100:2008 (GUM), 4.2 for the mean and its standard deviation, annex G for the expanded
    uncertainty.

    ```python
    >>> film = pl.Scene(pl.Layer("SiO2", pl.Free(100, 1000)), "Si")
    >>> truth = pl.Scene(pl.Layer("SiO2", 500.0), "Si")
    >>> fits = [pl.fit(pl.simulate(truth, noise=0.002, seed=seed), film) for seed in range(3)]
    >>> found = pl.fitting.repeats(fits)
    >>> found["thickness"].freedom, found["thickness"].agreement.value
    (2, 'agrees')

    ```
    """
    paths = _paths(fits)
    triples = zip(paths, fits, _reasons(fits, paths), strict=True)
    every = tuple(Repeat(path, fit.status, reason) for path, fit, reason in triples)
    used = [(each.path, fit) for each, fit in zip(every, fits, strict=True) if not each.left_out]
    warnings = [f"{each.path} is left out: {each.left_out}" for each in every if each.left_out]
    unclear = [each for each in every if not each.left_out and each.status is not Status.CONVERGED]
    if len(used) < 2:
        raise UsageError(
            f"repeats need two usable fits or more, and {len(used)} of {len(every)} are"
            + "".join(f"; {warning}" for warning in warnings)
        )
    warnings += [f"{each.path}: its fit is {each.status}" for each in unclear]
    names, compared = dict.fromkeys(p.name for _, fit in used for p in fit.free), {}
    for name in names:
        known = [(path, fit, p) for path, fit in used if (p := fit.parameters.get(name)) and _usable(p)]
        if len(known) < 2:
            continue
        compared[name] = _repeated(name, [p for *_, p in known])
        if compared[name].agreement is Agreement.LARGER:
            warnings += _other_minima(known, name) or _outlier(known, name)
    if not compared:
        raise UsageError(f"no parameter has a finite error in two of the {len(used)} repeats")
    return Repeats(every, compared, tuple(n for n in names if n not in compared), tuple(warnings))


def _usable(p: Estimate) -> bool:
    """True for a free parameter with an error; one that rests on a bound does not scatter."""
    return p.free and not p.at_bound and p.stderr_noise > 0 and math.isfinite(p.stderr)


def _repeated(name: str, estimates: Sequence[Estimate]) -> RepeatedParameter:
    """A parameter with its estimates by all repeats. Logs their scatter."""
    shared = float(np.mean([max(p.stderr**2 - p.stderr_noise**2, 0.0) for p in estimates]))
    values, noise = zip(*((p.value, p.stderr_noise) for p in estimates), strict=True)
    repeated = RepeatedParameter(name, estimates[0].unit, values, noise, math.sqrt(shared))
    log.info(
        "repeats: %s scatters by %.3g, stated noise error %.3g: chi-square %.3g on %d degrees of freedom",
        *(name, repeated.sd, repeated.stated, repeated.chi2, repeated.freedom),
    )
    return repeated


def _paths(fits: Sequence[Fit]) -> list[str]:
    """Names of repeats: their files, numbered where one file has several."""
    names = [", ".join(part.data.path for part in fit.parts if part.data.path) or "repeat" for fit in fits]
    numbers = [names[: i + 1].count(name) for i, name in enumerate(names)]
    pairs = zip(names, numbers, strict=True)
    return [f"{name} ({number})" if names.count(name) > 1 else name for name, number in pairs]


def _reasons(fits: Sequence[Fit], paths: Sequence[str]) -> list[str]:
    """Reasons to leave out the numbers of each fit: it is not usable or a copy; empty where they are used."""
    reasons = []
    for i, fit in enumerate(fits):
        reason = f"its fit is {fit.status}" if fit.status in _UNUSABLE else ""
        for path, earlier in zip(paths[:i], fits[:i], strict=True):
            pairs = zip(fit.parts, earlier.parts, strict=False)
            if all(np.array_equal(a.data.values, b.data.values) for a, b in pairs):
                reason = f"it holds the same numbers as {path}"
                break
        reasons.append(reason)
    return reasons


def _other_minima(known: Sequence[tuple[str, Fit, Estimate]], name: str) -> list[str]:
    """Sentences on fits whose best minimum is not that of the others, though a rival of theirs is."""
    result = []
    for path, fit, p in known:
        others = float(np.median([q.value for other, _, q in known if other != path]))
        values = {r.parameters.get(name, math.inf): r.delta_chi2 for r in fit.rivals}
        nearest = min(values, key=lambda value: abs(value - others), default=math.inf)
        if _NEARER * abs(nearest - others) < abs(p.value - others):
            unit = f" {p.unit}" if p.unit else ""
            result.append(
                f"{path} lies in another minimum: {name} {p.value:.5g}{unit}, while its rival of"
                f" {nearest:.5g}{unit} (Δχ² {values[nearest]:.2g}) is near the other repeats: narrow the"
                " bounds"
            )
    return result


def _outlier(known: Sequence[tuple[str, Fit, Estimate]], name: str) -> list[str]:
    """A sentence on the one repeat without which the scatter of the others is that of their noise."""
    if len(known) < _FEWEST:
        return []
    every = [(path, _repeated(name, [q for other, _, q in known if other != path])) for path, _, _ in known]
    path, others = max(every, key=lambda one: one[1].probability)
    value = next(p.value for own, _, p in known if own == path)
    scatter = max(others.sd, others.stated)
    if others.probability < UNLIKELY or abs(value - others.mean) < _FAR * scatter:
        return []
    unit = f" {others.unit}" if others.unit else ""
    return [
        f"{path} alone disagrees: {name} {value:.5g}{unit}, while the others scatter by"
        f" {short(others.sd)}{unit} around {others.mean:.5g}{unit}: look at that measurement, or leave its"
        " file out"
    ]


def short(number: float) -> str:
    """Format a positive number with two digits, or without decimals where it has more."""
    return f"{number:.2g}" if number < 99.5 else f"{number:.0f}"
