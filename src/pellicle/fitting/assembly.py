"""From ranked minima to a `Fit`, for every kind of data."""

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, Protocol, runtime_checkable

from pellicle.fitting.conclusion import Conclusion, conclude
from pellicle.fitting.covariance import Errors, Scaled
from pellicle.fitting.discrepancy import Discrepancy
from pellicle.fitting.linear_system import Evidence
from pellicle.fitting.marginal import Ranking, by_remaining, gains, ranking
from pellicle.fitting.profile_likelihood import Limits
from pellicle.fitting.result import Estimate, Fit, Part, Profile
from pellicle.fitting.reweighting import RankedMinima, linearised
from pellicle.fitting.tied_numbers import TiedNumber, estimate


@runtime_checkable
class Measurements(Protocol):
    """Data of one kind, what is to explain them, and the ranked minima of that."""

    @property
    def ranked(self) -> RankedMinima: ...

    def evidence(self, at: RankedMinima, jacobian: Scaled, /) -> list[Evidence]:
        """Residuals of each view and what may explain them `at` the best of some ranked minima."""
        ...

    def parts(self, discrepancy: Discrepancy) -> tuple[Part, ...]:
        """One part of the fit for each view."""
        ...

    def missed(self, parts: tuple[Part, ...], discrepancy: Discrepancy, /) -> Sequence[Part]:
        """The parts that are not explained."""
        ...

    def fixed(self) -> list[Estimate]:
        """Numbers of the scene or the surface that are not free."""
        ...

    def tied(self) -> list[TiedNumber]:
        """Numbers of the scene that follow free ones."""
        ...

    def amended(self, parts: tuple[Part, ...], limits: Limits, /) -> Limits:
        """Limits of the parameters by what this kind of data cannot tell."""
        ...


class Assembly(NamedTuple):
    """The best minimum judged: parts, those that are `missed`, the covariance and the conclusion."""

    best: Ranking
    covariance: Errors
    parts: tuple[Part, ...]
    missed: tuple[Part, ...]
    scans: Mapping[int, Profile]
    conclusion: Conclusion
    began: float
    tied: Sequence[TiedNumber] = ()

    @property
    def worst(self) -> Part:
        """The first part that is not explained, else the first."""
        return (self.missed or self.parts)[0]

    def fit(self, **about: Any) -> Fit:
        """The result. `about` are its fields that depend on the kind of data: `verdict`, `warnings`, `rms`,
        `scene`, and others where they are not those of the conclusion."""
        names, correlation = self.covariance.names, self.best.discrepancy.errors.correlation
        found = about.pop("parameters", self.conclusion.parameters)
        follow = {x.name: estimate(x, found, names, correlation) for x in self.tied}
        common = {
            "parts": self.parts,
            "status": self.conclusion.status,
            "parameters": found | follow,
            "rivals": self.conclusion.rivals,
            "probability": self.conclusion.probability,
            "chi2_reduced": self.best.ranked.chi2_reduced,
            "effective_points": sum(part.effective_points for part in self.parts),
            "correlation_names": names,
            "correlation": correlation,
            "profile": None,
            "ranking": self.best,
            "seconds": time.perf_counter() - self.began,
        }
        return Fit(**(common | about))


def assemble(
    make: Callable[[RankedMinima], Any],
    ranked: RankedMinima,
    began: float,
    *,
    scans: Callable[[RankedMinima, Sequence[Any]], Mapping[int, Profile]] = lambda *_: {},
    near: bool = False,
    binding: frozenset[str] = frozenset(),
) -> Assembly:
    """Judge the best of ranked minima.

    `make` returns the measurements of ranked minima, whose order may change. `began` is when the fit did, by
    `time.perf_counter`; the other arguments are those of `conclude`, the scans those of ranked minima.
    """
    best = ranking(make, ranked)
    data, model_error = best.data, best.discrepancy
    parts = data.parts(model_error)
    missed = tuple(data.missed(parts, model_error))
    counted = by_remaining(best.ranked, model_error)
    covariance, scanned = linearised(counted)[1], scans(best.ranked, gains(model_error))
    conclusion = conclude(
        best._replace(ranked=counted),
        covariance,
        misfit=bool(missed),
        binding=binding,
        fixed=data.fixed(),
        scans=scanned,
        near=near,
        amend=partial(data.amended, parts),
    )
    return Assembly(best, covariance, parts, missed, scanned, conclusion, began, data.tied())
