"""Effective thickness, index and base with which a renderer's own formula gives a film's exact colours.

Bounded least squares over the angles (and the thicknesses of a map), from several thicknesses: formulas
shift fringes, and a neighbouring order may fit better. Residuals are CIE 1994 differences, which are linear
in L*, a* and b* and close to ΔE2000; the best start is chosen by ΔE2000.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from pellicle.colour import delta_e2000
from pellicle.fitting.levenberg_marquardt import BoundedLevenbergMarquardt
from pellicle.rendering.appearance import Appearance
from pellicle.rendering.formula import Formula, Numbers, lab_of

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
    lower = np.concatenate([[_BOUNDS[0]], *(np.full(k.channels, k.lower) for k in keys)])
    upper = np.concatenate([[_BOUNDS[1]], *(np.full(k.channels, k.upper) for k in keys)])
    own = np.concatenate([np.ravel(start.numbers[k.name]) for k in keys])
    # a little inside the bounds, where every number has a slope
    inside = np.clip(own, lower[1:] + 0.01 * (upper - lower)[1:], upper[1:] - 0.01 * (upper - lower)[1:])
    starts = np.concatenate([SCALES[:, None], np.tile(inside, (len(SCALES), 1))], axis=1)
    fixed = {key: x for key, x in start.numbers.items() if key not in {k.name for k in keys}}
    with jax.enable_x64(True):
        solved = np.asarray(_solved(formula, starts, (lower, upper, fixed, _truth(look))))
    solutions = [start]
    for x in solved[np.all(np.isfinite(solved), axis=1)]:
        numbers = {key: np.asarray(value) for key, value in _numbers(formula, x[1:]).items()} | fixed
        scale = float(x[0])
        solutions.append(Solution(numbers, scale, error(formula, look, numbers, scale)))
    return min(solutions, key=lambda s: s.error.mean)


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


@partial(jax.jit, static_argnums=0)
def _xyz(formula: Formula, numbers: dict[str, Any], thickness: Any) -> Any:
    return formula.xyz(numbers, thickness)


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
