"""Film and data that a page shows, and the requests that change them."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.errors import UsageError
from pellicle.explorer import reading_fields
from pellicle.explorer.answers import curve_to_json, cut_ranges, data_curves, data_text
from pellicle.explorer.controls import scene_with, with_value
from pellicle.explorer.dropped_files import MaterialFiles, measured_spectra
from pellicle.explorer.film_texts import rebuilt
from pellicle.explorer.programs import LIGHT, asked_angles, measured_angles
from pellicle.explorer.views import FilmView, SurfaceExplorerView, same_view
from pellicle.scene.common_range import common_range, covered
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface

_VIEWS = 16
"""Sets of angles of incidence that are remembered."""
View: TypeAlias = FilmView | SurfaceExplorerView


class RecipeFile(NamedTuple):
    """One of several files of a recipe: its scene, and the options and the function that read it."""

    path: str
    scene: Callable[[], Scene]
    reading: Mapping[str, Any]
    read: Callable[[], Sequence[Spectrum]]


class Shown:
    """Film or surface and data that a page shows; the arguments are those of a `Session`.

    `changed` is called with True where the view is another one, with False where the data are.
    """

    def __init__(
        self,
        scene: Scene | Surface,
        folder: Path | None,
        wavelength: Any,
        spectra: Sequence[Spectrum],
        reading: Mapping[str, Any],
        files: Sequence[RecipeFile],
        changed: Callable[[bool], None],
    ) -> None:
        self.folder, self.files, self._changed = folder, files, changed
        self._nm = wavelength  # of the scene without data
        if wavelength is None and spectra:
            wavelength = np.unique(spectra[0].wavelength)
        view = SurfaceExplorerView(scene) if isinstance(scene, Surface) else FilmView(scene, wavelength)
        self.view: View = (view.measured(spectra) if spectra else None) or view
        self.spectra, self.reading = self._located(spectra), reading
        self.number = 0 if spectra else None  # of the file that is shown
        self._source: Mapping[str, Any] | Path | None = Path(spectra[0].path).resolve() if spectra else None
        self._light: Any = getattr(scene, "light", None)  # of the scene without data
        self._first = self.view, self.spectra, reading, self._nm, self._light
        self.edited = False
        self.materials = MaterialFiles(folder)
        self._views: dict[tuple[Any, tuple[float, ...]], FilmView] = {}  # at other angles of incidence

    def _located(self, spectra: Sequence[Spectrum]) -> list[Spectrum]:
        """Spectra with paths from the folder."""
        here = self.folder or Path.cwd()
        return [replace(each, path=os.path.relpath(each.path, here)) for each in spectra]

    def tab(self, body: Mapping[str, Any]) -> dict[str, Any]:
        """Show another file of the recipe, by its `number`, with the scene that the recipe has for it; layers
        that were changed stay."""
        number = body.get("number")
        if type(number) is not int or number not in range(len(self.files)):
            raise UsageError(f"no file {number!r}: the recipe has {len(self.files)}")
        own = self.files[number]
        scene, spectra = own.scene(), self._located(own.read())
        light = scene.light
        if self.edited:
            scene = with_value(self.film().scene, LIGHT, light)
        view = FilmView(scene, np.unique(spectra[0].wavelength))
        answer = self.take(view.measured(spectra) or view, spectra, own.reading)
        self.number, self._light, self._source = number, light, Path(own.path).resolve()
        return {**answer, "states_angle": True}

    def at(self, body: Mapping[str, Any]) -> View:
        """The view at the angles of incidence of a request, where it has some. Raises UsageError."""
        if body.get("angles") is None:
            return self.view
        angles = asked_angles(body["angles"])
        key = self.view, tuple(angles.tolist())
        if key not in self._views:
            while len(self._views) >= _VIEWS:
                del self._views[next(iter(self._views))]
            self._views[key] = self.view.at(angles)
        return self._views[key]

    def film(self) -> FilmView:
        """The view of a film. Raises UsageError for a surface."""
        if isinstance(self.view, SurfaceExplorerView):
            raise UsageError("the explorer draws no data of a surface: pellicle fit fits BRDF samples")
        return self.view

    def data(self, body: Mapping[str, Any]) -> dict[str, Any]:
        """Read data, which replace those before, and take the light of the scene from them."""
        view = self.film()
        if "name" in body or "file" in body or self._source is None:
            self._source, self.number = body, None
        reading = reading_fields.options_of(body.get("reading") or {})
        spectra = measured_spectra(self._source, self.folder, self._light.signal, reading)
        base = FilmView(self._unlit(view.scene), view.wavelength)
        if body.get("angles") is not None:
            base = base.at(asked_angles(body["angles"]))
        return self.take(base.measured(all_covered(spectra, view.scene)) or base, spectra, reading)

    def remove(self, body: Mapping[str, Any]) -> dict[str, Any]:
        """Remove the data, and with them their light and angles."""
        self.number = None
        scene = self._unlit(self.film().scene)
        return self.take(FilmView(scene, self._known(scene)), [])

    def reset(self, body: Mapping[str, Any]) -> dict[str, Any]:
        """Show what the session began with."""
        view, spectra, reading, self._nm, self._light = self._first
        self.edited, self.number = False, 0 if spectra else None
        return self.take(view, spectra, reading)

    def layers(self, body: Mapping[str, Any]) -> dict[str, Any]:
        """Change media and layers, at the values of the sliders; `rows` as `rebuilt` takes them."""
        view = self.film()
        marked = body.get("free") or []
        free = {c.name for c in view.controls if c.free is not None or c.name in marked}
        scene = scene_with(view.scene, view.controls, values_of(view, body), free)
        made = rebuilt(scene, body.get("rows"), self.materials.medium)
        if isinstance(made, list):
            return {"wrong": [sentence(ValueError(text)) for text in made]}
        answer = self.take(self.measured(made), self.spectra, self.reading)
        self.edited = True
        return answer

    def _unlit(self, scene: Scene) -> Scene:
        """The scene with the light that it has without data."""
        return with_value(scene, LIGHT, self._light)

    def _known(self, scene: Scene) -> Any:
        """Wavelengths in nm at which a scene without data is shown; None for the visible ones."""
        if self._nm is None:
            return None
        low, high = common_range(scene)
        nm = np.unique(np.asarray(self._nm, float))
        inside = nm[(nm >= low) & (nm <= high)]
        return inside if len(inside) > 1 else nm

    def measured(self, scene: Scene) -> FilmView:
        """The view of a scene with the light of the data."""
        if not self.spectra:
            return FilmView(scene, self._known(scene))
        spectra = all_covered(self.spectra, scene)
        view = FilmView(scene, np.unique(spectra[0].wavelength))
        return view.measured(spectra) or view

    def take(
        self, view: View, spectra: Sequence[Spectrum], reading: Mapping[str, Any] = MappingProxyType({})
    ) -> dict[str, Any]:
        """Show a view and data in place of those before; the answer says what is new to the page."""
        old, stated = self.view, bool(measured_angles([*self.spectra, *spectra]).size)
        self.spectra, self.reading = [*spectra], reading
        changed = not same_view(old, view)
        if changed:
            self.view = view
        self._changed(changed)
        new = {"scene_changed": True} if changed else {}
        return {**self.data_shown(), "states_angle": stated, **new}

    def data_shown(self) -> dict[str, Any]:
        """The data for the page: curves, notes, ranges that are left out, and options of reading."""
        if not self.spectra:
            return {"name": None, "curves": [], "notes": [], "cut": []}
        curves = data_curves(self.spectra, isinstance(self.view, FilmView) and self.view.against_angle)
        used = all_covered(self.spectra, self.view.scene)
        return {
            "name": self.spectra[0].path,
            "curves": [curve_to_json(curve) for curve in curves],
            "notes": data_text(used),
            "cut": cut_ranges(used),
            "reading": reading_fields.texts_of(self.reading),
        }


def values_of(view: View, body: Mapping[str, Any]) -> dict[str, float]:
    """The value of every control: those of the request, else the scene's. Raises UsageError."""
    given, values = body.get("values") or {}, view.defaults()
    if not isinstance(given, Mapping):
        raise UsageError("`values` must be numbers by name")
    for name, value in given.items():
        control = view.by_name.get(name)
        if control is None:
            raise UsageError(f"no control {name!r}; known: {', '.join(view.by_name)}")
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            raise UsageError(f"{name} must be a number, not {value!r}")
        if not control.lower <= value <= control.upper:
            bounds = f"{control.lower:g} to {control.upper:g} {control.unit}".rstrip()
            raise UsageError(f"{name} must be {bounds}, got {value:g}")
        values[name] = float(value)
    return values


def sentence(error: Exception) -> str:
    """A message on one line, with the names of fields for Python arguments."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename or 'a file'}: {error.strerror}"
    return reading_fields.in_words(str(error))


def all_covered(spectra: Sequence[Spectrum], scene: Any) -> list[Spectrum]:
    """Spectra without the points at which a material of the scene has no data."""
    return [covered(spectrum, scene) for spectrum in spectra]
