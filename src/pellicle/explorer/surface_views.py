"""A surface in the explorer: controls, the lobes or samples of its BRDF, and a sphere."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NoReturn

import jax
import numpy as np

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.effects.surface_plan import plan
from pellicle.errors import UsageError
from pellicle.explorer.controls import Control, Structure
from pellicle.explorer.programs import Curve
from pellicle.fitting.brdf.fit import check_channels
from pellicle.forward_model.plan import Plan
from pellicle.reporting.quantities import half_angle
from pellicle.reporting.renderings import LEAVING, display, png
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface, surface_view
from pellicle.simulation.brdf import default_directions
from pellicle.simulation.surface_sphere import along, in_plane, render

INCIDENCE = Control("incidence", "angle of incidence of the lobes", "°", 0.0, 85.0, 45.0, "light", ())
LARGEST_SPHERE, DIRECTIONS = 96, 96
"""Pixels across a sphere, and directions of its light at each: 0.5 s on two cores."""
DRAWN = 400
"""Most samples of a file that are drawn; a fit uses all of them."""
POSITIVE = 0.9
"""Share of values above zero from which the ordinate is logarithmic."""


class SurfaceExplorerView:
    """Sliders and renderings of a surface; the counterpart of `FilmView`.

    Without `samples` the lobes in the plane of incidence are drawn. Samples lie in no plane: they, and the
    model at their directions, are drawn against the half angle, as in reports.
    """

    kind, parts, light_in_words = "surface", ("curves", "sphere", "plan"), ""

    def __init__(self, surface: Surface, samples: BrdfSamples | None = None) -> None:
        self.scene, self.samples = surface, None
        self.controls = surface_controls(surface)
        if samples is None:
            self.controls = (*self.controls, INCIDENCE)
        else:
            check_channels(samples, surface)
            kept = samples.thinned(DRAWN)
            self.samples = kept.at(np.argsort(half_angle(kept), kind="stable"))
        self.by_name = {control.name: control for control in self.controls}

    def defaults(self) -> dict[str, float]:
        """Return the surface's own value of each control."""
        return {control.name: control.value for control in self.controls}

    def describe(self) -> dict[str, Any]:
        """Return controls and axes for a page."""
        axis: dict[str, Any] = {"label": "angle of view (°)", "value": "BRDF (1/sr)"}
        if self.samples is not None:
            # a lobe spans decades; noise makes a few of its values zero
            logarithmic = bool(np.mean(self.samples.values > 0) >= POSITIVE)
            axis |= {"label": "half angle (°)", "log": logarithmic, "points": True}
        return {
            "controls": [control.to_json() for control in self.controls],
            "signals": self._channels(),
            "axis": axis,
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
        seen = default_directions() if self.samples is None else self.samples
        with jax.enable_x64(True):
            return plan(surface_view(self.scene_at(values), seen))

    def scene_at(self, values: Mapping[str, float]) -> Surface:
        """Return the surface with these values, fixed."""
        return replace(self.scene, numbers=self._numbers(values))

    def stated(self, values: Mapping[str, float], fitted: Sequence[str] | None = None) -> Surface:
        """Return the surface with these values, at which its free numbers start, its own or those that are
        fitted. Raises UsageError for a number of all channels that would be one for each."""
        numbers = self._numbers(values)
        free = [c for c in self.controls if (c.free is not None if fitted is None else c.name in fitted)]
        for control in (control for control in free if control.path):
            key, prior = control.path[0], None if control.free is None else control.free.prior
            if not isinstance(numbers.get(key), Free):  # the first channel
                start = values[control.name]
                numbers[key] = Free(control.lower, control.upper, start=start, prior=prior)
        surface = replace(self.scene, numbers=numbers)
        each = {number.key for number in surface.free_numbers() if number.channel is not None}
        for control in free:
            if control.path[1:] == (None,) and control.name in each:
                raise UsageError(
                    f"a free {control.name} has a number for each channel: free it in the recipe, as in"
                    f" {control.name} = {{ lower = {control.lower:g}, upper = {control.upper:g} }}"
                )
        return surface

    def measured(self, samples: Sequence[BrdfSamples]) -> SurfaceExplorerView:
        """Return the view with samples. Raises UsageError where the surface has other channels."""
        return SurfaceExplorerView(self.scene, samples[0])

    def data_curves(self) -> list[Curve]:
        """Samples against the half angle, those that are drawn."""
        if self.samples is None:
            return []
        x = half_angle(self.samples)
        return [Curve(name, x, y) for name, y in zip(self._channels(), self.samples.values.T, strict=True)]

    def _numbers(self, values: Mapping[str, float]) -> dict[str, Any]:
        """Numbers that the surface states, and those that a slider has changed."""
        numbers: dict[str, Any] = dict(self.scene.numbers)
        own: dict[str, list[float]] = {}
        for control in self.controls:
            value = values[control.name]
            if control.path and (control.path[0] in numbers or value != control.value):
                own.setdefault(control.path[0], []).append(value)
        return numbers | {key: x[0] if len(x) == 1 else x for key, x in own.items()}

    def _channels(self) -> list[str]:
        if self.scene.sensor is not None:
            return [f"channel {i + 1}" for i in range(self.scene.channels)]
        return [f"{nm:g} nm" for nm in self.scene.channel_wavelengths]

    def _curves(self, values: Mapping[str, float]) -> list[Curve]:
        surface, samples = self.scene_at(values), self.samples
        with jax.enable_x64(True):
            if samples is None:
                x, brdf = LEAVING, in_plane(surface, values["incidence"], LEAVING)
            else:
                x, brdf = half_angle(samples), along(surface, samples)
        return [Curve(name, x, y) for name, y in zip(self._channels(), brdf.T, strict=True)]

    def _sphere(self, values: Mapping[str, float], size: int) -> bytes:
        surface = self.scene_at(values)
        return png(display(render(surface, size=min(size, LARGEST_SPHERE), count=DIRECTIONS)))


def surface_controls(surface: Surface) -> tuple[Control, ...]:
    """Return a control for each number of the model, but those that differ between channels or are media.

    A free number that differs between channels has one for each. The path is the key and the channel.
    """
    controls, free_numbers = [], surface.free_numbers()
    for parameter in surface.brdf.parameters:
        key = parameter.key
        value: Any = surface.numbers.get(key, parameter.value)
        if key in surface.media or (np.ndim(value) and key in surface.numbers):
            continue
        free = value if isinstance(value, Free) else None
        start = value.start if isinstance(value, Free) else float(np.ravel(value)[0])
        lower, upper = (free.lower, free.upper) if free else (parameter.lower, parameter.upper)
        bounds, unit = (min(lower, start), max(upper, start)), parameter.unit.replace("degree", "°")
        own = [(x.name, x.channel) for x in free_numbers if x.key == key] or [(key, None)]
        controls += [
            Control(name, name.replace("_", " "), unit, *bounds, start, "surface", (key, channel), free=free)
            for name, channel in own
        ]
    return tuple(controls)
