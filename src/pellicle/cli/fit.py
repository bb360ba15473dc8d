"""`pellicle fit`: measured spectra in, a report out."""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Annotated

from cyclopts import Group, Parameter

from pellicle.cli import brdf
from pellicle.cli.batch import Batch, Look
from pellicle.cli.options import ReadWords, SceneWords, light, merged, scene_from_words
from pellicle.cli.session import not_negative, say, start
from pellicle.errors import DataError, UsageError

if TYPE_CHECKING:
    from pellicle.io.recipe import Recipe

_scene = Group("Scene", sort_key=1)
_instrument = Group("Instrument", sort_key=2)
_reading = Group("Reading", sort_key=3)
_output = Group("Output", sort_key=4)


def _flag(group: Group, help: str) -> Parameter:
    return Parameter(group=group, help=help)


def fit(
    *data: Annotated[str, Parameter(help="Files to fit, one by one.")],
    recipe: Annotated[str | None, _flag(_scene, "A TOML file that describes the scene.")] = None,
    layer: Annotated[
        str | None,
        _flag(
            _scene,
            "The layer: a material (SiO2), an index (1.46, 2.9+0.1j), an n,k CSV, or a model: cauchy, "
            "cauchy-urbach, sellmeier, lorentz, drude, gaussian, tauc-lorentz, cody-lorentz, spline or "
            "spline-kk, its numbers free; cauchy(1.46,3000) fixes them. A recipe also mixes and adds models.",
        ),
    ] = None,
    substrate: Annotated[str | None, _flag(_scene, "What it lies on; the same words.")] = None,
    ambient: Annotated[str | None, _flag(_scene, "What it is seen from (air).")] = None,
    thickness: Annotated[str | None, _flag(_scene, "LO:HI in nm (1:5000), or one number to fix it.")] = None,
    free: Annotated[str | None, _flag(_scene, "Numbers of the layer to free: n,k or n=1.3:1.7.")] = None,
    back: Annotated[str | None, _flag(_scene, "The substrate is a plate; the medium behind it.")] = None,
    plate_mm: Annotated[float | None, _flag(_scene, "The plate's thickness in mm (1).")] = None,
    scale: Annotated[str | None, _flag(_instrument, "free, slow or a number (1).")] = None,
    offset: Annotated[str | None, _flag(_instrument, "free, slow or a number (0).")] = None,
    bandwidth: Annotated[
        str | None, _flag(_instrument, "Full width at half maximum in nm, free, or LO:HI.")
    ] = None,
    signal: Annotated[str | None, _flag(_reading, "R, T or psi-delta, where the file does not say.")] = None,
    angle: Annotated[float | None, _flag(_reading, "Angle of incidence in degrees (0).")] = None,
    polarisation: Annotated[str | None, _flag(_reading, "s, p or unpolarised.")] = None,
    range: Annotated[str | None, _flag(_reading, "Wavelengths to keep, LO:HI in nm.")] = None,
    noise: Annotated[
        float | None, _flag(_reading, "Standard deviation of every point; degrees for psi-delta.")
    ] = None,
    columns: Annotated[str | None, _flag(_reading, "Names of the columns in order, _ to skip.")] = None,
    wavelength_unit: Annotated[str | None, _flag(_reading, "nm, um, A, eV or cm-1.")] = None,
    signal_unit: Annotated[str | None, _flag(_reading, "fraction or percent.")] = None,
    reference: Annotated[
        str | None, _flag(_reading, "Raw counts of a bare reference: DATA are raw counts too.")
    ] = None,
    reference_material: Annotated[str, _flag(_reading, "What the reference is.")] = "Si",
    dark: Annotated[str | None, _flag(_reading, "Raw counts without light.")] = None,
    folded: Annotated[
        bool, Parameter(group=_reading, help="Δ is known in 0 to 180 degrees only.", negative="")
    ] = False,
    analyser: Annotated[
        float | None, _flag(_reading, "Of columns alpha and beta: the analyser's angle in degrees.")
    ] = None,
    spot: Annotated[int | None, _flag(_reading, "Which spot of an Accurion file, from 1.")] = None,
    joint: Annotated[
        bool, Parameter(group=_scene, help="All files are of one sample: fit them together.", negative="")
    ] = False,
    tolerance: Annotated[
        float, _flag(_scene, "Leave out effects that change the signal by less than this; 0 leaves none out.")
    ] = 0.0,
    out: Annotated[str | None, _flag(_output, "A folder for report, figure and tables.")] = None,
    json: Annotated[bool, Parameter(group=_output, help="One JSON object a line.", negative="")] = False,
) -> int:
    """Fit a layer to measured reflectance, transmittance, ellipsometry, or samples of a BRDF.

    Example: pellicle fit oxide.csv --layer SiO2 --substrate Si --thickness 10:3000
    """
    scene_words = SceneWords(
        layer, substrate, ambient, thickness, free, back, plate_mm, scale, offset, bandwidth
    )
    reading = ReadWords(
        signal,
        angle,
        polarisation,
        _range(range),
        noise,
        columns,
        wavelength_unit,
        signal_unit,
        reference,
        reference_material,
        dark,
        folded or None,
        analyser,
        spot,
    )
    if brdf.wanted(recipe, reading.signal):
        of_films = [*(["--joint"] if joint else []), *(["--tolerance"] if tolerance else [])]
        return brdf.fit_surface(
            list(data), str(recipe), [*scene_words.given(), *of_films], reading, out, json
        )
    _check(reading)
    not_negative("--tolerance", tolerance)
    looks, together = _what(list(data), recipe, scene_words, reading)
    from pellicle.fitting.fit import check_free

    try:
        for look in looks:
            check_free(look.scene)
    except UsageError as error:
        if recipe is None:
            raise
        raise DataError(f"{recipe}: {error}") from None
    start()
    joint = joint or together
    return Batch(out, json, joint, tolerance)([looks] if joint else [[look] for look in looks])


