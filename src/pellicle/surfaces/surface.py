"""A surface as a recipe describes it: a BRDF by name, each of its keys fixed or free."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from pellicle.brdf.models import Model, Parameter, model
from pellicle.errors import UsageError
from pellicle.free import Free

LETTERS = ("r", "g", "b")


class Leaf(NamedTuple):
    """One free number: `n_g` of the key `n`, its bounds and how it is searched."""

    name: str
    key: str
    channel: int | None
    free: Free
    about: Parameter

    @property
    def log(self) -> bool:
        """Searched in its logarithm."""
        return self.about.log and self.free.lower > 0


@dataclass(frozen=True)
class Surface:
    """A BRDF by name and its numbers: `Surface("microfacet-film", {"thickness": Free(lower=0, upper=500)})`.

    Each key of `numbers` is a number, one number a channel, or a `Free`; a key per channel that is
    free becomes `n_r`, `n_g` and `n_b`. A key that is not given keeps the model's default, fixed.
    `wavelengths` (nm) has one for each channel of the samples. Raises UsageError for a name or key
    that is none, and for a count that does not match.
    """

    model: str
    numbers: Mapping[str, float | Sequence[float] | Free] = field(default_factory=dict)
    wavelengths: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        try:
            known = [p.key for p in self.brdf.parameters]
        except ValueError as error:
            raise UsageError(str(error)) from None
        for key, value in self.numbers.items():
            if key not in known:
                near = difflib.get_close_matches(key, known, 1)
                hint = f" (did you mean {near[0]!r}?)" if near else ""
                raise UsageError(f"{self.model} has no {key!r}{hint}; it has {', '.join(known)}")
            count = np.size(value) if not isinstance(value, Free) else 1
            if count not in (1, self.channels):
                raise UsageError(f"{key}: {count} numbers for {self.channels} wavelengths; give one or each")

    @property
    def brdf(self) -> Model:
        return model(self.model)

    @property
    def seen_at(self) -> tuple[float, ...]:
        """Wavelengths in nm, the model's own where none are given."""
        return self.brdf.wavelengths if self.wavelengths is None else tuple(self.wavelengths)

    @property
    def channels(self) -> int:
        return len(self.seen_at)

    def leaves(self) -> tuple[Leaf, ...]:
        """Every free number, in the model's order."""
        return tuple(leaf for about in self.brdf.parameters for leaf in self._of(about))

    def _of(self, about: Parameter) -> list[Leaf]:
        given = self.numbers.get(about.key)
        if not isinstance(given, Free):
            return []
        if not about.per_channel or self.channels == 1:
            return [Leaf(about.key, about.key, None, given, about)]
        names = LETTERS if self.channels == 3 else [str(c + 1) for c in range(self.channels)]
        return [Leaf(f"{about.key}_{name}", about.key, c, given, about) for c, name in enumerate(names)]

    def fixed(self) -> dict[str, np.ndarray]:
        """Every fixed number as an array () or (channels,), and the wavelengths."""
        found = {"wavelengths": np.array(self.seen_at)}
        for about in self.brdf.parameters:
            given: Any = self.numbers.get(about.key, about.value)
            if isinstance(given, Free):
                continue
            default = about.key not in self.numbers and about.per_channel
            found[about.key] = np.asarray(given[0] if default else given, dtype=float)
        return found

    def start(self) -> dict[str, np.ndarray]:
        """Every number as an array: fixed ones, and where free ones start."""
        free = {key: np.asarray(x.value) for key, x in self.numbers.items() if isinstance(x, Free)}
        return self.fixed() | free
