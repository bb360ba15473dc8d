"""Session of the explorer: answers the requests of a page or a widget about one scene."""

import os
import time
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from logging import getLogger
from math import isfinite
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from pellicle.data.spectrum import Spectrum
from pellicle.errors import UsageError
from pellicle.explorer import reading_fields
from pellicle.explorer.answers import (
    colours_to_json,
    curve_to_json,
    cut_ranges,
    data_curves,
    data_text,
    fit_to_json,
    fitted_curves,
    plan_to_json,
)
from pellicle.explorer.background import NOW, SOON, Compiler, FitRun
from pellicle.explorer.controls import fitted_names, scene_with, with_value
from pellicle.explorer.dropped_files import LARGEST_FILE, MaterialFiles, measured_spectra
from pellicle.explorer.film_texts import described, rebuilt, words
from pellicle.explorer.programs import ANGLE, LIGHT, asked_angles, measured_angles
from pellicle.explorer.unknown_film import identification, identification_to_json
from pellicle.explorer.views import FilmView, SurfaceExplorerView, same_view
from pellicle.identification.hypothesis import Hypothesis
from pellicle.recipes.python_text import python_program
from pellicle.scene.common_range import common_range, covered
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface

log = getLogger(__name__)

SIZE, MOVING, LARGEST = 192, 96, 512
"""Pixels across the rendering of a ball, while a slider moves, and the most that a page may ask for."""
WANTED = ("curves", "colour", "sphere", "plan")
"""Parts of a view."""
_VIEWS = 16
"""Sets of angles of incidence that are remembered."""
_View: TypeAlias = FilmView | SurfaceExplorerView


