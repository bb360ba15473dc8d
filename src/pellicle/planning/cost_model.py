"""What an evaluation costs: XLA's own count of operations, and this machine's time for each of them."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.effects.plan import Plan
from pellicle.effects.removal import CAN_BE_LEFT_OUT
from pellicle.errors import UsageError
from pellicle.files import write_text
from pellicle.planning.differences import design, largest_difference, signals
from pellicle.planning.film import alternatives, reference
from pellicle.planning.tolerance import See
from pellicle.scene.film import Scene
from pellicle.scene.free import insert, start_values
from pellicle.simulation.film import build, sampled


class Work(NamedTuple):
    """Operations of one evaluation, before XLA puts any of them together."""

    flops: float
    transcendentals: float


class Calibration(NamedTuple):
    """Seconds that a call, an operation and a transcendental function take here, in float64."""

    call: float
    flop: float
    transcendental: float

    def seconds(self, work: Work) -> float:
        """The time that an evaluation should take; within a factor of 3 for films of some 100 points."""
        return self.call + self.flop * work.flops + self.transcendental * work.transcendentals


class Saving(NamedTuple):
    """What leaving one effect out would change, in the signal's unit, and save, in seconds."""

    error: float
    seconds: float


def work(plan: Plan, scene: Scene) -> Work:
    """The operations of one evaluation of the scene at its start values, as XLA counts them."""
    with jax.enable_x64(True):
        return counted(build(plan.static_key), insert(sampled(scene), start_values(scene)))


def counted(simulate: Callable[[Any], Any], numbers: Any) -> Work:
    """The same of any function of one pytree of numbers."""
    found = jax.jit(simulate).lower(numbers).cost_analysis() or {}
    return Work(float(found.get("flops", 0.0)), float(found.get("transcendentals", 0.0)))


def savings(scene: Scene, calibration: Calibration) -> dict[str, Saving]:
    """For each effect that could be left out: what that would change and save, all else being exact."""
    with jax.enable_x64(True):
        see = partial(signals, scene=sampled(scene), points=design(scene))
        cheaper = {effect: alternatives(effect, scene)[:1] for effect in CAN_BE_LEFT_OUT}
        return saved(reference(scene), cheaper, see, lambda plan: calibration.seconds(work(plan, scene)))


def saved(
    exactly: Plan, cheaper: dict[str, list[Plan]], see: See, seconds: Callable[[Plan], float]
) -> dict[str, Saving]:
    """What each cheaper plan changes, by `see`, and saves, by `seconds`; none where there is no plan."""
    truth, whole = see(exactly), seconds(exactly)
    return {
        effect: Saving(largest_difference(see(plan), truth, exactly.signal), whole - seconds(plan))
        for effect, plans in cheaper.items()
        for plan in plans
    }


def calibrated(folder: Path | None) -> Calibration:
    """This machine's calibration, from the folder (or None) where it is kept; measured once, in a second."""
    if folder is None:
        return _calibrate()
    path = folder / f"calibration-{jax.default_backend()}-{jax.__version__}.json"
    try:
        return Calibration(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):  # absent, or cut short: measured again
        found = _calibrate()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_text(path, json.dumps(found._asdict()), overwrite=True)
    except (OSError, UsageError):
        pass  # a cache that cannot be written is no failure
    return found


CHAIN, SIZE, REPEATS = 64, 4096, 40


@lru_cache(maxsize=1)
def _calibrate() -> Calibration:
    """Chains of products and sums, and of sines, long enough to outweigh the call."""
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
    """The shortest time of many calls: what else runs here only ever adds to it."""
    function(x).block_until_ready()

    def once() -> float:
        start = time.perf_counter()
        function(x).block_until_ready()
        return time.perf_counter() - start

    return float(np.min([once() for _ in range(REPEATS)]))
