"""Colours of one film over thickness and angle by several methods, each with its error and time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pellicle.accuracy.colour_methods import (
    COLOUR_METHODS,
    EYE,
    Films,
    differences,
    reference_colours,
    reference_program,
)
from pellicle.accuracy.compiled import Program
from pellicle.colour import sensor
from pellicle.dispersion.base import AbstractDispersion, known_index
from pellicle.dispersion.empirical import Table
from pellicle.errors import UsageError
from pellicle.optics.pair import parts
from pellicle.scene.film import Scene
from pellicle.scene.free import insert, start_values
from pellicle.scene.layers import Layer

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
    methods = {each.name: each.program for each in COLOUR_METHODS}
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
            ColourMap(name, found, differences(eye, exact, found), min(times[name]))
            for name, found in ((name, program.run()) for name, program in running.items())
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
        numbers |= {f"{prefix}{key}": value for key, value in _tables(medium).items()}
    return Films(numbers, np.deg2rad(angle), float(np.max(thickness)))


def _tables(medium: AbstractDispersion) -> dict[str, Table]:
    """Index of a medium, and its extinction where it has any, between 380 and 730 nm."""
    wavelength = sensor(*EYE).wavelength
    n, k = parts(known_index(medium, wavelength))
    ends = np.array([1.0, *wavelength, 1e5])  # bands of a method may be centred beyond

    def table(values: Any) -> Table:
        inside = np.broadcast_to(values, wavelength.shape)
        return Table(ends, np.array([inside[0], *inside, inside[-1]]))

    return {"n": table(n)} | ({"k": table(k)} if k is not None and np.any(np.asarray(k) > 0) else {})
