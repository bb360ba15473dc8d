"""What a ladder is climbed on: a scene, its full plan, and draws of its free parameters."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np

from pellicle.dispersion.base import AbstractDispersion
from pellicle.effects.plan import Plan
from pellicle.planning.film import full_plan
from pellicle.scene.film import Scene, with_wavelength
from pellicle.scene.free import free_leaves, insert, start_values
from pellicle.scene.layers import Interface

MOST_DRAWS, LEAST_DRAWS, POINTS = 256, 16, 65536
"""Spectra in one call: so many that the call itself does not count, and about this many points in all."""


class Case(NamedTuple):
    """One scene, looked at at its wavelengths through an instrument without scale and offset.

    `plan` is the full one, from which nothing is left out. `draws` are values of the free parameters,
    (draws, parameters), the first of them the scene's own. `tolerance` is in the signal's unit.
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
        return self.plan.signal == "psi-delta"


def case(scene: Scene, wavelength: np.ndarray, tolerance: float = 1e-3, seed: int = 0) -> Case:
    """The case of a scene at `wavelength` (nm). Draws are uniform between the bounds."""
    bare = replace(scene.instrument, scale=1.0, offset=0.0)
    seen = with_wavelength(eqx.tree_at(lambda s: s.instrument, scene, bare), np.asarray(wavelength, float))
    count = int(np.clip(POINTS // len(wavelength), LEAST_DRAWS, MOST_DRAWS))
    free = [leaf for _, leaf in free_leaves(seen)]
    low, high = np.array([f.lower for f in free]), np.array([f.upper for f in free])
    draws = np.random.default_rng(seed).uniform(low, high, (count, len(free)))
    draws[0] = start_values(seen)
    return Case(seen, full_plan(seen), draws, tolerance)


def media(scene: Scene) -> list[AbstractDispersion]:
    """Every medium that has a name of its own: layers, substrate, ambient, and what is behind a plate."""
    back = [] if scene.substrate.back is None else [scene.substrate.back]
    layers = [layer.material for layer in scene.layers if not isinstance(layer, Interface)]
    return [*layers, scene.substrate.material, scene.ambient, *back]


def disperses(case: Case) -> bool:
    """Whether any medium's index changes along the spectrum, at the scene's own values."""
    scene = insert(case.scene, start_values(case.scene))
    return any(np.ptp(np.asarray(m(case.wavelength))) > 0 for m in media(scene))


def kept(scene: Scene, changed: Scene) -> list[int]:
    """Which of a scene's free parameters a changed scene still has, by their places in it."""
    before, found = [_place(path) for path, _ in free_leaves(scene)], []
    for path, _ in free_leaves(changed):
        found.append(before.index(_place(path), found[-1] + 1 if found else 0))
    return found


def _place(path: tuple) -> str:
    """A path in words, blind to a medium's being wrapped in another."""
    return "".join(str(step) for step in path if getattr(step, "name", "") != "base")


def altered(plan: Plan, effect: str, on: bool, count: int = 0) -> Plan:
    """The plan with one effect switched, and its count of orders or nodes."""
    rows: Any = [replace(row, on=on, count=count) if row.effect == effect else row for row in plan.rows]
    return replace(plan, rows=tuple(rows))
