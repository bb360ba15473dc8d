"""Colours of films for the commands: which files have them, and their reading by the flags."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from pellicle.cli.flags import CameraFlags, ReadingFlags, given
from pellicle.cli.session import say
from pellicle.errors import UsageError

if TYPE_CHECKING:
    import numpy as np

    from pellicle.data.colours import Colours
    from pellicle.recipes.film import FilmRecipe

SPACES = ("srgb", "rgb", "xyz", "lab")
_PIXELS = ("region", "points")
_CAMERA = tuple(field.name for field in fields(CameraFlags))
_OF_SPECTRA = (
    "range",
    "wavelength_unit",
    "reference",
    "reference_material",
    "dark",
    "folded",
    "analyser",
    "spot",
)
"""Reading flags without a meaning for colours."""


def is_of_colours(path: str, reading: ReadingFlags) -> bool:
    """True for a file of colours or a photograph: by the signal, or by the file's content without one."""
    from pellicle.data.colour_rows import is_colour_table
    from pellicle.data.photographs import image_format

    if reading.signal is not None:
        return reading.signal in SPACES
    try:
        return image_format(path) is not None or is_colour_table(path)
    except ValueError:
        return False  # the reader of spectra reports it


def check_words(reading: ReadingFlags) -> None:
    """Raise UsageError for a value of a colour flag that is wrong for every file."""
    from pellicle.data.photographs import parse_regions, whole_numbers

    words: dict[str, tuple[str | None, tuple[str, ...]]] = {
        "--white-balance": (reading.white_balance, ("fixed", "free"))
    }
    if reading.observer is not None or reading.illuminant is not None:
        from pellicle.colour.observers import ILLUMINANTS, OBSERVERS

        words["--observer"] = reading.observer, OBSERVERS
        words["--illuminant"] = reading.illuminant, ILLUMINANTS
    for name, (value, known) in words.items():
        if value is not None and value not in known:
            raise UsageError(f"{name} must be one of {', '.join(known)}, not {value!r}")
    if reading.gamma is not None and not 0.1 <= reading.gamma <= 10:
        raise UsageError(f"--gamma must be a number from 0.1 to 10, such as 2.2, got {reading.gamma:g}")
    for name in ("region", "white"):
        if (value := getattr(reading, name)) is not None:
            parse_regions(value, name)
    if reading.points is not None:
        whole_numbers(reading.points, 2, "points", "x,y")


def check_camera(given_flags: ReadingFlags, files: Iterable[tuple[str, ReadingFlags]]) -> None:
    """Raise UsageError where flags of a camera are given, and none of the files has colours.

    `files` are paths, each with all flags of its reading; one that cannot be read is left to its reader.
    """
    from pellicle.data.photographs import image_format

    wrong = [name for name in _CAMERA if getattr(given_flags, name) is not None]
    each = list(files)
    if not wrong or not each or any(is_of_colours(path, reading) for path, reading in each):
        return
    try:
        for path, _ in each:
            image_format(path)
    except ValueError:
        return
    raise UsageError(f"{each[0][0]}: {', '.join(given(wrong))}: of colours, and it has none; leave it out")


def refuse_camera(path: str, reading: ReadingFlags) -> None:
    """Raise UsageError where flags of colours are given and the file has a spectrum."""
    from pellicle.data.photographs import image_format

    wrong = [name for name in _PIXELS if getattr(reading, name) is not None]
    if wrong:
        image_format(path)  # reports a file that does not exist
        raise UsageError(
            f"{path}: {', '.join(given(wrong))}: only photographs have pixels, with --signal srgb"
        )


def read_films(path: str, reading: ReadingFlags, angle: float | list[float] | None = None) -> list[Colours]:
    """Read the colours of every film of a file, or of the one that --spectrum names.

    `angle` is that of all colours, where the flags do not list one for each; None leaves it to the file or
    the scene.

    **Raises:** DataError or UsageError.
    """
    from pellicle.cli.options import sigma
    from pellicle.data.file_spectra import ALL
    from pellicle.data.read_colours import read_colours_by_film

    if wrong := [name for name in _OF_SPECTRA if getattr(reading, name) is not None]:
        raise UsageError(
            f"{path}: {', '.join(given(wrong))}: of spectra, and these are colours; leave it out"
        )
    options: dict[str, Any] = {name: getattr(reading, name) for name in (*_CAMERA, "region", "points")}
    transmitted = options.pop("transmitted")
    films = read_colours_by_film(
        path,
        space=reading.signal,
        signal="T" if transmitted else "R",
        angle=reading.angle if isinstance(reading.angle, list) else angle,
        polarisation=reading.polarisation or "unpolarised",
        noise=sigma(reading.noise),
        signal_unit=reading.signal_unit,
        columns=reading.columns,
        **{name: value for name, value in options.items() if value is not None},
    )
    if reading.spectrum in (None, ALL):
        return films
    chosen = [film for film in films if film.name == reading.spectrum]
    if not chosen:
        known = ", ".join(repr(film.name) for film in films)
        raise UsageError(f"{path}: has no film {reading.spectrum!r}; its films are {known}")
    return chosen


def recipe_angles(recipe: FilmRecipe) -> np.ndarray:
    """Angles of incidence (colours,) of a recipe: its list, those of its first file, or its one angle."""
    import numpy as np

    from pellicle.cli.options import light, merged

    own = recipe.each[0] if recipe.each else recipe
    flags = merged(ReadingFlags(), own)
    if recipe.files and not isinstance(flags.angle, list):
        stated = read_films(recipe.files[0], flags)[0].angle
        if stated is not None:
            say(f"angles: those of {recipe.files[0]} (the recipe gives none)")
            return stated
    angle: Any = light(flags).angle
    return np.atleast_1d(np.asarray(getattr(angle, "start", angle), float))
