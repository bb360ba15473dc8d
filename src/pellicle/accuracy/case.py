"""Case of a comparison: a scene, its full plan, and draws of its free parameters."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np

from pellicle.data import generalised
from pellicle.effects.film_plan import full_plan
from pellicle.forward_model.plan import Plan
from pellicle.scene.film import Scene, media, with_wavelength
from pellicle.scene.free import free_leaves, insert, start_values

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
        return self.plan.signal in ("psi-delta", generalised.SIGNAL)


def case(scene: Scene, wavelength: np.ndarray, tolerance: float = 1e-3, seed: int = 0) -> Case:
    """The case of a scene at `wavelength` (nm), with draws uniform between the bounds."""
    bare = replace(scene.instrument, scale=1.0, offset=0.0)
    scene = with_wavelength(eqx.tree_at(lambda s: s.instrument, scene, bare), np.asarray(wavelength, float))
    count = int(np.clip(POINTS // len(wavelength), LEAST_DRAWS, MOST_DRAWS))
    free = [leaf for _, leaf in free_leaves(scene)]
    low, high = np.array([f.lower for f in free]), np.array([f.upper for f in free])
    draws = np.random.default_rng(seed).uniform(low, high, (count, len(free)))
    draws[0] = start_values(scene)
    return Case(scene, full_plan(scene), draws, tolerance)


def disperses(case: Case) -> bool:
    """True where the index of any medium varies over the spectrum, at the start values."""
    scene = insert(case.scene, start_values(case.scene))
    return any(np.ptp(np.asarray(m(case.wavelength))) > 0 for m in media(scene))


def remaining_parameters(scene: Scene, changed: Scene) -> list[int]:
    """Positions, among the free parameters of a scene, of those that a changed scene still has."""
    names, positions = [_name(path) for path, _ in free_leaves(scene)], []
    for path, _ in free_leaves(changed):
        positions.append(names.index(_name(path), positions[-1] + 1 if positions else 0))
    return positions


def _name(path: tuple) -> str:
    """A path as text, the same for a medium that is wrapped in another one (`base`)."""
    return "".join(str(step) for step in path if getattr(step, "name", "") != "base")


def with_effect(plan: Plan, effect: str, on: bool, count: int = 0) -> Plan:
    """The plan with one effect switched on or off, and its number of orders or nodes."""
    rows: Any = [replace(row, on=on, count=count) if row.effect == effect else row for row in plan.rows]
    return replace(plan, rows=tuple(rows))
