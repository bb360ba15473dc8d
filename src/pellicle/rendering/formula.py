"""A renderer's own formula of a film's colour, and the numbers with which it comes nearest to the exact ones.

`physical` numbers are those of the film as it is. `effective` ones, of thickness, index and base, are solved
by bounded least squares over the angles (and the thicknesses of a map), from several thicknesses: formulas
shift fringes, and a neighbouring order may fit better. Residuals are CIE 1994 differences, which are linear
in L*, a* and b*. From the best of these solutions a simplex search minimises the mean ΔE2000 itself.

`sensitivity` and `series` are spectral sensitivities in Fourier space and Airy's series, as renderers
approximate them: L. Belcour and P. Barla, ACM TOG 36(4), 65 (2017), in the form that glTF and MaterialX
publish.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from scipy.optimize import minimize

from pellicle.colour import delta_e2000, lab, sensor
from pellicle.colour.bands import published_gaussians
from pellicle.colour.spaces import srgb_matrix
from pellicle.fitting.optimistix_solver import BoundedLevenbergMarquardt
from pellicle.rendering.appearance import ANGLES, Appearance

Numbers = Mapping[str, Any]
"""Numbers of a formula by key: arrays () or (3,) of red, green and blue."""


class Key(NamedTuple):
    """A number of a formula that may be solved for: its bounds, and 1 or 3 channels."""

    name: str
    lower: float
    upper: float
    channels: int = 1


@dataclass(frozen=True)
class Formula:
    """A renderer's formula of a film's colour.

    `colour` takes numbers by key, thicknesses (..., ) in nm and cosines (..., ) of the angle of incidence,
    which broadcast, and returns linear sRGB (..., 3), not above what the renderer would show. `physical` are
    the numbers of a film as a user would copy them from a table. `keys` are those that may be solved for,
    beside the thickness.
    """

    name: str
    keys: tuple[Key, ...]
    colour: Callable[[Numbers, Any, Any], Any]
    physical: Callable[[Appearance], Numbers]

    def xyz(self, numbers: Numbers, thickness: Any) -> Any:
        """XYZ (thicknesses, angles, 3) at `ANGLES` under D65, where linear sRGB (1, 1, 1) is white."""
        return self.xyz_at(numbers, jnp.asarray(thickness)[:, None], np.cos(np.deg2rad(ANGLES)))

    def xyz_at(self, numbers: Numbers, thickness: Any, cosine: Any) -> Any:
        """XYZ (..., 3) under D65 at thicknesses (nm) and cosines, which broadcast."""
        rgb = self.colour(numbers, thickness, cosine)
        matrix = np.linalg.inv(srgb_matrix(sensor().white))
        return rgb @ jnp.asarray(matrix.T, rgb.dtype)


def lab_of(xyz: Any, brightest: Any) -> Any:
    """CIE 1976 L*, a*, b* of XYZ (..., 3) with the exposure at which the Y `brightest` is white.

    A camera exposes for the image: without that, errors of dark films would look small.
    """
    return lab(xyz / brightest, sensor().white)


ORDERS = 2
"""Orders of interference that glTF and MaterialX sum."""


def sensitivity(path: Any, shift: Any) -> Any:
    """XYZ (..., 3) under E of cos(2π·path/λ + shift), for optical paths (...) in nm and shifts (..., 3)."""
    bands = published_gaussians()
    channel = np.array([0, 1, 2, 0])  # the second lobe of X has the shift of the first
    phase = 2 * jnp.pi * path[..., None]
    wavelength, width, weights = (jnp.asarray(x, phase.dtype) for x in bands[:3])
    waves = jnp.cos(phase / wavelength + shift[..., channel])
    return (waves * jnp.exp(-0.5 * (phase * width) ** 2)) @ weights


def series(
    first: Any, second: Any, path: Any, shift: Any, to_channels: Any, product: tuple[float, float]
) -> Any:
    """Reflectance (..., 3) of a film as order 0 and two orders of interference.

    **Arguments:** `first`, `second`: reflectances of the upper and of the lower face; `path`: optical path
    difference (...) in nm; `shift`: phase (..., 3) of both reflections; `to_channels`: converts the XYZ of a
    wave (..., 3) to the channels of the sum; `product`: bounds of the product of both reflectances, whose
    root has no slope at 0.
    """
    passed, both = 1 - first, jnp.clip(first * second, *product)
    returned = passed**2 * second / (1 - both)
    total, term = first + returned, returned - passed
    for order in range(1, ORDERS + 1):
        term = term * jnp.sqrt(both)
        total = total + 2 * term * to_channels(sensitivity(order * path, order * shift))
    return total


SCALES = np.concatenate([np.linspace(0.6, 1.6, 21), [2.0, 2.5]])
"""Factors of the thickness from which the solver starts."""
_BOUNDS = (0.25, 4.0)
_STEPS = 60


class ColourError(NamedTuple):
    """ΔE2000 from the exact colours, 0 to 80 degrees: mean and largest."""

    mean: float
    largest: float


class Solution(NamedTuple):
    """Numbers of a formula and their error. The film's thickness is that of the appearance times `scale`."""

    numbers: dict[str, np.ndarray]
    scale: float
    error: ColourError


