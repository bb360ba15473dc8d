"""Sensors: the CIE standard observers under its illuminants, and cameras and observers under any lamp."""

from functools import cache
from importlib import resources
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pellicle.colour.spaces import srgb_matrix

SPAN = (380, 730)
"""Range of wavelengths in nm: the rest is below 5e-4 of X, Y and Z under every lamp."""

OBSERVERS = ("1931", "1964")
ILLUMINANTS = ("E", "A", "D50", "D55", "D65", "D75")

_TAIL = 5e-4
"""Share of a channel's white that each end of a sensor may lose; the CIE observers lose as much."""
_CUT = 0.05
"""Sensitivity, relative to its largest, that a channel may have where the table of camera or lamp ends."""


class Sensor(NamedTuple):
    """An observer or a camera under a lamp, in steps of 1 nm."""

    wavelength: np.ndarray  # (N,), nm; (351,) of an observer
    weights: np.ndarray  # (N, 3): reflectance @ weights is XYZ, or R, G, B, of Y = 1 for white

    @property
    def white(self) -> np.ndarray:
        """XYZ of a perfect reflector, (3,)."""
        return self.weights.sum(axis=0)


@cache
def columns(name: str) -> dict[str, np.ndarray]:
    """Read the columns of a table of the package, by name."""
    text = (resources.files("pellicle.colour") / "data" / name).read_text(encoding="utf-8")
    header, *rows = [line.split(",") for line in text.splitlines() if not line.startswith("#")]
    return dict(zip(header, np.array(rows, dtype=float).T, strict=True))


@cache
def sensor(observer: str = "1931", illuminant: str = "D65") -> Sensor:
    """Return the sensor of an observer under an illuminant.

    Illuminants are tabulated in steps of 5 nm and interpolated linearly, as CIE 15 requires.

    **Arguments:** `observer` "1931" (2°) or "1964" (10°); `illuminant` one of `ILLUMINANTS`.

    **Raises:** ValueError for an unknown name.

    >>> sensor("1931", "E").white.round(3).tolist()
    [1.0, 1.0, 1.0]
    """
    if observer not in OBSERVERS:
        raise ValueError(f"observer {observer!r} is unknown: expected one of {', '.join(OBSERVERS)}")
    lamp, table = illuminant_spectrum(illuminant), columns("observers.csv")
    inside = (table["wavelength_nm"] >= SPAN[0]) & (table["wavelength_nm"] <= SPAN[1])
    wavelength = table["wavelength_nm"][inside]
    functions = np.stack([table[f"{axis}_{observer}"][inside] for axis in "xyz"], axis=1)
    functions = functions * np.interp(wavelength, *lamp)[:, None]
    return Sensor(wavelength, functions / functions[:, 1].sum())


def camera_sensor(
    wavelength: ArrayLike, sensitivities: ArrayLike, lamp_wavelength: ArrayLike, lamp: ArrayLike
) -> Sensor:
    """Return the sensor of a camera under a lamp, white-balanced: each channel of a perfect reflector is 1.

    Both tables are interpolated linearly to steps of 1 nm. The ends, where each channel receives less than
    5e-4 of its white, are left out.

    **Arguments:**

    - `wavelength`: rising, (N,), nm; `sensitivities` of the three channels, (N, 3), in any unit: signal per
      power of the light.
    - `lamp_wavelength`: rising, (M,), nm; `lamp`: power per wavelength in any unit, (M,).

    **Raises:** ValueError for tables that overlap by less than 100 nm; where the camera still sees light at
    the end of its table or beyond the lamp's (above 5 % of its largest sensitivity); and for a channel
    without light.

    >>> nm = np.arange(400.0, 701.0, 10.0)
    >>> bands = np.exp(-(((nm[:, None] - [600.0, 540.0, 460.0]) / 25) ** 2))
    >>> camera_sensor(nm, bands, [300.0, 800.0], [1.0, 1.0]).white.round(6).tolist()
    [1.0, 1.0, 1.0]
    """
    seen_at, seen = _increasing("wavelength", wavelength), np.asarray(sensitivities, float)
    lit_at, power = _increasing("lamp_wavelength", lamp_wavelength), np.asarray(lamp, float)
    if seen.shape != (seen_at.size, 3) or power.shape != lit_at.shape:
        raise ValueError(
            f"expected the shapes (N, 3) and (M,) of the tables, got {seen.shape}, {power.shape}"
        )
    nm = np.arange(np.ceil(max(seen_at[0], lit_at[0])), np.floor(min(seen_at[-1], lit_at[-1])) + 1)
    if nm.size < 100:
        raise ValueError(
            f"the camera is known from {seen_at[0]:g} to {seen_at[-1]:g} nm and the lamp from {lit_at[0]:g}"
            f" to {lit_at[-1]:g} nm: they must share 100 nm"
        )
    relative = seen / seen.max(axis=0)
    beyond = np.max(np.abs(relative[(seen_at <= nm[0]) | (seen_at >= nm[-1])]), axis=0)
    if np.any(beyond > _CUT):
        name, share = "RGB"[int(np.argmax(beyond))], 100 * beyond.max()
        raise ValueError(
            f"the channel {name} has {share:.0f} % of its sensitivity at or beyond {nm[0]:g} or {nm[-1]:g}"
            " nm, where the table of the camera or of the lamp ends: give tables of the whole range"
        )
    channels = [np.interp(nm, seen_at, channel) for channel in seen.T]
    both = np.stack(channels, axis=1) * np.interp(nm, lit_at, power)[:, None]
    white = both.sum(axis=0)
    if not np.all(white > 0):
        raise ValueError(f"the channel {'RGB'[int(np.argmin(white))]} receives no light from this lamp")
    return _trimmed(nm, both / white)


