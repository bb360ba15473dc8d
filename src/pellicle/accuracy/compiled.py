"""Compiled programs of methods, with their result, compile time, run time and operations."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.accuracy.case import Case, remaining_parameters
from pellicle.accuracy.variant import Variant
from pellicle.fitting.film.parameters import anonymous
from pellicle.forward_model.film_signal import build, tabulated
from pellicle.scene.film import Scene
from pellicle.scene.free import insert
from pellicle.scene.layers import Plate


@dataclass(frozen=True)
class Program:
    """A compiled function of all draws of a case, `samples` in number.

    `finish` is a second program that runs on the result of `call`. `flops` is XLA's count for one sample,
    None if it has none.
    """

    call: Any
    finish: Any
    arguments: tuple[Any, ...]
    double: bool
    samples: int
    compile_seconds: float
    flops: float | None

    def run(self) -> np.ndarray:
        """The signal of every draw, (draws, points)."""
        with jax.enable_x64(self.double):
            return np.asarray(self.finish(self.call(*self.arguments)))

    def seconds(self) -> float:
        """Time of one sample, from one call."""
        with jax.enable_x64(self.double):
            began = time.perf_counter()
            self.finish(self.call(*self.arguments)).block_until_ready()
            return (time.perf_counter() - began) / self.samples


def compiled(case: Case, variant: Variant) -> Program:
    """Compile a variant for all draws of a case. Raises ValueError where a material has no data."""
    scene = anonymous(tabulated(variant.scene, variant.plan.on("coherence")))
    values = case.draws[:, remaining_parameters(case.scene, variant.scene)]
    simulate = build(variant.plan)

    def signals(scene, values, zeros):
        def one(numbers, zero):
            return simulate(_with_added(zero, insert(scene, list(numbers))))

        return jax.vmap(one)(values, zeros)

    arguments = (scene, values, np.zeros(len(values)))
    finish = None if variant.finish is None else jax.vmap(variant.finish)
    return compiled_function(signals, arguments, len(values), variant.double, finish)


def compiled_function(
    function: Any, arguments: tuple[Any, ...], samples: int, double: bool = True, finish: Any = None
) -> Program:
    """Compile a function for arguments of these shapes, in double or single precision.

    `finish` is compiled as a second program: in the same one, XLA would compute a point again for each of
    its uses.
    """
    with jax.enable_x64(double):
        number = jnp.float64 if double else jnp.float32
        converted = jax.tree_util.tree_map(lambda x: jnp.asarray(x, number), arguments)
        began = time.perf_counter()
        call = jax.jit(function).lower(*converted).compile()
        second = lambda result: result  # noqa: E731
        if finish is not None:
            second = jax.jit(finish).lower(jax.eval_shape(function, *converted)).compile()
        compile_seconds = time.perf_counter() - began
    counts = call.cost_analysis() or {}
    counts = counts[0] if isinstance(counts, list) else counts
    flops = float(counts["flops"]) / samples if "flops" in counts else None
    return Program(call, second, converted, double, samples, compile_seconds, flops)


def _with_added(zero: Any, scene: Scene) -> Scene:
    """The scene with 0 added to its first thickness, so that no compiler simulates it once for all draws."""
    thickness = "plate_mm" if isinstance(scene.layers[0], Plate) else "thickness"
    where = lambda s: getattr(s.layers[0], thickness)  # noqa: E731
    return eqx.tree_at(where, scene, where(scene) + zero)
