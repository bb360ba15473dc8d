"""Cost model: operations of a simulation as XLA counts them, times the calibrated speed of this machine."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.effects.plan import Plan
from pellicle.errors import UsageError
from pellicle.files import write_text
from pellicle.planning.differences import Evaluation, largest_difference


class Work(NamedTuple):
    """Operations of one evaluation, before XLA fuses any of them."""

    flops: float
    transcendentals: float


class Calibration(NamedTuple):
    """Seconds of a call, an operation and a transcendental function on this machine, in float64."""

    call: float
    flop: float
    transcendental: float

    def seconds(self, work: Work) -> float:
        """Estimated time of an evaluation; within a factor of 3 for films of about 100 points."""
        return self.call + self.flop * work.flops + self.transcendental * work.transcendentals


class Saving(NamedTuple):
    """Effect of leaving something out: its error in the unit of the signal, and the seconds it saves."""

    error: float
    seconds: float


def work(simulate: Callable[[Any], Any], numbers: Any) -> Work:
    """Operations of a function of one pytree of numbers, as XLA counts them."""
    counts = jax.jit(simulate).lower(numbers).cost_analysis() or {}
    return Work(float(counts.get("flops", 0.0)), float(counts.get("transcendentals", 0.0)))


def savings(
    full: Plan, cheaper: Mapping[str, list[Plan]], evaluation: Evaluation, seconds: Callable[[Plan], float]
) -> dict[str, Saving]:
    """Error and time saved by leaving out each effect, compared with the `full` plan.

    `cheaper` has at most one plan for each effect; `seconds` estimates the time of a plan.
    """
    exact, total = evaluation.signals(full), seconds(full)
    return {
        effect: Saving(
            largest_difference(evaluation.signals(plan), exact, full.signal), total - seconds(plan)
        )
        for effect, plans in cheaper.items()
        for plan in plans
    }


def calibrated(folder: Path | None) -> Calibration:
    """The calibration of this machine, read from `folder` (None: not stored) or measured in about 1 s."""
    if folder is None:
        return _calibrate()
    path = folder / f"calibration-{jax.default_backend()}-{jax.__version__}.json"
    try:
        return Calibration(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):  # absent or truncated
        calibration = _calibrate()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_text(path, json.dumps(calibration._asdict()), overwrite=True)
    except (OSError, UsageError):
        pass  # it is only a cache
    return calibration


CHAIN, SIZE, REPEATS = 64, 4096, 40


@lru_cache(maxsize=1)
def _calibrate() -> Calibration:
    """Time chains of products and sums, and of sines, long enough to outweigh the call."""
    with jax.enable_x64(True):
        x = jnp.linspace(0.0, 1.0, SIZE)
        call = _best(jax.jit(lambda x: x + 1.0), x[:1])
        flop = (_best(partial(_chain, lambda y, x: y * x + 0.5), x) - call) / (2 * CHAIN * SIZE)
        sine = (_best(partial(_chain, lambda y, x: jnp.sin(y) + x), x) - call) / (CHAIN * SIZE)
    return Calibration(call, max(flop, 1e-12), max(sine - flop, 1e-12))


@partial(jax.jit, static_argnums=0)
def _chain(step: Callable[[Any, Any], Any], x: Any) -> Any:
    y = x
    for _ in range(CHAIN):
        y = step(y, x)
    return y


def _best(function: Callable[[Any], Any], x: Any) -> float:
    """The shortest time of many calls: other processes only ever add to it."""
    function(x).block_until_ready()

    def once() -> float:
        start = time.perf_counter()
        function(x).block_until_ready()
        return time.perf_counter() - start

    return float(np.min([once() for _ in range(REPEATS)]))
