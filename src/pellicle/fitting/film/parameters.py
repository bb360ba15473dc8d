"""The free parameters of a scene: their names, units and bounds."""

from collections.abc import Sequence
from dataclasses import replace

import jax
import numpy as np

from pellicle.dispersion.oscillators import (
    AbstractOscillator,
    Drude,
    DrudeSmith,
    Gaussian,
    Lorentz,
    Oscillators,
)
from pellicle.dispersion.profiles import Spline as FreeProfile
from pellicle.dispersion.spline import KramersKronigSpline, Spline
from pellicle.errors import UsageError
from pellicle.fitting.parameter import Parameter
from pellicle.fitting.tied_numbers import TiedNumber
from pellicle.scene.expressions import replaced
from pellicle.scene.film import Scene, unchecked
from pellicle.scene.free import Free, free_leaves, insert, is_free, remembered, without_bounds
from pellicle.scene.layers import Layer
from pellicle.scene.names import WIDTHS, location_of, name_in_fit, unit_of
from pellicle.scene.ties import tied_leaves
from pellicle.scene.uncertainty import Uncertainty

_NATURAL_ONE = ("back_collected", "stray_light")
_NATURAL_ZERO = (
    *("k", "k0", "A_uv", "A_ir", "fraction", "top", "bottom", "values", "offset"),
    *("numerical_aperture", "apodisation"),
    *_NATURAL_ONE,
    *WIDTHS,
)
_SEARCHED = (
    "thickness",
    "n",
    "A",
    "B",
    "k",
    "B1",
    "Ep",
    "E0",
    "Eg",
    "eps_inf",
    "n_inf",
    "f1",
    "E1",
    "TO1",
    "LO1",
    "fraction",
    "top",
    "bottom",
)
"""Parameters that move fringes or make them vanish: a start in the middle of their bounds fails."""
_RESOLUTION = 0.5
"""Thicknesses (nm) closer than this belong to one minimum."""
_FEW = 3
"""Levels of an oscillator's parameter, of which there are many at once."""
_DRUDE = {"eps_inf": 6, "Ep": 7}
"""Levels beside free charges: their reflection edge is where their plasma energy and eps_inf put it together.
Found of 14 simulated spectra of transparent conductors, 0.8 to 2.3 eV: 12 with 3 even levels, 14 with
these."""
_RESONANCE = {"E0": 7}
"""Levels of the energy of the only resonance, by decades: n and k on its two sides differ, more than where an
absorption edge goes with it. Found of 20 films
of `benchmarks/dispersion_models.py` with a gaussian one: 19 with 3 even levels, 20 with these."""


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Every free parameter, in the order of the scene's pytree."""
    return shared(("",), scene)[0]


@remembered
def shared(names: tuple[str, ...], *scenes: Scene) -> tuple[tuple[Parameter, ...], list[tuple[int, ...]]]:
    """Free parameters of data that are fitted together, and the positions of those in each scene.

    Scenes of one sample share layers, substrate and ambient; light and instrument are each scene's own, and
    bear its name. Several samples share the numbers that they name.
    """
    parameters: dict[tuple[str, ...], Parameter] = {}
    positions: list[list[tuple[str, ...]]] = []
    for scene, name in zip(scenes, names, strict=True):
        positions.append([])
        for path, free in free_leaves(scene):
            p = _parameter(scene, path, free, name)
            key = (_own(path, name), jax.tree_util.keystr(path)) if scene.sample is None else (p.name,)
            parameters.setdefault(key, p)
            positions[-1].append(key)
    order = {key: i for i, key in enumerate(parameters)}
    return tuple(parameters.values()), [tuple(order[key] for key in keys) for keys in positions]


def _own(path: tuple, name: str) -> str:
    """The name of the scene that a number belongs to, empty where all share it."""
    return name if path[0].name in ("light", "instrument") else ""