def _range(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    from pellicle.io.span import span

    return span(text, "--range")


def _check(reading: ReadWords) -> None:
    if reading.signal not in (None, "R", "T", "psi-delta"):
        raise UsageError(f"--signal must be R, T or psi-delta, not {reading.signal!r}")
    if reading.angle is not None and not 0 <= reading.angle <= 90:
        raise UsageError(f"--angle must lie in 0 to 90 degrees, got {reading.angle:g}")
    if reading.polarisation not in (None, "s", "p", "unpolarised"):
        raise UsageError(f"--polarisation must be s, p or unpolarised, not {reading.polarisation!r}")
    if reading.noise is not None and not 0 < reading.noise < inf:
        raise UsageError(f"--noise must be a standard deviation above zero, got {reading.noise:g}")
    if reading.dark is not None and reading.reference is None:
        raise UsageError("--dark needs --reference: the counts of a sample of known reflectance")
    _check_units(reading)


def _check_units(reading: ReadWords) -> None:
    from pellicle.io.units import SIGNAL_UNITS, WAVELENGTH_UNITS, signal_unit, wavelength_unit

    for flag, given, known, find in (
        ("--wavelength-unit", reading.wavelength_unit, WAVELENGTH_UNITS, wavelength_unit),
        ("--signal-unit", reading.signal_unit, SIGNAL_UNITS, signal_unit),
    ):
        if given is not None and find(given) is None:
            raise UsageError(f"{flag} must be one of {', '.join(known)}, not {given!r}")


def _what(files: list[str], recipe: str | None, words: SceneWords, reading: ReadWords):
    """The files with their scenes, and whether they are of one sample, from a recipe or from flags."""
    if recipe is None:
        if not files:
            raise UsageError("no data: name the file to fit, as in pellicle fit oxide.csv --layer SiO2 ...")
        scene, assumed = scene_from_words(words, reading)
        say(*assumed)
        return [Look(file, scene, reading) for file in files], False
    from pellicle.io.recipe import read_recipe

    if words.given():
        raise UsageError(f"{', '.join(words.given())} and --recipe exclude each other: put it in the recipe")
    found = read_recipe(recipe)
    if found.each and files:
        raise UsageError(f"{recipe}: [[data.file]] and files on the command line exclude each other")
    files = files or found.files
    if not files:
        raise UsageError(f"{recipe}: names no data files: give them on the command line or in [data] files")
    recipes = found.each or [found] * len(files)
    looks = [_look(file, one, reading) for file, one in zip(files, recipes, strict=True)]
    return looks, found.tables.data.joint


def _look(file: str, recipe: Recipe, reading: ReadWords) -> Look:
    import equinox as eqx

    reading = merged(reading, recipe)
    scene = eqx.tree_at(lambda s: s.light, recipe.scene(), light(reading))
    return Look(file, scene, reading, any(own.rescales for own in recipe.tables.data.file))
