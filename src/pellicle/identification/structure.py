"""Structures that are tried: layers of tables or dispersion models with effects, as rows of slots."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial.hermite_e import hermegauss

from pellicle.dispersion.effective_medium import Bruggeman
from pellicle.dispersion.empirical import Tabulated
from pellicle.identification.free_models import FREE_MODELS, built
from pellicle.identification.signal_view import SLOTS, SignalView, as_complex
from pellicle.optics.pair import to_pair

ROUGHEST = 20.0
"""Thickness (nm) of a mixture of half and half up to which it is roughness; more is a layer of its own."""
OXIDE = 60.0
"""Largest thickness (nm) of an oxide that grew below a film."""
_BOUNDS = {
    "roughness": (0.0, ROUGHEST, "nm"),
    "thickness_spread": (0.0, 60.0, "nm"),
    "angle_shift": (-3.0, 3.0, "deg"),
}
"""Bounds and units of the numbers of effects."""
_NODES, _WEIGHTS = hermegauss(7)


class Number(NamedTuple):
    """A number of a structure: name, bounds, unit, and position of its layer, None for the instrument."""

    name: str
    lower: float
    upper: float
    unit: str
    layer: int | None


class Material(NamedTuple):
    """A layer to be tried: a table of the catalogue or a dispersion model, and the largest thickness (nm)."""

    name: str
    most: float

    @property
    def modelled(self) -> bool:
        return self.name in FREE_MODELS


@dataclass(frozen=True)
class Structure:
    """Layers from the ambient down, and the effects on them."""

    layers: tuple[Material, ...]
    effects: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return ", ".join([" on ".join(x.name for x in self.layers), *self.effects])

    @cached_property
    def numbers(self) -> tuple[Number, ...]:
        """Its free numbers in order: of each layer the thickness and those of its model, then of effects."""
        found = []
        for i, layer in enumerate(self.layers):
            found.append(Number("thickness", 0.0, layer.most, "nm", i))
            if layer.modelled:
                found += [Number(key, *x, "", i) for key, x in FREE_MODELS[layer.name].items()]
        for effect in self.effects:
            found.append(Number(effect, *_BOUNDS[effect], None if effect == "angle_shift" else 0))
        return tuple(found)

    @cached_property
    def lower(self) -> np.ndarray:
        return np.array([x.lower for x in self.numbers])

    @cached_property
    def upper(self) -> np.ndarray:
        return np.array([x.upper for x in self.numbers])

    def column(self, name: str) -> int:
        """Position of an effect's number."""
        return [x.name for x in self.numbers].index(name)

    def index(self, layer: int, x: np.ndarray, view: SignalView) -> np.ndarray:
        """Complex index (rows, padded points) of a layer at the numbers `x` (rows, numbers)."""
        material = self.layers[layer]
        if not material.modelled:
            return np.broadcast_to(view.tables[material.name], (len(x), view.wavelength.size))
        own = {n.name: x[:, [i]] for i, n in enumerate(self.numbers) if n.layer == layer}
        values = {key: own[key] for key in FREE_MODELS[material.name]}
        with np.errstate(all="ignore"):
            found = built(material.name, values).index(view.wavelength)
        return np.broadcast_to(as_complex(found), (len(x), view.wavelength.size))

    def thicknesses(self, x: np.ndarray) -> np.ndarray:
        """Thicknesses (rows, layers) in nm."""
        return x[:, [i for i, n in enumerate(self.numbers) if n.name == "thickness"]]

    def slots(self, x: np.ndarray, view: SignalView) -> tuple[np.ndarray, np.ndarray]:
        """Index (rows, slots, padded points) and thickness (rows, slots) of the numbers `x`."""
        every = [self.index(i, x, view) for i in range(len(self.layers))]
        depth = list(self.thicknesses(x).T)
        if "roughness" in self.effects:
            every.insert(0, half_and_half(every[0], view))
            depth.insert(0, x[:, self.column("roughness")])
        return _in_slots(every, depth)

    def simulate(self, x: np.ndarray, view: SignalView) -> np.ndarray:
        """Simulate the values (rows, points · channels) of a view at the numbers `x` (rows, numbers)."""
        index, depth = self.slots(x, view)
        shift: Any = x[:, self.column("angle_shift")] if "angle_shift" in self.effects else 0.0
        if "thickness_spread" not in self.effects:
            return view.simulate(index, depth, shift)
        thickest = np.argmax(depth, axis=1)
        count = len(_NODES)
        depth, index = np.repeat(depth, count, 0), np.repeat(index, count, 0)
        uneven = np.outer(x[:, self.column("thickness_spread")], _NODES).ravel()
        rows = np.arange(len(depth)), np.repeat(thickest, count)
        depth[rows] = np.maximum(depth[rows] + uneven, 0.0)
        return view.simulate(index, depth, shift, average=(_WEIGHTS / _WEIGHTS.sum(), count))


def half_and_half(below: np.ndarray, view: SignalView) -> np.ndarray:
    """Index of a mixture of equal shares of a medium and the ambient, as `Interface` of a scene has it."""
    nm = view.wavelength
    above = np.broadcast_to(view.media[0].real, below.shape)
    media: Any = [Tabulated(nm, x, None) for x in (above, to_pair(below))]
    with np.errstate(all="ignore"):
        return as_complex(Bruggeman(media[0], media[1], 0.5).index(nm))


def _in_slots(index: list[np.ndarray], depth: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Layers in the last slots; the first are empty."""
    empty = SLOTS - len(index)
    none, nothing = np.ones_like(index[0]), np.zeros_like(depth[0])
    return np.stack([none] * empty + index, axis=1), np.stack([nothing] * empty + depth, axis=1)
