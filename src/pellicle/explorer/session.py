"""Session of the explorer: answers the requests of a page or a widget about one scene."""

import os
import time
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from logging import getLogger
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.options import FitOptions
from pellicle.data.spectrum import Spectrum
from pellicle.errors import UsageError
from pellicle.explorer import reading_fields
from pellicle.explorer.answers import (
    colours_to_json,
    curve_to_json,
    fit_to_json,
    fitted_curves,
    plan_to_json,
)
from pellicle.explorer.background import NOW, SOON, Compiler, FitRun
from pellicle.explorer.controls import fitted_names, scene_with, with_value
from pellicle.explorer.dropped_files import LARGEST_FILE
from pellicle.explorer.film_texts import described, words
from pellicle.explorer.programs import ANGLE, measured_angles
from pellicle.explorer.shown import RecipeFile, Shown, View, all_covered, sentence, values_of
from pellicle.explorer.surface_views import SurfaceExplorerView
from pellicle.explorer.unknown_film import identification, identification_to_json
from pellicle.explorer.views import FilmView
from pellicle.fitting.brdf.fit import fitted as fit_samples
from pellicle.fitting.film.fit import fit as fit_film
from pellicle.identification.hypothesis import Hypothesis
from pellicle.recipes.python_text import python_program
from pellicle.scene.film import Scene
from pellicle.scene.surface import Surface

log = getLogger(__name__)

SIZE, MOVING, LARGEST = 192, 96, 512
"""Pixels across the rendering of a ball, while a slider moves, and the most that a page may ask for."""
WANTED = ("curves", "colour", "sphere", "plan")
"""Parts of a view."""


