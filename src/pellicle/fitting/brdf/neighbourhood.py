"""The misfit around a fitted surface, each free number in its own unit: no logarithm, no disc of tilts."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from pellicle.fitting.brdf.coordinates import Box, Coordinates
from pellicle.fitting.brdf.problem import Problem, chi_squares, polished
from pellicle.fitting.neighbourhood import Valley
from pellicle.fitting.spectra.search import held
from pellicle.scene.surface import FreeNumber, Surface

NATURAL = frozenset({"k", "base_k", "deviation", "specular", "diffuse"})
"""Their lower bound, 0, is physics'."""
_MIRROR = frozenset({"exponent", "exponent_reflection", "exponent_transmission"})
"""Beyond their upper bound lies a mirror, which samples at some distance cannot tell from a narrow lobe."""
_STEPS = 40
"""Of a polish with one number held, which starts near where it ends."""


def affine(surface: Surface, problem: Problem) -> Problem:
    """The same problem with each free number, a weight too, as a coordinate that goes evenly between its own
    bounds; a tilt stays a disc, half a one where samples in one plane cannot see its sign."""
    order = problem.form.coordinates
    known = {leaf.name: leaf for leaf in surface.free_numbers()}
    leaves = [known[name] for name in (*order.names, *problem.form.weights)]
    lower, upper = (np.array([getattr(leaf.free, side) for leaf in leaves]) for side in ("lower", "upper"))
    if order.tilt is not None:
        lower[list(order.tilt)], upper[list(order.tilt)] = (-1.0, 0.0 if order.folded else -1.0), 1.0
    names, keys = tuple(leaf.name for leaf in leaves), tuple(leaf.key for leaf in leaves)
    channels = tuple(leaf.channel for leaf in leaves)
    coordinates = Coordinates(names, keys, channels, (False,) * len(leaves), order.tilt)
    form = problem.form._replace(coordinates=coordinates, weights=())
    return problem._replace(form=form, box=Box(lower, upper, problem.box.reach), most=np.zeros(0))


def in_own_units(surface: Surface, problem: Problem, values: np.ndarray) -> Problem:
    """The same, with deviation and azimuth for the disc.

    A free azimuth goes half a turn to either side of its best value; seen in one plane alone, where its
    sign means nothing, from 0 to 180 degrees.
    """
    found, order = affine(surface, problem), problem.form.coordinates
    if order.tilt is None:
        return found
    (lower, upper, reach), (deviation, azimuth) = found.box, order.tilt
    lower[deviation], upper[deviation] = 0.0, reach
    lower[azimuth], upper[azimuth] = (
        (0.0, 180.0) if order.folded else values[azimuth] + np.array([-180.0, 180.0])
    )
    coordinates = found.form.coordinates._replace(tilt=None)
    return found._replace(form=found.form._replace(coordinates=coordinates))


def valley(
    surface: Surface, problem: Problem, values: np.ndarray, covariance: np.ndarray, variance: float
) -> Valley:
    """Around the best of `values` (minima, numbers), the first, in the order of the problem's coordinates and
    weights; `variance` multiplies σ²."""
    own = in_own_units(surface, problem, values[0])
    form, data, fixed, box, most = own.program

    def solve(lower: np.ndarray, upper: np.ndarray, units: np.ndarray) -> Sequence[Any]:
        found, chi2, converged = polished(
            form, data, fixed, Box(lower, upper, box.reach), most, units, _STEPS
        )
        return found, np.asarray(chi2) / variance, converged

    known = {leaf.name: leaf for leaf in surface.free_numbers()}
    best, *others = np.clip((values - box.lower) / (box.upper - box.lower), 0.0, 1.0)
    return Valley(
        best,
        box.lower,
        box.upper,
        covariance,
        tuple(_natural(known[name], problem.form.coordinates) for name in form.coordinates.names),
        lambda units: np.asarray(chi_squares(form, data, fixed, box, most, units)) / variance,
        partial(held, solve, (box.lower, box.upper)),
        np.reshape(others, (-1, len(best))),
    )


def _natural(leaf: FreeNumber, searched: Coordinates) -> tuple[bool, bool]:
    """Whether the lower and the upper bound are physics': resting there gives a limit on the other side."""
    if leaf.key == "azimuth" and searched.folded:
        return True, True
    from_zero = leaf.free.lower == 0 and (leaf.key in NATURAL or leaf.key == "thickness")
    return from_zero or leaf.key == "roughness", leaf.key in _MIRROR
