"""Movies of a film: report, JSON record, table, figure, page and folder of its thickness in space and
time."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.files import replacing, write_text
from pellicle.fitting.batch.data import STATUSES
from pellicle.mapping.growth import TIME
from pellicle.mapping.movie import MovieResult
from pellicle.mapping.thinning_law import FORMULAS, Law
from pellicle.reporting import matplotlib_figure
from pellicle.reporting.drawable import SERIES, Line, Panel, Raster, Section, Table, labelled
from pellicle.reporting.folders import PAGE, REPORT
from pellicle.reporting.json_record import strict, versions, write_result
from pellicle.reporting.map_summary import is_decided
from pellicle.reporting.map_text import ADVICE
from pellicle.reporting.page.document import Table as PageTable
from pellicle.reporting.page.document import page, picture
from pellicle.reporting.plain_text import blocks_of, csv_text, facts, wrapped
from pellicle.reporting.series import CSV, FIGURE, NETCDF, SCHEMA

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ERRORS = (
    "The standard error (`stderr`) contains errors of the index, the wavelength, the gain and the dark level,"
    " which all places have in common; that of the noise alone is `stderr_noise`. A thinning law has the"
    " errors of its own residuals."
)


def report(made: MovieResult) -> str:
    """Format a movie as text: the verdict, thicknesses and thinning laws."""
    return blocks_of(
        [
            ("Movie", [*wrapped(verdict(made)), *facts(_file_rows(made))]),
            ("Thickness", facts(_value_rows(made))),
            ("Thinning laws", facts(_law_rows(made))),
            ("Warnings", [line for text in made.warnings for line in wrapped(text, "- ", "  ")]),
            ("Status: what to do", facts(_status_rows(made))),
            ("Errors", wrapped(_ERRORS)),
        ]
    )


def verdict(made: MovieResult) -> str:
    """The result in words: whether the order is decided, by which evidence, and the best thinning law."""
    counts = ", ".join(f"{count} {word}" for word, count in made.status.items())
    frames, *shape = made.dataset["status"].shape
    size = f"{frames} frames at {' x '.join(map(str, shape))} places: {counts}."
    if made.decided < 0.5:
        return f"{size} The order of interference is not determined by this movie."
    by = "continuity"
    if made.black is not None:
        place, time = made.black
        by += f" from the black film, first seen at {made.where(place)} from {time:.4g} {_unit(made)} on"
    first = next((laws[0] for laws in made.laws if laws), None)
    thins = "" if first is None else f" It thins as {FORMULAS[first.name]}: {_numbers(first, _unit(made))}."
    return f"{size} The order of interference is decided by {by}.{thins}"


def to_json(made: MovieResult) -> dict[str, Any]:
    """Convert to the dictionary of the record; thicknesses are in the NetCDF file and the table."""
    data, unit = made.dataset, _unit(made)
    times = np.asarray(data[TIME], float)
    black = None if made.black is None else {"place": made.where(made.black[0]), "time": made.black[1]}
    return strict(
        {
            "schema": SCHEMA,
            "data": {"path": made.path},
            "summary": verdict(made),
            "times": {"count": len(times), "unit": unit, "values": times},
            "status": made.status,
            "black_film": black,
            "thinning": [
                {"place": made.where(place), "law": law.name, "formula": FORMULAS[law.name]}
                | {"parameters": {k: {"value": v, "stderr": e} for k, (v, e) in law.numbers.items()}}
                | {"rms": law.rms, "worse": law.worse}
                for place, laws in zip(made.places, made.laws, strict=True)
                for law in laws
            ],
            "breaks": list(made.breaks),
            "warnings": list(made.warnings),
            "notes": list(made.notes),
            "versions": versions(),
        }
    )


def write_movie(
    folder: str | os.PathLike[str], made: MovieResult, again: Sequence[tuple[str, str]] = ()
) -> Path:
    """Write series.nc, series.csv, result.json, report and figure into a folder, and return it.

    `again` is what repeats it: descriptions and texts.

    **Raises:** UsageError where the folder holds files that pellicle did not write, or cannot be written.
    """
    figure, image = draw(made), io.BytesIO()
    figure.savefig(image, format="png")
    contents: dict[str, Any] = {REPORT: report(made), CSV: csv_text(_table(made)), FIGURE: figure}
    target = write_result(folder, to_json(made), contents)
    with replacing(target / NETCDF, overwrite=True) as draft:
        made.dataset.to_netcdf(draft, engine="h5netcdf")
    write_text(target / PAGE, _page(made, image.getvalue(), again), overwrite=True)
    return target


def draw(made: MovieResult) -> Figure:
    """Draw the decided thicknesses along a line against time, and those of chosen places with their laws."""
    data, unit = made.dataset, _unit(made)
    time, decided = np.asarray(data[TIME], float), is_decided(data["status"].values)
    shown = np.where(decided, np.asarray(data["thickness"], float), np.nan)
    dim, line = made.dims[0], "along the line" if len(made.dims) == 1 else "through the middle"
    if len(made.dims) == 2:
        shown = shown[:, :, shown.shape[2] // 2]
    panels = []
    if np.isfinite(shown).any():
        told = f"thickness {line}: dark {np.nanmin(shown):.4g} nm, bright {np.nanmax(shown):.4g} nm"
        where = np.asarray(data[dim], float)
        raster = Raster(time, where, shown.T, positive=True)
        down = (float(where[-1]), float(where[0]))  # the top of the film on top
        panels = [Panel(f"{dim} (pixels)", height=2.4, title=told, raster=raster, limits=down)]
    flat = np.where(decided, np.asarray(data["thickness"], float), np.nan).reshape(len(time), -1)
    lines = []
    for i, (place, laws) in enumerate(zip(made.places, made.laws, strict=True)):
        colour, after = SERIES[i % len(SERIES)], time > 0
        lines.append(Line(time[after], flat[after, place], made.where(place), colour, "point"))
        if laws:
            best = laws[0].thickness(time[after])
            known = np.isfinite(flat[after, place])
            lines.append(
                Line(time[after], np.where(known, best, np.nan), laws[0].name, "data", listed=i == 0)
            )
    thin = Panel("thickness (nm)", lines, height=2.6, legend="above", scale="log", abscissa="log")
    label = labelled("time", unit)
    sections = [Section(label, [[panel] for panel in panels])] if panels else []
    if any(np.isfinite(one.y).any() for one in lines):
        sections.append(Section(label, [[thin]]))
    if not sections:
        sections = [Section(label, [[Panel("", title="no thickness is decided")]])]
    return matplotlib_figure.draw(sections, f"{Path(made.path).name}\n{verdict(made).split('. ')[0]}.")


def _unit(made: MovieResult) -> str:
    return str(made.dataset[TIME].attrs["units"])


def _numbers(law: Law, unit: str) -> str:
    """The numbers of a law with their errors, but for the factor."""
    units = {"time constant": f" {unit}", "origin": f" {unit}"}
    named = (
        f"{name} {value:.4g} ± {error:.2g}{units.get(name, '')}"
        for name, (value, error) in law.numbers.items()
        if name != "A"
    )
    return ", ".join(named)


def _law_rows(made: MovieResult) -> list[tuple[str, str]]:
    rows = []
    for place, laws in zip(made.places, made.laws, strict=True):
        for i, law in enumerate(laws):
            told = f"{FORMULAS[law.name]}: {_numbers(law, _unit(made))}, rms {100 * law.rms:.2g} %"
            rows.append(("" if i else made.where(place), told + (f", worse by {law.worse:.3g}" if i else "")))
    return rows


def _value_rows(made: MovieResult) -> list[tuple[str, str]]:
    data = made.dataset
    used = is_decided(data["status"].values)
    if not used.any():
        return []
    value = np.asarray(data["thickness"], float)[used]
    error, noise = (
        np.nanmedian(np.asarray(data[f"thickness{key}"], float)[used]) for key in ("_stderr", "_stderr_noise")
    )
    low, middle, high = np.percentile(value, [0, 50, 100])
    return [
        ("decided", f"{low:.4g} to {high:.4g} nm, {middle:.4g} nm in the median"),
        ("error", f"standard error {error:.2g} nm (median), of the noise {noise:.2g} nm"),
    ]


def _status_rows(made: MovieResult) -> list[tuple[str, str]]:
    return [(word, advice) for word, advice in ADVICE.items() if word in made.status]


def _file_rows(made: MovieResult) -> list[tuple[str, str]]:
    first, last = np.asarray(made.dataset[TIME], float)[[0, -1]]
    rows = [("frames", made.path), ("times", f"{first:.6g} to {last:.6g} {_unit(made)}")]
    return [*rows, *(("read" if i == 0 else "", note) for i, note in enumerate(made.notes))]


def _table(made: MovieResult) -> Table:
    """A row for each time: the mean, and the chosen places."""
    data, count = made.dataset, made.dataset.sizes[TIME]
    columns: dict[str, Any] = {f"time_{_unit(made)}": np.asarray(data[TIME], float)}
    columns["mean_thickness_nm"] = np.asarray(data["mean_thickness"], float)
    for place in made.places:
        where = made.where(place).replace(", ", "_").replace(" ", "_")
        for name in ("thickness", "thickness_stderr", "thickness_stderr_noise"):
            columns[f"{name}_nm_{where}"] = np.asarray(data[name], float).reshape(count, -1)[:, place]
        codes = data["status"].values.reshape(count, -1)[:, place]
        columns[f"status_{where}"] = [STATUSES[code] for code in codes]
    return Table(columns)


def _page(made: MovieResult, image: bytes, again: Sequence[tuple[str, str]]) -> str:
    sentences = [verdict(made), *(f"{text[0].upper()}{text[1:]}." for text in made.warnings)]
    return page(
        "map.html",
        f"Movie {Path(made.path).name}",
        [],
        kind="Movie of a film",
        tone="good" if made.decided >= 0.5 else "warn",
        sentence=" ".join(sentences),
        pictures=[picture(image, verdict(made))],
        errors=_ERRORS,
        parameters=PageTable("Thickness", (), _value_rows(made)),
        rates=PageTable("Thinning laws", (), _law_rows(made)),
        statuses=PageTable("Statuses, and what to do", (), _status_rows(made)),
        plan=PageTable("", (), []),
        file=PageTable("Frames, and how they were read", (), _file_rows(made)),
        again=again,
    )
