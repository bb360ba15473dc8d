"""Convergence checks of a chain: length, mixing, minima visited, acceptance."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from importlib.util import find_spec
from types import ModuleType

import numpy as np

from pellicle.fitting.noise import integrated_time
from pellicle.sampling.chain import Chain
from pellicle.sampling.modes import Modes

LONG_ENOUGH = 50.0
"""Steps after burn-in, in autocorrelation times (D. Foreman-Mackey et al., 2013, PASP 125, 306)."""
MIXED_ENOUGH = 1.05
"""Largest split R̂ (A. Gelman et al., 2013, Bayesian data analysis, section 11.4)."""
MOVING = 0.01
"""Smallest share of proposals that is accepted."""
_BURNED = 5
"""Autocorrelation times that are thrown away."""


@dataclass(frozen=True)
class Checks:
    """Convergence checks of one chain.

    `discard` first steps are burn-in. `autocorrelation_time` is the longest of all parameters' and of the
    shares of the minima; `rhat` the largest split R̂, each walker a chain. `minima_found` counts the minima
    of the fit that hold a share worth missing, `minima_visited` those of them where walkers are.
    """

    steps: int
    discard: int
    autocorrelation_time: float
    rhat: float
    acceptance: float
    minima_found: int
    minima_visited: int
    independent: int

    @property
    def n_over_tau(self) -> float:
        return (self.steps - self.discard) / self.autocorrelation_time

    @property
    def doubts(self) -> tuple[str, ...]:
        """Reasons not to take intervals from the chain; empty if it can be trusted."""
        reasons = []
        if not self.n_over_tau >= LONG_ENOUGH:
            reasons.append(
                f"the chain is {self.n_over_tau:.0f} autocorrelation times long,"
                f" and {LONG_ENOUGH:.0f} are needed"
            )
        if not self.rhat <= MIXED_ENOUGH:
            reasons.append(f"walkers differ (split R̂ {self.rhat:.3f}, at most {MIXED_ENOUGH} is trusted)")
        if self.minima_visited < self.minima_found:
            reasons.append(
                f"{self.minima_visited} of the {self.minima_found} minima that matter were visited"
            )
        if not self.acceptance >= MOVING:
            reasons.append(f"only {100 * self.acceptance:.2g} % of the moves were accepted")
        return tuple(reasons)

    @property
    def trusted(self) -> bool:
        return not self.doubts


def check(chain: Chain, modes: Modes) -> Checks:
    """Every check of a chain of at least a few steps."""
    tau = autocorrelation_time(chain.draws, modes)
    discard = int(min(np.ceil(_BURNED * tau), chain.steps // 2))
    kept = chain.draws[discard:]
    home = modes.nearest(kept.reshape(-1, kept.shape[-1]))
    minima = np.flatnonzero(modes.matter)
    return Checks(
        steps=chain.steps,
        discard=discard,
        autocorrelation_time=tau,
        rhat=split_rhat(kept),
        acceptance=float(chain.accepted.mean() / chain.steps),
        minima_found=len(minima),
        minima_visited=int(np.isin(minima, home).sum()),
        independent=int(kept.shape[0] * kept.shape[1] / tau),
    )


def autocorrelation_time(draws: np.ndarray, modes: Modes) -> float:
    """The longest integrated autocorrelation time (steps), of parameters and of the minima's shares;
    infinite where nothing moves.

    Distances are from the ensemble's mean. `emcee.autocorr` takes those from each walker's own, which are
    0/0 for a walker that stays in one minimum, and too short a time for one that nearly stays.
    """
    columns = list(np.moveaxis(draws, 2, 0))
    if not all(np.ptp(column) > 0 for column in columns):
        return float("inf")
    several = np.flatnonzero(modes.matter)
    if len(several) > 1:
        home = modes.nearest(draws.reshape(-1, draws.shape[-1])).reshape(draws.shape[:2])
        there = [(home == mode).astype(float) for mode in several[:-1]]
        columns += [share for share in there if np.ptp(share) > 0]
    return max(integrated_time(column - column.mean()) for column in columns)


def split_rhat(draws: np.ndarray) -> float:
    """The largest split R̂ of (steps, walkers, parameters), by ArviZ."""
    rhat = arviz().rhat
    with np.errstate(invalid="ignore", divide="ignore"):
        return float(max(rhat(draws[:, :, i].T, method="split") for i in range(draws.shape[2])))


def arviz() -> ModuleType:
    """ArviZ, whose import warns once a day of its next version."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import arviz

        return arviz


PACKAGES = ("emcee", "arviz", "corner", "h5py")


def missing() -> list[str]:
    """The packages that are not installed; none of them is imported."""
    return [name for name in PACKAGES if find_spec(name) is None]
