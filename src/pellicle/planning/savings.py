"""Error of leaving each effect out of a plan, and the time that this saves, both measured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from pellicle.effects.plan import Plan
from pellicle.planning.differences import Evaluation, largest_difference


class Saving(NamedTuple):
    """Effect of leaving something out: its error in the unit of the signal, and the seconds it saves."""

    error: float
    seconds: float


class Savings(NamedTuple):
    """The saving of each effect, and the seconds of one evaluation of the exact plan and of the planned one.

    A saving below a few per cent of `exact` is noise, and may be negative.
    """

    effects: dict[str, Saving]
    exact: float
    planned: float


def measured(full: Plan, chosen: Plan, cheaper: Mapping[str, list[Plan]], evaluation: Evaluation) -> Savings:
    """Savings compared with the `full` plan; `cheaper` has at most one plan for each effect."""
    others = {effect: plan for effect, plans in cheaper.items() for plan in plans}
    exact = evaluation.signals(full)
    errors = [largest_difference(evaluation.signals(plan), exact, full.signal) for plan in others.values()]
    whole, planned, *times = evaluation.seconds([full, chosen, *others.values()])
    each = zip(others, errors, times, strict=True)
    return Savings({effect: Saving(error, whole - time) for effect, error, time in each}, whole, planned)
