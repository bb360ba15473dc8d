"""The free parameters of a scene: their names, units and bounds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import numpy as np

from pellicle.scene import Free, Layer, Normal, Scene, free_leaves, insert, is_free

_UNITS = {"thickness": "nm", "bandwidth": "nm", "thickness_spread": "nm", "plate_mm": "mm", "angle": "deg"}
_MODEL_UNITS = {"B": "nm^2", "C": "nm^4", "C1": "nm^2", "C2": "nm^2", "C3": "nm^2"}
_NATURAL_ZERO = ("k", "bandwidth", "thickness_spread", "offset")
_SEARCHED = ("thickness", "n", "A", "B", "k", "B1")
"""Parameters that change where the fringes lie, or whether there are any: a start in the middle fails."""


@dataclass(frozen=True)
class Parameter:
    """One nonlinear parameter; `key` is its last name (`thickness`, `n`, `A`), `name` its full one."""

    name: str
    key: str
    unit: str
    value: float
    lower: float
    upper: float
    prior: Normal | None

    @property
    def natural_lower(self) -> bool:
        """A lower bound that physics sets: resting on it gives a one-sided limit, not a warning."""
        return self.key in _NATURAL_ZERO and self.lower == 0

    @property
    def searched(self) -> bool:
        return self.key in _SEARCHED


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Every free parameter, in the order of the scene's pytree."""
    return tuple(_parameter(scene, path, free) for path, free in free_leaves(scene))


def _parameter(scene: Scene, path: tuple, free: Free) -> Parameter:
    steps = [_step(key) for key in path]
    key = _key(steps)
    return Parameter(
        name=".".join([*_owner(scene, steps), key]),
        key=key,
        unit=_unit(key),
        value=free.value,
        lower=free.lower,
        upper=free.upper,
        prior=free.prior,
    )


def _unit(key: str) -> str:
    return _UNITS.get(key, _MODEL_UNITS.get(key, ""))


def _step(key: Any) -> str:
    if isinstance(key, jax.tree_util.GetAttrKey):
        return key.name
    return str(getattr(key, "idx", getattr(key, "key", key)))


def _key(steps: list[str]) -> str:
    """`A`, or `B1` for the first number of a tuple B."""
    return f"{steps[-2]}{int(steps[-1]) + 1}" if steps[-1].isdigit() else steps[-1]


def _owner(scene: Scene, steps: list[str]) -> list[str]:
    """The part of the name before the last dot: nothing for the only layer of a scene."""
    if steps[0] != "layers":
        return [] if steps[0] == "light" else [steps[0]]
    if len(scene.layers) == 1:
        return []
    position = int(steps[1])
    return [scene.layers[position].name or f"layer{position + 1}"]


def bounds(parameters: tuple[Parameter, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bounds, each of shape (parameters,)."""
    return np.array([p.lower for p in parameters]), np.array([p.upper for p in parameters])


def anonymous(scene: Scene) -> Scene:
    """The scene without bounds and layers' names: neither may make a new program."""
    scene = insert(scene, [Free(0.5, 0.0, 1.0)] * len(free_leaves(scene)))
    return eqx.tree_at(lambda s: s.layers, scene, tuple(Layer(x.material, x.thickness) for x in scene.layers))


def fixed_numbers(scene: Scene) -> list[tuple[str, float, str]]:
    """(name, value, unit) of the layer's numbers and the instrument's that are not free."""
    leaves = jax.tree_util.tree_leaves_with_path((scene.layers, scene.instrument), is_leaf=is_free)
    found = []
    for path, leaf in leaves:
        if is_free(leaf) or np.ndim(leaf) or not isinstance(leaf, int | float):
            continue
        steps = ["layers" if path[0].idx == 0 else "instrument", *(_step(key) for key in path[1:])]
        key = _key(steps)
        found.append((".".join([*_owner(scene, steps), key]), float(leaf), _unit(key)))
    return found