def observer_sensor(observer: str, lamp_wavelength: ArrayLike, lamp: ArrayLike) -> Sensor:
    """Return the sensor of an observer of the CIE under a measured lamp; Y = 1 for a perfect reflector.

    **Arguments:** `observer` "1931" or "1964"; the lamp as in `camera_sensor`, from 390 to 720 nm at least:
    beyond its table it has the power of its last point, up to 380 and 730 nm.

    **Raises:** ValueError for an unknown observer, a table that ends before that and one without light.
    """
    eye = sensor(observer, "E")
    lit_at, power = _increasing("lamp_wavelength", lamp_wavelength), np.asarray(lamp, float)
    if lit_at[0] > 390 or lit_at[-1] < 720:
        raise ValueError(
            f"the lamp is known from {lit_at[0]:g} to {lit_at[-1]:g} nm: an observer needs it from 390 to"
            " 720 nm"
        )
    weights = eye.weights * np.interp(eye.wavelength, lit_at, power)[:, None]
    if not weights[:, 1].sum() > 0:
        raise ValueError("the lamp has no light that an observer sees")
    return Sensor(eye.wavelength, weights / weights[:, 1].sum())


def srgb_sensor(eye: Sensor) -> Sensor:
    """Return an observer's sensor whose channels are linear sRGB, adapted to its white by Bradford."""
    return Sensor(eye.wavelength, eye.weights @ srgb_matrix(eye.white).T)


@cache
def illuminant_spectrum(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return wavelengths (nm) and relative power of an illuminant of the CIE, one of `ILLUMINANTS`.

    **Raises:** ValueError for another name.
    """
    if name not in ILLUMINANTS:
        raise ValueError(f"illuminant {name!r} is unknown: expected one of {', '.join(ILLUMINANTS)}")
    lamps = columns("illuminants.csv")
    nm = lamps["wavelength_nm"]
    return nm, lamps.get(name, np.ones(nm.shape))  # E has equal energy at all wavelengths


def _increasing(name: str, values: ArrayLike) -> np.ndarray:
    nm = np.asarray(values, float)
    if nm.ndim != 1 or nm.size < 2 or not np.all(np.diff(nm) > 0):
        raise ValueError(f"`{name}` must be two or more rising numbers, in nm")
    return nm


def _trimmed(nm: np.ndarray, weights: np.ndarray) -> Sensor:
    """Without the ends that hold less than `_TAIL` of every channel, which keeps its white of 1."""
    share = np.cumsum(np.abs(weights), axis=0) / np.abs(weights).sum(axis=0)
    inside = np.any(share > _TAIL, axis=1) & np.any(share < 1 - _TAIL, axis=1)
    first, last = np.flatnonzero(inside)[[0, -1]]
    kept = slice(int(first), int(last) + 2)
    return Sensor(nm[kept], weights[kept] / weights[kept].sum(axis=0))
