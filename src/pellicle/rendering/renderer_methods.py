"""Formulas of renderers as methods of computing a film's colour, with its own numbers and solved ones."""

import time
from dataclasses import replace
from functools import partial
from typing import Any

import jax.numpy as jnp
import numpy as np

from pellicle.accuracy.case import Program
from pellicle.accuracy.colour_methods import Films, compiled, one_film
from pellicle.accuracy.registry import Method
from pellicle.dispersion.base import AbstractDispersion
from pellicle.rendering.appearance import appearance
from pellicle.rendering.formula import effective, physical
from pellicle.rendering.targets import target
from pellicle.scene.film import Scene
from pellicle.scene.layers import Layer

RENDERERS = ("gltf", "materialx")
"""Formulas that several renderers share; `benchmarks/renderers.py` compares all of them."""
_SHARES = np.linspace(0.0, 1.0, 5)
"""Quantiles of the thicknesses for which one set of numbers is solved."""


def _by_formula(name: str, solve: Any, films: Films) -> Program | str:
    """The formula with one set of numbers for all thicknesses, whose solving counts as compilation."""
    film = one_film(films)
    if isinstance(film, str):
        return film
    began = time.perf_counter()
    layer, base, ambient = map(_medium, (film.layer, film.base, film.ambient))
    scene = Scene(Layer(layer, float(film.thickness[0])), base, ambient=ambient)
    look = appearance(scene, np.quantile(film.thickness, _SHARES))
    formula = target(name, package_check=False).formula
    assert formula is not None
    chosen = formula(look)
    solution = solve(chosen, look)
    solved = time.perf_counter() - began

    def xyz(numbers: dict[str, Any], angle: Any) -> Any:
        own = {key: jnp.asarray(x, angle.dtype) for key, x in solution.numbers.items()}
        return chosen.xyz_at(own, solution.scale * numbers["thickness"], jnp.cos(angle))

    program = compiled(xyz, films)
    return replace(program, compile_seconds=program.compile_seconds + solved)


def _medium(index: Any) -> Any:
    """A dispersion as it is, a number as what `Scene` takes."""
    if isinstance(index, AbstractDispersion):
        return index
    number = complex(np.asarray(index))
    return number if number.imag else number.real


RENDERER_METHODS = tuple(
    Method(f"{target(name, package_check=False).title}, {words}", left_out, partial(_by_formula, name, solve))
    for name in RENDERERS
    for words, left_out, solve in (
        ("as it is", "what its formula lacks", physical),
        ("solved", "the same; one set of numbers for all", effective),
    )
)
"""Each renderer with a film's own numbers, and with those that come nearest to the exact colours."""
