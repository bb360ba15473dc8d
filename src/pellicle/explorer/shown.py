"""Film and data that a page shows, and the requests that change them."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

import equinox as eqx
import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.errors import UsageError
from pellicle.explorer import reading_fields
from pellicle.explorer.answers import curve_to_json, cut_ranges, data_curves, data_text, samples_text
from pellicle.explorer.controls import scene_with, with_value
from pellicle.explorer.dropped_files import MaterialFiles, measured, spectra_of
from pellicle.explorer.film_texts import rebuilt
from pellicle.explorer.programs import LIGHT, asked_angles, measured_angles
from pellicle.explorer.surface_views import SurfaceExplorerView
from pellicle.explorer.views import FilmView
from pellicle.recipes.read import surface_samples
from pellicle.scene.common_range import common_range, covered
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface

_VIEWS = 16
"""Sets of angles of incidence that are remembered."""
View: TypeAlias = FilmView | SurfaceExplorerView


class RecipeFile(NamedTuple):
    """One of several files of a recipe: its scene, and the options and the function that read it."""

    path: str
    scene: Callable[[], Scene | Surface]
    reading: Mapping[str, Any]
    read: Callable[[Mapping[str, Any]], Sequence[Any]]


class Shown:
    """Film or surface and data that a page shows; the arguments are those of a `Session`.

    `changed` is called with True where the view is another one, with False where the data are.
    """

    def __init__(
        self,
        scene: Scene | Surface,
        folder: Path | None,
        wavelength: Any,
        spectra: Sequence[Any],
        reading: Mapping[str, Any],
        files: Sequence[RecipeFile],
        changed: Callable[[bool], None],
    ) -> None:
        self.folder, self.files, self._changed = folder, files, changed
        self._nm = wavelength  # of the scene without data
        if wavelength is None and spectra and isinstance(spectra[0], Spectrum):
            wavelength = np.unique(spectra[0].wavelength)
        view: Any = SurfaceExplorerView(scene) if isinstance(scene, Surface) else FilmView(scene, wavelength)
        self.view: View = (view.measured(spectra) if spectra else None) or view
        self.spectra, self.reading = self._located(spectra), reading
        self.number = 0 if spectra else None  # of the file that is shown
        self._source: Mapping[str, Any] | Path | None = Path(spectra[0].path).resolve() if spectra else None
        self._light: Any = getattr(scene, "light", None)  # of the scene without data
        self._first = self.view, self.spectra, reading, self._nm, self._light, self._source
        self.edited = False
        self.materials = MaterialFiles(folder)
        self._views: dict[tuple[Any, tuple[float, ...]], FilmView] = {}  # at other angles of incidence

    def _located(self, spectra: Sequence[Any]) -> list[Any]:
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
        scene, spectra = own.scene(), self._located(own.read(own.reading))
        light = getattr(scene, "light", None)
        if self.edited:
            scene = with_value(self.film().scene, LIGHT, light)
        view = self._view_of(scene, spectra)
        answer = self.take(view, spectra, own.reading)
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
            raise UsageError("a surface has no layers here: change its media in the recipe")
        return self.view

    def data(self, body: Mapping[str, Any]) -> dict[str, Any]:
        """Read data, which replace those before, and take the light of the scene from them."""
        view: Any = self.view
        if "name" in body or "file" in body or self._source is None:
            self._source, self.number = body, None
        reading = reading_fields.options_of(body.get("reading") or {})
        own = None if self.number is None or not self.files else self.files[self.number]
        if own is not None:  # what has no field stays, and the recipe knows how counts and colours are read
            reading |= {name: x for name, x in own.reading.items() if name not in reading_fields.FIELDS}
        if isinstance(surface := view.scene, Surface):
            samples = measured(
                self._source,
                self.folder,
                lambda path: [*own.read(reading)] if own else [surface_samples(path, surface, **reading)],
            )
            return self.take(self._view_of(surface, samples), samples, reading)
        signal = self._light.signal
        spectra = measured(
            self._source,
            self.folder,
            lambda path: [*own.read(reading)] if own else spectra_of(path, signal, reading),
        )
        base = FilmView(self._unlit(view.scene), view.wavelength)
        if body.get("angles") is not None:
            base = base.at(asked_angles(body["angles"]))
        return self.take(base.measured(all_covered(spectra, view.scene)) or base, spectra, reading)

    def remove(self, body: Mapping[str, Any]) -> dict[str, Any]:
        """Remove the data, and with them their light and angles."""
        self.number, scene = None, self.view.scene
        if isinstance(scene, Surface):
            return self.take(SurfaceExplorerView(scene), [])
        scene = self._unlit(scene)
        return self.take(FilmView(scene, self._known(scene)), [])

    def reset(self, body: Mapping[str, Any]) -> dict[str, Any]:
        """Show what the session began with."""
        view, spectra, reading, self._nm, self._light, self._source = self._first
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
        return self._view_of(scene, all_covered(self.spectra, scene))

    @staticmethod
    def _view_of(scene: Any, spectra: Sequence[Any]) -> Any:
        """The view of a film or a surface with data."""
        if isinstance(scene, Surface):
            return SurfaceExplorerView(scene).measured(spectra)
        view = FilmView(scene, np.unique(spectra[0].wavelength))
        return view.measured(spectra) or view

    def take(
        self, view: View, spectra: Sequence[Any], reading: Mapping[str, Any] = MappingProxyType({})
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
        if isinstance(self.view, SurfaceExplorerView):
            curves, cut = self.view.data_curves(), []
            notes = samples_text(self.spectra[0], len(curves[0].x))
        else:
            used = all_covered(self.spectra, self.view.scene)
            curves, cut = data_curves(self.spectra, self.view.against_angle), cut_ranges(used)
            notes = data_text(used)
        drawn = [curve_to_json(curve) for curve in curves]
        about = {"name": self.spectra[0].path, "curves": drawn, "notes": notes, "cut": cut}
        return about | {"reading": reading_fields.texts_of(self.reading)}


def same_view(one: FilmView | SurfaceExplorerView, other: FilmView | SurfaceExplorerView) -> bool:
    """Return True for views of the same scene, drawn alike."""
    if isinstance(one, SurfaceExplorerView) or isinstance(other, SurfaceExplorerView):
        return one is other
    alike = one.folded == other.folded and np.array_equal(one.wavelength, other.wavelength)
    return alike and eqx.tree_equal(one.scene, other.scene) is True


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
