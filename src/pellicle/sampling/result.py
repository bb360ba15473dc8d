"""Results of sampling: small frozen records with plain numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pellicle.fitting.presentation import PlotMixin
from pellicle.fitting.result import Fit
from pellicle.sampling.checks import Checks
from pellicle.sampling.modes import Modes
from pellicle.sampling.predict import Prediction


@dataclass(frozen=True)
class Mode:
    """One minimum as one parameter sees it: the median of the draws there, and their share."""

    value: float
    mass: float


@dataclass(frozen=True)
class Marginal:
    """The posterior of one parameter, in its own unit: moments, quantiles of 2.5, 50 and 97.5 %, modes."""

    name: str
    unit: str
    mean: float
    sd: float
    q025: float
    q50: float
    q975: float
    modes: tuple[Mode, ...]


@dataclass(frozen=True, repr=False)
class Posterior(PlotMixin):
    """Draws from the posterior of a fit's free parameters; a spectrum's scale and offset are integrated out.

    `draws` (steps, walkers, parameters) in the parameters' own units, without burn-in, `log_density`
    (steps, walkers) beside them. `parameters` holds each one's marginal, or nothing where the checks do
    not carry an interval: `checks.doubts` says why. `units` is the same as `draws` between 0 and 1.
    `assumption` is what the posterior assumes though the fit does not show it; empty if nothing.
    """

    fit: Fit
    names: tuple[str, ...]
    draws: np.ndarray
    units: np.ndarray
    log_density: np.ndarray
    modes: Modes
    checks: Checks
    predict: Callable[[np.ndarray, int], tuple[Prediction, ...]]
    seconds: float
    assumption: str = ""

    def predictions(self, seed: int = 0) -> tuple[Prediction, ...]:
        """Posterior predictions of each measured quantity."""
        return self.predict(self.units, seed)

    @property
    def trusted(self) -> bool:
        return self.checks.trusted

    @cached_property
    def parameters(self) -> dict[str, Marginal]:
        """Marginals by name, the thickness first; empty where the chain is not to be trusted."""
        return self.marginals() if self.trusted else {}

    def marginals(self) -> dict[str, Marginal]:
        """Marginals by name, whatever the checks say."""
        flat = self.draws.reshape(-1, len(self.names))
        home = self.modes.nearest(self.units.reshape(-1, len(self.names)))
        result = {name: self._marginal(name, flat[:, i], home) for i, name in enumerate(self.names)}
        return {name: result[name] for name in self.fit.parameters if name in result}

    def _marginal(self, name: str, values: np.ndarray, home: np.ndarray) -> Marginal:
        shares = [(mode, float(np.mean(home == mode))) for mode in np.unique(home)]
        places = [Mode(float(np.median(values[home == mode])), mass) for mode, mass in shares]
        q025, q50, q975 = np.quantile(values, [0.025, 0.5, 0.975])
        return Marginal(
            name,
            self.fit.parameters[name].unit,
            float(values.mean()),
            float(values.std(ddof=1)),
            float(q025),
            float(q50),
            float(q975),
            tuple(sorted(places, key=lambda mode: -mode.mass)),
        )

    def __getitem__(self, name: str) -> Marginal:
        return self.parameters[name]

    def __str__(self) -> str:
        lines = [
            f"  {m.name} = {m.q50:.6g} ({m.q025:.6g} to {m.q975:.6g}) {m.unit}".rstrip()
            for m in self.parameters.values()
        ]
        return "\n".join([verdict(self), *lines])

    __repr__ = __str__


def verdict(posterior: Posterior) -> str:
    """One or two sentences: what the posterior adds, or why it may not be used."""
    checks = posterior.checks
    if not checks.trusted:
        return f"The chain does not carry an interval: {'; '.join(checks.doubts)}."
    lead = next(iter(posterior.parameters.values()))
    unit = f" {lead.unit}" if lead.unit else ""
    opening = f"If {posterior.assumption}, with" if posterior.assumption else "With"
    sentence = (
        f"{opening} 95 % probability {lead.name} lies between {lead.q025:.5g} and {lead.q975:.5g}{unit}"
    )
    several = [mode for mode in lead.modes if mode.mass >= 0.05]
    if len(several) < 2:
        return f"{sentence}."
    shares = ", ".join(f"{mode.value:.5g}{unit} with {100 * mode.mass:.0f} %" for mode in several)
    return f"{sentence}, in {len(several)} separate places: {shares}."
