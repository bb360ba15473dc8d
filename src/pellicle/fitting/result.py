"""Results of a fit: small frozen records with plain numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

import numpy as np

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.colours import Colours
from pellicle.data.spectrum import Spectrum
from pellicle.fitting.curves import NORMAL, BrdfCurve, ColourCurve, Curve, Index, at_each_wavelength
from pellicle.fitting.noise import student
from pellicle.fitting.report_methods import FitMixin
from pellicle.fitting.reported_layer import reported_layer, reported_medium
from pellicle.forward_model.plan import Plan
from pellicle.scene.film import Scene
from pellicle.scene.names import layer_name
from pellicle.scene.surface import Surface

LEVEL = 0.95
"""Level of confidence of expanded uncertainties."""
_FITTED = {Spectrum: "a spectrum was", Colours: "colours were", BrdfSamples: "BRDF samples were"}


class Status(StrEnum):
    """Status of a fit: the first that holds, in this order."""

    FAILED = "failed"
    NOT_CONVERGED = "not-converged"
    MISFIT = "misfit"
    NOT_IDENTIFIABLE = "not-identifiable"
    AMBIGUOUS = "ambiguous"
    AT_BOUND = "at-bound"
    CONVERGED = "converged"


@dataclass(frozen=True)
class Estimate:
    """A parameter's value and its standard error (infinite where the data see nothing).

    `stderr` is the combined standard uncertainty of the GUM: it includes systematic effects and what the
    model misses. `stderr_noise` is that of the noise alone, with its `degrees_of_freedom` (infinite where σ
    is given). `lower_limit` and `upper_limit` are one-sided 95 % limits, where only one side is bounded. With
    `default_bounds` nobody chose `lower` and `upper` for this sample. A value that is `at_bound` is `binding`
    unless physics sets the bound or the answer stands beside it. `tied` is the expression of a number that
    follows free ones, whose errors are theirs, propagated; its bounds are the range of the expression.
    """

    name: str
    value: float
    stderr: float
    unit: str
    lower: float
    upper: float
    free: bool
    at_bound: bool = False
    lower_limit: float | None = None
    upper_limit: float | None = None
    default_bounds: bool = False
    stderr_noise: float = math.nan  # not given: that of `stderr`
    degrees_of_freedom: float = math.inf
    binding: bool = False
    tied: str = ""

    def __post_init__(self):
        if math.isnan(self.stderr_noise):
            object.__setattr__(self, "stderr_noise", self.stderr)

    @property
    def effective_degrees_of_freedom(self) -> float:
        """Degrees of freedom of `stderr` (Welch-Satterthwaite: GUM 2008, eq. G.2b), systematic effects taken
        as known to infinitely many."""
        if not 0 < self.stderr_noise < math.inf:
            return math.inf
        return self.degrees_of_freedom * (self.stderr / self.stderr_noise) ** 4

    @property
    def coverage_factor(self) -> float:
        """Factor from `stderr` to the half width of a 95 % interval: Student's t (GUM 2008, G.3.2)."""
        return NORMAL * student(self.effective_degrees_of_freedom, NORMAL**2)

    @property
    def expanded(self) -> float:
        """Expanded uncertainty: half width of the 95 % interval."""
        return self.coverage_factor * self.stderr


def in_short(status: str, verdict: str, free: tuple[Estimate, ...]) -> str:
    """A fit as it prints: status and verdict, then each free parameter with its error."""
    lines = [f"  {p.name} = {p.value:.8g} ± {p.stderr:.2g} {p.unit}".rstrip() for p in free]
    return "\n".join([f"{status}: {verdict}", *lines])


@dataclass(frozen=True)
class SystematicEffect:
    """A row of the uncertainty budget: what the scene states or leaves out, and what it does to the result.

    `uncertainty` is its standard uncertainty in `unit` (relative where that is empty). `changes` are those of
    the free parameters by one of it, if nobody allows for it. `amount` is the size at which the effect
    explains the residuals best, together with all others; `explains` is the share of their sum of squares
    that it would take away alone, whatever its size. `carries` is what the variances of the free parameters
    would lose if it were known, as far as residuals do not tell it.
    """

    name: str
    uncertainty: float
    unit: str
    changes: dict[str, float]
    amount: float
    explains: float
    carries: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Rival:
    """Another minimum: its parameters and how much worse it is, in χ² on the effective points.

    Where the fit has computed them, `probability` is its share of the posterior (see `Fit.probability`),
    `stderr` the standard errors of its parameters by the noise alone, and `curves` the curve of each part of
    the fit there, whose errors of n and k are undefined.
    """

    parameters: dict[str, float]
    delta_chi2: float
    probability: float | None = None
    stderr: dict[str, float] | None = None
    curves: Sequence[Curve | ColourCurve | BrdfCurve] = field(default=(), compare=False, repr=False)


