"""Data files of a command, by a recipe or by flags, with the scene or surface that is fitted to them."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from glob import glob
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pellicle.api.data_files import check_camera
from pellicle.api.recipe_fits import (
    Input,
    Inputs,
    check_film,
    film_inputs,
    of_recipe,
    without_light,
)
from pellicle.cli.flags import FileFlags, FitFlags, SceneFlags
from pellicle.cli.messages import say
from pellicle.data.options import FileOptions, FitOptions
from pellicle.errors import DataError, UsageError

if TYPE_CHECKING:
    from pellicle.data.spectrum import Spectrum

_NO_DATA = {".toml", ".md", ".pdf", ".svg", ".html", ".json", ".ipynb", ".py", ".docx", ".log"}
"""Suffixes of files beside data in a folder, which are left out."""


def inputs(
    files: list[str],
    recipe: str | None,
    scene_flags: SceneFlags | None = None,
    reading_flags: FileFlags | None = None,
    fit_flags: FitFlags | None = None,
    joint: bool = False,
    repeats: bool | None = None,
) -> Inputs:
    """Combine files, recipe and flags; with `repeats` None that of the recipe is ignored.

    Raises UsageError or DataError where something is missing or wrong.
    """
    for file in files:
        if file.lower().endswith(".toml"):
            raise UsageError(f"{file}: is a recipe, and data were expected: write --recipe {file}")
    files = [path for file in files for path in _matching(file)]
    scene_flags = scene_flags or SceneFlags()
    reading = FileOptions() if reading_flags is None else reading_flags.options()
    fitting = FitOptions() if fit_flags is None else fit_flags.options()
    if recipe is None:
        result = _by_flags(files, scene_flags, reading)
        described: dict[str, Any] = {"flags": {n: x for n, x in vars(scene_flags).items() if x is not None}}
    else:
        if scene_flags.given():
            flags = ", ".join(scene_flags.given())
            raise UsageError(f"{flags} and --recipe exclude each other: describe the scene in the recipe")
        result = of_recipe(files, recipe, reading)
        described = {"recipe": recipe}
    described |= {"reading": how} if (how := reading.given() | fitting.given()) else {}
    options = FitOptions(**result.fitting.given() | fitting.given())
    written = result.written | options.given()
    joint = joint or result.joint
    result = replace(result, joint=joint, fitting=options, described=described, written=written)
    return result if repeats is None or not (repeats or result.repeats) else _as_repeats(result)


def _matching(file: str) -> list[str]:
    """The files of a folder, or of a pattern such as wafer/*.csv, which shells of Windows leave as it is, in
    natural order: 2 before 10. Any other path is itself."""
    path = Path(file)
    if path.is_dir():
        inside = [each for each in path.iterdir() if each.is_file() and not each.name.startswith((".", "~"))]
        found = [str(each) for each in inside if each.suffix.lower() not in _NO_DATA]
        if left := len(inside) - len(found):
            others = "1 other is" if left == 1 else f"{left} others are"
            say(f"{file}: {len(found)} files of data; {others} left out")
    elif path.exists() or not any(mark in file for mark in "*?["):
        return [file]
    else:
        found = glob(file, recursive=True)
    if not found:
        raise DataError(
            f"{file}: no file of data is there; name files, as in wafer/*.csv, or a folder of them"
        )
    numbered = partial(re.split, r"(\d+)")
    return sorted(found, key=lambda name: [int(x) if x.isdigit() else x for x in numbered(name)])


def _as_repeats(files: Inputs) -> Inputs:
    """Inputs of repeated measurements, each sweep of a file by itself."""
    if files.joint:
        raise UsageError(
            "repeats are fitted one by one, and a joint fit takes all files together: choose one"
        )
    sweeps = [sweep for file in files.files for sweep in _sweeps(file)]
    if len(sweeps) < 2:
        raise UsageError("repeats are two files or more, or several sweeps in one; leave --repeats out")
    return replace(files, files=sweeps, repeats=True)


def _sweeps(file: Input) -> list[Input]:
    """One input for each sweep of a file; the file itself where it has one, or cannot be read."""
    try:
        [one] = file.read()
        count = len(getattr(one, "sweeps", ()))
    except ValueError:  # more than one, or an error that is reported when it is fitted
        return [file]
    sweeps = [file._replace(read=partial(_sweep, file.read, i), file="") for i in range(count)]
    return sweeps or [file]


def _sweep(read_file: Callable[[], Any], number: int) -> list[Spectrum]:
    [one] = read_file()
    note, sweep = f"sweep {number + 1} of {len(one.sweeps)}", one.sweeps[number]
    return [replace(sweep, notes=(*sweep.notes, note))]


def _by_flags(files: list[str], scene_flags: SceneFlags, reading: FileOptions) -> Inputs:
    from pellicle.scene.free import check_free_count, free_leaves

    check_film(reading)
    if not files:
        raise UsageError(
            "no data: name the file, as in pellicle fit oxide.csv --layer SiO2 --substrate Si, or give a"
            " --recipe that does; pellicle demo is an example, --help lists every flag"
        )
    scene = scene_flags.scene(reading)
    if not scene_flags.thickness:
        say("thickness: 1 to 5000 nm, since no --thickness was given")
    check_free_count(len(free_leaves(scene)))
    check_camera(reading, [(file, reading) for file in files])
    inputs = [one for file in files for one in film_inputs(file, scene, reading)]
    return Inputs(inputs, False, written=without_light(reading.given()))