def physical(formula: Formula, look: Appearance) -> Solution:
    """The numbers of the film as they are, and their error in this formula."""
    numbers = {key: np.asarray(x, float) for key, x in formula.physical(look).items()}
    return Solution(numbers, 1.0, error(formula, look, numbers, 1.0))


def error(formula: Formula, look: Appearance, numbers: Numbers, scale: float) -> ColourError:
    """ΔE2000 of a formula's colours from the exact ones."""
    with jax.enable_x64(True):
        simulated = _xyz(formula, dict(numbers), scale * look.thickness)
    brightest = np.max(look.xyz[..., 1])
    difference = delta_e2000(*(lab_of(xyz, brightest) for xyz in (np.asarray(simulated), look.xyz)))
    return ColourError(float(np.mean(difference)), float(np.max(difference)))


def effective(formula: Formula, look: Appearance) -> Solution:
    """Solve for the numbers whose colours are nearest to the exact ones, never worse than the physical ones.

    **Raises:** ImportError without colour-science.
    """
    start = physical(formula, look)
    keys = formula.keys
    lower, upper = (
        np.concatenate([[_BOUNDS[i]], *(np.full(key.channels, key[1 + i]) for key in keys)]) for i in (0, 1)
    )
    own = np.concatenate([np.ravel(start.numbers[k.name]) for k in keys])
    # a little inside the bounds, where every number has a slope
    inside = np.clip(own, lower[1:] + 0.01 * (upper - lower)[1:], upper[1:] - 0.01 * (upper - lower)[1:])
    starts = np.concatenate([SCALES[:, None], np.tile(inside, (len(SCALES), 1))], axis=1)
    fixed = {key: x for key, x in start.numbers.items() if key not in {k.name for k in keys}}
    with jax.enable_x64(True):
        solved = np.asarray(_solved(formula, starts, (lower, upper, fixed, _truth(look))))
    solved = solved[np.all(np.isfinite(solved), axis=1)]

    def solution(x: np.ndarray) -> Solution:
        numbers = {key: np.asarray(value) for key, value in _numbers(formula, x[1:]).items()} | fixed
        return Solution(numbers, float(x[0]), error(formula, look, numbers, float(x[0])))

    # the mean ΔE2000 of six films, 20 nm to 3 µm thick and on four bases, is lowered by up to a quarter
    candidates = [np.concatenate([[1.0], inside]), *solved]
    best, span = min(candidates, key=lambda x: solution(x).error.mean), upper - lower
    polished = minimize(
        lambda share: solution(lower + span * share).error.mean,
        (best - lower) / span,
        method="Nelder-Mead",
        bounds=[(0.0, 1.0)] * len(span),
        options={"xatol": 1e-4, "fatol": 1e-4, "maxfev": 200 * len(span)},
    ).x
    return min(start, solution(lower + span * polished), key=lambda s: s.error.mean)


def _numbers(formula: Formula, values: Any) -> dict[str, Any]:
    numbers, at = {}, 0
    for key in formula.keys:
        numbers[key.name] = values[at : at + key.channels] if key.channels > 1 else values[at]
        at += key.channels
    return numbers


def _truth(look: Appearance) -> dict[str, Any]:
    """The exact colours, and the directions and weights of CIE 1994 differences from them."""
    brightest = np.max(look.xyz[..., 1])
    lab = np.asarray(lab_of(look.xyz, brightest))
    chroma = np.hypot(lab[..., 1], lab[..., 2])
    hue = np.arctan2(lab[..., 2], lab[..., 1])
    return {
        "thickness": look.thickness,
        "brightest": brightest,
        "lab": lab,
        "hue": np.stack([np.cos(hue), np.sin(hue)], axis=-1),
        "weights": np.stack([np.ones_like(chroma), 1 / (1 + 0.045 * chroma), 1 / (1 + 0.015 * chroma)], -1),
    }


_xyz = jax.jit(Formula.xyz, static_argnums=0)


@partial(jax.jit, static_argnums=0)
def _solved(formula: Formula, starts: Any, given: Any) -> Any:
    lower, upper, fixed, truth = given

    def residuals(x: Any, _: Any) -> Any:
        numbers = _numbers(formula, x[1:]) | fixed
        xyz = formula.xyz(numbers, x[0] * truth["thickness"])
        off = lab_of(xyz, truth["brightest"]) - truth["lab"]
        cos, sin = truth["hue"][..., 0], truth["hue"][..., 1]
        along, across = cos * off[..., 1] + sin * off[..., 2], cos * off[..., 2] - sin * off[..., 1]
        return jnp.stack([off[..., 0], along, across], axis=-1) * truth["weights"]

    def solve(x: Any) -> Any:
        solver = BoundedLevenbergMarquardt(1e-6, 1e-6)
        options = {"lower": lower, "upper": upper}
        return optx.least_squares(residuals, solver, x, options=options, max_steps=_STEPS, throw=False).value

    return jax.vmap(solve)(starts)
