"""Variant of a case: the plan and scene by which a method computes its signal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from pellicle.accuracy.case import Case
from pellicle.effects.film_plan import full_plan
from pellicle.effects.removal import FilmRemoval
from pellicle.forward_model.plan import Plan
from pellicle.scene.film import Scene


class Variant(NamedTuple):
    """A method applied to a case: its plan and scene, a second program that completes the signal, and its
    precision."""

    plan: Plan
    scene: Scene
    finish: Callable[[Any], Any] | None = None
    double: bool = True


@dataclass(frozen=True)
class Method:
    """A method of simulating a scene; `variant` applies it to a case, or returns why it does not apply."""

    name: str
    leaves_out: str
    variant: Callable[[Case], Variant | str]


def without(effect: str, absent: str, case: Case) -> Variant | str:
    """The scene without one effect, otherwise in full; `absent` is the reason where it does not have it."""
    if not case.plan.on(effect):
        return absent
    removal = FilmRemoval(effect)
    return Variant(replace(full_plan(removal(case.scene)), left_out=(removal,)), case.scene)
