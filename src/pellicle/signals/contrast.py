"""Optical contrast: the change of a reflectance against that of a reference."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, final

import numpy as np

from pellicle.signals.base import Offset
from pellicle.signals.limits import Where, refuse_first
from pellicle.signals.one_column import OneColumn

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
