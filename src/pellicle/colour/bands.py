"""Ways to integrate over an eye and a lamp, by name.

Every way is a few bands: centres, widths, and what each adds to X, Y and Z. A band of no width is a
sample of the spectrum; a Gaussian one sees the film's Fourier orders damped by their optical path.
"""

from __future__ import annotations

import re
from functools import cache
from typing import NamedTuple

import numpy as np

from pellicle.colour.observers import SPAN, Sensor, columns, sensor
from pellicle.colour.spaces import SRGB_WHITE, TO_SRGB, adaptation

LONGEST_PATH = 12_000.0  # nm: beyond, our Gaussians let less than 4e-4 of an order through


class Bands(NamedTuple):
    """XYZ = (what each band sees) @ weights."""

    wavelength: np.ndarray  # (N,), nm: the centres
    width: np.ndarray | None  # (N,), 1/nm: standard deviations in 1/λ; None where samples are taken
    weights: np.ndarray  # (N, 3)
    orders: int = 0  # of the film's series, where bands have a width
    absorbs: bool = True  # False: meant for layers that do not absorb


def points(wavelengths, target: Sensor) -> Bands:
    """Reflectances at three wavelengths taken for linear red, green and blue, as shaders do."""
    to_xyz = adaptation(SRGB_WHITE, target.white) @ np.linalg.inv(TO_SRGB)
    return Bands(np.array(wavelengths, float), None, to_xyz.T)


def uniform(count: int, target: Sensor, frequency: bool = False) -> Bands:
    """Midpoints of equal steps in λ, or in ν = 1/λ; each 1 nm of the sensor is shared by its neighbours."""
    low, high = SPAN[0] - 0.5, SPAN[1] + 0.5
    place = (np.arange(count) + 0.5) / count
    if frequency:
        wavelength = 1 / (1 / high + place[::-1] * (1 / low - 1 / high))
        step = wavelength**2
    else:
        wavelength, step = low + place * (high - low), np.ones(count)
    values = [np.interp(wavelength, target.wavelength, column) * step for column in target.weights.T]
    weights = np.stack(values, axis=1)
    return Bands(wavelength, None, weights * target.white / weights.sum(axis=0))


class Transforms(NamedTuple):
    """A sensor's Fourier transform, as something to be matched."""

    path: np.ndarray  # (P,), optical paths in nm
    root: np.ndarray  # (P,), square roots of what each path counts
    exact: np.ndarray  # (2P, 3): root × real parts, then root × imaginary parts
    white: np.ndarray  # (3,)

    def columns(self, wavelength: np.ndarray, width: np.ndarray) -> np.ndarray:
        """The same of unit Gaussians in 1/λ at `wavelength`, (2P, N)."""
        path = self.path[:, None]
        return _stack(
            self.root[:, None] * np.exp(2j * np.pi * path / wavelength - 2 * (np.pi * path * width) ** 2)
        )


def transforms(target: Sensor, reach: float) -> Transforms:
    """Paths count alike up to `reach` (nm); path 0, the mean colour, ten thousand times more."""
    path = np.arange(0.0, reach + 1, 50.0)
    root = np.where(path == 0, 100.0, 1.0)
    exact = np.exp(2j * np.pi * path[:, None] / target.wavelength) @ target.weights
    return Transforms(path, root, _stack(exact * root[:, None]), target.white)


def _stack(z: np.ndarray) -> np.ndarray:
    return np.concatenate([np.real(z), np.imag(z)])


def fit_weights(wavelength: np.ndarray, width: np.ndarray, target: Transforms) -> np.ndarray:
    """The weights (N, 3) with which the bands' transforms come nearest the sensor's.

    A trace of ridge keeps neighbouring Gaussians from cancelling each other in float32.
    """
    ridge = 0.02 * np.eye(len(wavelength))
    columns = np.concatenate([target.columns(wavelength, width), ridge])
    exact = np.concatenate([target.exact, np.zeros((len(wavelength), 3))])
    weights = np.linalg.lstsq(columns, exact, rcond=None)[0]
    return weights * target.white / weights.sum(axis=0)


