"""What accuracy costs for a surface: the ways to its film's colour, and to the values of its BRDF."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import jax
import numpy as np

from pellicle.accuracy import colour_methods
from pellicle.accuracy.colour_methods import COLOURS, Films
from pellicle.accuracy.compiled import Program, compiled_function
from pellicle.accuracy.measure import Ladder, Progress, measured
from pellicle.brdf.directions import angle_to_half
from pellicle.colour import sensor
from pellicle.effects.plan import Plan
from pellicle.effects.surface import exact
from pellicle.effects.surface_removal import SurfaceRemoval
from pellicle.errors import UsageError
from pellicle.planning import surface
from pellicle.planning.surface import FLOOR
from pellicle.scene.free import free_leaves, insert, start_values
from pellicle.scene.surface import SurfaceView
from pellicle.simulation.surface import build

DRAWS = 64
"""Surfaces, drawn between the bounds: so many that a call itself does not count."""
COLOUR_TOLERANCE, VALUE_TOLERANCE = 0.5, 1e-3
"""What is accurate enough unless somebody says otherwise: mean ΔE2000, and the share of a BRDF's value."""


@dataclass
class SurfaceCost:
    """`colours` is None where the surface has no film to be coloured, and `no_colours` says why."""

    colours: Ladder | None
    values: Ladder
    no_colours: str = ""

    @property
    def interrupted(self) -> bool:
        return self.values.interrupted or (self.colours is not None and self.colours.interrupted)


def cost(
    view: SurfaceView, *, tolerance: float | None = None, progress: Progress = lambda what, done, total: None
) -> SurfaceCost:
    """Measure every way to a surface's colours (`tolerance` in mean ΔE2000), and to its BRDF.

    The tolerance is relative, as in `planning.surface.plan`, where the surface has no film to be coloured.
    **Raises:** UsageError for a tolerance that is not above zero, and without colour-science.
    """
    if tolerance is not None and not 0 < tolerance < math.inf:
        raise UsageError(f"the tolerance must be above zero, got {tolerance:g}: what error is small enough?")
    with jax.enable_x64(True):
        draws = drawn(view)
        films = coloured(view, draws)
        found, own = None, tolerance
        if isinstance(films, Films):
            found, own = _colours(films, tolerance or COLOUR_TOLERANCE, progress), None
        values = _values(view, draws, own or VALUE_TOLERANCE, progress)
        return SurfaceCost(found, values, films if isinstance(films, str) else "")


def drawn(view: SurfaceView, count: int = DRAWS, seed: int = 0) -> np.ndarray:
    """Values of the free numbers, (draws, numbers), uniform between the bounds; the first are the start."""
    free = [leaf for _, leaf in free_leaves(view)]
    low, high = (np.array([getattr(f, side) for f in free]) for side in ("lower", "upper"))
    draws = np.random.default_rng(seed).uniform(low, high, (count, len(free)))
    draws[0] = start_values(view)
    return draws


FILM = ("thickness", "n", "k", "base_n", "base_k", "ambient_n")


def coloured(view: SurfaceView, draws: np.ndarray) -> Films | str:
    """The films of these draws, or why they have no colour of their own."""
    if view.brdf.from_film_colour is None:
        return f"{view.model} is made for three wavelengths and has no other colour"
    if any(isinstance(view.numbers.get(key), list) for key in FILM):
        return "an index is free for each of three wavelengths: nothing says what it is between them"
    each = [insert(view.numbers, values) for values in draws]
    at = tuple(np.asarray(view.numbers["wavelengths"]))
    numbers = {}
    for key in FILM:
        if key in view.numbers and np.ndim(each[0][key]) == 0:
            numbers[key] = np.array([float(one[key]) for one in each])
        elif key in view.numbers:
            numbers[key] = colour_methods.along_the_spectrum(each[0][key], at)
    angle = np.asarray(angle_to_half(view.i, view.o))
    return Films(numbers, angle, float(np.max(numbers["thickness"])))


