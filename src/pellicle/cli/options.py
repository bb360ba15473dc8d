"""From the words of `pellicle fit` to a scene, and to how files are read."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING, Any

from pellicle.cli.flags import ReadWords, SceneWords
from pellicle.errors import UsageError

if TYPE_CHECKING:
    from pellicle.recipes.film import FilmRecipe
    from pellicle.scene.film import Light, Scene

DEFAULT_THICKNESS = "1:5000"


def scene_from_words(words: SceneWords, read: ReadWords) -> tuple[Scene, list[str]]:
    """The scene that the flags describe, and what was assumed. Raises UsageError."""
    from pellicle.recipes import media_words as w
    from pellicle.scene.film import Scene
    from pellicle.scene.instrument import Instrument
    from pellicle.scene.layers import Layer, Substrate

    if words.layer is None or words.substrate is None:
        missing = "--layer" if words.layer is None else "--substrate"
        raise UsageError(
            f"{missing} is missing: say what the layer is and what it lies on, as in "
            "--layer SiO2 --substrate Si, or give a --recipe"
        )
    if words.plate_mm is not None and words.back is None:
        raise UsageError("--plate-mm needs --back: which medium lies behind the plate, as in --back air")
    if words.plate_mm is not None and not 0 < words.plate_mm < inf:
        raise UsageError(f"--plate-mm must be a finite number above zero, got {words.plate_mm:g}")
    free = [item.strip() for item in (words.free or "").split(",") if item.strip()]
    assumed = [] if words.thickness else ["thickness: 1 to 5000 nm, since no --thickness was given"]
    layer = Layer(w.medium(words.layer, free), w.thickness(words.thickness or DEFAULT_THICKNESS))
    back = None if words.back is None else w.medium(words.back, name="`back`")
    bandwidth = words.bandwidth
    scene = Scene(
        layer,
        Substrate(w.medium(words.substrate, name="`substrate`"), back, words.plate_mm or 1.0),
        ambient=w.medium(words.ambient or "air", name="`ambient`"),
        light=light(read),
        instrument=Instrument(
            w.drift(words.scale or "1", "`scale`"),
            w.drift(words.offset or "0", "`offset`"),
            None if bandwidth is None else w.free_or_number(bandwidth, "`bandwidth`", 0.0, 20.0, 2.0),
        ),
    )
    return scene, assumed


def light(read: ReadWords) -> Light:
    """How the scene is looked at, where the file does not say."""
    from pellicle.recipes.film import optional
    from pellicle.scene.film import Light

    return Light(
        None, optional(read.angle, "angle") or 0.0, read.signal or "R", read.polarisation or "unpolarised"
    )


def merged(read: ReadWords, recipe: FilmRecipe | None) -> ReadWords:
    """What the flags say, and else the recipe."""
    if recipe is None:
        return read
    data = recipe.tables.data
    return replace(
        read, **{word: getattr(data, word, None) for word, given in vars(read).items() if given is None}
    )


def read(path: str, words: ReadWords, *, scaled: bool) -> Any:
    """One spectrum as the flags say; `scaled` where a free scale makes any level acceptable.

    Raises DataError or UsageError.
    """
    from pellicle.data.read_spectrum import read_spectrum

    if words.reference is not None:
        return _from_counts(path, words)
    return read_spectrum(
        path,
        signal=words.signal,
        columns=words.columns,
        wavelength_unit=words.wavelength_unit,
        signal_unit=words.signal_unit,
        range=spanned(words.range),
        noise=words.noise,
        polarisation=words.polarisation,
        calibrated=False if scaled else None,
        folded=bool(words.folded),
        analyser=words.analyser,
        spot=words.spot,
    )


def spanned(given: str | tuple[float, float] | None) -> tuple[float, float] | None:
    """The wavelengths to keep (nm), however they were written. Raises UsageError."""
    if not isinstance(given, str):
        return given
    from pellicle.recipes.number_words import parse_range

    return parse_range(given, "`range`")


def _from_counts(path: str, words: ReadWords) -> Any:
    """Reflectance from raw counts of a sample and of a bare reference (a polished surface)."""
    import numpy as np

    from pellicle.data.read_counts import read_counts, reflectance_from_counts
    from pellicle.recipes.media_words import medium
    from pellicle.simulation.functions import reflectance

    if words.signal not in (None, "R"):
        raise UsageError("--reference turns counts into reflectance: leave --signal out, or give R")
    if not isinstance(words.angle, float | int | None):
        raise UsageError("--reference needs a known angle of incidence: give one number")
    options: dict[str, Any] = {"columns": words.columns, "wavelength_unit": words.wavelength_unit}
    sample = read_counts(path, range=spanned(words.range), **options)
    reference = read_counts(str(words.reference), **options)
    dark = None if words.dark is None else read_counts(words.dark, **options)
    material = medium(words.reference_material, name="`reference_material`")
    known = reflectance(
        sample.wavelength,
        0.0,
        1.0,
        material,
        angle=words.angle or 0.0,
        polarisation=words.polarisation or "unpolarised",
    )
    return reflectance_from_counts(sample, reference, np.asarray(known), dark, noise=words.noise)
