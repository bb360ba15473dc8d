"""From ranked minima to a `Fit`, for every kind of data."""

import time
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, Protocol, runtime_checkable

from pellicle.fitting.conclusion import Conclusion, conclude, linearised
from pellicle.fitting.covariance import Errors, Scaled
from pellicle.fitting.discrepancy import Discrepancy, Evidence, discrepancy
from pellicle.fitting.profile_likelihood import Limits
from pellicle.fitting.result import Estimate, Fit, Part, Profile
from pellicle.fitting.reweighting import RankedMinima


@runtime_checkable
class Measurements(Protocol):
    """Data of one kind, what is to explain them, and the ranked minima of that."""

    @property
    def ranked(self) -> RankedMinima: ...

    def evidence(self, jacobian: Scaled) -> list[Evidence]:
        """Residuals of each view at the best minimum and what may explain them."""
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

    def amended(self, parts: tuple[Part, ...], limits: Limits, /) -> Limits:
        """Limits of the parameters by what this kind of data cannot tell."""
        ...


class Assembly(NamedTuple):
    """The best minimum judged: parts, those that are `missed`, the discrepancy and the conclusion."""

    ranked: RankedMinima
    jacobian: Scaled
    covariance: Errors
    discrepancy: Discrepancy
    parts: tuple[Part, ...]
    missed: tuple[Part, ...]
    conclusion: Conclusion
    began: float

    @property
    def worst(self) -> Part:
        """The first part that is not explained, else the first."""
        return (self.missed or self.parts)[0]

    def fit(self, **about: Any) -> Fit:
        """The result. `about` are its fields that depend on the kind of data: `verdict`, `warnings`, `rms`,
        `scene`, and others where they are not those of the conclusion."""
        common = {
            "parts": self.parts,
            "status": self.conclusion.status,
            "parameters": self.conclusion.parameters,
            "rivals": self.conclusion.rivals,
            "chi2_reduced": self.ranked.chi2_reduced,
            "effective_points": sum(part.effective_points for part in self.parts),
            "correlation_names": self.covariance.names,
            "correlation": self.discrepancy.errors.correlation,
            "profile": None,
            "seconds": time.perf_counter() - self.began,
        }
        return Fit(**(common | about))


def assemble(
    data: Measurements,
    began: float,
    *,
    scans: Mapping[int, Profile] | None = None,
    near: bool = False,
    binding: frozenset[str] = frozenset(),
) -> Assembly:
    """Judge the best of the ranked minima of `data`.

    `began` is when the fit did, by `time.perf_counter`; the other arguments are those of `conclude`.
    """
    ranked = data.ranked
    jacobian, covariance = linearised(ranked)
    model_error = discrepancy(data.evidence(jacobian), jacobian, ranked.minima.units[0])
    parts = data.parts(model_error)
    missed = tuple(data.missed(parts, model_error))
    conclusion = conclude(
        ranked,
        jacobian,
        covariance,
        model_error,
        misfit=bool(missed),
        binding=binding,
        fixed=data.fixed(),
        scans=scans or {},
        near=near,
        amend=partial(data.amended, parts),
    )
    return Assembly(ranked, jacobian, covariance, model_error, parts, missed, conclusion, began)