@dataclass(frozen=True)
class Profile:
    """χ² above the best against thickness (nm): what the search saw."""

    thickness: np.ndarray
    delta_chi2: np.ndarray


@dataclass(frozen=True)
class Part:
    """One spectrum, one set of colours or of BRDF samples of a fit, and how the best scene explains it.

    `name` ends the names of its own parameters, empty where the fit is no joint one. `rms` is in the unit of
    the signal: a fraction, degrees of Ψ, or the unit in which BRDF samples are compared (standard deviations
    where σ is known). `sigma_from` names the source of σ: "given", "residuals", "model", the error of a
    model whose lamp drifts, or "usual", that of ordinary cameras.
    """

    name: str
    data: Spectrum | Colours | BrdfSamples
    curve: Curve | ColourCurve | BrdfCurve
    plan: Plan
    rms: float
    chi2_reduced: float
    effective_points: float
    sigma_from: str = "given"

    @property
    def sigma(self) -> float:
        """The median σ of the points, in the unit of the signal; of BRDF samples in 1/sr, or their rms where
        no σ is given."""
        if isinstance(self.curve, Curve | ColourCurve):
            return float(np.median(self.curve.sigma))
        return self.rms if self.data.sigma is None else float(np.median(self.data.sigma))

    @property
    def spectrum(self) -> Spectrum:
        """The spectrum. Raises TypeError for colours and BRDF samples."""
        if not isinstance(self.data, Spectrum):
            raise TypeError(f"{_FITTED[type(self.data)]} fitted, not a spectrum: see data")
        return self.data

    @property
    def samples(self) -> BrdfSamples:
        """The BRDF samples. Raises TypeError for other data."""
        if not isinstance(self.data, BrdfSamples):
            raise TypeError(f"{_FITTED[type(self.data)]} fitted, not BRDF samples: see data")
        return self.data

    @property
    def spectral(self) -> Curve:
        """Data and model of the spectrum. Raises TypeError for colours and BRDF samples."""
        if not isinstance(self.curve, Curve):
            raise TypeError(f"{_FITTED[type(self.data)]} fitted, not a spectrum: see curve")
        return self.curve


@dataclass(frozen=True)
class Baseline:
    """Another model of the same samples and its error on those that were held out."""

    name: str
    held_out: float


@dataclass(frozen=True)
class LayerTest:
    """Evidence for a layer on a surface: errors on held-out BRDF samples.

    `held_out` is the error on a fifth of the samples of a fit to the others, as it is for the `baselines`, in
    the unit in which samples are compared (`residual`: its name; standard deviations where σ is known).
    """

    layered: bool
    held_out: float
    baselines: tuple[Baseline, ...]
    residual: str


