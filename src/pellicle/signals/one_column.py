"""Signals of one column: reflectance, transmittance, raw counts, contrast to a reference; their base."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, final

import numpy as np

from pellicle.signals.base import Arrays, Channels, Offset, Place, Quantity, Signal
from pellicle.signals.limits import Where, check_power, refuse_first


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
        return rows.reshape(-1)


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


FORMS = {"relative": "(R - R0)/R0", "normalised": "(R - R0)/(R + R0)"}
"""Formulas of the contrast of R against R0, by their names."""
LIMITS = (-1.0, 50.0)
"""Least contrast, that of a black sample, and a largest one: above, the values are in percent."""
_NOISE = 0.05, 5.0
"""Distance by which calibration may take a contrast below its least value, and noise in σ."""


@final
@dataclass(frozen=True)
class Contrast(OneColumn):
    """Contrast against a reference, in one of `FORMS`. A scale of the lamp cancels."""

    word: ClassVar[str] = "contrast"
    title: ClassVar[str] = "optical contrast"
    noun: ClassVar[str] = "contrast"
    simulated: ClassVar[str] = "R"
    ordinate: ClassVar[str] = "contrast"
    has_reference: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ("contrast", "optical contrast", "dr/r", "δr/r", "dr/r0", "drr")
    form: str = "relative"

    def seen_in(self, scene: Any, depolarises: bool) -> Contrast:
        return self if scene.reference is None else replace(self, form=scene.reference.form)

    def against(self, sample: Any, reference: Any) -> Any:
        """Return the contrast of reflectances (traced)."""
        return (sample - reference) / (reference if self.form == "relative" else reference + sample)

    def check_values(
        self, values: np.ndarray, sigma: np.ndarray | None, where: Where, too_high: str, remedy: str
    ) -> None:
        low, high = LIMITS
        limit = low - np.maximum(_NOISE[0], 0.0 if sigma is None else _NOISE[1] * sigma)
        refuse_first(values, values < limit, where, f"is a contrast below {low:g}; {remedy}")
        refuse_first(values, values > high, where, f"is above {high:g} for a contrast; {too_high}")

    def offsets(self, columns: np.ndarray, allowed: Any) -> list[Offset]:
        """A lamp that is brighter on the sample than on the reference."""
        slope = 1 + columns if self.form == "relative" else 0.5 * (1 - columns**2)
        return [Offset("lamp between sample and reference", allowed.scale, "", allowed.scale * slope)]
