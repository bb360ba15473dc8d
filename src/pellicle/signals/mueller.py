"""Elements of a normalised Mueller matrix: their names, limits and usual symmetries.

Stokes vectors are (I, Q, U, V) with Q = I_p − I_s, and the matrix of an isotropic sample is m12 = m21 = −N,
m33 = m44 = C, m34 = −m43 = S, m22 = 1, the others 0, with N, C, S of `signals.sphere` (Jellison
and Modine 1997, Appl. Opt. 36, 8184; CompleteEASE). Elements are those of the matrix divided by m11.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, final

import numpy as np
from jaxtyping import Float

from pellicle.signals.base import Arrays, Cell, Channels, Offset, Place, Quantity, Signal
from pellicle.signals.limits import Where, refuse_first
from pellicle.signals.sphere import ROUGH

ELEMENTS = tuple(f"m{i}{j}" for i in range(1, 5) for j in range(1, 5))[1:]
"""Names of the elements beside m11, row by row."""
HIGHEST, MOST_SIGMA = 1.1, 5.0
"""Largest element that calibration leaves, and noise beyond it in σ: of a passive sample none exceeds 1."""
_PAIRS = (("m12", "m21", 1), ("m33", "m44", 1), ("m34", "m43", -1))
"""Elements of a reflection that are equal, or opposite, for isotropic samples."""
_OPPOSED = -0.9
_DARK = 0.02
"""Elements smaller than this have no sign beyond noise and calibration."""


@final
@dataclass(frozen=True)
class Mueller(Signal):
    """Elements `parts` of a normalised Mueller matrix, all 15 by default. Raises UsageError for unknown and
    repeated ones."""

    word: ClassVar[str] = "mueller"
    title: ClassVar[str] = "normalised elements of a Mueller matrix"
    noun: ClassVar[str] = "Mueller elements"
    simulated: ClassVar[str] = "Stokes"
    ordinate: ClassVar[str] = "normalised Mueller element"
    keywords: ClassVar[frozenset[str]] = frozenset({"elements"})
    required: ClassVar[frozenset[str]] = frozenset({"elements"})
    named: ClassVar[str] = "elements"
    every: ClassVar[tuple[str, ...]] = ELEMENTS
    expected: ClassVar[str] = f"must be among {ELEMENTS[0]} to {ELEMENTS[-1]} without m11"
    parts: tuple[str, ...] = ELEMENTS

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        return tuple(
            Quantity(name, name, column=i, cell=Cell(int(name[1]) - 1, int(name[2]) - 1, name, name, 0.02))
            for i, name in enumerate(self.parts)
        )

    @property
    def grid(self) -> tuple[tuple[str, ...], ...]:
        """The matrix."""
        titles = [[f"m{row}{column}" for column in range(1, 5)] for row in range(1, 5)]
        titles[0][0] = "m11 = 1"
        return tuple(map(tuple, titles))

    def check(self, data: Arrays, place: Place, remedy: str) -> None:
        for i, element in enumerate(self.parts):
            sigma = None if data.sigma is None else data.sigma[:, i]
            check_element(data.values[:, i], sigma, element, place(f"`{element}`"), remedy)

    def isotropic(self, rows: Sequence[Any]) -> Sequence[Any]:
        return [element for row in self.waves.isotropic_matrix(*rows) for element in row][1:]

    def of_jones(self, jones: Any) -> list[Any]:
        return self.waves.all_elements(jones)

    def of_mueller(self, matrix: Sequence[Sequence[Any]]) -> list[Any]:
        return [element for row in matrix for element in row]

    def of_sums(self, sums: Sequence[Any]) -> Sequence[Any]:
        return self.waves.normalised_elements(sums)

    def synthetic(self, rows: np.ndarray, noise: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
        values = rows + noise * np.random.default_rng(seed).normal(0.0, 1.0, rows.shape)
        return values[:, self.positions], rows[:, self.positions]

    def channels(self, data: Arrays, sigma: np.ndarray | None) -> Channels:
        return Channels(data.values, np.full(len(data), ROUGH) if data.sigma is None else data.sigma)

    def compared(self, rows: Any, frame: Any, depolarises: bool) -> Any:
        return self.waves.columns(rows, self.positions)

    def offsets(self, columns: np.ndarray, allowed: Any) -> list[Offset]:
        """An offset of each element, and a depolarisation that mixes the phases of s and p: elements of the
        third and fourth rows and columns lose a share."""
        result = []
        for channel, name in enumerate(self.parts) if allowed.mueller else ():
            change = np.zeros(columns.shape)
            change[..., channel] = allowed.mueller
            result.append(Offset(f"offset of {name}", allowed.mueller, "", change))
        mixed = [allowed.depolarisation * bool({"3", "4"} & set(name[1:])) for name in self.parts]
        if any(mixed):
            change = -columns * mixed
            result.append(Offset("depolarisation", allowed.depolarisation, "", change, positive=True))
        return result


def check_element(
    values: Float[np.ndarray, " points"],
    sigma: Float[np.ndarray, " points"] | None,
    element: str,
    where: Where,
    remedy: str,
) -> None:
    """Refuse what no normalised element is. Raises DataError."""
    reason = f"is beyond {HIGHEST:g} for {element}, a normalised element of a Mueller matrix; {remedy}"
    limit = HIGHEST + (0.0 if sigma is None else MOST_SIGMA * sigma)
    refuse_first(values, np.abs(values) > limit, where, reason)


def reversed_elements(parts: Sequence[str]) -> list[str]:
    """The elements that have the fourth Stokes parameter on one side."""
    return [name for name in parts if ("4" in name[1]) != ("4" in name[2])]


def sign_notes(elements: Sequence[str], values: Float[np.ndarray, "points elements"]) -> list[str]:
    """A sentence for each pair of elements whose signs are not those of an isotropic sample."""
    column = dict(zip(elements, values.T, strict=True))
    sentences = []
    for one, other, sign in _PAIRS:
        if one not in column or other not in column:
            continue
        first, second = column[one], column[other]
        sizes = np.sqrt(np.mean(first**2)), np.sqrt(np.mean(second**2))
        if min(sizes) > _DARK and np.mean(first * second) * sign < _OPPOSED * sizes[0] * sizes[1]:
            have, want = ("opposite signs", "equal") if sign > 0 else ("the same sign", "opposite")
            sentences.append(
                f"{one} and {other} have {have}, and of an isotropic sample they are {want}: the file may"
                " follow another convention of signs"
            )
    return sentences
