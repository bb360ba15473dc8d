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

from pellicle.fitting.parameters import anonymous
from pellicle.ladder.case import Case, kept
from pellicle.ladder.rungs import Way
from pellicle.model import build, sampled
from pellicle.scene import Plate, Scene, insert


@dataclass(frozen=True)
class Program:
    """All draws of a case in one call. `flops` is XLA's own count for one spectrum, None if it has none."""

    call: Any
    finish: Any
    arguments: tuple[Any, ...]
    double: bool
    spectra: int
    compile_seconds: float
    flops: float | None

    def run(self) -> np.ndarray:
        """The signal of every draw, (draws, points)."""
        with _precision(self.double):
            return np.asarray(self.finish(self.call(*self.arguments)))

    def seconds(self) -> float:
        """How long one spectrum takes, from one call."""
        with _precision(self.double):
            began = time.perf_counter()
            self.finish(self.call(*self.arguments)).block_until_ready()
            return (time.perf_counter() - began) / self.spectra


def compiled(case: Case, way: Way) -> Program:
    """Compile a way for all the draws of a case. Raises ValueError where a material has no data."""
    scene = anonymous(sampled(way.scene, way.plan.on("coherence")))
    values = case.draws[:, kept(case.scene, way.scene)]
    simulate = build(way.plan)

    def signals(scene, values, nothing):
        def one(numbers, zero):
            return simulate(_told_apart(insert(scene, list(numbers)), zero))

        return jax.vmap(one)(values, nothing)

    with _precision(way.double):
        number = jnp.float64 if way.double else jnp.float32
        arguments = jax.tree_util.tree_map(lambda x: jnp.asarray(x, number), (scene, values))
        arguments = (*arguments, jnp.zeros(len(values), number))
        began = time.perf_counter()
        call = jax.jit(signals).lower(*arguments).compile()
        finish = _unchanged if way.finish is None else _after(way, jax.eval_shape(signals, *arguments))
        took = time.perf_counter() - began
    return Program(call, finish, arguments, way.double, len(values), took, _flops(call, len(values)))


def _after(way: Way, signals: Any) -> Any:
    """A program of its own: within the first, XLA simulates a point again for all that is made of it."""
    assert way.finish is not None
    return jax.jit(jax.vmap(way.finish)).lower(signals).compile()


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


def _flops(call: Any, spectra: int) -> float | None:
    counted = call.cost_analysis() or {}
    counted = counted[0] if isinstance(counted, list) else counted
    return float(counted["flops"]) / spectra if "flops" in counted else None
