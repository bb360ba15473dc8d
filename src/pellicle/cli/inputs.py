"""From a command line's words to what is fitted: files, each with the scene that is to explain it."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING

from pellicle.cli.batch import Look
from pellicle.cli.flags import ReadWords, SceneWords
from pellicle.cli.options import light, merged, scene_from_words, spanned
from pellicle.cli.session import say
from pellicle.errors import DataError, UsageError

if TYPE_CHECKING:
    from pellicle.recipes.film import FilmRecipe
    from pellicle.recipes.surface import SurfaceRecipe


def described_by(path: str | None, signal: str | None) -> FilmRecipe | SurfaceRecipe | None:
    """Read the recipe, if there is one. Raises DataError, and UsageError for the signal brdf without one."""
    if path is not None:
        from pellicle.recipes import read_recipe

        return read_recipe(path)
    if signal == "brdf":
        raise UsageError("--signal brdf needs a --recipe that describes the surface under [scene.surface]")
    return None


def groups(
    files: list[str], recipe: FilmRecipe | None, words: SceneWords, reading: ReadWords, joint: bool
) -> tuple[list[list[Look]], bool]:
    """Files that are fitted together, and whether more than one may be. Raises UsageError or DataError."""
    _check(reading)
    reading = replace(reading, range=spanned(reading.range))
    looks, together = _what(files, recipe, words, reading)
    from pellicle.fitting.spectra.fit import check_free

    try:
        for look in looks:
            check_free(look.scene)
    except UsageError as error:
        if recipe is None:
            raise
        raise DataError(f"{recipe.path}: {error}") from None
    joint = joint or together
    return [looks] if joint else [[look] for look in looks], joint


def _check(reading: ReadWords) -> None:
    if reading.signal not in (None, "R", "T", "psi-delta"):
        raise UsageError(f"--signal must be R, T or psi-delta, not {reading.signal!r}")
    if reading.angle is not None and not 0 <= reading.angle <= 90:
        raise UsageError(f"--angle must lie in 0 to 90 degrees, got {reading.angle:g}")
    if reading.polarisation not in (None, "s", "p", "unpolarised"):
        raise UsageError(f"--polarisation must be s, p or unpolarised, not {reading.polarisation!r}")
    if reading.noise is not None and not 0 < reading.noise < inf:
        raise UsageError(f"--noise must be a standard deviation above zero, got {reading.noise:g}")
    if reading.loss is not None:
        from pellicle.fitting.robust_losses import check_loss

        check_loss(reading.loss, "--loss")
    if reading.dark is not None and reading.reference is None:
        raise UsageError("--dark needs --reference: the counts of a sample of known reflectance")
    _check_units(reading)


def _check_units(reading: ReadWords) -> None:
    from pellicle.data.tabular.units import SIGNAL_UNITS, WAVELENGTH_UNITS, signal_unit, wavelength_unit

    for flag, given, known, find in (
        ("--wavelength-unit", reading.wavelength_unit, WAVELENGTH_UNITS, wavelength_unit),
        ("--signal-unit", reading.signal_unit, SIGNAL_UNITS, signal_unit),
    ):
        if given is not None and find(given) is None:
            raise UsageError(f"{flag} must be one of {', '.join(known)}, not {given!r}")


def _what(
    files: list[str], recipe: FilmRecipe | None, words: SceneWords, reading: ReadWords
) -> tuple[list[Look], bool]:
    """The files with their scenes, and whether they are of one sample, from a recipe or from flags."""
    if recipe is None:
        if not files:
            raise UsageError(
                "no data: name the file, as in pellicle fit oxide.csv --layer SiO2 --substrate Si, or give a "
                "--recipe that does; pellicle demo shows it all, --help every flag"
            )
        scene, assumed = scene_from_words(words, reading)
        say(*assumed)
        return [Look(file, scene, reading) for file in files], False
    if words.given():
        raise UsageError(f"{', '.join(words.given())} and --recipe exclude each other: put it in the recipe")
    if recipe.each and files:
        raise UsageError(f"{recipe.path}: [[data.file]] and files on the command line exclude each other")
    files = files or recipe.files
    if not files:
        raise UsageError(
            f"{recipe.path}: names no data files: give them on the command line or in [data] files"
        )
    recipes = recipe.each or [recipe] * len(files)
    looks = [_look(file, one, reading) for file, one in zip(files, recipes, strict=True)]
    return looks, recipe.tables.data.joint


def _look(file: str, recipe: FilmRecipe, reading: ReadWords) -> Look:
    import equinox as eqx

    reading = merged(reading, recipe)
    scene = eqx.tree_at(lambda s: s.light, recipe.scene(), light(reading))
    return Look(file, scene, reading, any(own.rescales for own in recipe.tables.data.file))
