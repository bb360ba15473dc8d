"""What a fit of a BRDF returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.effects.plan import Plan
from pellicle.fitting.result import Estimate, Rival, Status, in_short
from pellicle.scene.surface import Surface


@dataclass(frozen=True)
class Baseline:
    """Another model of the same samples and its error on those that were held out."""

    name: str
    held_out: float


@dataclass(frozen=True)
class BrdfFit:
    """The outcome of fitting samples of a BRDF.

    `rms` and `held_out` are in the units of the residual (`residual`: its name; standard deviations
    where σ is known); `held_out` is the error on a fifth of the samples of a fit to the others, as it
    is for the `baselines`. `model` has the shape of the samples' values.
    """

    samples: BrdfSamples
    surface: Surface
    residual: str
    status: Status
    verdict: str
    layered: bool
    parameters: dict[str, Estimate]
    rivals: tuple[Rival, ...]
    baselines: tuple[Baseline, ...]
    held_out: float
    chi2_reduced: float
    rms: float
    effective_points: float
    correlation_names: tuple[str, ...]
    correlation: np.ndarray
    plan: Plan
    warnings: tuple[str, ...]
    model: np.ndarray
    seconds: float

    def __getitem__(self, name: str) -> Estimate:
        return self.parameters[name]

    def __str__(self) -> str:
        return in_short(self.status, self.verdict, self.free)

    @property
    def sigma_from(self) -> str:
        """Where the noise comes from that errors rest on: "given", or "residuals"."""
        return "residuals" if self.samples.sigma is None else "given"

    @property
    def sigma(self) -> float:
        """The median σ in 1/sr as given, or the rms of the residuals, in their unit."""
        return self.rms if self.samples.sigma is None else float(np.median(self.samples.sigma))

    @property
    def free(self) -> tuple[Estimate, ...]:
        return tuple(p for p in self.parameters.values() if p.free)
