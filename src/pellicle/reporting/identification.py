"""Report, JSON record, page and folder of an identification, with a recipe for each hypothesis left."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from pellicle.files import MARKER, new_folder
from pellicle.fitting.status import describe
from pellicle.identification.hypothesis import Hypothesis, Identification, Outcome, SupposedLayer
from pellicle.recipes.write import recipe_text
from pellicle.reporting.folders import PAGE, REPORT
from pellicle.reporting.identification_figures import SHOWN, draw, evidence_figure, file_names, of_spectrum
from pellicle.reporting.json_record import failed, parameter_record, strict, taken, versions, write_result
from pellicle.reporting.page.document import Table, page
from pellicle.reporting.plain_text import INDENT, blocks_of, table, wrapped

SCHEMA = "pellicle.identify/1"
_TONES = {Outcome.IDENTIFIED: "good", Outcome.UNDECIDED: "warn"}
"""Class of the page's style for each outcome; of the others it is "bad"."""


def report(found: Identification) -> str:
    """Format the verdict and a table of hypotheses: evidence, residuals, numbers."""
    points = sum(len(x) for x in found.data)
    names = ", ".join(file_names(found))
    verdict = [*wrapped(f"{found.status.value}: {found.verdict}"), *wrapped(f"{names}: {points} points")]
    rows = [("", *HEAD)]
    rows += [("*" * (x in found.hypotheses), x.name, *cells) for x, cells in rows_of(found)]
    notes = [
        "* left by the data",
        _RESIDUALS,
        *(f"not tried: {x.material}, {x.why}" for x in found.not_tried),
    ]
    body = [*table(rows), "", *(INDENT + note for note in notes)]
    return blocks_of([("Verdict", verdict), ("Hypotheses", body)])


HEAD = "hypothesis", "probability", "Δ ln Z", "residuals", "numbers"
_RESIDUALS = "residuals that no systematic effect explains are in units of the noise"


def rows_of(found: Identification) -> list[tuple[Hypothesis, tuple[str, str, str, str]]]:
    """Each hypothesis that is shown, with its probability, evidence, residuals and numbers in words."""
    every, rows = (*found.hypotheses, *found.excluded), []
    least = max((x.ln_z for x in every), default=0.0)
    for i, x in enumerate(every[: len(found.hypotheses) + SHOWN]):
        numbers = ", ".join(describe(own) for own in x.parameters.values())
        numbers = f"oxide {numbers}" if x.name == "bare substrate" else numbers
        share = f"{x.probability:.2g}" if i < len(found.hypotheses) else ""
        rows.append((x, (share, f"{x.ln_z - least:.1f}", f"{x.remaining:.3g}", numbers)))
    return rows


def to_json(found: Identification) -> dict[str, Any]:
    """Convert an identification to dictionaries."""
    least = max((x.ln_z for x in (*found.hypotheses, *found.excluded)), default=0.0)
    data = [taken(x, "path", "sha256", "signal") | {"points": len(x)} for x in found.data]
    record = {
        "schema": SCHEMA,
        "data": data[0] if len(data) == 1 else data,
        "status": found.status.value,
        "verdict": found.verdict,
        "hypotheses": [_hypothesis(x) for x in found.hypotheses],
        "excluded": [
            taken(x, "name", "remaining", "status") | {"delta_ln_z": x.ln_z - least} for x in found.excluded
        ],
        "not_tried": [vars(x) for x in found.not_tried],
        "would_decide": [vars(x) for x in found.would_decide],
        "versions": versions(),
        "seconds": found.seconds,
    }
    return strict(record)


def failure(paths: Sequence[str], error: str) -> dict[str, Any]:
    """Build the record of data that could not be identified."""
    data = {"path": ", ".join(paths), "sha256": None, "signal": None, "points": 0}
    return failed(SCHEMA, data, error)


