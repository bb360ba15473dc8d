"""Session of the explorer: answers the requests of a page or a widget about one scene."""

import os
import tempfile
import time
from base64 import b64decode, b64encode
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

from pellicle.data.read_spectrum import read_spectra
from pellicle.data.spectrum import Spectrum
from pellicle.errors import DataError, UsageError
from pellicle.explorer.answers import (
    colours_to_json,
    curve_to_json,
    data_curves,
    data_text,
    fit_to_json,
    fitted_curves,
    plan_to_json,
)
from pellicle.explorer.background import NOW, SOON, Compiler, FitRun
from pellicle.explorer.controls import fitted_names, scene_with, with_value
from pellicle.explorer.programs import ANGLE, asked_angles, measured_angles
from pellicle.explorer.unknown_film import identification, identification_to_json
from pellicle.explorer.views import FilmView, SurfaceExplorerView
from pellicle.identification.hypothesis import Hypothesis
from pellicle.recipes.python_text import python_program
from pellicle.recipes.write import recipe_text
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface

log = getLogger(__name__)

SIZE, MOVING, LARGEST = 192, 96, 512
"""Pixels across the rendering of a ball, while a slider moves, and the most that a page may ask for."""
WANTED = ("curves", "colour", "sphere", "plan")
"""Parts of a view."""
LARGEST_FILE = 20_000_000
"""Bytes of the largest data file."""
_LONGEST_NAME = 120
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
        if wavelength is None and spectra:
            wavelength = np.unique(spectra[0].wavelength)
        view = SurfaceExplorerView(scene) if isinstance(scene, Surface) else FilmView(scene, wavelength)
        self.view: _View = (view.measured(spectra) if spectra else None) or view
        here = self.folder or Path.cwd()
        self.spectra = [replace(each, path=os.path.relpath(each.path, here)) for each in spectra]
        self._reading = reading
        self._views: dict[tuple[Any, tuple[float, ...]], FilmView] = {}  # at other angles of incidence
        self._ahead = False  # whether programs are compiled before a view needs them
        self._compiler, self._fit_run = Compiler(), FitRun()
        self._hypotheses: tuple[Hypothesis, ...] = ()  # those that the data leave
        self._requests: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
            "scene": self._scene,
            "view": self._view,
            "data": self._data,
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
            return {"error": _sentence(error), **serial}
        except Exception as error:  # a fault of ours must not end the session
            log.exception("request %s", request)
            return {"error": f"{request} failed: {type(error).__name__}: {error}", **serial}

    def _scene(self, body: Mapping[str, Any]) -> dict[str, Any]:
        view = self._view_of(body)
        about = {"title": self.title, "kind": view.kind, "limit": LARGEST_FILE}
        data = {"data": self._data_shown()} if self.spectra else {}
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

    def _data(self, body: Mapping[str, Any]) -> dict[str, Any]:
        """Read data, and take the light of the scene from them."""
        view = self.view
        if isinstance(view, SurfaceExplorerView):
            view.measured([])
        spectra = _measured_spectra(body, self.folder, view.scene.light.signal)
        changed = self._view_of(body).measured(spectra)
        self.spectra, self._reading, self._hypotheses = spectra, {}, ()
        if changed is None:
            return self._data_shown()
        self.view = changed
        if self._ahead:
            self.prepare()
        return {**self._data_shown(), "scene_changed": True}

    def _data_shown(self) -> dict[str, Any]:
        curves = data_curves(self.spectra, isinstance(self.view, FilmView) and self.view.against_angle)
        return {
            "name": self.spectra[0].path,
            "curves": [curve_to_json(curve) for curve in curves],
            "notes": data_text(self.spectra),
            "states_angle": any(spectrum.angle is not None for spectrum in self.spectra),
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
        fit = self._fit_run.run(self.spectra, scene)
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
        found = self._fit_run.alone(lambda: identification(self.spectra, view.scene, values))
        assert found is not None  # nothing stops it
        self._hypotheses = found.hypotheses
        return identification_to_json(found)

    def _take_hypothesis(self, body: Mapping[str, Any]) -> dict[str, Any]:
        """Show the scene of a hypothesis, by its `number` in the answer of `identify`."""
        number = body.get("number")
        if type(number) is not int or number not in range(len(self._hypotheses)):
            raise UsageError(f"no hypothesis {number!r}: ask which film it is first")
        view = FilmView(self._hypotheses[number].scene())
        self.view = view.measured(self.spectra) or view
        if self._ahead:
            self.prepare()
        return {**self._data_shown(), "scene_changed": True}

    def _recipe(self, body: Mapping[str, Any]) -> dict[str, Any]:
        view = self._view_of(body)
        scene, folder = view.stated(self._values(view, body)), self.folder or Path.cwd()
        if isinstance(scene, Surface) or isinstance(view, SurfaceExplorerView):
            return {"toml": recipe_text(scene, folder), "python": python_program(scene)}
        program = python_program(view.sampled(scene))
        if not self.spectra:
            return {"toml": recipe_text(scene, folder, wavelength=view.wavelength), "python": program}
        if np.ndim(scene.light.angle):  # those of the files
            scene = with_value(scene, ANGLE, 0.0)
        files = list(dict.fromkeys(folder / spectrum.path for spectrum in self.spectra))
        return {"toml": recipe_text(scene, folder, files=files, reading=self._reading), "python": program}

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
    """A message on one line, without the backticks of Python arguments."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename or 'a file'}: {error.strerror}"
    return " ".join(str(error).replace("`", "").split())


def _measured_spectra(body: Mapping[str, Any], folder: Path | None, signal: str) -> list[Spectrum]:
    """Read the spectra of a request: `name` with `text` or `base64`, or `file`, one in the folder.

    A file that does not state its signal has that of the scene. **Raises:** DataError or UsageError in one
    sentence.
    """
    if "file" in body:
        path = _inside(folder, body["file"])
        return _read(path, path.name, signal)
    name = body.get("name")
    if not isinstance(name, str):
        raise UsageError("a file needs a name")
    name = "".join(x for x in name.replace("\\", "/").rpartition("/")[2] if x.isprintable()).strip(". ")
    name = name[-_LONGEST_NAME:] or "data.csv"
    encoded = body.get("base64")
    given = body.get("text") if encoded is None else encoded
    if not isinstance(given, str):
        raise UsageError(f"{name}: a file needs its text, or its bytes in base64")
    try:
        content = given.encode() if encoded is None else b64decode(given, validate=True)
    except ValueError:
        form = "Unicode text" if encoded is None else "base64"
        raise UsageError(f"{name}: is not {form}") from None
    _check_size(name, len(content))
    with tempfile.TemporaryDirectory(prefix="pellicle-") as place:
        path = Path(place) / name
        path.write_bytes(content)
        return _read(path, name, signal)


def _check_size(name: str, size: int) -> None:
    if size > LARGEST_FILE:
        raise DataError(f"{name}: has more than {LARGEST_FILE // 1_000_000} MB: fit it with pellicle fit")


def _inside(folder: Path | None, name: Any) -> Path:
    """The path of a file in the folder. Raises UsageError for one outside, whether it exists or not."""
    path = None if folder is None or not isinstance(name, str) or "\0" in name else (folder / name).resolve()
    if path is None or folder is None or not path.is_relative_to(folder):
        raise UsageError(f"{name}: only files in the folder of the recipe can be read")
    if not path.is_file():
        raise DataError(f"{name}: no such file in the folder of the recipe")
    _check_size(name, path.stat().st_size)
    return path


def _read(path: Path, name: str, signal: str) -> list[Spectrum]:
    """Read a file whose errors and spectra bear its name without the folder."""
    try:
        try:
            spectra = read_spectra(path)
        except UsageError as error:
            try:
                spectra = read_spectra(path, signal=signal)
            except UsageError:
                raise error from None
            note = f"the file does not say what it is: taken as {signal}, the signal of the scene"
            spectra = [replace(each, notes=(*each.notes, note)) for each in spectra]
    except (UsageError, DataError) as error:
        raise type(error)(str(error).replace(str(path), name)) from None
    notes = [tuple(note.replace(str(path), name) for note in each.notes) for each in spectra]
    return [replace(each, path=name, notes=own) for each, own in zip(spectra, notes, strict=True)]
