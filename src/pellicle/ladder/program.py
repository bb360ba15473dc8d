"""A way as a compiled program: what it answers, what it takes to compile, to run, and to count."""

from __future__ import annotations

import contextlib
import time
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.fitting.parameters import anonymous
from pellicle.ladder.case import Case, kept
from pellicle.ladder.rungs import Way
from pellicle.model import build, sampled
from pellicle.scene import insert


@dataclass(frozen=True)
class Program:
    """All draws of a case in one call. `flops` is XLA's own count for one spectrum, None if it has none."""

    call: Any
    arguments: tuple[Any, ...]
    double: bool
    spectra: int
    compile_seconds: float
    flops: float | None

    def run(self) -> np.ndarray:
        """The signal of every draw, (draws, points)."""
        with _precision(self.double):
            return np.asarray(self.call(*self.arguments))

    def seconds(self) -> float:
        """How long one spectrum takes, from one call."""
        with _precision(self.double):
            began = time.perf_counter()
            self.call(*self.arguments).block_until_ready()
            return (time.perf_counter() - began) / self.spectra


def compiled(case: Case, way: Way) -> Program:
    """Compile a way for all the draws of a case. Raises ValueError where a material has no data."""
    scene = anonymous(sampled(way.scene, way.plan.on("coherence")))
    values = case.draws[:, kept(case.scene, way.scene)]
    simulate, finish = build(way.plan), way.finish

    def signals(scene, values, repeat):
        def one(numbers, _):
            found = simulate(insert(scene, list(numbers)))
            return found if finish is None else finish(found)

        return jax.vmap(one)(values, repeat)

    with _precision(way.double):
        number = jnp.float64 if way.double else jnp.float32
        arguments = jax.tree_util.tree_map(lambda x: jnp.asarray(x, number), (scene, values))
        arguments = (*arguments, jnp.zeros(len(values), number))
        began = time.perf_counter()
        call = jax.jit(signals).lower(*arguments).compile()
        took = time.perf_counter() - began
    return Program(call, arguments, way.double, len(values), took, _flops(call, len(values)))


def _precision(double: bool) -> contextlib.AbstractContextManager:
    return jax.enable_x64(double)


def _flops(call: Any, spectra: int) -> float | None:
    counted = call.cost_analysis() or {}
    counted = counted[0] if isinstance(counted, list) else counted
    return float(counted["flops"]) / spectra if "flops" in counted else None
