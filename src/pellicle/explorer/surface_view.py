"""A surface in the explorer: sliders of the numbers of its BRDF, its lobes and a sphere."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NoReturn

import jax
import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.effects.surface_plan import plan
from pellicle.errors import UsageError
from pellicle.explorer.answers import png
from pellicle.explorer.controls import Control, Structure
from pellicle.explorer.programs import Curve
from pellicle.forward_model.plan import Plan
from pellicle.reporting.renderings import display
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface, surface_view
from pellicle.simulation.brdf import default_directions
from pellicle.simulation.surface_sphere import in_plane, render

INCIDENCE = Control("incidence", "angle of incidence of the lobes", "°", 0.0, 85.0, 45.0, "light", ())
LEAVING = np.linspace(-88.0, 88.0, 353)
"""Angles of the lobes in degrees; positive ones are on the side of the mirror direction."""
LARGEST_SPHERE, DIRECTIONS = 96, 96
"""Pixels across a sphere, and directions of its light at each: 0.5 s on two cores."""


class SurfaceExplorerView:
    """Sliders and renderings of a surface; the counterpart of `FilmView`."""

    kind, parts, light_in_words = "surface", ("curves", "sphere", "plan"), ""

    def __init__(self, surface: Surface) -> None:
        self.scene = surface
        self.controls = (*surface_controls(surface), INCIDENCE)
        self.by_name = {control.name: control for control in self.controls}

    def defaults(self) -> dict[str, float]:
        """Return the surface's own value of each control."""
        return {control.name: control.value for control in self.controls}

    def describe(self) -> dict[str, Any]:
        """Return controls and axes for a page."""
        return {
            "controls": [control.to_json() for control in self.controls],
            "signals": self._channels(),
            "axis": {"label": "angle of view (°)", "value": "BRDF (1/sr)"},
            "angles": None,
            "at_one_wavelength": None,
        }

    def structure(self, values: Mapping[str, float]) -> Structure:
        """Return the one structure, whose programs serve all values."""
        return Structure(())

    def neighbours(self, structure: Structure) -> list[Structure]:
        """Return no other structures."""
        return []

    def at(self, angles: np.ndarray) -> NoReturn:
        """Raise UsageError: the angle of incidence has a slider."""
        raise UsageError("a surface has one angle of incidence, a slider: leave the angles out")

    def key(self, kind: str) -> Hashable:
        """Key of the programs `kind`."""
        return self, kind

    def seen_at(self, kind: str) -> np.ndarray:
        """Return no angles: programs take that of the slider."""
        return np.zeros(0)

    def compile(self, kind: str, structure: Structure) -> Callable[[Mapping[str, float], np.ndarray], Any]:
        """Compile the lobes ("curves") or the sphere by computing them once."""
        if kind == "curves":
            self._curves(self.defaults())
            return lambda values, _: self._curves(values)
        self._sphere(self.defaults(), 32)
        return lambda values, _: values

    def rendering(self, numbers: Mapping[str, float], size: int) -> bytes:
        """Draw the sphere with these values as a PNG."""
        return self._sphere(numbers, size)

    def plan(self, values: Mapping[str, float]) -> Plan:
        """Return the exact plan of the surface with these values."""
        with jax.enable_x64(True):
            return plan(surface_view(self.scene_at(values), default_directions()))

    def scene_at(self, values: Mapping[str, float]) -> Surface:
        """Return the surface with these values, fixed."""
        return replace(self.scene, numbers=self._numbers(values))

    def stated(self, values: Mapping[str, float]) -> Surface:
        """Return the surface with these values, at which its own free numbers start."""
        numbers = self._numbers(values)
        for key, free in self.scene.numbers.items():
            if isinstance(free, Free):
                numbers[key] = Free(free.lower, free.upper, start=numbers[key], prior=free.prior)
        return replace(self.scene, numbers=numbers)

    def measured(self, spectra: Sequence[Spectrum]) -> NoReturn:
        """Raise UsageError: BRDF samples are not drawn."""
        raise UsageError("the explorer draws no data of a surface: pellicle fit fits BRDF samples")

    def _numbers(self, values: Mapping[str, float]) -> dict[str, Any]:
        """Numbers that the surface states, and those that a slider has changed."""
        numbers: dict[str, Any] = dict(self.scene.numbers)
        for control in self.controls[:-1]:
            value = values[control.name]
            if control.name in numbers or value != control.value:
                numbers[control.name] = value
        return numbers

    def _channels(self) -> list[str]:
        if self.scene.sensor is not None:
            return [f"channel {i + 1}" for i in range(self.scene.channels)]
        return [f"{nm:g} nm" for nm in self.scene.channel_wavelengths]

    def _curves(self, values: Mapping[str, float]) -> list[Curve]:
        with jax.enable_x64(True):
            lobes = in_plane(self.scene_at(values), values["incidence"], LEAVING)
        return [Curve(name, LEAVING, y) for name, y in zip(self._channels(), lobes.T, strict=True)]

    def _sphere(self, values: Mapping[str, float], size: int) -> bytes:
        surface = self.scene_at(values)
        return png(display(render(surface, size=min(size, LARGEST_SPHERE), count=DIRECTIONS)))


def surface_controls(surface: Surface) -> tuple[Control, ...]:
    """Return a control for each number of the model, but those that differ between channels or are media."""
    controls = []
    for parameter in surface.brdf.parameters:
        key = parameter.key
        value: Any = surface.numbers.get(key, parameter.value)
        if key in surface.media or (np.ndim(value) and key in surface.numbers):
            continue
        free = value if isinstance(value, Free) else None
        start = value.start if isinstance(value, Free) else float(np.ravel(value)[0])
        lower, upper = (free.lower, free.upper) if free else (parameter.lower, parameter.upper)
        bounds = min(lower, start), max(upper, start)
        label, unit = key.replace("_", " "), parameter.unit.replace("degree", "°")
        controls.append(Control(key, label, unit, *bounds, start, "surface", (), free=free))
    return tuple(controls)
