"""A surface with one effect left out: simpler, and nearly the same to the eye."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pellicle.effects.without import in_single
from pellicle.surfaces.lit import LAYERED, Lit

_LOBES = ("specular", "roughness", "exponent", "exponent_reflection", "exponent_transmission")
_NORMALS = ("deviation", "azimuth")


@dataclass(frozen=True)
class LeftOut:
    """An effect that a plan leaves out."""

    effect: str

    def __call__(self, lit: Lit) -> Lit:
        return _WITHOUT[self.effect](lit)


def _roughness(lit: Lit) -> Lit:
    """The diffuse part alone; where that is grey nothing of the layer is left."""
    if lit.model in LAYERED:
        return _dropped(lit, *_LOBES, *_NORMALS)
    kept = {"wavelengths", "diffuse"}
    return _dropped(lit, *(lit.numbers.keys() - kept))


def _spectral_sampling(lit: Lit) -> Lit:
    """The middle channel for all of them."""
    middle = lit.channels // 2

    def one(number: Any) -> Any:
        if isinstance(number, list):
            return [number[middle]]
        return number if np.ndim(number) == 0 else number[middle : middle + 1]

    return replace(lit, numbers={key: one(number) for key, number in lit.numbers.items()})


def _dropped(lit: Lit, *keys: str) -> Lit:
    return replace(lit, numbers={key: x for key, x in lit.numbers.items() if key not in keys})


_WITHOUT: dict[str, Callable[[Lit], Lit]] = {
    "roughness": _roughness,
    "spectral-sampling": _spectral_sampling,
    "coherence": lambda lit: replace(lit, coherent=False),
    "oblique": lambda lit: replace(lit, oblique=False),
    "polarisation": lambda lit: replace(lit, polarisation="s"),
    "deviation": lambda lit: _dropped(lit, *_NORMALS),
    "absorption": lambda lit: _dropped(lit, "k"),
    "diffuse": lambda lit: _dropped(lit, "diffuse"),
    "precision": in_single,
}

CAN_BE_LEFT_OUT = tuple(_WITHOUT)
"""Effects that a tolerance may leave out, those that save most first."""
