"""Effects that a film can have, and its exact plan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pellicle.effects import averaging, presence
from pellicle.effects.plan import Plan, Row
from pellicle.scene.film import Scene


@dataclass(frozen=True)
class Effect:
    """An effect by name, and the function that judges whether a scene has it."""

    name: str
    judge: Callable[[Any], Row]


EFFECTS = (
    Effect("absorption", presence.absorption),
    Effect("stack", presence.stack),
    Effect("roughness", presence.roughness),
    Effect("tunnelling", presence.tunnelling),
    Effect("oblique", presence.oblique),
    Effect("polarisation", presence.polarisation),
    Effect("transmission", presence.transmission),
    Effect("back-face", presence.back_face),
    Effect("coherence", averaging.coherence),
    Effect("orders", averaging.orders),
    Effect("angle-spread", averaging.angle_spread),
    Effect("dispersion", presence.dispersion),
    Effect("opaque", presence.opaque),
    Effect("precision", presence.precision),
)
"""Every effect there is, in the order that a plan lists them."""


def exact(scene: Scene) -> Plan:
    """The effects that a scene has, judged from its types and bounds.

    An effect is left out only where it is provably absent: of those the error bound is 0. The orders,
    nodes and rays of an average have a bound (see `effects.averaging`).
    """
    rows = tuple(effect.judge(scene) for effect in EFFECTS)
    return Plan(rows, scene.light.signal, scene.light.polarisation)
