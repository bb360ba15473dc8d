"""Signals of one column: reflectance, transmittance, raw counts, and their base."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, final

import numpy as np

from pellicle.signals.base import Arrays, Channels, Place, Quantity, Signal
from pellicle.signals.limits import Where, check_power


@dataclass(frozen=True)
class OneColumn(Signal):
    """A signal of one number for each wavelength, which is compared as it is."""

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        return (Quantity(self.word, self.noun),)

    def check(self, data: Arrays, place: Place, remedy: str) -> None:
        if data.calibrated and len(data):
            too_high = "divide percent by 100, or give `calibrated=False` for an arbitrary scale"
            self.check_values(data.values, data.sigma, place("`values`"), too_high, remedy)

    @abstractmethod
    def check_values(
        self, values: np.ndarray, sigma: np.ndarray | None, where: Where, too_high: str, remedy: str
    ) -> None:
        """Refuse impossible values; `too_high` and `remedy` are advice. Raises DataError."""

    def of_sums(self, sums: Sequence[Any]) -> Sequence[Any]:
        """The mean over polarisations."""
        return sums if len(sums) == 1 else [0.5 * (sums[0] + sums[1])]

    def synthetic(self, rows: np.ndarray, noise: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
        clean = rows.reshape(-1)
        return clean + noise * np.random.default_rng(seed).normal(0.0, 1.0, clean.shape), clean

    def channels(self, data: Arrays, sigma: np.ndarray | None) -> Channels:
        known = data.sigma if data.sigma is not None else sigma
        assert known is not None
        return Channels(data.values, known)

    def compared(self, rows: Any, frame: Any, depolarises: bool) -> Any:
        return rows


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
