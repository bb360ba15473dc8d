"""Controls of a scene: its numbers that can be moved, and those of effects that can be added.

A structure of a program is the set of effects that are there, and the largest sizes that the program serves.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
from jax.tree_util import GetAttrKey, SequenceKey

from pellicle.dispersion.empirical import Constant
from pellicle.errors import UsageError
from pellicle.fitting.film.parameters import parameters
from pellicle.scene.film import Scene
from pellicle.scene.free import Free, free_leaves, is_free
from pellicle.scene.layers import Interface, Layer, Plate
from pellicle.scene.ties import bound
from pellicle.simulation.colours import varied_layer

STEPS = 1000
"""Steps of a slider, at least."""
_WIDEST_RATIO = 1000.0
"""Ratio of the bounds from which a slider is logarithmic."""
_OPTIONAL = {
    "k": 1.0,
    "roughness": 20.0,
    "thickness_spread": 50.0,
    "bandwidth": 20.0,
    "numerical_aperture": 0.9,
    "angle_spread": 60.0,
    "angle": 85.0,
}
"""Keys whose effect is absent at 0, and the upper bound of their sliders."""
_LABELS = {
    "thickness_spread": "thickness spread (standard deviation)",
    "roughness": "roughness of the upper face (rms)",
    "bandwidth": "bandwidth (FWHM)",
    "numerical_aperture": "numerical aperture",
    "angle_spread": "half angle of the cone",
    "angle": "angle of incidence",
    "plate_mm": "thickness of the plate",
}


@dataclass(frozen=True)
class Control:
    """One number of a scene and the slider that moves it.

    `path` is its place in the scene, as of `jax.tree_util`. An `optional` one is the size of an effect that
    is absent at 0. `scale` is "linear" or "log". `free` is the scene's own `Free`, None for a fixed number.
    """

    name: str
    label: str
    unit: str
    lower: float
    upper: float
    value: float
    group: str
    path: tuple[Any, ...]
    optional: bool = False
    free: Free | None = None

    @property
    def scale(self) -> str:
        """Logarithmic where the bounds are far apart."""
        return "log" if self.lower > 0 and self.upper > _WIDEST_RATIO * self.lower else "linear"

    @property
    def step(self) -> float:
        """Step of the slider: 1, 2 or 5 times a power of ten."""
        raw = (self.upper - self.lower) / STEPS
        power = 10.0 ** math.floor(math.log10(raw))
        return float(f"{max(x for x in (1, 2, 5) if x * power <= raw * (1 + 1e-9)) * power:.6g}")

    def to_json(self) -> dict[str, Any]:
        """Return what a page needs to draw the slider."""
        names = ("name", "label", "unit", "lower", "upper", "value", "step", "scale", "group")
        return {name: getattr(self, name) for name in names} | {"free": self.free is not None}


def film_controls(scene: Scene) -> tuple[Control, ...]:
    """Return the controls of a film: thicknesses, constant indices, every free number and optional effects.

    An array of angles of incidence has none.
    """
    # numbers that the scene has: free ones, thicknesses, constant indices and optional effects
    leaves = jax.tree_util.tree_leaves_with_path(scene, is_leaf=is_free)
    shown = {(*at, GetAttrKey(key)) for at in _constants(scene) for key in ("n", "k")}
    present = {}
    for path, leaf in leaves:
        key, number = getattr(path[-1], "name", ""), isinstance(leaf, int | float)
        slides = path[0].name != "ambient" and key in ("thickness", *_OPTIONAL) and key != "k"
        if (is_free(leaf) and leaf.tie is None) or (number and (path in shown or slides)):
            present[path] = leaf
    for path in _addable(scene):
        present.setdefault(path, 0.0)
    scaffold = scene
    for path, value in present.items():
        scaffold = with_value(scaffold, path, _bounds(path, value))
    scaffold = bound(scaffold, again=True)
    named = dict(zip(free_paths(scaffold), parameters(scaffold), strict=True))
    controls = []
    for path, number in named.items():
        value: Any = present[path]
        label = _LABELS.get(number.key, number.key)
        free = value if isinstance(value, Free) else None
        unit = {"deg": "°"}.get(number.unit, number.unit)
        start = value.start if isinstance(value, Free) else float(value)
        bounds, group = (number.lower, number.upper), _group(scene, path)
        optional = getattr(path[-1], "name", "") in _OPTIONAL and number.lower <= 0
        controls.append(Control(number.name, label, unit, *bounds, start, group, path, optional, free))
    return tuple(controls)


def template(scene: Scene, controls: Collection[Control], active: Collection[str]) -> Scene:
    """Return the scene with a `Free` at each control that is not optional or is `active`.

    Other optional effects are absent. The order of the controls is that of the free numbers.
    """
    for control in controls:
        there = not control.optional or control.name in active
        absent = 0.0 if control.path[-1] == GetAttrKey("angle") else None
        number = Free(control.lower, control.upper, start=control.value) if there else absent
        scene = with_value(scene, control.path, number)
    return bound(scene, again=True)


def with_value(tree: Any, path: tuple[Any, ...], value: Any) -> Any:
    """Return the pytree with the number at `path` replaced; None may stand there, before and after.

    The checks of the scene are not run: bounds of two sliders may contradict where no values of them do.
    """
    if not path:
        return value
    step, *rest = path
    if isinstance(step, SequenceKey):
        return tuple(with_value(x, tuple(rest), value) if i == step.idx else x for i, x in enumerate(tree))
    changed = object.__new__(type(tree))
    for name, field in vars(tree).items():
        new = with_value(field, tuple(rest), value) if name == step.name else field
        object.__setattr__(changed, name, new)
    return changed


def scene_with(
    scene: Scene, controls: Collection[Control], values: Mapping[str, float], free: Collection[str]
) -> Scene:
    """Return the scene with the values of its controls; those named `free` are free within their bounds."""
    for control in controls:
        value: Any = values[control.name]
        if control.name in free:
            prior = None if control.free is None else control.free.prior
            value = Free(control.lower, control.upper, start=value, prior=prior)
        elif control.optional and value == 0 and control.path[-1].name != "angle":
            value = None
        scene = with_value(scene, control.path, value)
    return bound(scene, again=True)


def free_paths(tree: Any) -> list[tuple[Any, ...]]:
    """Return the place of each free number of a pytree, in their order."""
    return [path for path, _ in free_leaves(tree)]


def _constants(scene: Scene) -> list[tuple[Any, ...]]:
    """Places of media of layers and of the substrate that are one constant index."""
    media: dict[tuple[Any, ...], Any] = {
        (GetAttrKey("layers"), SequenceKey(i)): x
        for i, x in enumerate(scene.layers)
        if isinstance(x, Layer | Plate)
    }
    media[(GetAttrKey("substrate"),)] = scene.substrate
    return [(*path, GetAttrKey("material")) for path, x in media.items() if isinstance(x.material, Constant)]


def _addable(scene: Scene) -> list[tuple[Any, ...]]:
    """Places of effects that the scene leaves out and a slider can add."""
    paths: list[tuple[Any, ...]] = [(*at, GetAttrKey("k")) for at in _constants(scene)]
    coherent = [i for i, x in enumerate(scene.layers) if isinstance(x, Layer)]
    if coherent:
        layers = GetAttrKey("layers")
        paths.append((layers, SequenceKey(coherent[0]), GetAttrKey("roughness")))
        if scene.instrument.thickness_spread is None:
            paths.append((layers, SequenceKey(varied_layer(scene)), GetAttrKey("thickness_spread")))
    instrument = ["bandwidth", *([] if scene.instrument.has_cone else ["numerical_aperture"])]
    return [*paths, *((GetAttrKey("instrument"), GetAttrKey(name)) for name in instrument)]


def _bounds(path: tuple[Any, ...], value: Any) -> Free:
    """Bounds of a slider: those of a free number, else usual ones that include a fixed number."""
    if isinstance(value, Free):
        return Free(value.lower, value.upper, start=value.start)
    key, number = getattr(path[-1], "name", ""), float(value)
    if key == "thickness":
        return Free(0.0, _round_up(max(2 * number, 1000.0)), start=number)
    if key in _OPTIONAL:
        most = STEEPEST if key == "angle" else math.inf
        wide = _round_up(1.2 * number) if number else 0.0
        return Free(0.0, min(max(_OPTIONAL[key], wide), most), start=number)
    return Free(min(max(number - 0.5, 0.05), max(1.0, number - 0.5)), number + 0.5, start=number)


def _round_up(number: float) -> float:
    power = 10.0 ** math.floor(math.log10(number))
    return next(x * power for x in (1, 2, 5, 10) if x * power >= number * (1 - 1e-9))


def _group(scene: Scene, path: tuple[Any, ...]) -> str:
    """Heading of the sliders of one part of the scene."""
    part = path[0].name
    if part != "layers":
        return part
    layer = scene.layers[path[1].idx]
    if isinstance(layer, Interface):
        return layer.name or "interface"
    medium = getattr(layer.material, "name", "")
    number = "" if len(scene.layers) == 1 else f" {path[1].idx + 1}"
    return " ".join(x for x in (f"layer{number}", layer.name or "", f"({medium})" if medium else "") if x)


_AVERAGED = ("thickness_spread", "bandwidth", "numerical_aperture", "angle_spread")
CONES = ("numerical_aperture", "angle_spread")
_SHARES = (0.125, 0.25, 0.5, 1.0)
"""Shares of the range of an average for which programs are compiled: a small spread needs few nodes."""
_ANGLES, STEEPEST = 5.0, 89.0
"""Step of the largest angle of incidence of programs with a cone of light, and the steepest ray (degrees)."""


class Structure(NamedTuple):
    """Optional effects that a program is compiled for, with upper bounds of their sizes."""

    active: tuple[tuple[str, float], ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the controls of the effects that are there."""
        return tuple(name for name, _ in self.active)


