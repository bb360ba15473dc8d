"""Methods to integrate a spectrum over an observer and an illuminant, by name.

Every method is a set of bands: centres, widths, and weights for X, Y and Z. A band without a width is a
sample of the spectrum; in a Gaussian band the film's Fourier orders are damped by their optical path.
"""

import re
from functools import cache
from typing import NamedTuple

import numpy as np

from pellicle.colour.observers import SPAN, Sensor, columns, sensor
from pellicle.colour.spaces import SRGB_WHITE, TO_SRGB, adaptation

LONGEST_PATH = 12_000.0
"""Optical path (nm) beyond which our Gaussians transmit less than 4e-4 of an order."""


class Bands(NamedTuple):
    """Bands of a method: XYZ = (reflectance in each band) @ weights."""

    wavelength: np.ndarray  # (N,), nm: the centres
    width: np.ndarray | None  # (N,), 1/nm: standard deviations in 1/λ; None for samples
    weights: np.ndarray  # (N, 3)
    orders: int = 0  # of the film's series, if the bands have a width
    absorbs: bool = True  # False for a method that excludes absorbing layers


def points(wavelengths, target: Sensor) -> Bands:
    """Take the reflectances at three wavelengths for linear red, green and blue, as shaders do."""
    to_xyz = adaptation(SRGB_WHITE, target.white) @ np.linalg.inv(TO_SRGB)
    return Bands(np.array(wavelengths, float), None, to_xyz.T)


def uniform(count: int, target: Sensor, frequency: bool = False) -> Bands:
    """Sample at the midpoints of equal steps in λ, or in ν = 1/λ if `frequency`."""
    low, high = SPAN[0] - 0.5, SPAN[1] + 0.5
    fraction = (np.arange(count) + 0.5) / count
    if frequency:
        wavelength = 1 / (1 / high + fraction[::-1] * (1 / low - 1 / high))
        step = wavelength**2
    else:
        wavelength, step = low + fraction * (high - low), np.ones(count)
    values = [np.interp(wavelength, target.wavelength, column) * step for column in target.weights.T]
    weights = np.stack(values, axis=1)
    return Bands(wavelength, None, weights * target.white / weights.sum(axis=0))


class SensorTransform(NamedTuple):
    """Fourier transform of a sensor, the target of the fitted weights."""

    path: np.ndarray  # (P,), optical paths in nm
    root: np.ndarray  # (P,), square roots of the weight of each path
    exact: np.ndarray  # (2P, 3): root × real parts, then root × imaginary parts
    white: np.ndarray  # (3,)

    def columns(self, wavelength: np.ndarray, width: np.ndarray) -> np.ndarray:
        """Return the transforms of unit Gaussians in 1/λ at `wavelength`, (2P, N)."""
        path = self.path[:, None]
        return _stack(
            self.root[:, None] * np.exp(2j * np.pi * path / wavelength - 2 * (np.pi * path * width) ** 2)
        )


def sensor_transform(target: Sensor, reach: float) -> SensorTransform:
    """Return the transform at paths up to `reach` (nm), of equal weight; path 0, the mean colour, has 1e4."""
    path = np.arange(0.0, reach + 1, 50.0)
    root = np.where(path == 0, 100.0, 1.0)
    exact = np.exp(2j * np.pi * path[:, None] / target.wavelength) @ target.weights
    return SensorTransform(path, root, _stack(exact * root[:, None]), target.white)


def _stack(z: np.ndarray) -> np.ndarray:
    return np.concatenate([np.real(z), np.imag(z)])


def fit_weights(wavelength: np.ndarray, width: np.ndarray, target: SensorTransform) -> np.ndarray:
    """Fit the weights (N, 3) of bands to the transform of a sensor, by linear least squares.

    A small ridge keeps neighbouring Gaussians from cancelling each other in float32.
    """
    ridge = 0.02 * np.eye(len(wavelength))
    columns = np.concatenate([target.columns(wavelength, width), ridge])
    exact = np.concatenate([target.exact, np.zeros((len(wavelength), 3))])
    weights = np.linalg.lstsq(columns, exact, rcond=None)[0]
    return weights * target.white / weights.sum(axis=0)


