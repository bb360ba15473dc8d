"""A film in the explorer: its controls, the structure that their values need, and its programs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from jax.tree_util import GetAttrKey

from pellicle.data import generalised
from pellicle.data.spectrum import Spectrum
from pellicle.effects.film import exact
from pellicle.effects.plan import Plan
from pellicle.errors import DataError, UsageError
from pellicle.explorer.controls import Control, film_controls, scene_with, template, with_value
from pellicle.explorer.programs import angle_program, colour_program, spectrum_program
from pellicle.explorer.sphere import ball_picture
from pellicle.scene.film import Light, Scene, with_wavelength
from pellicle.scene.free import Free, insert
from pellicle.synthetic.spectra import VISIBLE, default_wavelengths

_AVERAGED = ("thickness_spread", "bandwidth", "numerical_aperture", "angle_spread")
_CONES = ("numerical_aperture", "angle_spread")
_SHARES = (0.125, 0.25, 0.5, 1.0)
"""Shares of the range of an average for which programs are compiled: a small spread needs few nodes."""

_FEWEST, _MOST, _POINTS = 100, 1500, 401
"""Numbers of wavelengths of data at which the curve is computed too, and that of its own otherwise."""
_ANGLES, _GRAZING = 5.0, 89.0
"""Step of the largest angle of incidence of programs with a cone of light, and the steepest ray (degrees)."""


class Structure(NamedTuple):
    """Optional effects that a program is compiled for, with upper bounds of their sizes."""

    active: tuple[tuple[str, float], ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the controls of the effects that are there."""
        return tuple(name for name, _ in self.active)


