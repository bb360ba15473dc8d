"""Samples of a BRDF as arrays, wherever they came from."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from pellicle.data.tabular.columns import DIRECTIONS
from pellicle.errors import UsageError

CHANNELS = (("value",), ("R", "G", "B"))
_TABLES = ("values", "sigma")
_GOLDEN = (math.sqrt(5) - 1) / 2


@dataclass(frozen=True, eq=False)
class BrdfSamples:
    """Values of a BRDF (1/sr) at pairs of directions, in the order of the file.

    `theta_i`, `phi_i` is the direction to the light and `theta_o`, `phi_o` to the eye, in degrees from
    the normal and around it; the mirror side of phi_i = 0 is phi_o = 180. `values` has shape
    (samples, channels) and `sigma` its standard deviations, or None; `channels` is ("value",) or
    ("R", "G", "B"). `lines` are the source line numbers of the samples, `notes` sentences on what was
    detected.
    """

    theta_i: np.ndarray
    phi_i: np.ndarray
    theta_o: np.ndarray
    phi_o: np.ndarray
    values: np.ndarray
    channels: tuple[str, ...]
    sigma: np.ndarray | None = None
    path: str = ""
    sha256: str = ""
    notes: tuple[str, ...] = ()
    lines: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.channels not in CHANNELS:
            raise ValueError(f"channels: expected ('value',) or ('R', 'G', 'B'), got {self.channels}")
        size = np.size(self.theta_i)
        for name in (*DIRECTIONS, *_TABLES, "lines"):
            given = getattr(self, name)
            if given is None:
                continue
            shape = (size, len(self.channels)) if name in _TABLES else (size,)
            if np.shape(given) != shape:
                raise ValueError(f"{name}: expected the shape {shape}, got {np.shape(given)}")
            array = np.array(given, dtype=np.int64 if name == "lines" else np.float64)
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return self.theta_i.size

    def __str__(self) -> str:
        return f"{self.path or 'BRDF'}: {len(self)} samples of {', '.join(self.channels)}"

    def thinned(self, samples: int) -> BrdfSamples:
        """At most `samples` of them, spread over the file. Raises UsageError if that is not above zero."""
        kept = spread(len(self), samples)
        if kept.size == len(self):
            return self
        note = f"{kept.size} of {len(self)} samples kept, spread over the file"
        return dataclasses.replace(self.at(kept), notes=(*self.notes, note))

    def at(self, rows: np.ndarray) -> BrdfSamples:
        """The samples of these rows, in their order."""
        names = [name for name in (*DIRECTIONS, *_TABLES, "lines") if getattr(self, name) is not None]
        return dataclasses.replace(self, **{name: getattr(self, name)[rows] for name in names})


def sigma_names(channels: tuple[str, ...]) -> tuple[str, ...]:
    """The columns of the standard deviations of `channels`."""
    return ("sigma",) if len(channels) == 1 else tuple(f"sigma_{channel}" for channel in channels)


def spread(count: int, samples: int) -> np.ndarray:
    """Indices, rising, of at most `samples` of `count` things, none twice, the same at every call.

    Those with the smallest fractional parts of index times golden section: no gap is longer than 2.6
    times the mean, without the beat that a regular step would have with the rows of a grid. A larger
    choice holds the smaller ones. Raises UsageError if `samples` is not above zero.
    """
    if samples < 1:
        raise UsageError(f"samples: {samples} must be above zero")
    if samples >= count:
        return np.arange(count)
    return np.sort(np.argpartition(np.arange(count) * _GOLDEN % 1, samples)[:samples])