def _tabulated(kind: str, count: int, reach: float, target: Sensor) -> Bands:
    table = columns(f"{kind}.csv")
    rows = (table["count"] == count) & (table["reach_nm"] == reach)
    if not rows.any():
        known = sorted({(int(c), int(r)) for c, r in zip(table["count"], table["reach_nm"], strict=True)})
        raise ValueError(f"no {kind} of that size: expected (count, reach) among {known}")
    wavelength, width = table["wavelength_nm"][rows], table["width_per_um"][rows] / 1000
    weights = fit_weights(wavelength, width, sensor_transform(target, reach))
    return Bands(wavelength, width if kind == "gaussians" else None, weights, orders=6)


@cache
def published_gaussians() -> Bands:
    """Return the bands of Belcour and Barla 2017 as published: four Gaussians, three orders, no absorption.

    The constants are those of their plugin and of glTF Sample Viewer, MaterialX and three.js: height,
    centre (1/m) and variance of exp(−V(2πD)²); X has a second, blue lobe. Their white is that of E.
    """
    height = np.array([5.4856e-13, 4.4201e-13, 5.2481e-13, 9.7470e-14])
    centre = np.array([1.6810e6, 1.7953e6, 2.2084e6, 2.2399e6])
    variance = np.array([4.3278e9, 9.3046e9, 6.6121e9, 4.5282e9])
    weights = np.zeros((4, 3))
    weights[range(4), (0, 1, 2, 0)] = height * np.sqrt(2 * np.pi * variance) / 1.0685e-7
    return Bands(1e9 / centre, np.sqrt(2 * variance) * 1e-9, weights, orders=3, absorbs=False)


_WORD = re.compile(r"(points|uniform|frequency|nodes|gaussians)-(\d+(?:-\d+)*)")


@cache
def integration_bands(method: str = "gaussians-8", observer: str = "1931", illuminant: str = "D65") -> Bands:
    """Return the bands of a method by its name.

    **Arguments:** `method` is one of

    - `points-645-525-445`: any three wavelengths, in nm;
    - `uniform-32`, `frequency-32`: equal steps in λ, or in 1/λ;
    - `nodes-8-500`: 8 optimised samples for layers up to 500 nm;
    - `belcour-barla`: as published;
    - `gaussians-4`, `-5`, `-6`, `-8`, `-10`: ours, for any thickness and any lamp, except that the
      centres of the four are for E and daylight.

    There is no method with a table of the sensors' transforms: `gaussians-8` are as accurate without one,
    and follow the absorption of the layer and the dispersion of its index.

    **Raises:** ValueError for an unknown name.

    >>> integration_bands("uniform-4").wavelength.tolist()
    [423.375, 511.125, 598.875, 686.625]
    """
    target = sensor(observer, illuminant)
    if method == "belcour-barla":
        published, from_equal_energy = published_gaussians(), adaptation(np.ones(3), target.white)
        return published._replace(weights=published.weights @ from_equal_energy.T)
    match_ = _WORD.fullmatch(method)
    kind, numbers = (match_[1], [int(n) for n in match_[2].split("-")]) if match_ else ("", [])
    match kind, numbers:
        case "points", [_, _, _] if min(numbers) > 0:
            return points(numbers, target)
        case "uniform" | "frequency", [count] if count > 0:
            return uniform(count, target, kind == "frequency")
        case "nodes", [count, thickest]:
            return _tabulated("nodes", count, reach_of(thickest), target)
        case "gaussians", [count]:
            return _tabulated("gaussians", count, LONGEST_PATH, target)
    raise ValueError(
        f"method {method!r} is unknown: expected belcour-barla, gaussians-N, uniform-N, "
        "frequency-N, nodes-N-THICKEST or points-RED-GREEN-BLUE"
    )


def reach_of(thickest: float) -> float:
    """Return the longest optical path (nm) of the samples for layers up to `thickest` nm."""
    return 7.0 * thickest
