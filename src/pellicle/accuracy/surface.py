"""Accuracy against time for a surface: methods of computing the colour of its film, and its BRDF."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import jax
import numpy as np

from pellicle.accuracy.case import Program, check_tolerance, compiled_function, random_draws
from pellicle.accuracy.colour_methods import COLOUR_METHODS, COLOUR_TOLERANCE, DRAWS, Films, compare_colours
from pellicle.accuracy.registry import Comparison, Cost, Method, measure
from pellicle.brdf.directions import angle_to_half
from pellicle.dispersion.empirical import along_the_spectrum
from pellicle.effects import surface_plan
from pellicle.effects.surface_plan import FLOOR, SurfaceRemoval, exact
from pellicle.fitting.progress import Progress, quiet
from pellicle.forward_model.plan import Plan
from pellicle.forward_model.surface_signal import build
from pellicle.scene.free import insert
from pellicle.scene.surface import SurfaceView

VALUE_TOLERANCE = 1e-3
"""Default tolerance: relative error of a BRDF."""


def cost(
    view: SurfaceView,
    *,
    tolerance: float | None = None,
    colours: Sequence[Method] = COLOUR_METHODS,
    progress: Progress = quiet,
) -> Cost:
    """Measure every method of computing the colours of a surface, and its BRDF.

    `colours` are the methods of computing a colour. `tolerance` is in mean ΔE2000; where the surface has no
    film with a colour, it is relative, as in `effects.surface_plan.plan`.

    **Raises:** UsageError for a tolerance that is not above zero, and without colour-science.
    """
    check_tolerance(tolerance)
    with jax.enable_x64(True):
        draws = random_draws(view, DRAWS)
        films = films_of(view, draws)
        if isinstance(films, str):
            values = _values(view, draws, tolerance or VALUE_TOLERANCE, progress)
            return Cost(values=values, no_colours=films)
        compared = compare_colours(films, tolerance or COLOUR_TOLERANCE, progress, colours)
        return Cost(colours=compared, values=_values(view, draws, VALUE_TOLERANCE, progress))


FILM = ("thickness", "n", "k", "base_n", "base_k", "ambient_n")


def films_of(view: SurfaceView, draws: np.ndarray) -> Films | str:
    """The films of these draws, or why they have no colour of their own."""
    if view.brdf.from_film_colour is None:
        return f"{view.model} is defined at three wavelengths only"
    if any(isinstance(view.numbers.get(key), list) for key in FILM):
        return "an index is free at each of three wavelengths: it is unknown between them"
    each = [insert(view.numbers, values) for values in draws]
    wavelengths = tuple(np.asarray(view.numbers["wavelengths"]))
    numbers = {}
    for key in FILM:
        if key in view.numbers and np.ndim(each[0][key]) == 0:
            numbers[key] = np.array([float(one[key]) for one in each])
        elif key in view.numbers:
            numbers[key] = along_the_spectrum(each[0][key], wavelengths)
    angle = np.asarray(angle_to_half(view.i, view.o))
    return Films(numbers, angle, float(np.max(numbers["thickness"])))


def _without(effect: str, absent: str, view: SurfaceView, tolerance: float) -> Plan | str:
    if not any(row.effect == effect and row.on for row in exact(view).rows):
        return absent
    if not surface_plan.something_left(effect, view):
        return "nothing else is left of the BRDF"
    removal = SurfaceRemoval(effect)
    return replace(exact(removal(view)), left_out=(removal,))


def _by_angles(count: int, view: SurfaceView, tolerance: float) -> Plan | str:
    plan = exact(view)
    if not any(row.effect == "oblique" and row.on for row in plan.rows):
        return "no film whose colour depends on the angle"
    return plan.with_rows(replace(plan.row("oblique"), count=count))


BRDF_METHODS = (
    Method("float64", "nothing", lambda view, _: exact(view)),
    Method("float32", "nine digits of sixteen", lambda view, _: exact(view), double=False),
    Method("planned", "what its plan leaves out", surface_plan.plan),
    *(Method(f"{n} angles", "the film's colour between them", partial(_by_angles, n)) for n in (8, 16, 32)),
    Method("mean wavelengths", "the bands", partial(_without, "bands", "it has no sensor")),
    Method("without interference", "interference", partial(_without, "coherence", "it has none")),
    Method("normal incidence", "the film's angle", partial(_without, "oblique", "no oblique film")),
    Method("s alone", "p", partial(_without, "polarisation", "s and p are equal")),
    Method("transparent film", "its absorption", partial(_without, "absorption", "no film absorbs")),
    Method(
        "single scattering",
        "light reflected more than once",
        partial(_without, "multiple-scattering", "it is not asked for"),
    ),
    Method("parallel boundaries", "the deviation", partial(_without, "deviation", "they are parallel")),
    Method("no lobe of the coat", "the clear coat's lobe", partial(_without, "coat", "it has no coat")),
    Method("no diffuse part", "the diffuse part", partial(_without, "diffuse", "it has none")),
    Method("diffuse part alone", "the lobe", partial(_without, "roughness", "there is no lobe")),
    Method("one wavelength", "the other channels", partial(_without, "spectral-sampling", "it has only one")),
)
"""Every method of computing a BRDF, in the order of the table."""


def _values(view: SurfaceView, draws: np.ndarray, tolerance: float, progress: Progress) -> Comparison:
    truth = _program(view, draws, exact(view)).run()
    scale = np.maximum(np.abs(truth), FLOOR)

    def prepare(method: Method) -> Program | str:
        plan = method.apply(view, tolerance)
        return plan if isinstance(plan, str) else _program(view, draws, plan.static_key, method.double)

    def error(values: np.ndarray) -> float:
        worst = float(np.max(np.abs(np.asarray(values, float) - truth) / scale))
        return worst if math.isfinite(worst) else math.inf

    comparison = Comparison("brdf", "float64", tolerance, "relative", len(view.i), len(draws))
    return measure(comparison, BRDF_METHODS, prepare, error, progress)


def _program(view: SurfaceView, draws: np.ndarray, plan: Plan, double: bool = True) -> Program:
    """The BRDF of every draw, (draws, directions, channels)."""
    simulate = build(plan)

    def one(values: Any, zero: Any, numbers: Any, i: Any, o: Any) -> Any:
        # i + zero: XLA computes anything that is equal for all draws only once
        return simulate(replace(insert(replace(view, numbers=numbers), list(values)), i=i + zero, o=o))

    call = jax.vmap(one, in_axes=(0, 0, None, None, None))
    arguments = (draws, np.zeros(len(draws)), view.numbers, view.i, view.o)
    return compiled_function(call, arguments, len(draws) * len(view.i), double)
