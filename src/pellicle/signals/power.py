"""Reflectance, transmittance and raw counts."""

from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np

from pellicle.signals.limits import Where, check_power
from pellicle.signals.one_column import OneColumn


@dataclass(frozen=True)
class _Power(OneColumn):
    """A power: with fringes, a scale and an offset."""

    has_scale: ClassVar[bool] = True

    def check_values(
        self, values: np.ndarray, sigma: np.ndarray | None, where: Where, too_high: str, remedy: str
    ) -> None:
        check_power(self.noun, values, sigma, where, too_high=too_high, remedy=remedy)


@final
@dataclass(frozen=True)
class Reflectance(_Power):
    """Reflectance as a fraction."""

    word: ClassVar[str] = "R"
    title: ClassVar[str] = "reflectance R"
    noun: ClassVar[str] = "reflectance"
    simulated: ClassVar[str] = "R"
    ordinate: ClassVar[str] = "R (fraction)"


@final
@dataclass(frozen=True)
class Transmittance(_Power):
    """Transmittance as a fraction."""

    word: ClassVar[str] = "T"
    title: ClassVar[str] = "transmittance T"
    noun: ClassVar[str] = "transmittance"
    simulated: ClassVar[str] = "T"
    ordinate: ClassVar[str] = "T (fraction)"
    transmission: ClassVar[bool] = True


@final
@dataclass(frozen=True)
class Counts(OneColumn):
    """Raw counts of a detector, which become a reflectance by a reference."""

    word: ClassVar[str] = "counts"
    title: ClassVar[str] = "raw counts"
    noun: ClassVar[str] = "counts"
    simulated: ClassVar[str] = ""
    ordinate: ClassVar[str] = "counts"
    has_scale: ClassVar[bool] = True
    of_counts: ClassVar[bool] = True

    def check_values(
        self, values: np.ndarray, sigma: np.ndarray | None, where: Where, too_high: str, remedy: str
    ) -> None:
        """Accept any finite count."""
