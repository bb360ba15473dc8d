"""CIE standard observers and illuminants: colour-matching functions times a lamp's spectrum."""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import NamedTuple

import numpy as np

SPAN = (380, 730)
"""Range of wavelengths in nm: the rest is below 5e-4 of X, Y and Z under every lamp."""

OBSERVERS = ("1931", "1964")
ILLUMINANTS = ("E", "A", "D50", "D55", "D65", "D75")


class Sensor(NamedTuple):
    """An observer under an illuminant, in steps of 1 nm."""

    wavelength: np.ndarray  # (351,), nm
    weights: np.ndarray  # (351, 3): reflectance @ weights is XYZ, with Y = 1 for a perfect reflector

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
    if illuminant not in ILLUMINANTS:
        raise ValueError(f"illuminant {illuminant!r} is unknown: expected one of {', '.join(ILLUMINANTS)}")
    table, lamps = columns("observers.csv"), columns("illuminants.csv")
    inside = (table["wavelength_nm"] >= SPAN[0]) & (table["wavelength_nm"] <= SPAN[1])
    wavelength = table["wavelength_nm"][inside]
    functions = np.stack([table[f"{axis}_{observer}"][inside] for axis in "xyz"], axis=1)
    if illuminant != "E":
        functions = functions * np.interp(wavelength, lamps["wavelength_nm"], lamps[illuminant])[:, None]
    return Sensor(wavelength, functions / functions[:, 1].sum())
