"""A way as a compiled program: what it answers, what it takes to compile, to run, and to count."""

from __future__ import annotations

import contextlib
import time
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.accuracy.case import Case, kept
from pellicle.accuracy.methods import Way
from pellicle.fitting.spectra.parameters import anonymous
from pellicle.scene.film import Scene
from pellicle.scene.free import insert
from pellicle.scene.layers import Plate
from pellicle.simulation.film import build, tabulated


@dataclass(frozen=True)
class Program:
    """All draws of a case in one call, of so many `samples`. `flops` is XLA's own count for one of them,
    None if it has none."""

    call: Any
    finish: Any
    arguments: tuple[Any, ...]
    double: bool
    samples: int
    compile_seconds: float
    flops: float | None

    def run(self) -> np.ndarray:
        """The signal of every draw, (draws, points)."""
        with _precision(self.double):
            return np.asarray(self.finish(self.call(*self.arguments)))

    def seconds(self) -> float:
        """How long one sample takes, from one call."""
        with _precision(self.double):
            began = time.perf_counter()
            self.finish(self.call(*self.arguments)).block_until_ready()
            return (time.perf_counter() - began) / self.samples


def compiled(case: Case, way: Way) -> Program:
    """Compile a way for all the draws of a case. Raises ValueError where a material has no data."""
    scene = anonymous(tabulated(way.scene, way.plan.on("coherence")))
    values = case.draws[:, kept(case.scene, way.scene)]
    simulate = build(way.plan)

    def signals(scene, values, nothing):
        def one(numbers, zero):
            return simulate(_told_apart(insert(scene, list(numbers)), zero))

        return jax.vmap(one)(values, nothing)

    arguments = (scene, values, np.zeros(len(values)))
    finish = None if way.finish is None else jax.vmap(way.finish)
    return compiled_function(signals, arguments, len(values), way.double, finish)


def compiled_function(
    function: Any, arguments: tuple[Any, ...], samples: int, double: bool = True, finish: Any = None
) -> Program:
    """Compile a function for arguments of this shape, in double or single precision.

    What `finish` makes of its answer is a program of its own: within the first, XLA would compute a point
    again for all that is made of it.
    """
    with _precision(double):
        number = jnp.float64 if double else jnp.float32
        given = jax.tree_util.tree_map(lambda x: jnp.asarray(x, number), arguments)
        began = time.perf_counter()
        call = jax.jit(function).lower(*given).compile()
        after = _unchanged
        if finish is not None:
            after = jax.jit(finish).lower(jax.eval_shape(function, *given)).compile()
        took = time.perf_counter() - began
    return Program(call, after, given, double, samples, took, _flops(call, samples))


def _unchanged(signals: Any) -> Any:
    return signals


def _told_apart(scene: Scene, zero: Any) -> Scene:
    """The same scene, in a way that keeps a compiler from simulating it once for all draws."""
    where = (lambda s: s.layers[0].plate_mm) if isinstance(scene.layers[0], Plate) else _first_thickness
    return eqx.tree_at(where, scene, where(scene) + zero)


def _first_thickness(scene: Scene) -> Any:
    return scene.layers[0].thickness  # pyright: ignore[reportAttributeAccessIssue]


def _precision(double: bool) -> contextlib.AbstractContextManager:
    return jax.enable_x64(double)


def _flops(call: Any, samples: int) -> float | None:
    counted = call.cost_analysis() or {}
    counted = counted[0] if isinstance(counted, list) else counted
    return float(counted["flops"]) / samples if "flops" in counted else None
