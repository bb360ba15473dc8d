"""`pellicle identify`: the film on a known substrate, from files of one sample."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from pellicle.api.data_files import check_words, is_of_colours, read
from pellicle.cli.batch import written
from pellicle.cli.flags import OUTPUT, SCENE, FileFlags, flag, switch
from pellicle.cli.messages import Progress, show
from pellicle.cli.session import GOOD, UNCLEAR, check_folder, error_message, reported, start
from pellicle.data.options import CONDITIONS, FileOptions, parse_number
from pellicle.errors import UsageError

if TYPE_CHECKING:
    from pellicle.data.spectrum import Spectrum


def identify(
    *data: Annotated[str, Parameter(help="Files of one sample, which count together.")],
    substrate: Annotated[str | None, flag(SCENE, "Substrate: a material (Si), an index or a file.")] = None,
    back: Annotated[str | None, flag(SCENE, "Medium behind the substrate, where it is a plate.")] = None,
    ambient: Annotated[str | None, flag(SCENE, "Medium in front of the film (air).")] = None,
    among: Annotated[str | None, flag(SCENE, "Materials to try: SiO2,Si3N4.")] = None,
    family: Annotated[
        str | None,
        flag(SCENE, "Films to try: oxide, nitride, fluoride, polymer, semiconductor or metal (all)."),
    ] = None,
    allow: Annotated[
        str | None, flag(SCENE, "Layers, and mistakes to look for (layers=2,calibration,plate,substrate).")
    ] = None,
    budget: Annotated[str | None, flag(SCENE, "Time after which no more structures are tried: 20s.")] = None,
    next: Annotated[
        bool, switch(SCENE, "Compute which measurement would decide, where several are left.")
    ] = False,
    reading: Annotated[FileFlags | None, Parameter(name="*")] = None,
    out: Annotated[str | None, flag(OUTPUT, "Folder for the report and a recipe of each film.")] = None,
    json: Annotated[bool, switch(OUTPUT, "Print one JSON object.")] = False,
) -> int:
    """Identify a film on a known substrate: which layers, dispersion and effects its spectra need.

    Example: pellicle identify unknown.csv --substrate Si --out found

    Example: pellicle identify R.csv T.csv --substrate BK7 --back air --family oxide

    Example: pellicle identify R8.csv R60.csv --angle 8,60 --substrate Si
    """
    paths, options = list(data), (reading or FileFlags()).options()
    if not paths:
        raise UsageError("no data: name the files, as in pellicle identify oxide.csv --substrate Si")
    if substrate is None:
        raise UsageError("no substrate: an identification needs it, as in --substrate Si")
    if twice := [path for i, path in enumerate(paths) if path in paths[:i]]:
        raise UsageError(f"{twice[0]} is named twice: each file counts as a measurement of its own")
    check_words(options)
    given: dict[str, Any] = {"back": back, "ambient": ambient, "family": family}
    given = {name: value for name, value in given.items() if value is not None} | _allowed(allow)
    if budget is not None:
        given["budget"] = parse_number(budget.removesuffix("s"), "`budget`", "seconds, as in 20s")
        if given["budget"] <= 0:
            raise UsageError(f"--budget must be above 0 seconds, not {budget}")
    if among is not None:
        given["among"] = [word.strip() for word in among.split(",") if word.strip()]
    if out is not None:
        check_folder(out)
    start()
    return _identify(paths, options, substrate, given, next, out, json)


def _identify(
    paths: list[str],
    options: FileOptions,
    substrate: str,
    given: dict[str, Any],
    plan: bool,
    out: str | None,
    json: bool,
) -> int:
    from pellicle.api.identification import identify as identified
    from pellicle.identification.films import chosen
    from pellicle.materials import Material
    from pellicle.recipes.media import medium
    from pellicle.reporting.identification import failure, report, to_json, write_identification

    for name in ("back", "ambient"):
        if name in given:
            given[name] = medium(given[name], name=f"`{name}`")
    below = medium(substrate, name="`substrate`")
    for material in chosen(given.get("among"), given.get("family")):
        if not isinstance(medium(material, name="`among`"), Material):
            raise UsageError(
                f"--among takes materials and files of n and k, not {material}: films of free index are tried"
                " beside these"
            )
    several = options.angle if isinstance(options.angle, list) else []
    if several and len(several) != len(paths):
        raise UsageError(
            f"--angle has {len(several)} angles for {len(paths)} files: give one, or one for each"
        )
    if options.angle is not None and not several:
        given["angle"] = options.angle
    try:
        spectra = [spectrum for path in paths for spectrum in _spectra(path, options)]
        if several:
            spectra = [_at(several[paths.index(x.path)], x) for x in spectra]
        found = identified(spectra, below, **given)
        if plan:
            from pellicle.identification.next_measurement import with_next_measurement

            with Progress("measurements") as progress:
                found = with_next_measurement(found, progress)
    except ValueError as error:
        message = error_message(error, paths)
        return reported(message, failure(paths, message) if json else None)
    show(to_json(found) if json else report(found), out is not None)
    code = GOOD if found.status == "identified" else UNCLEAR
    if out is None:
        return code
    stated = {name: x for name, x in options.given().items() if x is not None and name != "angle"}
    tables = [{"path": path, "angle": angle} for path, angle in zip(paths, several, strict=False)]
    write = partial(write_identification, Path(out), found, stated, tables)
    what = "report and recipes" if found.hypotheses else "report"
    return max(code, written(write, f"{out}: {what} written"))


def _spectra(path: str, options: FileOptions) -> list[Spectrum]:
    """Spectra of a file. Raises UsageError for one of colours."""
    if is_of_colours(path, options):
        raise UsageError(f"{path}: colours cannot be identified: give a spectrum")
    return read(path, options)


def _at(angle: float, spectrum: Spectrum) -> Spectrum:
    """The spectrum at an angle of incidence, unless its file states one."""
    import numpy as np

    return spectrum if spectrum.angle is not None else replace(spectrum, angle=np.full(len(spectrum), angle))


def _allowed(allow: str | None) -> dict[str, Any]:
    """Layers and mistakes of a list such as layers=1,plate. Raises UsageError for another word."""
    if allow is None:
        return {}
    words = [word.strip() for word in allow.split(",")]
    layers = [word.removeprefix("layers=") for word in words if word.startswith("layers=")]
    mistakes = [word for word in words if word not in ("layers=1", "layers=2")]
    if unknown := [word for word in mistakes if word not in CONDITIONS]:
        known = ", ".join(("layers=1", "layers=2", *CONDITIONS))
        raise UsageError(f"--allow takes a list of {known}, not {unknown[0]}")
    return {"allow": mistakes} | ({"layers": int(layers[-1])} if layers else {})