class Session:
    """A scene whose numbers a page moves: one `answer` for each request.

    **Arguments:** `scene`; `folder`, in which data files may be read (None: none); `wavelength` in nm,
    (wavelengths,), by default those of the scene's light or the visible ones; `title` of the page; `spectra`,
    the data to begin with, and the options of a recipe by which they were read, `reading`.

    **Raises:** UsageError for more angles of incidence than are drawn, DataError where materials share no
    wavelengths.
    """

    def __init__(
        self,
        scene: Scene | Surface,
        folder: str | Path | None = None,
        *,
        wavelength: Any = None,
        title: str = "",
        spectra: Sequence[Spectrum] = (),
        reading: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        self.title, self.folder = title, None if folder is None else Path(folder).resolve()
        self._nm = wavelength  # of the scene without data
        if wavelength is None and spectra:
            wavelength = np.unique(spectra[0].wavelength)
        view = SurfaceExplorerView(scene) if isinstance(scene, Surface) else FilmView(scene, wavelength)
        self.view: _View = (view.measured(spectra) if spectra else None) or view
        here = self.folder or Path.cwd()
        self.spectra = [replace(each, path=os.path.relpath(each.path, here)) for each in spectra]
        self._reading = reading
        self._source: Mapping[str, Any] | Path | None = Path(spectra[0].path).resolve() if spectra else None
        self._first = self.view, self.spectra, reading
        self._light: Any = getattr(scene, "light", None)  # of the scene without data
        self._edited = False
        self._materials = MaterialFiles(self.folder)
        self._views: dict[tuple[Any, tuple[float, ...]], FilmView] = {}  # at other angles of incidence
        self._ahead = False  # whether programs are compiled before a view needs them
        self._compiler, self._fit_run = Compiler(), FitRun()
        self._hypotheses: tuple[Hypothesis, ...] = ()  # those that the data leave
        self._requests: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
            "scene": self._scene,
            "view": self._view,
            "data": self._data,
            "remove": self._remove,
            "reset": self._reset,
            "layers": self._layers,
            "material": lambda body: {"word": self._materials.take(body)},
            "fit": self._fit,
            "fit_status": lambda body: self._fit_run.status(),
            "fit_stop": lambda body: self._fit_run.stop(),
            "identify": self._identify,
            "hypothesis": self._take_hypothesis,
            "recipe": self._recipe,
        }

    def answer(self, request: str, body: Any) -> dict[str, Any]:
        """Answer one request; what is wrong with it is one sentence under `error`."""
        if request not in self._requests:
            return {"error": f"no request {request!r}; known: {', '.join(self._requests)}"}
        if not isinstance(body, Mapping):
            return {"error": "the body of a request must be a JSON object"}
        serial = {"serial": body["serial"]} if "serial" in body else {}
        try:
            return serial | self._requests[request](body)
        except (ValueError, OSError) as error:
            named = reading_fields.named_in(str(error))
            return {"error": _sentence(error), **({"fields": named} if named else {}), **serial}
        except Exception as error:  # a fault of ours must not end the session
            log.exception("request %s", request)
            return {"error": f"{request} failed: {type(error).__name__}: {error}", **serial}

    def _scene(self, body: Mapping[str, Any]) -> dict[str, Any]:
        view = self._view_of(body)
        about = {"title": self.title, "kind": view.kind, "limit": LARGEST_FILE, "edited": self._edited}
        data = {"data": self._data_shown()} if self.spectra else {}
        if isinstance(view, FilmView):
            data |= {"layers": described(view.scene), "words": words()}
            data |= {"fields": reading_fields.described()}
        return {**about, **view.describe(), **data}

    def _view_of(self, body: Mapping[str, Any]) -> _View:
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

    def _film(self) -> FilmView:
        """The view of a film. Raises UsageError for a surface."""
        if isinstance(self.view, SurfaceExplorerView):
            raise UsageError("the explorer draws no data of a surface: pellicle fit fits BRDF samples")
        return self.view

    def _data(self, body: Mapping[str, Any]) -> dict[str, Any]:
        """Read data, which replace those before, and take the light of the scene from them."""
        view = self._film()
        if "name" in body or "file" in body or self._source is None:
            self._source = body
        reading = reading_fields.options_of(body.get("reading") or {})
        spectra = measured_spectra(self._source, self.folder, self._light.signal, reading)
        base = FilmView(self._unlit(view.scene), view.wavelength)
        if body.get("angles") is not None:
            base = base.at(asked_angles(body["angles"]))
        return self._take(base.measured(_covered(spectra, view.scene)) or base, spectra, reading)

    def _remove(self, body: Mapping[str, Any]) -> dict[str, Any]:
        """Remove the data, and with them their light and angles."""
        scene = self._unlit(self._film().scene)
        return self._take(FilmView(scene, self._known(scene)), [])

    def _reset(self, body: Mapping[str, Any]) -> dict[str, Any]:
        """Show what the session began with."""
        view, spectra, reading = self._first
        self._edited = False
        return self._take(view, spectra, reading)

    def _layers(self, body: Mapping[str, Any]) -> dict[str, Any]:
        """Change media and layers, at the values of the sliders; `rows` as `rebuilt` takes them."""
        view = self._film()
        marked = body.get("free") or []
        free = {c.name for c in view.controls if c.free is not None or c.name in marked}
        scene = scene_with(view.scene, view.controls, self._values(view, body), free)
        made = rebuilt(scene, body.get("rows"), self._materials.medium)
        if isinstance(made, list):
            return {"wrong": [_sentence(ValueError(text)) for text in made]}
        answer = self._take(self._measured(made), self.spectra, self._reading)
        self._edited = True
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

    def _measured(self, scene: Scene) -> FilmView:
        """The view of a scene with the light of the data."""
        if not self.spectra:
            return FilmView(scene, self._known(scene))
        spectra = _covered(self.spectra, scene)
        view = FilmView(scene, np.unique(spectra[0].wavelength))
        return view.measured(spectra) or view

    def _take(
        self, view: _View, spectra: Sequence[Spectrum], reading: Mapping[str, Any] = MappingProxyType({})
    ) -> dict[str, Any]:
        """Show a view and data in place of those before; the answer says what is new to the page."""
        old, stated = self.view, bool(measured_angles([*self.spectra, *spectra]).size)
        self.spectra, self._reading, self._hypotheses = [*spectra], reading, ()
        if same_view(old, view):
            return {**self._data_shown(), "states_angle": stated}
        self.view = view
        if self._ahead:
            self.prepare()
        return {**self._data_shown(), "states_angle": stated, "scene_changed": True}

    def _data_shown(self) -> dict[str, Any]:
        if not self.spectra:
            return {"name": None, "curves": [], "notes": [], "cut": []}
        curves = data_curves(self.spectra, isinstance(self.view, FilmView) and self.view.against_angle)
        used = _covered(self.spectra, self.view.scene)
        return {
            "name": self.spectra[0].path,
            "curves": [curve_to_json(curve) for curve in curves],
            "notes": data_text(used),
            "cut": cut_ranges(used),
            "reading": reading_fields.texts_of(self._reading),
        }

    def _fit(self, body: Mapping[str, Any]) -> dict[str, Any]:
        view = self._view_of(body)
        if not self.spectra or isinstance(view, SurfaceExplorerView):
            raise UsageError("there are no data to fit: open a file first")
        values = self._values(view, body)
        names = fitted_names(view.controls, body.get("free"))
        scene = scene_with(view.scene, view.controls, values, names)
        if "angle" not in names and all(spectrum.angle is not None for spectrum in self.spectra):
            scene = with_value(scene, ANGLE, 0.0)  # angles of the data, whatever the slider has
        fit = self._fit_run.run(_covered(self.spectra, scene), scene)
        if fit is None:
            return {"stopped": True}
        answer = fit_to_json(fit, view.controls)
        stated = measured_angles(self.spectra)
        if "angle" not in names and "angle" in values and len(stated) == 1:
            answer["values"]["angle"] = float(stated[0])
        curves = fitted_curves(fit, view.against_angle)
        return {**answer, "curves": [curve_to_json(curve) for curve in curves]}

    def _identify(self, body: Mapping[str, Any]) -> dict[str, Any]:
        view = self._view_of(body)
        if not self.spectra or isinstance(view, SurfaceExplorerView):
            raise UsageError("there are no data to identify: open a file first")
        values = self._values(view, body)
        spectra = _covered(self.spectra, view.scene)
        found = self._fit_run.alone(lambda: identification(spectra, view.scene, values))
        assert found is not None  # nothing stops it
        self._hypotheses = found.hypotheses
        return identification_to_json(found)

    def _take_hypothesis(self, body: Mapping[str, Any]) -> dict[str, Any]:
        """Show the scene of a hypothesis, by its `number` in the answer of `identify`."""
        number = body.get("number")
        if type(number) is not int or number not in range(len(self._hypotheses)):
            raise UsageError(f"no hypothesis {number!r}: ask which film it is first")
        kept = self._hypotheses
        answer = self._take(self._measured(kept[number].scene()), self.spectra, self._reading)
        self._hypotheses, self._edited = kept, True
        return answer

    def _recipe(self, body: Mapping[str, Any]) -> dict[str, Any]:
        view = self._view_of(body)
        scene, folder = view.stated(self._values(view, body)), self.folder or Path.cwd()
        if isinstance(scene, Surface) or isinstance(view, SurfaceExplorerView):
            return {"toml": self._materials.recipe(scene, folder), "python": python_program(scene)}
        about: dict[str, Any] = {"wavelength": view.wavelength}
        program = python_program(view.sampled(scene))
        if self.spectra:
            files = list(dict.fromkeys(folder / spectrum.path for spectrum in self.spectra))
            about = {"files": files, "reading": self._reading}
        if self.spectra and np.ndim(scene.light.angle):  # those of the files
            scene = with_value(scene, ANGLE, 0.0)
        return {"toml": self._materials.recipe(scene, folder, **about), "python": program}

    def _view(self, body: Mapping[str, Any]) -> dict[str, Any]:
        view, warnings = self._view_of(body), []
        values = self._values(view, body)
        wanted, size = body.get("want", WANTED), body.get("size", MOVING if body.get("moving") else SIZE)
        if not isinstance(wanted, list | tuple) or not all(x in WANTED for x in wanted):
            raise UsageError(f"`want` must be a list of {', '.join(WANTED)}")
        if not isinstance(size, int) or not 16 <= size <= LARGEST:
            raise UsageError(f"`size` must be 16 to {LARGEST} pixels")
        answer: dict[str, Any] = {"compiling": [], "milliseconds": {}}
        for part in (part for part in wanted if part in view.parts):
            began = time.perf_counter()
            try:
                content = self._part(part, view, values, bool(body.get("wait")), size)
            except ValueError as error:
                warnings.append(_sentence(error))
                continue
            if content is None:
                answer["compiling"].append(part)
                continue
            answer[part] = content
            answer["milliseconds"][part] = round(1e3 * (time.perf_counter() - began), 3)
        return {**answer, "warnings": list(dict.fromkeys(warnings))}

    def _values(self, view: _View, body: Mapping[str, Any]) -> dict[str, float]:
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

    def _part(self, part: str, view: _View, values: Mapping[str, float], wait: bool, size: int) -> Any:
        """A part of a view, by the program for the effects of these values; None while that is compiled."""
        if part == "plan":
            return plan_to_json(view.plan(values))
        structure = view.structure(values)
        get = self._compiler.wait if wait else self._compiler.get
        program = get((view.key(part), structure), lambda: view.compile(part, structure))
        if program is None:
            return None
        made = program(values, view.seen_at(part))
        if part == "sphere":
            return f"data:image/png;base64,{b64encode(view.rendering(made, size)).decode()}"
        if part == "colour":
            return colours_to_json(made, view.seen_at(part), view.light_in_words)
        measured = {name for spectrum in self.spectra for name in spectrum.kind.parts}
        return [curve_to_json(curve) for curve in made if not measured or curve.signal in measured]

    def prepare(self) -> None:
        """Compile in the background what the first views need, and then what one effect more needs."""
        view, self._ahead = self.view, True
        structure = view.structure(view.defaults())
        several = [(kind, structure, NOW) for kind in view.parts if kind != "plan"]
        for other in view.neighbours(structure):
            several += [(kind, other, SOON) for kind in ("curves", "colour")]
        for kind, needed, urgency in several:
            # a ValueError, of a colour without data, is raised by the view that wants it
            with suppress(ValueError):
                self._compiler.get((view.key(kind), needed), partial(view.compile, kind, needed), urgency)


def _sentence(error: Exception) -> str:
    """A message on one line, with the names of fields for Python arguments."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename or 'a file'}: {error.strerror}"
    return reading_fields.in_words(str(error))


def _covered(spectra: Sequence[Spectrum], scene: Any) -> list[Spectrum]:
    """Spectra without the points at which a material of the scene has no data."""
    return [covered(spectrum, scene) for spectrum in spectra]
