"""Python expression of a scene, which builds the same scene where `pl` is pellicle."""

from dataclasses import MISSING, fields, is_dataclass, replace
from typing import Any

import numpy as np

from pellicle.dispersion.anisotropic import Anisotropic
from pellicle.dispersion.base import AbstractDispersion
from pellicle.dispersion.empirical import Constant
from pellicle.errors import UsageError
from pellicle.materials import Material, UnknownMaterial
from pellicle.materials import material as find
from pellicle.scene.film import Light, Reference, Scene
from pellicle.scene.free import Free
from pellicle.scene.graded import Graded
from pellicle.scene.groups import Group, unlisted
from pellicle.scene.instrument import ONE_NUMBER, Drift, Instrument
from pellicle.scene.layers import Interface, Layer, Plate, Substrate
from pellicle.scene.surface import Surface
from pellicle.scene.uncertainty import StandardUncertainties

_PLACES = {
    "pellicle.dispersion.effective_medium": "mixing",
    "pellicle.dispersion.profiles": "profile",
    "pellicle.scene.priors": "priors",
}
"""Public namespaces of classes by their module; other dispersions are in `pl.dispersion`."""
_POSITIONAL = {
    Scene: ("layers", "substrate"),
    Layer: ("material", "thickness"),
    Group: ("layers",),
    Interface: ("thickness",),
    Plate: ("material", "plate_mm"),
    Substrate: ("material",),
    Reference: ("substrate",),
    Graded: ("first", "second"),
    Surface: ("model", "numbers"),
}
"""Fields that are given without their names."""


class _Text(str):
    """An expression that is finished."""


def python_program(scene: Scene | Surface, recipe: str = "") -> str:
    """Return a program that builds a scene and simulates it, at the wavelengths of its light where given; or
    that fits its free parameters to the data of a `recipe`."""
    nm = scene.light.wavelength if isinstance(scene, Scene) else None
    lines = ["import pellicle as pl", "", f"scene = {python_text(scene)}"]
    numpy = ["import numpy as np"] if (nm is not None and not recipe) or "np." in lines[-1] else []
    if recipe:
        lines.append(f"[(data, _, options)] = pl.read_problems({recipe!r})")
        return "\n".join([*numpy, *lines, "fit = pl.fit(data, scene, **options)", "print(fit)", ""])
    if nm is None:
        return "\n".join([*numpy, *lines, "simulated = pl.simulate(scene)", "print(simulated.values)", ""])
    lines = [*numpy, *lines, f"wavelength = {_array(np.asarray(nm, float))}  # nm"]
    return "\n".join([*lines, "spectrum = pl.simulate(scene, wavelength)", "print(spectrum.values)", ""])


def python_text(thing: Any) -> str:
    """Format a scene, a surface or a part of them as an expression in Python.

    The wavelengths of a light are left out. **Raises:** UsageError for what has no expression, such as the
    sensor of a camera.
    """
    if isinstance(thing, Free) and thing.tie is not None:
        return _call("pl.Tied", [thing.tie.text], {})
    if isinstance(thing, Free):
        about = {} if thing.start == 0.5 * (thing.lower + thing.upper) else {"start": thing.start}
        kept = "prior", "limits", "varies", "first", "last"
        about |= {key: x for key in kept if (x := getattr(thing, key)) is not None}
        return _call("pl.Free", [thing.lower, thing.upper], about)
    if isinstance(thing, Anisotropic):
        return _call("pl.Anisotropic", [], thing.arguments)
    if isinstance(thing, StandardUncertainties) and thing == type(thing).none():
        return f"pl.{type(thing).__name__}.none()"
    if isinstance(thing, Drift):
        words = {"varies": thing.varies} if thing.varies else "free" if thing == ONE_NUMBER else "slow"
        return repr(words)
    if isinstance(thing, Material | Constant):
        return _medium(thing)
    if isinstance(thing, _Text):
        return str(thing)
    if is_dataclass(thing) and not isinstance(thing, type):
        return _module(thing)
    if isinstance(thing, dict):
        return "{" + ", ".join(f"{key!r}: {python_text(x)}" for key, x in thing.items()) + "}"
    if isinstance(thing, list):
        return "[" + ", ".join(map(python_text, thing)) + "]"
    if isinstance(thing, tuple):
        inside = ", ".join(map(python_text, thing))
        return f"({inside},)" if len(thing) == 1 else f"({inside})"
    if isinstance(thing, str | bool) or thing is None:
        return repr(thing)
    number: Any = thing
    if np.ndim(number) == 0 and hasattr(number, "__float__"):
        return repr(float(number))
    if np.ndim(number) == 1 and len(number):
        return _array(np.asarray(number, float))
    raise UsageError(f"{type(thing).__name__} has no expression in Python")


