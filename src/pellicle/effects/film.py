"""Effects that a film can have, and its exact plan."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from pellicle.effects import anisotropy, averaging, cone, gradient, presence
from pellicle.effects.plan import Plan, Row
from pellicle.scene.film import Scene


@dataclass(frozen=True)
class Effect:
    """Name of an effect, and the function that makes its row of a plan from a scene."""

    name: str
    judge: Callable[[Any], Row]


EFFECTS = (
    Effect("absorption", presence.absorption),
    Effect("anisotropy", anisotropy.anisotropy),
    Effect("stack", presence.stack),
    Effect("gradient", gradient.gradient),
    Effect("roughness", presence.roughness),
    Effect("tunnelling", presence.tunnelling),
    Effect("oblique", presence.oblique),
    Effect("polarisation", presence.polarisation),
    Effect("transmission", presence.transmission),
    Effect("back-face", presence.back_face),
    Effect("coherence", averaging.coherence),
    Effect("orders", averaging.orders),
    Effect("angle-spread", cone.angle_spread),
    Effect("dispersion", presence.dispersion),
    Effect("opaque", presence.opaque),
    Effect("precision", presence.precision),
)
"""Every effect of a film, in the order of a plan."""


def exact(scene: Scene, given: Sequence[Row] = ()) -> Plan:
    """The effects that a scene has, judged from its types and bounds; rows that are `given` are not judged.

    An effect is off only where it is provably absent; its error bound is 0. The orders, nodes and rays of
    an average have a bound above 0 (see `effects.averaging` and `effects.cone`).
    """
    known = {row.effect: row for row in given}
    rows = tuple(known.get(effect.name) or effect.judge(scene) for effect in EFFECTS)
    return Plan(rows, scene.light.signal, scene.light.polarisation)