class FilmView:
    """Controls and programs of a film, whose spectra are computed at `wavelength` in nm."""

    kind, parts = "spectrum", ("curves", "colour", "sphere", "plan")

    def __init__(self, scene: Scene, wavelength: Any = None) -> None:
        if scene.light.signal == generalised.SIGNAL:
            raise UsageError(
                "the explorer does not draw generalised psi and delta: give the scene another signal, such as"
                ' "psi-delta" or "mueller"'
            )
        if np.ndim(scene.light.azimuth):
            raise UsageError("the explorer draws one azimuth of the sample: give the scene one")
        self.scene = scene
        self.controls = film_controls(scene)
        self.by_name = {control.name: control for control in self.controls}
        if wavelength is None:
            wavelength = scene.light.wavelength
        if wavelength is not None and np.size(wavelength) < 2:
            raise UsageError(
                "the explorer draws signals against the wavelength: give two or more wavelengths"
            )
        if wavelength is None:
            wavelength = default_wavelengths(scene)
            if len(wavelength) > 1:
                wavelength = np.arange(wavelength[0], wavelength[-1] + 0.5)
        self.wavelength = np.asarray(wavelength, float)
        if len(self.wavelength) < 2:
            raise DataError(
                f"the materials share no wavelengths in {VISIBLE[0]:g} to {VISIBLE[1]:g} nm:"
                " give [data] wavelengths = { start, stop, step }"
            )

    def defaults(self) -> dict[str, float]:
        """Return the scene's own value of each control."""
        return {control.name: control.value for control in self.controls}

    def describe(self) -> dict[str, Any]:
        """Return controls and axes for a page, the thickness of each layer first."""
        groups = list(dict.fromkeys(control.group for control in self.controls))
        order = sorted(
            self.controls, key=lambda c: (groups.index(c.group), c.optional, c.label != "thickness")
        )
        signal = self.scene.light.signal
        units = {"psi-delta": "Ψ, Δ (°)", "mueller": "normalised Mueller element"}
        return {
            "controls": [control.to_json() for control in order],
            "signals": {"psi-delta": ["Ψ", "Δ"]}.get(signal, [signal]),
            "axis": {"label": "wavelength (nm)", "value": units.get(signal, f"{signal} (fraction)")},
        }

    @property
    def light_in_words(self) -> str:
        """The light whose colour is shown, in words."""
        return "transmitted light" if self.scene.light.signal == "T" else "reflected light"

    def structure(self, values: Mapping[str, float]) -> Structure:
        """Return the effects that values other than 0 need. Raises UsageError for an impossible cone."""
        bounds = {
            c.name: _bucket(c, values[c.name]) for c in self.controls if c.optional and values[c.name] > 0
        }
        cone = next((name for name in bounds if _key(name) in _CONES), None)
        if cone is not None and "angle" in bounds:
            bounds["angle"], bounds[cone] = _oblique_cone(cone, values["angle"], values[cone], bounds[cone])
        return Structure(tuple(bounds.items()))

    def neighbours(self, structure: Structure) -> list[Structure]:
        """Return the structures with one effect more, where its size is least."""
        there = dict(structure.active)
        more = [c for c in self.controls if c.optional and c.name not in there]
        return [Structure((*structure.active, (c.name, _bucket(c, 0.0)))) for c in more] if not there else []

    def compile(self, kind: str, structure: Structure) -> Callable[[Mapping[str, float]], Any]:
        """Compile the program `kind`, "curves", "colour" or "sphere". Raises ValueError as programs do."""
        controls, active = self._bounded(structure), structure.names
        if kind == "sphere":
            return angle_program(self.scene, controls, active)
        scene = template(self.scene, controls, active)
        names = [c.name for c in controls if not c.optional or c.name in active]
        if kind == "colour":
            return colour_program(scene, names)
        return spectrum_program(scene, names, self.wavelength)

    def measured(self, spectra: Sequence[Spectrum]) -> FilmView | None:
        """Return the view with the light and the range of the first spectrum; None where it has them."""
        data, own = spectra[0], self.scene.light
        angles = [] if data.angle is None else np.unique(data.angle).tolist()
        start = own.angle.start if isinstance(own.angle, Free) else float(own.angle)
        angle = own.angle if not angles or start in angles else angles[0]
        polarised = data.polarisation if data.polarisation != "unpolarised" else own.polarisation
        nm = np.unique(data.wavelength)
        if len(nm) < 2:
            raise UsageError(
                f"{data.path}: the explorer draws signals against the wavelength, and here it is one"
            )
        if not _FEWEST <= len(nm) <= _MOST:
            nm = np.linspace(nm[0], nm[-1], _POINTS)
        if data.azimuth is not None and np.ptp(data.azimuth) > 0:
            raise UsageError(f"{data.path}: has several azimuths of the sample, and the explorer draws one")
        azimuth = own.azimuth if data.azimuth is None else float(data.azimuth[0]) or None
        light = Light(own.wavelength, angle, data.signal, polarised, azimuth)
        if light == own and np.array_equal(nm, self.wavelength):
            return None
        scene = with_value(self.scene, (GetAttrKey("light"),), light)
        return FilmView(scene, nm)

    def picture(self, found: np.ndarray, size: int) -> bytes:
        """Draw a ball with the colours `found` by the program "sphere", as a PNG."""
        return ball_picture(found, size)

    def stated(self, values: Mapping[str, float]) -> Scene:
        """Return the scene with these values, at which its own free numbers start."""
        free = [control.name for control in self.controls if control.free is not None]
        return scene_with(self.scene, self.controls, values, free)

    def plan(self, values: Mapping[str, float]) -> Plan:
        """Return the exact plan of the scene with these values."""
        return exact(self.scene_at(values))

    def scene_at(self, values: Mapping[str, float]) -> Scene:
        """Return the scene with these values, at the wavelengths of the plot."""
        active = self.structure(values).names
        numbers = [values[c.name] for c in self.controls if not c.optional or c.name in active]
        scene = insert(template(self.scene, self.controls, active), numbers)
        return with_wavelength(scene, self.wavelength)

    def _bounded(self, structure: Structure) -> tuple[Control, ...]:
        """The controls with the upper bounds of a structure."""
        bounds = dict(structure.active)
        return tuple(
            replace(c, upper=bounds[c.name], value=min(c.value, bounds[c.name])) if c.name in bounds else c
            for c in self.controls
        )


def _bucket(control: Control, value: float) -> float:
    """Upper bound of the program for a value: a share of the range of an average, else the whole range."""
    if _key(control.name) not in _AVERAGED:
        return control.upper
    return next(share * control.upper for share in _SHARES if value <= share * control.upper * (1 + 1e-12))


def _oblique_cone(name: str, angle: float, size: float, bound: float) -> tuple[float, float]:
    """Upper bounds of the angle of incidence, in steps of `_ANGLES`, and of the size of a cone at it.

    Raises UsageError where the cone reaches beyond `_GRAZING`.
    """
    aperture = _key(name) == "numerical_aperture"
    half = math.degrees(math.asin(min(size, 1.0))) if aperture else size
    if angle + half > _GRAZING:
        raise UsageError(
            f"the cone of light reaches beyond {_GRAZING:g} degrees: the angle of incidence is {angle:g}, and"
            f" the half angle of the cone {half:.3g}"
        )
    highest = min(math.ceil(angle / _ANGLES) * _ANGLES, _GRAZING - half)
    room = _GRAZING - highest
    return highest, min(bound, math.sin(math.radians(room)) if aperture else room)


def _key(name: str) -> str:
    """The last part of a control's name."""
    return name.rpartition(".")[2]