def _array(values: np.ndarray) -> str:
    """A call of NumPy that makes an array of one dimension: even, repeated, or number by number."""
    count = len(values)
    even = np.linspace(values[0], values[-1], count)
    if count > 2 and values[0] != values[-1] and np.allclose(even, values, rtol=0, atol=1e-9):
        return f"np.linspace({float(values[0])!r}, {float(values[-1])!r}, {count})"
    run = int(np.argmax(values != values[0])) or count  # of the first number
    if run > 1 and count % run == 0 and np.array_equal(values, np.repeat(values[::run], run)):
        return f"np.repeat({values[::run].tolist()!r}, {run})"
    period = 1 + int(np.argmax(np.append(values[1:], values[0]) == values[0]))
    tiled = 1 < period < count and count % period == 0
    if tiled and np.array_equal(values, np.resize(values[:period], count)):
        return f"np.tile({_array(values[:period])}, {count // period})"
    return f"np.array({values.tolist()!r})"


def _medium(medium: Material | Constant) -> str:
    """The catalogue name or the path of a file, or a number, which a layer takes for a medium."""
    if isinstance(medium, Material):
        try:
            known: Any = find(medium.name)
        except UnknownMaterial:
            return repr(medium.page)
        return repr(medium.name if known.page == medium.page else medium.page)
    if isinstance(medium.n, Free) or isinstance(medium.k, Free):
        both = [medium.n] if medium.k is None else [medium.n, medium.k]
        return _call("pl.dispersion.Constant", both, {})
    n, k = float(medium.n), 0.0 if medium.k is None else float(medium.k)
    return repr(complex(n, k)).strip("()") if k else repr(n)


def _module(module: Any) -> str:
    kind = type(module)
    first = _POSITIONAL.get(kind, ())
    given, named = [], {}
    whole = isinstance(module, AbstractDispersion) and not isinstance(module, Graded)
    for field in fields(module):
        value = getattr(module, field.name)
        if field.name in first:
            given.append(_shortened(module, field.name, value))
        elif whole and isinstance(value, Material | Constant):
            named[field.name] = _Text(f"pl.medium({_medium(value)})")  # a model takes no names and numbers
        elif field.name == "wavelength" or _is_default(module, field, value):
            continue
        else:
            named[field.name] = _shortened(module, field.name, value)
    public = kind in _POSITIONAL or isinstance(module, Light | Instrument | StandardUncertainties)
    place = "" if public else f"{_PLACES.get(kind.__module__, 'dispersion')}."
    return _call(f"pl.{place}{kind.__name__}", given, named)


def _shortened(module: Any, name: str, value: Any) -> Any:
    """The value of a field as its converter takes it: one layer, and a plain substrate by its material."""
    if isinstance(module, Scene | Reference) and name == "layers":
        return value[0] if len(value) == 1 else unlisted(value)
    if isinstance(module, Group):
        return list(value) if name == "layers" else _Text(value)
    if isinstance(module, Scene | Reference) and name == "substrate" and value == Substrate(value.material):
        return value.material
    return dict(value) if isinstance(module, Surface) and name == "numbers" else value


def _is_default(module: Any, field: Any, value: Any) -> bool:
    default = field.default if field.default is not MISSING else None
    if isinstance(module, Scene) and field.name == "ambient":
        return isinstance(value, Constant) and value == Constant(1.0)
    if isinstance(value, Light):
        return bool(replace(value, wavelength=None) == Light())
    if isinstance(value, Instrument | StandardUncertainties) or isinstance(module, Scene):
        return bool(value == default)
    if isinstance(module, Reference) and field.name == "layers":
        return value == ()
    return value is default or (isinstance(value, str | int | float) and value == default)


def _call(name: str, given: list[Any], named: dict[str, Any]) -> str:
    arguments = [*map(python_text, given), *(f"{key}={python_text(x)}" for key, x in named.items())]
    return f"{name}({', '.join(arguments)})"
