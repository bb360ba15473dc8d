"""A film in the explorer: controls, the structure that their values need, and programs."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import numpy as np
from jax.tree_util import GetAttrKey

from pellicle.data.spectrum import Spectrum
from pellicle.effects.film_plan import exact
from pellicle.errors import DataError, UsageError
from pellicle.explorer.answers import ball_rendering
from pellicle.explorer.controls import (
    CONES,
    Structure,
    bucket,
    film_controls,
    key_of,
    oblique_cone,
    scene_with,
    template,
    with_value,
)
from pellicle.explorer.programs import (
    ANGLE,
    abscissa,
    angle_program,
    colour_program,
    light_angles,
    measured_angles,
    named,
    spectrum_program,
    thinned,
)
from pellicle.forward_model.plan import Plan
from pellicle.scene.film import Light, Scene, with_wavelength
from pellicle.scene.free import Free, insert
from pellicle.signals.registry import KINDS
from pellicle.simulation.spectra import VISIBLE, default_wavelengths

_FEWEST, _MOST, _POINTS = 100, 1500, 401
"""Numbers of wavelengths of data at which the curve is computed too, and that of its own otherwise."""
_MANY, _FEW_POINTS = 4, 201
"""Number of angles above which each curve has fewer points, and how many."""


class FilmView:
    """Controls and programs of a film, whose spectra are computed at `wavelength` in nm.

    A light with an array of angles has a curve for each, and `angles` has them in degrees. Signals at one
    wavelength are drawn against the angle, as `against_angle` says. `angles` is empty where the angle has a
    slider. With `folded` Δ is drawn in 0 to 180 degrees, as it was measured.
    """

    kind, parts = "spectrum", ("curves", "colour", "sphere", "plan")

    def __init__(self, scene: Scene, wavelength: Any = None, folded: bool = False) -> None:
        if not (kind := scene.light.kind).explored:
            others = [
                f'"{word}"' for word, x in KINDS.items() if x.explored and x.simulated == kind.simulated
            ]
            raise UsageError(
                f"the explorer does not draw {kind.noun}: give the scene another signal, such as"
                f" {' or '.join(others)}"
            )
        if np.ndim(scene.light.azimuth):
            raise UsageError("the explorer draws one azimuth of the sample: give the scene one")
        if wavelength is None:
            wavelength = scene.light.wavelength
        visible = _visible(scene) if wavelength is None else np.unique(np.asarray(wavelength, float))
        self.wavelength, self.folded = visible, folded
        self.angles = light_angles(scene.light, len(self.wavelength))
        self.against_angle = len(self.wavelength) == 1
        if len(self.angles) == 1 and not self.against_angle:
            scene, self.angles = with_value(scene, ANGLE, float(self.angles[0])), np.zeros(0)
        if self.against_angle and not self.angles.size:
            if isinstance(scene.light.angle, Free):
                raise UsageError(
                    "the explorer draws one wavelength against the angle of incidence, which is free: give"
                    " the scene a fixed angle"
                )
            self.angles = np.array([float(scene.light.angle)])
        scene = with_value(scene, (*ANGLE[:1], GetAttrKey("wavelength")), None)
        self.scene = with_value(scene, ANGLE, self.angles) if self.angles.size else scene
        self.controls = film_controls(self.scene)
        self.by_name = {control.name: control for control in self.controls}
        self._programs: Any = self

    def at(self, angles: np.ndarray) -> FilmView:
        """Return the view with these angles of incidence in degrees: a curve for each, or a slider for one.

        Programs are shared. Raises UsageError where the abscissa is the angle.
        """
        if self.against_angle:
            raise UsageError("at one wavelength the abscissa is the angle of incidence: leave the angles out")
        angle = angles if len(angles) > 1 else float(angles[0])
        view = FilmView(with_value(self.scene, ANGLE, angle), self.wavelength, self.folded)
        view._programs = self._programs
        return view

    def key(self, kind: str) -> Hashable:
        """Key of the programs `kind`: programs are the same for other angles, if they are as many."""
        return self._programs, kind, self.seen_at(kind).size

    def seen_at(self, kind: str) -> np.ndarray:
        """Angles of incidence in degrees that a program `kind` takes beside the values; none of a sphere."""
        if kind == "sphere":
            return np.zeros(0)
        return abscissa(self.angles) if kind == "curves" and self.against_angle else thinned(self.angles)

    def defaults(self) -> dict[str, float]:
        """Return the scene's own value of each control."""
        return {control.name: control.value for control in self.controls}

    def describe(self) -> dict[str, Any]:
        """Return controls and axes for a page, the thickness of each layer first."""
        groups = list(dict.fromkeys(control.group for control in self.controls))
        order = sorted(
            self.controls, key=lambda c: (groups.index(c.group), c.optional, c.label != "thickness")
        )
        kind = self.scene.light.kind
        across = "angle of incidence (°)" if self.against_angle else "wavelength (nm)"
        return {
            "controls": [control.to_json() for control in order],
            "signals": [kind.word] if kind.parts else [q.symbol for q in kind.quantities],
            "axis": {"label": across, "value": kind.ordinate},
            "angles": self.angles.tolist() if len(self.angles) > 1 and not self.against_angle else [],
            "at_one_wavelength": float(self.wavelength[0]) if self.against_angle else None,
        }

    @property
    def light_in_words(self) -> str:
        """The light whose colour is shown, in words."""
        return "transmitted light" if self.scene.light.kind.transmitted else "reflected light"

    def structure(self, values: Mapping[str, float]) -> Structure:
        """Return the effects that values other than 0 need. Raises UsageError for an impossible cone."""
        bounds = {
            c.name: bucket(c, values[c.name]) for c in self.controls if c.optional and values[c.name] > 0
        }
        cone = next((name for name in bounds if key_of(name) in CONES), None)
        if cone is not None and (self.angles.size or "angle" in bounds):
            steepest = float(self.seen_at("curves").max()) if self.angles.size else values["angle"]
            bounds["angle"], bounds[cone] = oblique_cone(cone, steepest, values[cone], bounds[cone])
        return Structure(tuple(bounds.items()))

    def neighbours(self, structure: Structure) -> list[Structure]:
        """Return the structures with one effect more, where its size is least."""
        there = dict(structure.active)
        more = [c for c in self.controls if c.optional and c.name not in there]
        if there or self.angles.size:
            return []
        return [Structure((*structure.active, (c.name, bucket(c, 0.0)))) for c in more]

    def compile(self, kind: str, structure: Structure) -> Callable[[Mapping[str, float], np.ndarray], Any]:
        """Compile the program `kind`, "curves", "colour" or "sphere", of values and of the angles `seen_at`.

        Raises ValueError as programs do.
        """
        bounds, active = dict(structure.active), structure.names
        controls = tuple(  # with the upper bounds of the structure
            replace(c, upper=bounds[c.name], value=min(c.value, bounds[c.name])) if c.name in bounds else c
            for c in self.controls
        )
        if kind == "sphere":
            return angle_program(self.scene, controls, active)
        scene, count = template(self.scene, controls, active), self.seen_at(kind).size
        if count:
            scene = with_value(scene, ANGLE, Free(0.0, bounds.get("angle", 90.0)))
        names = [c.name for c in controls if not c.optional or c.name in active]
        if kind == "colour":
            return colour_program(scene, names, count)
        return spectrum_program(scene, names, self.wavelength, count, self.folded)

    def measured(self, spectra: Sequence[Spectrum]) -> FilmView | None:
        """Return the view with the light, the angles and the range of the first spectrum and of those like
        it; None where it has them."""
        data, stated = spectra[0], self.scene.light
        alike = [x for x in spectra if (x.signal, x.polarisation) == (data.signal, data.polarisation)]
        polarised = data.polarisation if data.polarisation != "unpolarised" else stated.polarisation
        nm = np.unique(np.concatenate([spectrum.wavelength for spectrum in alike]))
        angles = measured_angles(alike)
        angle = self._measured_angle(data.path, thinned(angles) if len(nm) > 1 else angles)
        curves = max(np.size(angle), 1)
        if len(nm) > 1 and not _FEWEST <= len(nm) <= _MOST / curves:
            nm = np.linspace(nm[0], nm[-1], _POINTS if curves <= _MANY else _FEW_POINTS)
        if data.azimuth is not None and np.ptp(data.azimuth) > 0:
            raise UsageError(f"{data.path}: has several azimuths of the sample, and the explorer draws one")
        azimuth = stated.azimuth if data.azimuth is None else float(data.azimuth[0]) or None
        light = Light(None, angle, data.signal, polarised, azimuth, data.transmission)
        view = FilmView(with_value(self.scene, (GetAttrKey("light"),), light), nm, data.kind.folded)
        same = data.kind.folded == self.folded and np.array_equal(nm, self.wavelength)
        same = same and eqx.tree_equal(view.scene.light, stated) is True
        return None if same else view

    def _measured_angle(self, path: str, angles: np.ndarray) -> Any:
        """The angle of a light as data state it, or the scene's own where they state none or that."""
        stated = self.scene.light.angle
        if not angles.size and len(self.angles) > 1:
            several = ", ".join(map(named, self.angles))
            raise UsageError(
                f"{path}: states no angle of incidence, and the scene has {several}: leave one of them,"
                " or add a column angle_deg"
            )
        if len(angles) > 1 and isinstance(stated, Free):
            raise UsageError(
                f"{path}: has several angles of incidence, and one free angle cannot stand for them: fix"
                " it, and free angle_shift of the instrument for an error of all angles"
            )
        if len(angles) > 1:
            return angles
        one = angles if angles.size else self.angles
        same = not self.angles.size and (not angles.size or getattr(stated, "start", stated) == angles[0])
        return stated if same else float(one[0])

    def rendering(self, colours: np.ndarray, size: int) -> bytes:
        """Draw a ball with the `colours` that the program "sphere" computed, as a PNG."""
        return ball_rendering(colours, size)

    def stated(self, values: Mapping[str, float], fitted: Sequence[str] | None = None) -> Scene:
        """Return the scene with these values, at which its free numbers start, its own or those that are
        fitted; at no wavelengths."""
        own = [control.name for control in self.controls if control.free is not None]
        free = own if fitted is None else fitted
        one = len(self.angles) == 1
        scene = with_value(self.scene, ANGLE, float(self.angles[0])) if one else self.scene
        return scene_with(scene, self.controls, values, free)

    def sampled(self, scene: Scene) -> Scene:
        """Return a scene of this view at each of its wavelengths and angles, one angle after the other."""
        angles = self.angles
        if len(angles) < 2:
            return with_wavelength(scene, self.wavelength)
        nm = np.tile(self.wavelength, len(angles))
        return with_wavelength(scene, nm, np.repeat(angles, len(self.wavelength)))

    def plan(self, values: Mapping[str, float]) -> Plan:
        """Return the exact plan of the scene with these values."""
        active = self.structure(values).names
        numbers = [values[c.name] for c in self.controls if not c.optional or c.name in active]
        return exact(self.sampled(insert(template(self.scene, self.controls, active), numbers)))


def _visible(scene: Scene) -> np.ndarray:
    """Visible wavelengths of the materials of a scene. Raises DataError where there are none."""
    nm = default_wavelengths(scene)
    if len(nm) < 2:
        raise DataError(
            f"the materials share no wavelengths in {VISIBLE[0]:g} to {VISIBLE[1]:g} nm:"
            " give [data] wavelengths = { start, stop, step }"
        )
    return np.arange(nm[0], nm[-1] + 0.5)
