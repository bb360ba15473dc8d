"""Removal of single effects from a surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pellicle.effects.removal import in_single_precision
from pellicle.scene.surface import LAYERED, SurfaceView

_LOBES = ("specular", "roughness", "exponent", "exponent_reflection", "exponent_transmission")
_NORMALS = ("deviation", "azimuth")


@dataclass(frozen=True)
class SurfaceRemoval:
    """Removal of one effect from a surface."""

    effect: str

    def __call__(self, view: SurfaceView) -> SurfaceView:
        return _REMOVALS[self.effect](view)


def _roughness(view: SurfaceView) -> SurfaceView:
    """Keep the diffuse part alone; where that is grey, nothing of the layer remains."""
    if view.model in LAYERED:
        return _drop(view, *_LOBES, *_NORMALS)
    return _drop(view, *(view.numbers.keys() - {"wavelengths", "weights", "diffuse"}))


def _spectral_sampling(view: SurfaceView) -> SurfaceView:
    """Take the middle channel for all of them."""
    middle = view.channels // 2
    if "weights" in view.numbers:
        one = view.numbers["weights"][:, middle : middle + 1]
        return replace(view, numbers={**view.numbers, "weights": one})

    def one(number: Any) -> Any:
        if isinstance(number, list):
            return [number[middle]]
        return number if np.ndim(number) == 0 else number[middle : middle + 1]

    return replace(view, numbers={key: one(number) for key, number in view.numbers.items()})


def _bands(view: SurfaceView) -> SurfaceView:
    """Take the mean wavelength of each band for all of it, with the mean indices."""
    weights = view.numbers["weights"]
    means = {key: x if np.ndim(x) != 1 else x @ weights for key, x in view.numbers.items()}
    return _drop(replace(view, numbers=means), "weights")


def _drop(view: SurfaceView, *keys: str) -> SurfaceView:
    """The surface without these numbers, which the model takes as absent."""
    return replace(view, numbers={key: x for key, x in view.numbers.items() if key not in keys})


_REMOVALS: dict[str, Callable[[SurfaceView], SurfaceView]] = {
    "roughness": _roughness,
    "spectral-sampling": _spectral_sampling,
    "bands": _bands,
    "coherence": lambda view: replace(view, coherent=False),
    "oblique": lambda view: replace(view, oblique=False),
    "polarisation": lambda view: replace(view, polarisation="s"),
    "deviation": lambda view: _drop(view, *_NORMALS),
    "absorption": lambda view: _drop(view, "k"),
    "multiple-scattering": lambda view: _drop(view, "multiple_scattering"),
    "coat": lambda view: _drop(view, "coat"),
    "diffuse": lambda view: _drop(view, "diffuse"),
    "precision": in_single_precision,
}

REMOVABLE = tuple(_REMOVALS)
"""Effects that may be left out within a tolerance, those that save most first."""
