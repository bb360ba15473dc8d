"""Groups of layers that are repeated, as in Bragg mirrors and interference filters.

A scene lists each layer of a group once, with its `Repetition`; consecutive layers with the same one are a
group.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import groupby
from typing import Any, final

import equinox as eqx

from pellicle.errors import UsageError
from pellicle.optics.repeats import places
from pellicle.scene.free import Free
from pellicle.scene.graded import Graded
from pellicle.scene.layers import Interface, Layer, Plate, Repetition

MOST_REPEATS = 10_000
"""Largest number of repeats of a group."""


@final
class Group(eqx.Module):
    """Coherent layers that are repeated, as the pairs of a Bragg mirror.

    **Arguments:** `layers`, two or more `Layer`, from the ambient down; `repeat`, how often they follow one
    another. A free number of a layer is one number for all repeats; a layer's `drift` changes its thickness
    linearly from the uppermost repeat to the lowest.

    **Raises:** UsageError for anything but two or more homogeneous layers, ValueError for a number of repeats
    outside 1 to 10 000, and for a drift of 200 % or more.

    >>> mirror = pl.Scene([Group([pl.Layer("TiO2", 60.0), pl.Layer("SiO2", 94.0)], repeat=8)], "BK7")
    >>> mirror.layers[1].repeats
    8
    """

    layers: tuple[Layer, ...] = eqx.field(
        converter=lambda x: tuple(x) if isinstance(x, list | tuple) else (x,)
    )
    repeat: int = eqx.field(static=True)

    def __check_init__(self):
        for layer in self.layers:
            if not isinstance(layer, Layer) or isinstance(layer.material, Graded) or layer.group is not None:
                raise UsageError(
                    "a group repeats layers as pl.Layer('SiO2', 100.0): no plates, mixed interfaces, graded"
                    " layers or further groups"
                )
            drift = layer.drift
            bounds = (drift.lower, drift.upper) if isinstance(drift, Free) else (drift,)
            if any(isinstance(x, int | float) and not abs(x) < 2 for x in bounds):
                raise ValueError("`drift` is a relative change of thickness, which must lie between -2 and 2")
        if len(self.layers) < 2:
            raise UsageError("a group repeats two or more layers; one layer repeated is a thicker layer")
        if isinstance(self.repeat, bool) or not isinstance(self.repeat, int):
            raise UsageError(f"`repeat` must be a whole number, not {self.repeat!r}")
        if not 1 <= self.repeat <= MOST_REPEATS:
            raise ValueError(f"`repeat` must be 1 to {MOST_REPEATS}, got {self.repeat}")


def listed(value: Any) -> tuple[Layer | Interface | Plate, ...]:
    """Return one layer or several as a tuple, which has each layer of a group once.

    **Raises:** UsageError for what is no layer, and for a drift outside of a group.
    """
    items = tuple(value) if isinstance(value, list | tuple) else (value,)
    taken = {x.group.number for x in items if isinstance(x, Layer) and x.group is not None}
    layers: list[Any] = []
    for item in items:
        if isinstance(item, Group):
            number = next(i for i in range(len(taken) + 1) if i not in taken)
            taken.add(number)
            layers += [replace(x, group=Repetition(item.repeat, number)) for x in item.layers]
        elif isinstance(item, Layer | Interface | Plate):
            layers.append(item)
        else:
            shown = repr(item) if isinstance(item, str) else type(item).__name__
            raise UsageError(f"a layer of a scene must be as pl.Layer('SiO2', 100.0), not {shown}")
    if any(isinstance(x, Layer) and x.group is None and x.drift is not None for x in layers):
        raise UsageError("`drift` of a thickness is that of a layer in a group, from repeat to repeat")
    return tuple(layers)


def runs(layers: Iterable[Any]) -> list[tuple[int, list[Any]]]:
    """Return (repeats, layers) of each group and, with 1 repeat, of the layers between groups, in order."""
    found = groupby(layers, lambda x: x.group if isinstance(x, Layer) else None)
    return [(1 if group is None else group.repeats, [*members]) for group, members in found]


def unlisted(layers: Sequence[Any]) -> list[Any]:
    """Return layers with their groups as `Group`, the inverse of `listed`."""
    items: list[Any] = []
    for repeats, own in runs(layers):
        grouped = isinstance(own[0], Layer) and own[0].group is not None
        items += [Group([replace(x, group=None) for x in own], repeats)] if grouped else own
    return items


def written_out(layers: Sequence[Any]) -> tuple[Layer | Interface | Plate, ...]:
    """Return every repeat of every layer, of a scene in numbers."""
    every: list[Any] = []
    for repeats, own in runs(layers):
        grouped = isinstance(own[0], Layer) and own[0].group is not None
        for place in places(repeats):
            every += [_at(x, float(place)) for x in own] if grouped else own
    return tuple(every)


def _at(layer: Any, place: float) -> Any:
    """The layer in the repeat at a place of its drift, −½ to ½."""
    drift = 0.0 if layer.drift is None else layer.drift
    return replace(layer, thickness=layer.thickness * (1 + place * drift), drift=None, group=None)