class Session:
    """A scene whose numbers a page moves: one `answer` for each request.

    **Arguments:** `scene`; `folder`, in which data files may be read (None: none); `wavelength` in nm,
    (wavelengths,), by default those of the scene's light or the visible ones; `title` of the page; `spectra`,
    the data to begin with, and the options of a recipe by which they were read, `reading`; `files` of a
    recipe that has several, of which `spectra` are the first.

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
        spectra: Sequence[Spectrum | BrdfSamples] = (),
        reading: Mapping[str, Any] = MappingProxyType({}),
        files: Sequence[RecipeFile] = (),
    ) -> None:
        self.title, self.folder = title, None if folder is None else Path(folder).resolve()
        self.shown = Shown(scene, self.folder, wavelength, spectra, reading, files, self._changed)
        self._ahead = False  # whether programs are compiled before a view needs them
        self._compiler, self._fit_run = Compiler(), FitRun()
        self._hypotheses: tuple[Hypothesis, ...] = ()  # those that the data leave
        self._folded: tuple[bool, ...] = ()  # of each spectrum, as it was identified
        self._requests: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
            "scene": self._scene,
            "view": self._view,
            **{name: getattr(self.shown, name) for name in ("data", "remove", "reset", "layers", "tab")},
            "material": lambda body: {"word": self.shown.materials.take(body)},
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
            return {"error": sentence(error), **({"fields": named} if named else {}), **serial}
        except Exception as error:  # a fault of ours must not end the session
            log.exception("request %s", request)
            return {"error": f"{request} failed: {type(error).__name__}: {error}", **serial}

    def _changed(self, view: bool) -> None:
        """Forget films that were found in other data, and compile what another view needs."""
        self._hypotheses = ()
        if view and self._ahead:
            self.prepare()

    def _scene(self, body: Mapping[str, Any]) -> dict[str, Any]:
        view = self.shown.at(body)
        about = {"title": self.title, "kind": view.kind, "limit": LARGEST_FILE, "edited": self.shown.edited}
        data: dict[str, Any] = {"data": self.shown.data_shown()} if self.shown.spectra else {}
        film = isinstance(view, FilmView)
        if film:
            data |= {"layers": described(view.scene), "words": words()}
        fields = reading_fields.described(reading_fields.FIELDS if film else reading_fields.OF_SAMPLES)
        data |= {"fields": fields, "number": self.shown.number}
        if len(self.shown.files) > 1:
            data["files"] = [os.path.basename(file.path) for file in self.shown.files]
        return {**about, **view.describe(), **data}

    def _fit(self, body: Mapping[str, Any]) -> dict[str, Any]:
        view = self.shown.at(body)
        if not self.shown.spectra:
            raise UsageError("there are no data to fit: open a file first")
        values = values_of(view, body)
        names = fitted_names(view.controls, body.get("free"))
        options = FitOptions.of(self.shown.reading).given()
        if isinstance(view, SurfaceExplorerView):
            surface, samples = view.stated(values, names), self.shown.spectra[0]
            options = {"tolerance": 0.0, "residual": self.shown.reading.get("residual"), **options}
            fit = self._fit_run.run(
                lambda progress: fit_samples(samples, surface, progress=progress, **options)[0]
            )
            return {"stopped": True} if fit is None else fit_to_json(fit, view.controls)
        scene = scene_with(view.scene, view.controls, values, names)
        if "angle" not in names and all(spectrum.angle is not None for spectrum in self.shown.spectra):
            scene = with_value(scene, ANGLE, 0.0)  # angles of the data, whatever the slider has
        spectra = all_covered(self.shown.spectra, scene)
        measured: Any = spectra[0] if len(spectra) == 1 else spectra
        fit = self._fit_run.run(lambda progress: fit_film(measured, scene, progress=progress, **options))
        if fit is None:
            return {"stopped": True}
        answer = fit_to_json(fit, view.controls)
        stated = measured_angles(self.shown.spectra)
        if "angle" not in names and "angle" in values and len(stated) == 1:
            answer["values"]["angle"] = float(stated[0])
        curves = fitted_curves(fit, view.against_angle)
        return {**answer, "curves": [curve_to_json(curve) for curve in curves]}

    def _identify(self, body: Mapping[str, Any]) -> dict[str, Any]:
        view = self.shown.at(body)
        if not self.shown.spectra or isinstance(view, SurfaceExplorerView):
            raise UsageError("there are no data to identify: open a file of a spectrum first")
        values, spectra = values_of(view, body), self.shown.spectra
        found = self._fit_run.alone(lambda: identification(spectra, view.scene, values))
        assert found is not None  # nothing stops it
        self._hypotheses, self._folded = found.hypotheses, tuple(bool(x.folded) for x in found.data)
        return identification_to_json(found)

    def _take_hypothesis(self, body: Mapping[str, Any]) -> dict[str, Any]:
        """Show the scene of a hypothesis, by its `number` in the answer of `identify`."""
        number = body.get("number")
        if type(number) is not int or number not in range(len(self._hypotheses)):
            raise UsageError(f"no hypothesis {number!r}: ask which film it is first")
        kept, reading = self._hypotheses, self.shown.reading
        if any(self._folded):
            pairs = zip(self.shown.spectra, self._folded, strict=True)
            self.shown.spectra = [replace(x, folded=True) if own else x for x, own in pairs]
            reading = {**reading, "folded": True}
        answer = self.shown.take(self.shown.measured(kept[number].scene()), self.shown.spectra, reading)
        self._hypotheses, self.shown.edited = kept, True
        return answer

    def _recipe(self, body: Mapping[str, Any]) -> dict[str, Any]:
        view = self.shown.at(body)
        fitted = fitted_names(view.controls, body.get("free")) if self.shown.spectra else None
        scene, folder = view.stated(values_of(view, body), fitted), self.folder or Path.cwd()
        about: dict[str, Any] = {}
        if isinstance(scene, Scene) and isinstance(view, FilmView):
            about, program = {"wavelength": view.wavelength}, python_program(view.sampled(scene))
        else:
            program = python_program(scene)
        if self.shown.spectra:
            files = list(dict.fromkeys(folder / spectrum.path for spectrum in self.shown.spectra))
            joint = {"joint": True} if len(self.shown.spectra) > 1 else {}  # as they are fitted here
            about = {"files": files, "reading": {**self.shown.reading, **joint}}
            if isinstance(scene, Scene) and np.ndim(scene.light.angle):  # those of the files
                scene = with_value(scene, ANGLE, 0.0)
            program = python_program(scene, "recipe.toml") if fitted else program
        verb = "fit" if self.shown.spectra else "simulate"
        beside = [Path(spectrum.path).name for spectrum in self.shown.spectra] + self.shown.materials.used(
            scene
        )
        files = ", ".join(dict.fromkeys(beside))
        toml = self.shown.materials.recipe(scene, folder, **about)
        return {"toml": toml, "python": program, "commands": _commands(verb, files, bool(fitted))}

    def _view(self, body: Mapping[str, Any]) -> dict[str, Any]:
        view, warnings = self.shown.at(body), []
        values = values_of(view, body)
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
                warnings.append(sentence(error))
                continue
            if content is None:
                answer["compiling"].append(part)
                continue
            answer[part] = content
            answer["milliseconds"][part] = round(1e3 * (time.perf_counter() - began), 3)
        return {**answer, "warnings": list(dict.fromkeys(warnings))}

    def _part(self, part: str, view: View, values: Mapping[str, float], wait: bool, size: int) -> Any:
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
        of_film = self.shown.spectra if isinstance(view, FilmView) else ()
        measured = {name for spectrum in of_film for name in spectrum.kind.parts}
        return [curve_to_json(curve) for curve in made if not measured or curve.signal in measured]

    def prepare(self) -> None:
        """Compile in the background what the first views need, and then what one effect more needs."""
        view, self._ahead = self.shown.view, True
        structure = view.structure(view.defaults())
        several = [(kind, structure, NOW) for kind in view.parts if kind != "plan"]
        for other in view.neighbours(structure):
            several += [(kind, other, SOON) for kind in ("curves", "colour")]
        for kind, needed, urgency in several:
            # a ValueError, of a colour without data, is raised by the view that wants it
            with suppress(ValueError):
                self._compiler.get((view.key(kind), needed), partial(view.compile, kind, needed), urgency)


def _commands(verb: str, files: str, fitted: bool) -> dict[str, str]:
    """Sentences that say how to run a recipe and a program that are saved beside the files that they name."""
    place = f", saved beside {files}" if files else ""
    words = "--recipe recipe.toml" if verb == "fit" else "recipe.toml --out film.csv"
    toml, python = f"Run it: pellicle {verb} {words}{place}", "Run it: python film.py"
    return {"toml": toml, "python": f"{python}, saved beside recipe.toml" if fitted else python}