@dataclass(frozen=True, repr=False)
class Fit(FitMixin):
    """The outcome of fitting spectra or BRDF samples of one sample: `parts`, one for each.

    `rms` is None where the spectra have no unit in common. `scene` is what was fitted, one for each spectrum
    where there are several, or a `Surface`. `budget` has the systematic effects that `stderr` includes, the
    largest first. `probability` is the share of the posterior that the answer has beside its rivals, each by
    its normal approximation; None where no rival could have some. `profile` is the scan against thickness of
    a fit of spectra, `layer_test` the evidence for a layer of a fit of BRDF samples; None else. `ranking` is
    the `fitting.marginal.Ranking` that it rests on.
    """

    parts: tuple[Part, ...]
    status: Status
    verdict: str
    parameters: dict[str, Estimate]
    rivals: tuple[Rival, ...]
    chi2_reduced: float
    rms: float | None
    effective_points: float
    correlation_names: tuple[str, ...]
    correlation: np.ndarray
    warnings: tuple[str, ...]
    profile: Profile | None
    seconds: float
    scene: Scene | tuple[Scene | Surface, ...] | Surface | None = None
    layer_test: LayerTest | None = None
    budget: tuple[SystematicEffect, ...] = ()
    probability: float | None = None
    ranking: Any = field(default=None, compare=False, repr=False)

    def __getitem__(self, name: str) -> Estimate:
        return self.parameters[name]

    def __str__(self) -> str:
        return in_short(self.status, self.verdict, self.free)

    __repr__ = __str__

    @property
    def log_evidence(self) -> float:
        """ln of the evidence by the fit's own noise; `pellicle.compare` gives several fits the same noise."""
        return self.ranking.log_evidence

    @property
    def effects(self) -> tuple[tuple[Any, ...], ...]:
        """Systematic effects (`fitting.linear_system.Effect`) of each part: `change` is that of the data."""
        return self.ranking.effects()

    @property
    def free(self) -> tuple[Estimate, ...]:
        return tuple(p for p in self.parameters.values() if p.free)

    @property
    def joint(self) -> bool:
        """True where a list of data was fitted, even of one."""
        return bool(self.parts[0].name)

    @property
    def data(self) -> Spectrum | Colours | BrdfSamples:
        """The spectrum, colours or samples that were fitted. Raises ValueError where there are several."""
        return self._only.data

    @property
    def spectrum(self) -> Spectrum:
        """The spectrum that was fitted. Raises ValueError where there are several."""
        return self._only.spectrum

    @property
    def samples(self) -> BrdfSamples:
        """The BRDF samples that were fitted. Raises ValueError where there are several sets."""
        return self._only.samples

    @property
    def surface(self) -> Surface:
        """The surface that was fitted. Raises TypeError for a fit of spectra."""
        if not isinstance(self.scene, Surface):
            raise TypeError("a scene was fitted to spectra, not a surface: see scene")
        return self.scene

    @property
    def curve(self) -> Curve:
        """Data and model of the only spectrum. Raises ValueError where there are several."""
        return self._only.spectral

    @property
    def model(self) -> np.ndarray:
        """Model of the only data. Raises ValueError where there are several."""
        return self._only.curve.model

    @property
    def plan(self) -> Plan:
        """Plan of the only data. Raises ValueError where there are several."""
        return self._only.plan

    @property
    def one_layer(self) -> bool:
        """True where all data are of one reported medium: False for samples with layers of several."""
        scenes = [x for x in self.scene if isinstance(x, Scene)] if isinstance(self.scene, tuple) else []
        shown = [(scene.sample, reported_layer(scene), scene) for scene in scenes if scene.sample]
        owners = {"substrate" if i is None else layer_name(s, i) for _, i, s in shown}
        return not shown or (
            len(owners) == 1 and not any(sample.of(owner) for sample, *_ in shown for owner in owners)
        )

    @property
    def index(self) -> Index:
        """The layer's n and k at every wavelength of any spectrum or sensor, each once."""
        return at_each_wavelength(self._film_curves)

    @property
    def index_in_short(self) -> Index | None:
        """The layer's n and k at the knots of a spline, else at ends, quarters and middle of the wavelengths;
        None where they are known, and of a birefringent layer."""
        scene = self.scene[0] if isinstance(self.scene, tuple) else self.scene
        if not isinstance(scene, Scene) or self.principal_indices or not self.one_layer:
            return None
        index = self.index
        if not np.any(index.n_stderr > 0) and not np.any(index.k_stderr > 0):
            return None
        ends = np.min(index.wavelength), np.max(index.wavelength)
        knots = getattr(reported_medium(scene), "knots", np.linspace(*ends, 5))
        return index.at([nm for nm in knots if ends[0] <= nm <= ends[1]])

    @property
    def principal_indices(self) -> dict[str, Index]:
        """Each index of a birefringent layer by its name ("ordinary", "extraordinary", or "x", "y", "z"), and
        "birefringence", their difference, of a uniaxial one; empty for an isotropic layer."""
        curves = self._film_curves
        each = [curve.principal or {} for curve in curves]
        names = [name for name in each[0] if all(name in own for own in each)]
        return {name: at_each_wavelength([own[name] for own in each]) for name in names}

    @property
    def _film_curves(self) -> list[Curve | ColourCurve]:
        curves = [part.curve for part in self.parts if not isinstance(part.curve, BrdfCurve)]
        if not curves:
            raise TypeError("BRDF samples were fitted: the index is among the parameters")
        return curves

    @property
    def _only(self) -> Part:
        if len(self.parts) != 1:
            raise ValueError(f"a joint fit of {len(self.parts)} has one of these for each: see parts")
        return self.parts[0]

    def alone(self, part: Part) -> Fit:
        """This fit as one spectrum of it sees it: for panels and tables of one file."""
        return replace(self, parts=(part,), rms=part.rms, chi2_reduced=part.chi2_reduced)
