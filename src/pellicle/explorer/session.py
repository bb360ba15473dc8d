"""Session of the explorer: answers the requests of a page or a widget about one scene."""

from __future__ import annotations

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
from typing import Any

import numpy as np

from pellicle.colour import lab, sensor
from pellicle.data.spectrum import Spectrum
from pellicle.errors import DataError, UsageError
from pellicle.explorer.compiler import NOW, SOON, Compiler
from pellicle.explorer.controls import scene_with
from pellicle.explorer.dropped_files import LARGEST_FILE, data_curves, data_text, measured_spectra
from pellicle.explorer.film_view import FilmView
from pellicle.explorer.fit_run import FitRun, fitted_curves, fitted_names, to_json
from pellicle.explorer.programs import Curve
from pellicle.explorer.sphere import to_linear_srgb
from pellicle.explorer.surface_view import SurfaceExplorerView
from pellicle.recipes.python_text import python_program
from pellicle.recipes.write import recipe_text
from pellicle.reporting.picture import encode
from pellicle.scene.film import Scene, with_wavelength
from pellicle.scene.surface import Surface

log = getLogger(__name__)

SIZE, MOVING, LARGEST = 192, 96, 512
"""Pixels across the picture of a ball, while a slider moves, and the most that a page may ask for."""
WANTED = ("curves", "colour", "sphere", "plan")
"""Parts of a view."""


