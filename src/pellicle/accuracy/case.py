"""Case of a comparison: a scene, its full plan, draws of its free parameters, and compiled programs."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pellicle.effects.film_plan import full_plan
from pellicle.errors import UsageError
from pellicle.fitting.film.parameters import anonymous
from pellicle.forward_model.film_signal import build, tabulated
from pellicle.forward_model.plan import Plan, Removal
from pellicle.scene.film import Scene, media, with_wavelength
from pellicle.scene.free import free_leaves, insert, start_values
from pellicle.scene.layers import Plate

MOST_DRAWS, LEAST_DRAWS, POINTS = 256, 16, 65536
"""Limits of the number of draws in one call, which hides the cost of the call itself, and about the number of
points of all draws together."""


class Case(NamedTuple):
    """One scene with its wavelengths and an instrument without scale and offset.

    `plan` is the full one, which leaves nothing out. `draws` are values of the free parameters,
    (draws, parameters), the first of them the start values. `tolerance` is in the unit of the signal.
    """

    scene: Scene
    plan: Plan
    draws: np.ndarray
    tolerance: float

    @property
    def wavelength(self) -> np.ndarray:
        return np.asarray(self.scene.light.wavelength, dtype=float)

    @property
    def ellipsometric(self) -> bool:
        return self.plan.ellipsometric

    @property
    def in_degrees(self) -> bool:
        """True where errors are degrees on the sphere of N, C, S."""
        return self.plan.degrees


def case(scene: Scene, wavelength: np.ndarray, tolerance: float = 1e-3, seed: int = 0) -> Case:
    """The case of a scene at `wavelength` (nm), with draws uniform between the bounds."""
    bare = replace(scene.instrument, scale=1.0, offset=0.0)
    scene = with_wavelength(eqx.tree_at(lambda s: s.instrument, scene, bare), np.asarray(wavelength, float))
    count = int(np.clip(POINTS // len(wavelength), LEAST_DRAWS, MOST_DRAWS))
    return Case(scene, full_plan(scene), random_draws(scene, count, seed), tolerance)


def random_draws(scene: Any, count: int, seed: int = 0) -> np.ndarray:
    """Values of the free numbers, (draws, numbers), uniform between the bounds, the start values first."""
    free = [leaf for _, leaf in free_leaves(scene)]
    low, high = (np.array([getattr(f, side) for f in free]) for side in ("lower", "upper"))
    draws = np.random.default_rng(seed).uniform(low, high, (count, len(free)))
    draws[0] = start_values(scene)
    return draws


def check_tolerance(tolerance: float | None) -> None:
    """Raise UsageError for a tolerance that is not above zero."""
    if tolerance is not None and not 0 < tolerance < math.inf:
        raise UsageError(f"the tolerance must be above zero, got {tolerance:g}: what error is small enough?")


def disperses(case: Case) -> bool:
    """True where the index of any medium varies over the spectrum, at the start values."""
    scene = insert(case.scene, start_values(case.scene))
    return any(np.ptp(np.asarray(m(case.wavelength))) > 0 for m in media(scene))


def remaining_parameters(scene: Scene, variant: Scene) -> list[int]:
    """Positions, among the free parameters of a scene, of those that a changed scene still has."""

    def names(scene: Scene) -> list[str]:
        # paths are the same for a medium that is wrapped in another one (`base`)
        paths = (
            [step for step in path if getattr(step, "name", "") != "base"] for path, _ in free_leaves(scene)
        )
        return ["".join(map(str, path)) for path in paths]

    every, positions = names(scene), [-1]
    for name in names(variant):
        positions.append(every.index(name, positions[-1] + 1))
    return positions[1:]


def with_effect(plan: Plan, effect: str, on: bool, count: int = 0) -> Plan:
    """The plan with one effect switched on or off, and its number of orders or nodes."""
    return plan.with_rows(replace(plan.row(effect), on=on, count=count))


class Variant(NamedTuple):
    """A method applied to a case: its plan and scene, and a second program that completes the signal."""

    plan: Plan
    scene: Scene
    finish: Callable[[Any], Any] | None = None


def changed(scene: Scene) -> Variant:
    """Another scene in full."""
    return Variant(full_plan(scene), scene)


def removed(removal: Removal, case: Case) -> Variant:
    """The scene without what a removal takes away, otherwise in full."""
    return Variant(replace(full_plan(removal(case.scene)), left_out=(removal,)), case.scene)


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


def compiled(case: Case, variant: Variant, double: bool = True) -> Program:
    """Compile a variant for all draws of a case. Raises ValueError where a material has no data."""
    scene = anonymous(tabulated(variant.scene))
    values = case.draws[:, remaining_parameters(case.scene, variant.scene)]
    simulate = build(variant.plan)

    def first_thickness(scene: Scene) -> Any:
        first = scene.layers[0]
        return first.plate_mm if isinstance(first, Plate) else first.thickness

    def signals(scene, values, zeros):
        def one(numbers: Any, zero: Any) -> Any:
            # 0 is added to the first thickness, so that no compiler simulates it once for all draws
            whole = insert(scene, list(numbers))
            return simulate(eqx.tree_at(first_thickness, whole, first_thickness(whole) + zero))

        return jax.vmap(one)(values, zeros)

    arguments = (scene, values, np.zeros(len(values)))
    finish = None if variant.finish is None else jax.vmap(variant.finish)
    return compiled_function(signals, arguments, len(values), double, finish)


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