def _colours(films: Films, tolerance: float, progress: Progress) -> Ladder:
    try:
        truth = colour_methods.truth(films)
        error = partial(colour_methods.error, sensor(*colour_methods.EYE), truth)
        error(truth)
    except ImportError as missing:
        raise UsageError(str(missing)) from None
    ladder = Ladder("steps of 1 nm", tolerance, "ΔE2000", films.angle.size, len(truth), "colour")
    return measured(ladder, COLOURS, lambda rung: rung.program(films), error, progress)


@dataclass(frozen=True)
class ValueRung:
    """One way to the BRDF; `plan` gives it, or the reason why it makes no sense for a surface."""

    name: str
    leaves_out: str
    plan: Callable[[SurfaceView, float], Plan | str]
    double: bool = True


def _left_out(effect: str, absent: str, view: SurfaceView, tolerance: float) -> Plan | str:
    judged = exact(view)
    if not any(row.effect == effect and row.on for row in judged.rows):
        return absent
    other = {"roughness": "diffuse", "diffuse": "specular"}.get(effect)
    if other is not None and other not in view.numbers:
        return "it is all there is"
    leave_out = SurfaceRemoval(effect)
    return replace(exact(leave_out(view)), left_out=(leave_out,))


def _by_angles(count: int, view: SurfaceView, tolerance: float) -> Plan | str:
    judged = {row.effect: row for row in exact(view).rows}
    if "oblique" not in judged or not judged["oblique"].on:
        return "no film whose colour depends on the angle"
    rows = (replace(row, count=count) if row.effect == "oblique" else row for row in judged.values())
    return replace(exact(view), rows=tuple(rows))


def _absent(effect: str, absent: str) -> Callable[[SurfaceView, float], Plan | str]:
    return partial(_left_out, effect, absent)


VALUES = (
    ValueRung("float64", "nothing", lambda view, _: exact(view)),
    ValueRung("float32", "nine digits of sixteen", lambda view, _: exact(view), double=False),
    ValueRung("planned", "what a plan within the tolerance does", surface.plan),
    *(
        ValueRung(f"{n} angles", "the film's colour between them", partial(_by_angles, n))
        for n in (8, 16, 32)
    ),
    ValueRung("without interference", "interference", _absent("coherence", "there is none")),
    ValueRung("normal incidence", "the film's angle", _absent("oblique", "no film whose angle counts")),
    ValueRung("s alone", "p", _absent("polarisation", "no polarisation is told apart")),
    ValueRung("transparent film", "its absorption", _absent("absorption", "no film absorbs")),
    ValueRung("parallel boundaries", "the deviation", _absent("deviation", "no boundary deviates")),
    ValueRung("no diffuse part", "the diffuse part", _absent("diffuse", "there is none")),
    ValueRung("diffuse part alone", "the lobe", _absent("roughness", "there is no lobe")),
    ValueRung("one wavelength", "the other channels", _absent("spectral-sampling", "there is but one")),
)
"""Every rung to the values of a BRDF, in the order of the table."""


def _values(view: SurfaceView, draws: np.ndarray, tolerance: float, progress: Progress) -> Ladder:
    truth = _program(view, draws, exact(view)).run()
    scale = np.maximum(np.abs(truth), FLOOR)

    def prepare(rung: ValueRung) -> Program | str:
        plan = rung.plan(view, tolerance)
        return plan if isinstance(plan, str) else _program(view, draws, plan.static_key, rung.double)

    def error(answer: np.ndarray) -> float:
        worst = float(np.max(np.abs(np.asarray(answer, float) - truth) / scale))
        return worst if math.isfinite(worst) else math.inf

    ladder = Ladder("float64", tolerance, "relative", len(view.i), len(draws), "sample")
    return measured(ladder, VALUES, prepare, error, progress)


def _program(view: SurfaceView, draws: np.ndarray, plan: Plan, double: bool = True) -> Program:
    """The BRDF of every draw, (draws, directions, channels)."""
    simulate = build(plan)

    def one(values: Any, nothing: Any, numbers: Any, i: Any, o: Any) -> Any:
        # what is the same for all draws would be computed once
        return simulate(replace(insert(replace(view, numbers=numbers), list(values)), i=i + nothing, o=o))

    call = jax.vmap(one, in_axes=(0, 0, None, None, None))
    arguments = (draws, np.zeros(len(draws)), view.numbers, view.i, view.o)
    return compiled_function(call, arguments, len(draws) * len(view.i), double)
