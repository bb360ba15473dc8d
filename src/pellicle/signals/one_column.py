"""Signals of one column: powers, counts, and their change against a reference."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pellicle.errors import UsageError
from pellicle.signals.base import (
    Arrays,
    ChannelGroup,
    Channels,
    Offset,
    Place,
    Quantity,
    Residuals,
    Signal,
)
from pellicle.signals.limits import Where


@dataclass(frozen=True)
class OneColumn(Signal):
    """A signal of one number for each wavelength, which is compared as it is."""

    @classmethod
    def of(cls, data: Any) -> Signal:
        return cls()

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

    @property
    def independent(self) -> int:
        return 1

    def coordinates(self, data: Arrays) -> np.ndarray:
        return data.values.reshape(len(data), -1)

    def averaged(self, coordinates: np.ndarray) -> dict[str, np.ndarray]:
        return {"values": coordinates[:, 0]}

    def isotropic(self, rows: Sequence[Any]) -> Sequence[Any]:
        raise UsageError(f"{self.word} has no N, C and S")

    def of_jones(self, jones: Any) -> list[Any]:
        raise UsageError(f"{self.word} is no comparison of polarisations")

    def of_mueller(self, matrix: Sequence[Sequence[Any]]) -> list[Any]:
        raise UsageError(f"{self.word} is no comparison of polarisations")

    def of_sums(self, sums: Sequence[Any]) -> Sequence[Any]:
        """The mean over polarisations."""
        return sums if len(sums) == 1 else [0.5 * (sums[0] + sums[1])]

    def drawn(self, rows: Any) -> Any:
        return rows.T

    def synthetic(self, rows: np.ndarray, noise: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
        clean = rows.reshape(-1)
        return clean + noise * np.random.default_rng(seed).normal(0.0, 1.0, clean.shape), clean

    def channels(self, data: Arrays, sigma: np.ndarray | None) -> Channels:
        known = data.sigma if data.sigma is not None else sigma
        assert known is not None
        return Channels(data.values, known)

    def compared(self, rows: Any, frame: Any, depolarises: bool) -> Any:
        return rows.reshape(-1)

    def groups(self, count: int, framed: bool) -> tuple[ChannelGroup, ...]:
        return (ChannelGroup((0,), 1),)

    def rms(self, residual: np.ndarray) -> float:
        return float(np.sqrt(np.mean(residual**2)))

    def offsets(self, columns: np.ndarray, allowed: Any) -> list[Offset]:
        return []

    def curves(self, data: np.ndarray, model: np.ndarray, weight: np.ndarray) -> dict[str, np.ndarray]:
        return {"data": np.ravel(data), "model": np.ravel(model), "sigma": 1 / weight[:, 0]}

    def residuals(self, data: Arrays, curve: Any, known: bool) -> list[Residuals]:
        rows = curve.residual if data.sigma is None else curve.residual / data.sigma
        return [Residuals(rows[:, None], known, len(rows))]