def _parameter(scene: Scene, path: tuple, free: Free, name: str) -> Parameter:
    location = location_of(scene, path)
    owner, key, field = type(location.owner), location.key, location.field
    full = name_in_fit(scene, path, location.name, _own(path, name))
    if key in _NATURAL_ONE and free.upper > 1:
        raise UsageError(f"`{key}` must be at most 1: its upper bound is {free.upper:g}")
    # the A of an oscillator is a strength, which cannot be negative; that of Cauchy is an index
    strength = key in ("A", "f1") and (issubclass(owner, AbstractOscillator) or key == "f1")
    # a search moves the index of a spline as a whole
    group = full.removesuffix(key) + field if owner in (Spline, KramersKronigSpline, FreeProfile) else full
    oscillator = owner is Oscillators or issubclass(owner, AbstractOscillator)
    drude = any(
        isinstance(x, Drude | DrudeSmith) for x in [location.owner, *getattr(location.owner, "terms", ())]
    )
    resonances = sum(getattr(steps[-1], "name", "") == "E0" for steps, _ in free_leaves(scene))
    sole = resonances == 1 and issubclass(owner, Lorentz | Gaussian)
    levels = (_DRUDE if drude else _RESONANCE if sole else {}).get(key, _FEW)
    return Parameter(
        name=full,
        key=key,
        unit=unit_of(location),
        start=free.start,
        lower=free.lower,
        upper=free.upper,
        prior=free.prior,
        limits=free.limits,
        varies=free.varies,
        first=free.first,
        last=free.last,
        natural=(
            (strength or (field or key) in _NATURAL_ZERO) and free.lower == 0,
            key in _NATURAL_ONE and free.upper == 1,
        ),
        resolution=_RESOLUTION if key == "thickness" else None,
        searched=key in _SEARCHED or owner in (Spline, FreeProfile) or group.split(".")[-1] == "k",
        group=group,
        levels=levels if oscillator else None,
        decades=oscillator and levels > _FEW and key != "eps_inf",
    )


def thickness_name(scene: Scene, position: int) -> str:
    """The full name of a layer's thickness."""
    path = jax.tree_util.GetAttrKey("layers"), jax.tree_util.SequenceKey(position)
    return name_in_fit(scene, path, "thickness")


def varied_and_kept(scene: Scene, position: int) -> tuple[str, list[str]]:
    """Name of the thickness of a layer that is varied alone, and the other free numbers as `n = 1.46`."""
    varied = thickness_name(scene, position)
    others = [p for p in parameters(scene) if p.name != varied]
    return varied, [f"{p.name} = {p.start:.6g} {p.unit}".rstrip() for p in others]


def bounds(parameters: tuple[Parameter, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bounds, each of shape (parameters,)."""
    return np.array([p.lower for p in parameters]), np.array([p.upper for p in parameters])


def with_bounds(scene: Scene, parameters: Sequence[Parameter]) -> Scene:
    """The scene with the bounds of these parameters, which are its own in their order."""
    pairs = zip(free_leaves(scene), parameters, strict=True)
    kept = "prior", "varies", "first", "last"
    free = [
        Free(
            p.lower,
            p.upper,
            start=free.start,
            limits=free.limits,
            **{key: getattr(free, key) for key in kept},
        )
        for (_, free), p in pairs
    ]
    return insert(scene, free)


def anonymous(scene: Scene) -> Scene:
    """The scene without bounds, names and uncertainties: none of them may make a new program."""
    scene = without_bounds(scene)
    layers = tuple(
        replace(layer, name=None, **({"index_uncertainty": None} if isinstance(layer, Layer) else {}))
        for layer in scene.layers
    )
    substrate = replace(scene.substrate, index_uncertainty=None)
    return unchecked(scene, layers=layers, substrate=substrate, uncertainty=Uncertainty(), sample=None)


@remembered
def tied_numbers(scene: Scene, name: str = "") -> list[TiedNumber]:
    """The numbers of a scene that follow free ones; `name` is the scene's where it is one of several."""

    def called(path: tuple) -> str:
        return name_in_fit(scene, path, location_of(scene, path).name, _own(path, name))

    names = {free.label: called(path) for path, free in free_leaves(scene)}
    return [
        TiedNumber(
            called(path),
            unit_of(location_of(scene, path)),
            x.lower,
            x.upper,
            x.tie.text or "",
            replaced(x.tie.tree, lambda label: ("name", names[label])),
        )
        for path, x in tied_leaves(scene)
    ]


@remembered
def fixed_numbers(scene: Scene, name: str = "") -> list[tuple[str, float, str]]:
    """(name, value, unit) of the layer's numbers and the instrument's that are not free.

    `name` is the scene's where it is one of several.
    """
    rows = []
    for path, leaf in jax.tree_util.tree_leaves_with_path(scene, is_leaf=is_free):
        if path[0].name not in ("layers", "instrument") or not isinstance(leaf, int | float):
            continue
        location = location_of(scene, path)
        full = name_in_fit(scene, path, location.name, _own(path, name))
        rows.append((full, float(leaf), unit_of(location)))
    return rows
