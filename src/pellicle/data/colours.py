"""Measured colours of a film as arrays, and their CSV."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pellicle.data.options import SPACES
from pellicle.data.spectrum import POLARISATIONS
from pellicle.errors import UsageError
from pellicle.files import write_text
from pellicle.signals.limits import Where, refuse_first

USUAL_NOISE = {"srgb": 1.5 / 255, "rgb": 0.01, "xyz": 0.005, "lab": 0.5}
"""Standard deviation of each channel where none is given: that of a good camera, or of a colorimeter."""
_REMEDY = "correct or delete that row"


class CameraMatrix(NamedTuple):
    """Colours as a camera records them: its linear R, G, B are `matrix` (3, 3) times the XYZ of the sensor.

    `covariance` (9, 9) is that of the matrix by rows, as a fit to a chart leaves it.
    """

    matrix: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, eq=False, repr=False)
class Colours:
    """Colours of one film, at one angle of incidence each.

    **Arguments:**

    - `values`: shape (colours, 3). "srgb": display values from 0 to 1; "rgb": those of the sensor's three
      channels, 1 for a perfect reflector, to the power 1/`gamma`; "xyz": Y = 1 for a perfect reflector;
      "lab": CIE 1976 L*, a*, b* relative to that white.
    - `sensor`: observer or camera under the lamp, as `pellicle.colour.sensor` returns it: wavelengths (N,) in
      nm, and weights (N, 3), reflectance @ weights being the colour. All spaces but "rgb" need an observer of
      the CIE, whose channels are X, Y and Z with Y = 1 for white; so do channels with a `camera`.
    - `space`: "rgb", "srgb", "xyz" or "lab".
    - `signal`: "R", or "T" for transmitted light.
    - `sigma`: standard deviations of `values`, shape (colours, 3); None for the usual ones of the space.
    - `angle` of incidence in degrees, (colours,); None leaves it to the scene.
    - `polarisation`: "s", "p" or "unpolarised".
    - `gamma` of "rgb".
    - `white_balance`: "fixed", or "free" where each channel has an unknown factor.
    - `camera`: matrix of a camera whose sensitivities are not known, by a chart.
    - `calibrated`: false for the channels of a camera that nobody calibrated: `sensor` is a guess at it.
    - `balance`: relative standard uncertainty of the white balance; None for the usual one.
    - `path`, `sha256`, `lines`: file, its digest and the source line of each colour.
    - `notes`: sentences on how the file was read.
    - `name` of these colours within their file.

    Values of 0 and 1 in "srgb" and "rgb" are limits: the film may be darker or brighter.

    **Raises:** DataError for values that are not finite or, in "srgb", not from 0 to 1, for a σ that is not
    positive and for angles beyond 0 to 90 degrees; UsageError for unknown words; ValueError for shapes.
    """

    values: np.ndarray
    sensor: tuple[np.ndarray, np.ndarray]
    space: str = "srgb"
    signal: str = "R"
    sigma: np.ndarray | None = None
    angle: np.ndarray | None = None
    polarisation: str = "unpolarised"
    gamma: float = 1.0
    white_balance: str = "fixed"
    camera: CameraMatrix | None = None
    path: str = ""
    sha256: str = ""
    lines: np.ndarray | None = None
    notes: tuple[str, ...] = ()
    name: str = ""
    calibrated: bool = True
    balance: float | None = None

    def __post_init__(self) -> None:
        values = np.asarray(self.values)
        if values.ndim != 2 or values.shape[1] != 3 or not len(values):
            raise ValueError(f"`values`: expected the shape (colours, 3), got {values.shape}")
        for name in ("values", "sigma", "angle", "lines"):
            if (given := getattr(self, name)) is None:
                continue
            array = np.array(given, dtype=np.int64 if name == "lines" else np.float64)
            if name == "sigma" and array.shape != values.shape:
                raise ValueError(f"`sigma`: expected the shape {values.shape}, got {array.shape}")
            if name in ("angle", "lines") and array.shape != (len(values),):
                raise ValueError(
                    f"`{name}`: expected one number per colour ({len(values)}), got {array.shape}"
                )
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        nm, weights = (np.array(x, dtype=np.float64) for x in self.sensor)
        if nm.ndim != 1 or weights.shape != (nm.size, 3):
            raise ValueError(
                f"`sensor`: expected the shapes (N,) and (N, 3), got {nm.shape}, {weights.shape}"
            )
        object.__setattr__(self, "sensor", (nm, weights))
        known = {"space": SPACES, "signal": ("R", "T"), "polarisation": POLARISATIONS}
        for name, words in (known | {"white_balance": ("fixed", "free")}).items():
            if getattr(self, name) not in words:
                raise UsageError(f"`{name}` must be one of {', '.join(words)}, not {getattr(self, name)!r}")
        if self.gamma != 1.0 and self.space != "rgb":
            raise UsageError(f'`gamma` goes with `space="rgb"`: {self.space} has its own coding')
        if not 0.1 <= self.gamma <= 10:
            raise UsageError(f"`gamma` must be a number from 0.1 to 10, such as 2.2, got {self.gamma:g}")
        if self.space != "rgb" and (self.camera is not None or self.white_balance == "free"):
            name = "camera" if self.camera is not None else "white_balance"
            raise UsageError(f'`{name}` goes with `space="rgb"`, the channels of a camera, not {self.space}')
        errors = np.ones((1, 3)) if self.sigma is None else self.sigma
        angle = np.zeros(1) if self.angle is None else self.angle
        for channel, column, spread in zip(self.channels, self.values.T, errors.T, strict=True):
            where, of_spread = self.place(channel), self.place(f"the standard deviation of {channel}")
            refuse_first(column, ~np.isfinite(column), where, f"is not finite; {_REMEDY}")
            if self.space == "srgb":
                outside = (column < 0) | (column > 1)
                refuse_first(column, outside, where, "is not from 0 to 1; divide 8-bit values by 255")
            wrong = ~(np.isfinite(spread) & (spread > 0))
            refuse_first(spread, wrong, of_spread, f"is not above zero; {_REMEDY}")
        beyond = ~((angle >= 0) & (angle <= 90))
        refuse_first(angle, beyond, self.place("angle"), "is not from 0 to 90 degrees")

    @property
    def channels(self) -> tuple[str, str, str]:
        """Names of the three channels."""
        return {"xyz": ("X", "Y", "Z"), "lab": ("L*", "a*", "b*")}.get(self.space, ("R", "G", "B"))

    @property
    def noise(self) -> np.ndarray:
        """Standard deviations (colours, 3): those given, or the usual ones of the space."""
        return np.full(self.values.shape, USUAL_NOISE[self.space]) if self.sigma is None else self.sigma

    @property
    def source(self) -> str:
        """Path of the file, and the name within it: `photo.png [patch 2]`."""
        return " ".join(part for part in (self.path, f"[{self.name}]" if self.name else "") if part)

    def place(self, name: str) -> Where:
        """Return the place of a colour, as a function of its row, for a message about `name`."""
        path = f"{self.source}: " if self.source else ""
        lines = self.lines
        return lambda row: f"{path}{f'colour {row}' if lines is None else f'line {lines[row]}'}: {name}"

    def __len__(self) -> int:
        return len(self.values)

    def __str__(self) -> str:
        plural = "s" * (len(self) != 1)
        return f"{self.source or 'colours'}: {len(self)} colour{plural} in {self.space}, {self.signal}"

    __repr__ = __str__


def write_colours(
    path: str | os.PathLike[str], films: Sequence[Colours], *, comments: Sequence[str] = ()
) -> Path:
    """Write colours of one film or several, in one space, as `pellicle.read_colours` reads them.

    The first comment states the space. Sensor, gamma and camera are not in the file.

    **Raises:** ValueError for films of different spaces, UsageError where the file exists or cannot be
    written.
    """
    first = films[0]
    if any(film.space != first.space for film in films):
        raise ValueError("films of one file must be in one space")
    named = any(film.name for film in films)
    angled = any(film.angle is not None for film in films)
    spread = any(film.sigma is not None for film in films)
    header = ["name"] * named + ["angle_deg"] * angled + list(first.channels)
    header += [f"sigma_{channel}" for channel in first.channels] * spread
    rows = []
    for film in films:
        angle = np.zeros(len(film)) if film.angle is None else film.angle
        for degrees, values, sigma in zip(angle, film.values, film.noise, strict=True):
            numbers = [*[degrees] * angled, *values, *(sigma if spread else ())]
            rows.append(",".join([f'"{film.name}"'] * named + [f"{x:.8g}" for x in numbers]))
    light = "transmitted" if first.signal == "T" else "reflected"
    lines = [f"# signal {first.space}, {light}, {first.polarisation}", *(f"# {line}" for line in comments)]
    write_text(path, "\n".join([*lines, ",".join(header), *rows, ""]))
    return Path(path)