def _derived(kind: str, count: int, reach: float, target: Sensor) -> Bands:
    table = columns(f"{kind}.csv")
    chosen = (table["count"] == count) & (table["reach_nm"] == reach)
    if not chosen.any():
        known = sorted({(int(c), int(r)) for c, r in zip(table["count"], table["reach_nm"], strict=True)})
        raise ValueError(f"no {kind} of that size: expected (count, reach) among {known}")
    wavelength, width = table["wavelength_nm"][chosen], table["width_per_um"][chosen] / 1000
    weights = fit_weights(wavelength, width, transforms(target, reach))
    return Bands(wavelength, width if kind == "gaussians" else None, weights, orders=6)


def belcour_barla(target: Sensor) -> Bands:
    """Belcour and Barla 2017 as published: four Gaussians, three orders, illuminant E, no absorption.

    The constants of their plugin and of glTF Sample Viewer, MaterialX and three.js: height, place
    (1/m) and variance of exp(−V(2πD)²); their X has a second, blue lobe. Under another illuminant
    their colour is carried over by Bradford's adaptation, as renderers do.
    """
    height = np.array([5.4856e-13, 4.4201e-13, 5.2481e-13, 9.7470e-14])
    place = np.array([1.6810e6, 1.7953e6, 2.2084e6, 2.2399e6])
    variance = np.array([4.3278e9, 9.3046e9, 6.6121e9, 4.5282e9])
    weights = np.zeros((4, 3))
    weights[range(4), (0, 1, 2, 0)] = height * np.sqrt(2 * np.pi * variance) / 1.0685e-7
    to_target = adaptation(np.ones(3), target.white)
    return Bands(1e9 / place, np.sqrt(2 * variance) * 1e-9, weights @ to_target.T, orders=3, absorbs=False)


_WORD = re.compile(r"(points|uniform|frequency|nodes|gaussians)-(\d+(?:-\d+)*)")


@cache
def integration_bands(method: str = "gaussians-8", observer: str = "1931", illuminant: str = "D65") -> Bands:
    """The bands of a way by its name.

    `points-645-525-445` (any three, in nm), `uniform-32` (steps in λ), `frequency-32` (steps in
    1/λ), `nodes-8-500` (8 optimised samples for layers up to 500 nm), `belcour-barla` (as
    published), `gaussians-4`, `-5`, `-6`, `-8` and `-10` (ours). Raises ValueError for another name.

    Gaussians serve any thickness, and any lamp but for the four, whose centres are for E and daylight.
    There is no table of the sensors' transforms: `gaussians-8` come as near without one, and follow what
    the layer absorbs and how its index varies.
    """
    target = sensor(observer, illuminant)
    if method == "belcour-barla":
        return belcour_barla(target)
    found = _WORD.fullmatch(method)
    kind, numbers = (found[1], [int(n) for n in found[2].split("-")]) if found else ("", [])
    match kind, numbers:
        case "points", [_, _, _] if min(numbers) > 0:
            return points(numbers, target)
        case "uniform" | "frequency", [count] if count > 0:
            return uniform(count, target, kind == "frequency")
        case "nodes", [count, thickest]:
            return _derived("nodes", count, reach_of(thickest), target)
        case "gaussians", [count]:
            return _derived("gaussians", count, LONGEST_PATH, target)
    raise ValueError(
        f"method {method!r} is unknown: expected belcour-barla, gaussians-N, uniform-N, "
        "frequency-N, nodes-N-THICKEST or points-RED-GREEN-BLUE"
    )


def reach_of(thickest: float) -> float:
    """The optical path (nm) that samples for layers up to `thickest` nm are made to serve."""
    return 7.0 * thickest