class Session:
    """A scene whose numbers a page moves: one `answer` for each request.

    **Arguments:** `scene`; `folder`, in which data files may be read (None: none); `wavelength` in nm,
    (wavelengths,), by default those of the scene's light or the visible ones; `title` of the page; `spectra`,
    the data to begin with.

    **Raises:** UsageError for a light of several angles, DataError where materials share no wavelengths.
    """

    def __init__(
        self,
        scene: Scene | Surface,
        folder: str | Path | None = None,
        *,
        wavelength: Any = None,
        title: str = "",
        spectra: Sequence[Spectrum] = (),
    ) -> None:
        self.title, self.folder = title, None if folder is None else Path(folder).resolve()
        if wavelength is None and spectra:
            wavelength = np.unique(spectra[0].wavelength)
        view = SurfaceExplorerView(scene) if isinstance(scene, Surface) else FilmView(scene, wavelength)
        self.view: FilmView | SurfaceExplorerView = (view.measured(spectra) if spectra else None) or view
        here = self.folder or Path.cwd()
        self.spectra = [replace(each, path=os.path.relpath(each.path, here)) for each in spectra]
        self._ahead = False  # whether programs are compiled before a view needs them
        self._compiler, self._fit_run = Compiler(), FitRun()
        self._requests: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
            "scene": self._scene,
            "view": self._view,
            "data": self._data,
            "fit": self._fit,
            "fit_status": lambda body: self._fit_run.status(),
            "fit_stop": lambda body: self._fit_run.stop(),
            "recipe": self._recipe,
        }

    def answer(self, request: str, body: Any) -> dict[str, Any]:
        """Answer one request; what is wrong with it is one sentence under `error`."""
        if request not in self._requests:
            return {"error": f"no request {request!r}; known: {', '.join(self._requests)}"}
        if not isinstance(body, Mapping):
            return {"error": "the body of a request must be a JSON object"}
        try:
            return self._requests[request](body)
        except (UsageError, DataError, ValueError, OSError) as error:
            return {"error": _sentence(error), **_serial(body)}
        except Exception as error:  # a fault of ours must not end the session
            log.exception("request %s", request)
            return {"error": f"{request} failed: {type(error).__name__}: {error}", **_serial(body)}

    def _scene(self, body: Mapping[str, Any]) -> dict[str, Any]:
        about = {"title": self.title, "kind": self.view.kind, "limit": LARGEST_FILE}
        data = {"data": self._data_shown()} if self.spectra else {}
        return {**about, **self.view.describe(), **data}

    def _data(self, body: Mapping[str, Any]) -> dict[str, Any]:
        """Read data, and take the light of the scene from them."""
        view = self.view
        if isinstance(view, SurfaceExplorerView):
            view.measured([])
        spectra = measured_spectra(body, self.folder, view.scene.light.signal)
        changed = view.measured(spectra)
        self.spectra = spectra
        if changed is None:
            return self._data_shown()
        self.view = changed
        if self._ahead:
            self.prepare()
        return {**self._data_shown(), "scene_changed": True}

    def _data_shown(self) -> dict[str, Any]:
        angle = self.view.defaults().get("angle", 0.0)
        return {
            "name": self.spectra[0].path,
            "curves": [curve_to_json(curve) for curve in data_curves(self.spectra, angle)],
            "notes": data_text(self.spectra),
        }

    def _fit(self, body: Mapping[str, Any]) -> dict[str, Any]:
        view, values = self.view, self._values(body)
        if not self.spectra or isinstance(view, SurfaceExplorerView):
            raise UsageError("there are no data to fit: open a file first")
        names = fitted_names(view.controls, body.get("free"))
        found = self._fit_run.run(self.spectra, scene_with(view.scene, view.controls, values, names))
        if found is None:
            return {"stopped": True}
        return {
            **to_json(found, view.controls),
            "curves": [curve_to_json(curve) for curve in fitted_curves(found)],
        }

    def _recipe(self, body: Mapping[str, Any]) -> dict[str, Any]:
        view, values = self.view, self._values(body)
        scene, folder = view.stated(values), Path.cwd() if self.folder is None else self.folder
        if isinstance(scene, Surface) or isinstance(view, SurfaceExplorerView):
            return {"toml": recipe_text(scene, folder), "python": python_program(scene)}
        sampled = with_wavelength(scene, view.wavelength)
        files = list(dict.fromkeys(folder / spectrum.path for spectrum in self.spectra))
        toml = recipe_text(scene if files else sampled, folder, files=files)
        return {"toml": toml, "python": python_program(sampled)}

    def _view(self, body: Mapping[str, Any]) -> dict[str, Any]:
        values, warnings = self._values(body), []
        wanted, size = body.get("want", WANTED), body.get("size", MOVING if body.get("moving") else SIZE)
        if not isinstance(wanted, list | tuple) or not all(x in WANTED for x in wanted):
            raise UsageError(f"`want` must be a list of {', '.join(WANTED)}")
        if not isinstance(size, int) or not 16 <= size <= LARGEST:
            raise UsageError(f"`size` must be 16 to {LARGEST} pixels")
        answer: dict[str, Any] = {**_serial(body), "compiling": [], "milliseconds": {}}
        parts = {"curves": self._curves, "colour": self._colour, "sphere": self._sphere, "plan": self._plan}
        for part in (part for part in wanted if part in self.view.parts):
            began = time.perf_counter()
            try:
                found = parts[part](values, bool(body.get("wait")), size)
            except ValueError as error:
                warnings.append(_sentence(error))
                continue
            if found is None:
                answer["compiling"].append(part)
                continue
            answer[part] = found
            answer["milliseconds"][part] = round(1e3 * (time.perf_counter() - began), 3)
        return {**answer, "warnings": list(dict.fromkeys(warnings))}

    def _values(self, body: Mapping[str, Any]) -> dict[str, float]:
        """The value of every control: those of the request, else the scene's. Raises UsageError."""
        given, values = body.get("values") or {}, self.view.defaults()
        if not isinstance(given, Mapping):
            raise UsageError("`values` must be numbers by name")
        for name, value in given.items():
            control = self.view.by_name.get(name)
            if control is None:
                raise UsageError(f"no control {name!r}; known: {', '.join(self.view.by_name)}")
            if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
                raise UsageError(f"{name} must be a number, not {value!r}")
            if not control.lower <= value <= control.upper:
                bounds = f"{control.lower:g} to {control.upper:g} {control.unit}".rstrip()
                raise UsageError(f"{name} must be {bounds}, got {value:g}")
            values[name] = float(value)
        return values

    def _program(self, kind: str, values: Mapping[str, float], wait: bool) -> Any:
        """A compiled program of the effects that these values have, None while it is compiled."""
        view = self.view
        structure = view.structure(values)
        get = self._compiler.wait if wait else self._compiler.get
        return get((view, kind, structure), lambda: view.compile(kind, structure))

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
                self._compiler.get((view, kind, needed), partial(view.compile, kind, needed), urgency)

    def _curves(self, values: Mapping[str, float], wait: bool, size: int) -> list[dict[str, Any]] | None:
        program = self._program("curves", values, wait)
        return None if program is None else [curve_to_json(curve) for curve in program(values)]

    def _colour(self, values: Mapping[str, float], wait: bool, size: int) -> dict[str, Any] | None:
        program = self._program("colour", values, wait)
        if program is None:
            return None
        xyz = program(values)
        shown = encode(to_linear_srgb(xyz))
        numbers = np.asarray(lab(xyz, sensor().white)).round(2).tolist()
        in_words = ", ".join(f"{name} {x:.1f}" for name, x in zip(("L*", "a*", "b*"), numbers, strict=True))
        return {
            "hex": "#" + "".join(f"{round(255 * float(x)):02x}" for x in shown),
            "lab": numbers,
            "text": f"{self.view.light_in_words} under D65: {in_words}",
        }

    def _sphere(self, values: Mapping[str, float], wait: bool, size: int) -> str | None:
        program = self._program("sphere", values, wait)
        if program is None:
            return None
        return "data:image/png;base64," + b64encode(self.view.picture(program(values), size)).decode()

    def _plan(self, values: Mapping[str, float], wait: bool, size: int) -> list[dict[str, Any]]:
        return [
            {
                "effect": row.effect,
                "choice": "on" if row.on else "off",
                "reason": row.why,
                "error": row.error_bound,
                "cost": None,
            }
            for row in self.view.plan(values).rows
        ]


def curve_to_json(curve: Curve) -> dict[str, Any]:
    """Convert a curve; 7 digits are more than a plot shows, None is a point without a value."""
    y = [float(f"{v:.7g}") if isfinite(v) else None for v in np.asarray(curve.y, float).tolist()]
    return {
        "label": curve.label,
        "x": [float(f"{v:.7g}") for v in np.asarray(curve.x, float).tolist()],
        "y": y,
    }


def _serial(body: Mapping[str, Any]) -> dict[str, Any]:
    return {"serial": body["serial"]} if "serial" in body else {}


def _sentence(error: Exception) -> str:
    """A message on one line, without the backticks of Python arguments."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename or 'a file'}: {error.strerror}"
    return " ".join(str(error).replace("`", "").split())
