"""Colours of a film by every method of integrating its spectrum: accuracy against time, and maps of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np
from numpy.typing import ArrayLike

from pellicle.accuracy.case import Program, check_tolerance
from pellicle.accuracy.colour_methods import (
    COLOUR_METHODS,
    COLOUR_TOLERANCE,
    EYE,
    Films,
    compare_colours,
    differences,
    reference_colours,
    reference_program,
)
from pellicle.accuracy.cost import Cost
from pellicle.accuracy.registry import Method
from pellicle.accuracy.surface import DRAWS
from pellicle.colour import sensor
from pellicle.colour.observers import SPAN
from pellicle.dispersion.base import AbstractDispersion, known_index
from pellicle.dispersion.empirical import Table
from pellicle.errors import UsageError
from pellicle.fitting.progress import Progress, quiet
from pellicle.optics.pair import imag, is_real, parts, real
from pellicle.scene.film import Scene
from pellicle.scene.free import Free, free_leaves, insert, start_values
from pellicle.scene.layers import Layer

COLOURS = 1024
"""Colours that a call computes at least: fewer would measure the cost of the call."""


def colour_cost(
    scene: Scene,
    angle: ArrayLike | None = None,
    *,
    tolerance: float | None = None,
    methods: Sequence[Method] = COLOUR_METHODS,
    progress: Progress = quiet,
) -> Cost:
    """Measure every method of computing the colours of a film at `angle` (degrees).

    Colours are those of the CIE observer 1931 under D65, of films between the bounds of the thickness, in
    unpolarised light. `tolerance` is the mean ΔE2000 that is small enough, 0.5 by default.

    **Raises:** UsageError for a film that the methods do not compute, for a tolerance that is not above zero,
    and without colour-science.
    """
    check_tolerance(tolerance)
    own: Any = getattr(scene.light.angle, "start", scene.light.angle)
    angles = np.unique(np.atleast_1d(np.asarray(own if angle is None else angle, float)))
    with jax.enable_x64(True):
        films = films_of_scene(scene, angles)
        compared = compare_colours(films, tolerance or COLOUR_TOLERANCE, progress, methods)
    return Cost(compared, None, "solvers are compared on spectra: leave the space out")


def films_of_scene(scene: Scene, angle: np.ndarray) -> Films:
    """Films of a scene's layer of many thicknesses between its bounds, at angles in degrees.

    **Raises:** UsageError for more than one thin layer on a half space, in reflection.
    """
    layer = scene.layers[0]
    if len(scene.layers) != 1 or not isinstance(layer, Layer):
        raise UsageError("methods for colours are compared on one layer; a plan is for any scene")
    if scene.light.signal != "R" or scene.substrate.back is not None:
        raise UsageError("methods for colours are compared on reflected light of a half space")
    if free_leaves((layer.material, scene.substrate.material, scene.ambient)):
        raise UsageError("methods for colours are compared on known indices: fix them")
    nm = np.arange(SPAN[0] - 1.0, SPAN[1] + 2.0)
    numbers: dict[str, Any] = {}
    for key, medium in (("", layer.material), ("base_", scene.substrate.material)):
        n, k = _tables(medium, nm)
        numbers |= {f"{key}n": n} if k is None else {f"{key}n": n, f"{key}k": k}
    ambient = np.asarray(real(known_index(scene.ambient, nm))) * np.ones(nm.size)
    if np.ptp(ambient) > 0:
        raise UsageError("methods for colours are compared in an ambient without dispersion")
    depth: Any = layer.thickness
    low, high = (depth.lower, depth.upper) if isinstance(depth, Free) else (float(depth),) * 2
    draws = max(DRAWS, -(-COLOURS // angle.size))
    numbers["thickness"] = np.random.default_rng(0).uniform(low, high, draws)
    numbers["ambient_n"] = np.full(draws, ambient[0])
    return Films(numbers, np.deg2rad(angle), float(high))


def _tables(medium: AbstractDispersion, nm: np.ndarray) -> tuple[Table, Table | None]:
    """n, and k where the medium absorbs, at each wavelength."""
    index = known_index(medium, nm)
    n = Table(nm, np.asarray(real(index)) * np.ones(nm.size))
    return n, None if is_real(index) else Table(nm, np.asarray(imag(index)) * np.ones(nm.size))


EXACT = "steps of 1 nm"
COMPARED = (EXACT, "table of the film", "gaussians-8", "belcour-barla", "points-645-525-445")
"""Methods that are drawn, from exact to coarse."""
ROUNDS = 15


@dataclass(frozen=True)
class ColourMap:
    """Colours by one method: XYZ and ΔE2000 from the exact ones over (thicknesses, angles).

    `seconds` is the shortest time of one colour in `ROUNDS` rounds, in turns with the other methods.
    """

    name: str
    xyz: np.ndarray
    delta_e: np.ndarray
    seconds: float


def colour_maps(scene: Scene, thickness: np.ndarray, angle: np.ndarray) -> list[ColourMap]:
    """Compute the colours of a film under D65 by every method of `COMPARED` that applies to it.

    **Arguments:** a `scene` of one layer on a half space; `thickness` in nm, (thicknesses,), `angle` of
    incidence in degrees, (angles,).

    **Raises:** UsageError for more layers and for a back face, without colour-science, and where a material
    has no data between 380 and 730 nm.
    """
    films = films_of(scene, thickness, angle)
    eye, exact = sensor(*EYE), reference_colours(films)
    if not np.all(np.isfinite(exact)):
        raise UsageError("a material has no data between 380 and 730 nm, which a colour needs")
    methods = {each.name: each.apply for each in COLOUR_METHODS}
    programs = {
        name: reference_program(films) if name == EXACT else methods[name](films) for name in COMPARED
    }
    running = {name: program for name, program in programs.items() if isinstance(program, Program)}
    times: dict[str, list[float]] = {name: [] for name in running}
    for _ in range(ROUNDS):
        for name, program in running.items():
            times[name].append(program.seconds())
    try:
        return [
            ColourMap(name, colours, differences(eye, exact, colours), min(times[name]))
            for name, colours in ((name, program.run()) for name, program in running.items())
        ]
    except ImportError as missing:
        raise UsageError(str(missing)) from None


def films_of(scene: Scene, thickness: np.ndarray, angle: np.ndarray) -> Films:
    """The one layer of a scene at these thicknesses, with its indices in steps of 1 nm."""
    fixed: Any = insert(scene, start_values(scene))
    if len(fixed.layers) != 1 or not isinstance(fixed.layers[0], Layer) or fixed.substrate.back is not None:
        raise UsageError("methods are compared on one coherent layer on a half space")
    numbers: dict[str, Any] = {"thickness": np.asarray(thickness, float)}
    media = {"": fixed.layers[0].material, "base_": fixed.substrate.material, "ambient_": fixed.ambient}
    for prefix, medium in media.items():
        numbers |= {f"{prefix}{key}": value for key, value in _tables_beyond(medium).items()}
    return Films(numbers, np.deg2rad(angle), float(np.max(thickness)))


def _tables_beyond(medium: AbstractDispersion) -> dict[str, Table]:
    """Index of a medium, and its extinction where it has any, between 380 and 730 nm."""
    wavelength = sensor(*EYE).wavelength
    n, k = parts(known_index(medium, wavelength))
    ends = np.array([1.0, *wavelength, 1e5])  # bands of a method may be centred beyond

    def table(values: Any) -> Table:
        inside = np.broadcast_to(values, wavelength.shape)
        return Table(ends, np.array([inside[0], *inside, inside[-1]]))

    return {"n": table(n)} | ({"k": table(k)} if k is not None and np.any(np.asarray(k) > 0) else {})