def bucket(control: Control, value: float) -> float:
    """Return the upper bound of a program for a value: a share of the range of an average, else all of it."""
    if key_of(control.name) not in _AVERAGED:
        return control.upper
    return next(share * control.upper for share in _SHARES if value <= share * control.upper * (1 + 1e-12))


def oblique_cone(name: str, angle: float, size: float, bound: float) -> tuple[float, float]:
    """Return upper bounds of the angle of incidence, in steps of `_ANGLES`, and of the size of a cone at it.

    Raises UsageError where the cone reaches beyond `STEEPEST`.
    """
    aperture = key_of(name) == "numerical_aperture"
    half = math.degrees(math.asin(min(size, 1.0))) if aperture else size
    if angle + half > STEEPEST:
        raise UsageError(
            f"the cone of light reaches beyond {STEEPEST:g} degrees: the angle of incidence is {angle:g}, and"
            f" the half angle of the cone {half:.3g}"
        )
    highest = min(math.ceil(angle / _ANGLES) * _ANGLES, STEEPEST - half)
    room = STEEPEST - highest
    return highest, min(bound, math.sin(math.radians(room)) if aperture else room)


def key_of(name: str) -> str:
    """Return the last part of a control's name."""
    return name.rpartition(".")[2]


def fitted_names(controls: Collection[Control], asked: Any) -> list[str]:
    """Names of the controls to fit: those that are `asked`, else the scene's free ones, else thicknesses.

    Raises UsageError for an unknown name.
    """
    if asked is not None:
        known = {control.name for control in controls}
        if not isinstance(asked, list | tuple) or not asked or not all(name in known for name in asked):
            raise UsageError(f"`free` must be a list of one or more of {', '.join(sorted(known))}")
        return list(asked)
    free = [control.name for control in controls if control.free is not None]
    return free or [control.name for control in controls if key_of(control.name) == "thickness"]