def _hypothesis(x: Hypothesis) -> dict[str, Any]:
    return {
        "name": x.name,
        "layers": [_layer(layer) for layer in x.layers],
        **taken(x, "effects", "condition", "probability", "ln_z", "remaining", "status"),
        "parameters": {name: parameter_record(own) for name, own in x.parameters.items()},
    }


def _layer(layer: SupposedLayer) -> dict[str, Any]:
    own = layer.thickness
    thickness = [own.value, own.stderr, own.stderr_noise]
    return taken(layer, "material", "like", "n", "k") | {"thickness": thickness}


def write_identification(
    folder: str | os.PathLike[str],
    found: Identification,
    reading: Mapping[str, Any] = MappingProxyType({}),
    tables: Sequence[Mapping[str, Any]] = (),
) -> Path:
    """Write report.txt, report.html, figure.png, result.json and a recipe of each hypothesis that is left,
    `1.toml` and on.

    `reading` has the options by which the files were read, and `tables` those of each file where they differ.
    Returns the folder. Raises UsageError for a folder with other files.
    """
    target = new_folder(folder)
    contents = {REPORT: report(found), PAGE: identification_page(found)}
    files = list(dict.fromkeys(x.path for x in found.data if x.path))
    options = dict(reading) | ({"joint": True} if len(files) > 1 else {})
    if any(x.left_out is not None for x in found.data):
        nm = np.concatenate([x.wavelength for x in found.data])
        options["range"] = [float(nm.min()), float(nm.max())]
    if all(x.folded for x in found.data):
        options["folded"] = True
    elif folded := {x.path for x in found.data if x.folded}:
        known = {x["path"]: x for x in tables}
        own = [known.get(path, {"path": path}) for path in files]
        tables = [{**x, "folded": True} if x["path"] in folded else x for x in own]
    stated = {name: x for name, x in options.items() if name in ("signal", "polarisation", "transmission")}
    for number, x in enumerate(found.hypotheses, 1):
        scene = x.scene()
        scene = replace(scene, light=replace(scene.light, **stated))  # as the recipe states it
        contents[f"{number}.toml"] = recipe_text(
            scene, target, files=[] if tables else files, reading=options, tables=tables
        )
    earlier = _recipes(target)
    write_result(target, to_json(found), contents | {"figure.png": draw(found)})
    for name in earlier - contents.keys():
        (target / name).unlink(missing_ok=True)
    return target


def _recipes(folder: Path) -> set[str]:
    """Names of the recipes that an earlier identification wrote into a folder."""
    with suppress(OSError, ValueError):
        record = json.loads((folder / MARKER).read_text(encoding="utf-8"))
        return {f"{number + 1}.toml" for number in range(len(record.get("hypotheses", ())))}
    return set()


def identification_page(found: Identification) -> str:
    """Format an identification as a page: its data with the curves of hypotheses, the evidence of each,
    recipes of those that are left, what was not tried, and what to measure next."""
    spectra, evidence = [of_spectrum(found, i) for i in range(len(found.data))], evidence_figure(found)
    rows = [
        {"name": x.name, "number": i, "left": i < len(found.hypotheses), "cells": cells}
        for i, (x, cells) in enumerate(rows_of(found))
    ]
    left_out = [(x.material, x.why) for x in found.not_tried]
    would = [(x.signal, f"{x.angle:g}°", f"{x.delta_ln_z:.3g}") for x in found.would_decide]
    return page(
        "identification.html",
        ", ".join(file_names(found)),
        [*spectra, evidence],
        tone=_TONES.get(found.status, "bad"),
        **taken(found, "status", "verdict"),
        data_figures=spectra,
        evidence=evidence,
        head=HEAD,
        rows=rows,
        note=_RESIDUALS,
        condition=any(x.condition for x in found.hypotheses),
        not_tried=Table("Materials, structures and effects that were not tried", ("name", "why"), left_out),
        would_decide=Table("Measurements that would decide", ("signal", "angle", "Δ ln Z to expect"), would),
    )
