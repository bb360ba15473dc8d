"""Signals of elementary scenes by NumPy, which compiles nothing.

The formulas are those of `film_signal`; many candidates of one scene are evaluated side by side.
"""

import jax
import numpy as np

from pellicle.dispersion.critical_points import BrendelBormann, Tanguy
from pellicle.dispersion.oscillators import CodyLorentz
from pellicle.dispersion.psemi import Psemi
from pellicle.dispersion.spline import KramersKronigSpline
from pellicle.forward_model.film_signal import signal_rows
from pellicle.forward_model.plan import GENERAL, Plan
from pellicle.scene.film import Scene
from pellicle.scene.free import insert
from pellicle.scene.graded import Graded
from pellicle.scene.layers import Layer

_VALUES = 2**16
"""Values of an array of NumPy: those of longer ones leave the cache of the processor."""
_SLOW = {BrendelBormann: 2, CodyLorentz: 10, KramersKronigSpline: 7, Psemi: 24, Tanguy: 3}
"""Points of a film that take as long as one of the index of a medium with free numbers, if that is slow."""


def is_elementary(plan: Plan) -> bool:
    """True where NumPy evaluates a plan: homogeneous layers, without sums over orders of interference."""
    return plan.reference is None and not (plan.on("orders") or plan.on("gradient"))


def points_by_numpy(plan: Plan, scene: Scene) -> float:
    """Number of points of one or two layers that take NumPy as long as one candidate of a scene; infinite for
    a plan that it does not evaluate."""
    if not is_elementary(plan):
        return np.inf
    bandwidth, cone = plan.row("coherence"), plan.row("angle-spread")
    layers = sum(getattr(layer, "repeats", 1) for layer in scene.layers)
    rays = cone.count * (cone.around if plan.row("anisotropy").count >= GENERAL else 1)
    nodes = max(layers / 2, 1) * max(bandwidth.count, 1) * (rays if cone.on else 1)
    media = jax.tree.leaves(scene, is_leaf=lambda x: type(x) in _SLOW)
    return np.size(scene.light.wavelength) * (nodes + sum(_SLOW.get(type(x), 0) for x in media))


def by_numpy(plan: Plan, scene: Scene, candidates: np.ndarray) -> np.ndarray:
    """Signals (candidates, values) of an elementary plan, as of `build`, with the free numbers of the scene
    at `candidates` (candidates, numbers), as many side by side as have `_VALUES` values."""
    # means over a graded medium, and the rays of a ring, have an axis of their own
    own_axis = any(isinstance(layer, Layer) and isinstance(layer.material, Graded) for layer in scene.layers)
    own_axis |= plan.on("angle-spread") and plan.row("anisotropy").count >= GENERAL
    most = 1 if own_axis else max(1, _VALUES // np.size(scene.light.wavelength))
    if len(candidates) > most:
        parts = (candidates[first : first + most] for first in range(0, len(candidates), most))
        return np.concatenate([by_numpy(plan, scene, part) for part in parts])
    columns = candidates[0] if len(candidates) == 1 else np.transpose(candidates)[:, :, None]
    numbers = jax.tree.map(np.asarray, insert(scene, [*columns]))
    each, kind = np.empty((len(candidates), 1)), plan.kind
    with np.errstate(all="ignore"):  # a candidate without a signal has NaN
        _, *rows = np.broadcast_arrays(each, *signal_rows(plan)(numbers))
    if not kind.ellipsometric:
        return np.asarray(kind.of_power(rows[0]))
    return np.stack(rows, axis=-1).reshape(len(candidates), -1)
