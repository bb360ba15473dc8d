"""Records of measurements that are not made yet, with what to expect of each."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pellicle.fitting.comparison import STRONG
from pellicle.fitting.report_methods import ReportMixin

R, T, PSI_DELTA = "R", "T", "psi-delta"
_SHOWN = 2
"""Measurements that decide, and those that do not, in a verdict."""


@dataclass(frozen=True)
class ExpectedError:
    """Standard error to expect of a free number, with systematic effects and by the noise alone."""

    stderr: float
    stderr_noise: float
    unit: str


@dataclass(frozen=True)
class PlannedMeasurement:
    """A measurement that is not made yet, and what to expect of it.

    `lower` and `upper` bound its wavelengths (nm), `wider` is true for more than the given range; `noise` is
    the standard deviation of a point (of Ψ and Δ in degrees), and `times` the factor on the thickness, 2 for
    another sample that is twice as thick. `delta_ln_z` is the expected difference of ln Z `between` the two
    scenes that it distinguishes worst, whichever of them is true; None for one scene. `errors` are those of
    the free numbers of one scene.
    """

    signal: str
    angle: float
    polarisation: str
    lower: float
    upper: float
    noise: float
    times: float = 1.0
    wider: bool = False
    delta_ln_z: float | None = None
    between: tuple[str, ...] = ()
    errors: Mapping[str, ExpectedError] = field(default_factory=dict)

    @property
    def decides(self) -> bool:
        """True where the evidence between any two scenes is strong."""
        return self.delta_ln_z is not None and self.delta_ln_z >= STRONG

    @property
    def word(self) -> str:
        """The signal in sentences."""
        return "ψ and Δ" if self.signal == PSI_DELTA else self.signal

    @property
    def name(self) -> str:
        """Name in sentences: `ψ and Δ at 65°`."""
        polarised = "" if self.polarisation == "unpolarised" else f" {self.polarisation}"
        wider = f" from {self.lower:.0f} to {self.upper:.0f} nm" if self.wider else ""
        thicker = f" of a film {self.times:g} times as thick" if self.times != 1 else ""
        return f"{self.word}{polarised} at {self.angle:g}°{wider}{thicker}"

    @property
    def evidence(self) -> str:
        """Δ ln Z in two digits."""
        value = self.delta_ln_z or 0.0
        return f"{value:.1f}" if value < 10 else f"{float(f'{value:.2g}'):.0f}"


@dataclass(frozen=True, repr=False)
class MeasurementPlan(ReportMixin):
    """Measurements of rival `scenes` (names), the one that decides most first, or of one scene.

    `not_tried` are sentences on what was left out.
    """

    scenes: tuple[str, ...]
    measurements: tuple[PlannedMeasurement, ...]
    not_tried: tuple[str, ...] = ()

    @property
    def best(self) -> dict[str, PlannedMeasurement]:
        """The measurement of the least error of each free number of one scene that any determines."""
        names = dict.fromkeys(name for m in self.measurements for name in m.errors)
        known = {n: [m for m in self.measurements if math.isfinite(m.errors[n].stderr)] for n in names}
        return {name: min(own, key=lambda m: m.errors[name].stderr) for name, own in known.items() if own}

    @property
    def would_decide(self) -> tuple[dict[str, Any], ...]:
        """The best measurement of each kind that decides: signal, polarisation, angle, bounds of its
        wavelengths, factor on the thickness and Δ ln Z."""
        words = ("signal", "polarisation", "angle", "lower", "upper", "times", "delta_ln_z")
        return tuple({word: getattr(m, word) for word in words} for m in self._kinds if m.decides)

    @property
    def verdict(self) -> str:
        """The measurements that decide and those that do not, or the best one for each free number."""
        if len(self.scenes) == 1:
            rows = [(name, m, m.errors[name]) for name, m in self.best.items()]
            said = [f"{name} ± {e.stderr:.2g} {e.unit}".rstrip() + f" by {m.name}" for name, m, e in rows]
            return f"best: {'; '.join(said)}" if said else "no measurement determines a free number"
        good = [f"{m.name} (Δ ln Z {m.evidence})" for m in self._kinds if m.decides][:_SHOWN]
        poor = [f"{m.name} ({m.evidence})" for m in self._kinds if not m.decides][:_SHOWN]
        if not good:
            return f"none of these measurements would decide; the best are {' and '.join(poor)}"
        less = f"; {' and '.join(poor)} {'does' if len(poor) == 1 else 'do'} not" if poor else ""
        return f"would decide: {', '.join(good)}{less}"

    @property
    def _kinds(self) -> list[PlannedMeasurement]:
        """The best measurement of each signal; those of a wider range or another sample are others."""
        kinds: dict[Any, PlannedMeasurement] = {}
        for m in self.measurements:
            kinds.setdefault((m.signal, m.times, m.wider), m)
        return list(kinds.values())

    def __str__(self) -> str:
        return self.verdict

    __repr__ = __str__
