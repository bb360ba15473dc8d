"""Samples of a BRDF as arrays, and their CSV; directions as angles, vectors, half and difference angles.

Half and difference angles (radians) are those of Rusinkiewicz (A new change of variables for efficient BRDF
representation, 1998): with the normal along z, the half vector lies at (θ_h, φ_h), and the difference vector
(θ_d, φ_d) is one of the two directions after a rotation of the half vector onto the normal.
"""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np
from jaxtyping import Int

from pellicle.data.tabular.columns import DIRECTIONS
from pellicle.errors import DataError, UsageError
from pellicle.files import write_text
from pellicle.signals.limits import Where, noise_level, refuse_first

Angle = np.ndarray | float


def vectors(theta: Angle, phi: Angle) -> np.ndarray:
    """Return unit vectors of shape (3, ...)."""
    theta, phi = np.broadcast_arrays(theta, phi)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def angles(vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return θ from 0 to π and φ from 0 to 2π of vectors of shape (3, ...) and any length."""
    x, y, z = vector
    return np.arctan2(np.hypot(x, y), z), np.arctan2(y, x) % (2 * np.pi)


def from_half_difference(
    theta_h: Angle, phi_h: Angle, theta_d: Angle, phi_d: Angle
) -> tuple[np.ndarray, np.ndarray]:
    """Return the two directions (3, ...) with these half and difference angles, that of φ_d first.

    The second is that of φ_d + π, the mirror image of the first at the half vector: adding π to φ_d swaps
    light and viewer.
    """
    x, y, z = vectors(theta_d, phi_d)
    return _rotated(x, y, z, theta_h, phi_h), _rotated(-x, -y, z, theta_h, phi_h)


def _rotated(x: np.ndarray, y: np.ndarray, z: np.ndarray, theta: Angle, phi: Angle) -> np.ndarray:
    """Rotate by θ about y, which takes the normal to the half vector, then by φ about z."""
    x, z = np.cos(theta) * x + np.sin(theta) * z, np.cos(theta) * z - np.sin(theta) * x
    return np.stack([np.cos(phi) * x - np.sin(phi) * y, np.sin(phi) * x + np.cos(phi) * y, z])


CHANNELS = (("value",), ("R", "G", "B"))
ROUNDING = 1e-3
"""Degrees by which theta may exceed its limits: π/2 with four decimals is not below the horizon."""

DARKEST = 1e-3
"""Share of the median value below which values are alike: to the cube root, and to a relative noise."""

_TABLES = ("values", "sigma")
_GOLDEN = (math.sqrt(5) - 1) / 2
_REMEDY = "correct or delete that row"


@dataclass(frozen=True, eq=False)
class BrdfSamples:
    """Values of a BRDF at pairs of directions, in the order of the file.

    **Arguments:** the angles have shape (samples,) and are in degrees.

    - `theta_i`, `phi_i`: direction to the light, from the normal and around it; `theta_o`, `phi_o`: direction
      to the viewer. The mirror direction of phi_i = 0 has phi_o = 180.
    - `values`: the BRDF in 1/sr, shape (samples, channels).
    - `channels`: ("value",) or ("R", "G", "B").
    - `sigma`: standard deviations of `values`, in their shape, or None.
    - `relative`: the share of the signal that `sigma` is in each channel, 0 where it is not in proportion;
      a fit then takes σ from the fitted values, which have no noise.
    - `path`, `sha256`, `lines`: file, its digest and the source line of each sample.
    - `notes`: sentences on how the file was read.

    **Raises:** DataError for directions below the horizon, a negative BRDF and a standard deviation that is
    not positive; ValueError for shapes.
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
    relative: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if self.channels not in CHANNELS:
            raise ValueError(f"`channels`: expected ('value',) or ('R', 'G', 'B'), got {self.channels}")
        size = np.size(self.theta_i)
        for name in (*DIRECTIONS, *_TABLES, "lines"):
            value = getattr(self, name)
            if value is None:
                continue
            shape = (size, len(self.channels)) if name in _TABLES else (size,)
            if np.shape(value) != shape:
                raise ValueError(f"`{name}`: expected the shape {shape}, got {np.shape(value)}")
            array = np.array(value, dtype=np.int64 if name == "lines" else np.float64)
            if name in ("theta_i", "theta_o"):
                remedy = "write theta from 0 to 90 degrees, the far side with phi + 180"
                inside = (array >= -ROUNDING) & (array <= 90 + ROUNDING)
                reason = f"degrees is below the horizon; {remedy}"
                refuse_first(array, ~inside, self._place(name), reason)
                array = np.clip(array, 0, 90)
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        values = dict(zip(self.channels, self.values.T, strict=True))
        sigma = () if self.sigma is None else self.sigma.T
        errors = {f"the standard deviation of {x}": y for x, y in zip(self.channels, sigma, strict=False)}
        for name, column in ({"phi_i": self.phi_i, "phi_o": self.phi_o} | values | errors).items():
            refuse_first(column, ~np.isfinite(column), self._place(name), f"is not finite; {_REMEDY}")
        for name, column in values.items():
            refuse_first(column, column < 0, self._place(name), f"is a BRDF below zero; {_REMEDY}")
        for name, column in errors.items():
            refuse_first(column, column <= 0, self._place(name), f"is not above zero; {_REMEDY}")

    def _place(self, name: str) -> Where:
        path = f"{self.path}: " if self.path else ""
        lines = self.lines
        return lambda row: f"{path}{'sample ' + str(row) if lines is None else f'line {lines[row]}'}: {name}"

    def __len__(self) -> int:
        return self.theta_i.size

    def __str__(self) -> str:
        return f"{self.path or 'BRDF'}: {len(self)} samples of {', '.join(self.channels)}"

    def thinned(self, samples: int) -> BrdfSamples:
        """Keep at most `samples` samples, spread over the file. Raises UsageError unless it is positive."""
        kept = spread(len(self), samples)
        if kept.size == len(self):
            return self
        note = f"{kept.size} of {len(self)} samples kept, spread over the file"
        return dataclasses.replace(self.at(kept), notes=(*self.notes, note))

    def within(self, max_theta: float) -> BrdfSamples:
        """Leave out samples beyond an angle from the normal. Raises DataError where none is left."""
        kept = np.flatnonzero(np.maximum(self.theta_i, self.theta_o) <= max_theta)
        if not kept.size:
            raise DataError(
                f"{self.path}: has no sample within {max_theta:g} degrees of the normal; raise `max_theta`"
            )
        note = f"left out: {len(self) - kept.size} samples more than {max_theta:g} degrees from the normal"
        return dataclasses.replace(self.at(kept), notes=(*self.notes, note))

    def with_noise(self, noise: float | str | Sequence[float | str]) -> BrdfSamples:
        """Return the samples with standard deviations.

        **Arguments:** `noise`, one for all channels or one for each: a number in 1/sr, or a share of the
        signal as "2 %". Values below a thousandth of the median have the noise of that.

        **Raises:** UsageError where a noise is not above zero, or there is not one for each channel.
        """
        given = [noise] if isinstance(noise, str | float | int) else list(noise)
        if len(given) not in (1, len(self.channels)):
            raise UsageError(
                f"`noise` has {len(given)} numbers for {len(self.channels)} channels "
                f"({', '.join(self.channels)}); give one or each"
            )
        levels = [noise_level(level) for level in given] * (len(self.channels) // len(given))
        share = np.array([level.value * level.relative for level in levels])
        same = np.array([level.value * (not level.relative) for level in levels])
        floor = max(DARKEST * float(np.median(self.values)), 1e-12)
        sigma = share * np.maximum(self.values, floor) + same
        return dataclasses.replace(self, sigma=sigma, relative=tuple(share.tolist()) if share.any() else None)

    def at(self, rows: np.ndarray) -> BrdfSamples:
        """Return the samples of rows (N,), in their order."""
        names = [name for name in (*DIRECTIONS, *_TABLES, "lines") if getattr(self, name) is not None]
        return dataclasses.replace(self, **{name: getattr(self, name)[rows] for name in names})


def sigma_names(channels: tuple[str, ...]) -> tuple[str, ...]:
    """Return the column names of the standard deviations of `channels`."""
    return ("sigma",) if len(channels) == 1 else tuple(f"sigma_{channel}" for channel in channels)


def spread(count: int, samples: int) -> Int[np.ndarray, " samples"]:
    """Return rising indices of at most `samples` of `count` items, without repetition, the same each time.

    They have the smallest fractional parts of index times golden section: no gap is longer than 2.6 times
    the mean, without the beat that a regular step would have with the rows of a grid. A larger choice
    includes the smaller ones. Raises UsageError if `samples` is not positive.
    """
    if samples < 1:
        raise UsageError(f"`samples` must be above zero, got {samples}")
    if samples >= count:
        return np.arange(count)
    return np.sort(np.argpartition(np.arange(count) * _GOLDEN % 1, samples)[:samples])


def write_brdf_samples(
    path: str | os.PathLike[str],
    samples: BrdfSamples,
    *,
    comments: Sequence[str] = (),
    overwrite: bool = False,
) -> None:
    """Write samples as CSV, which `read_brdf_samples` reads back unchanged.

    `comments` are lines of the header. Raises UsageError where `path` exists without `overwrite`, or cannot
    be written.
    """
    sigma = [] if samples.sigma is None else [samples.sigma]
    names = [*DIRECTIONS, *samples.channels, *(sigma_names(samples.channels) if sigma else ())]
    header = [
        "# BRDF in 1/sr; directions in degrees, from the normal and around it",
        *(f"# {line}" for line in comments),
        f"# from {' '.join(samples.path.split()) or 'samples'}, sha256 {samples.sha256 or 'unknown'}",
        f"# written by pellicle {version('pellicle')}",
        ",".join(names),
    ]
    columns = [*(getattr(samples, name) for name in DIRECTIONS), samples.values, *sigma]
    # each number with the digits that reproduce it exactly
    rows = (",".join(map(repr, row)) for row in np.column_stack(columns).tolist())
    write_text(path, "\n".join([*header, *rows, ""]), overwrite=overwrite)
