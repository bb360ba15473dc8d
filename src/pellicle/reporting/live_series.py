"""Live series: line, JSON record, table and page of a film whose spectra are fitted as they arrive."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.errors import UsageError
from pellicle.fitting.batch.data import BY_NEIGHBOURS
from pellicle.fitting.parameter import Parameter
from pellicle.fitting.result import Status
from pellicle.fitting.status import with_error
from pellicle.mapping.live_series import LiveFit
from pellicle.mapping.store import variable_name
from pellicle.reporting.drawable import Line, Panel, Section, labelled
from pellicle.reporting.json_record import strict
from pellicle.reporting.page.document import Table, page
from pellicle.reporting.plain_text import csv_rows, with_unit
from pellicle.reporting.plotly_figure import figure

SCHEMA = "pellicle.watch/1"
CSV = "watch.csv"
_DECIDED = str(Status.CONVERGED), BY_NEIGHBOURS
_LISTED = 20
"""Latest files in the table of the page."""
_VALUES = "values", "stderr", "stderr_noise"
_OTHERS = "rival_delta_chi2", "chi2_reduced", "rms"


def line(fit: LiveFit, parameters: Sequence[Parameter], unit: str) -> str:
    """Format a fit as a line: file, time, values with errors, status."""
    if fit.error:
        return f"{fit.file}: not fitted: {fit.error}"
    numbers = zip(parameters, fit.values, fit.stderr, strict=True)
    values = [f"{p.name} {with_unit(with_error(value, error), p.unit)}" for p, value, error in numbers]
    jump = ", after a jump" if fit.jump else ""
    return f"{fit.file}: {fit.time:.6g} {unit}, {', '.join(values)}, {fit.status}{jump}"


def to_json(fit: LiveFit, parameters: Sequence[Parameter], unit: str, folder: Path) -> dict[str, Any]:
    """Convert to the dictionary of the record."""
    about = {"schema": SCHEMA, "data": {"path": str(folder / fit.file)}, "status": fit.status}
    if fit.error:
        return about | {"error": fit.error}
    numbers = zip(parameters, fit.values, fit.stderr, fit.stderr_noise, strict=True)
    found = {
        p.name: {"value": value, "stderr": error, "stderr_noise": noise, "unit": p.unit}
        for p, value, error, noise in numbers
    }
    found = {"time": {"value": fit.time, "unit": unit}, "parameters": found}
    return strict(about | found | {name: getattr(fit, name) for name in (*_OTHERS, "jump")})


def head(parameters: Sequence[Parameter], unit: str) -> list[str]:
    """Names of the columns of the table, with their units."""
    names = []
    for p in parameters:
        ends = ["", "_stderr", "_stderr_noise"]
        names += ["_".join(filter(None, [variable_name(p.name) + end, p.unit])) for end in ends]
    return ["file", f"time_{unit}", "status", *names, *_OTHERS, "jump", "bytes", "error"]


def row(fit: LiveFit, parameters: Sequence[Parameter]) -> str:
    """Format a fit as a row of the table."""
    found = [getattr(fit, name) or (np.nan,) * len(parameters) for name in _VALUES]
    numbers = [one[i] for i in range(len(parameters)) for one in found]
    others = [getattr(fit, name) for name in _OTHERS]
    cells = [fit.file, fit.time, fit.status, *numbers, *others, int(fit.jump), fit.size, fit.error]
    return csv_rows([f"{i}" for i in range(len(cells))], [cells]).partition("\n")[2]


def read(text: str, parameters: Sequence[Parameter], path: Path) -> tuple[list[LiveFit], str]:
    """Read the table of an earlier run; returns its fits, the last one of each file, and the unit of times.

    A last row without its end, of a machine that lost its power, is left out.

    **Raises:** UsageError for another table.
    """
    rows = list(csv.reader(StringIO(text[: text.rfind("\n") + 1])))
    unit = rows[0][1].removeprefix("time_") if rows and len(rows[0]) > 1 else ""
    if not rows or rows[0] != head(parameters, unit):
        raise UsageError(f"{path}: is the table of another scene; choose another `out`")
    fits: dict[str, LiveFit] = {}
    for file, time, status, *cells in rows[1:]:
        numbers = [float(cell or "nan") for cell in cells[:-1]]
        fitted = 0 if cells[-1] else 3 * len(parameters)
        values = [tuple(numbers[i:fitted:3]) for i in range(3)]
        *others, jump, size = numbers[3 * len(parameters) :]
        found = zip((*_VALUES, *_OTHERS), (*values, *others), strict=True)
        about: dict[str, Any] = dict(found)
        about |= {"jump": bool(jump), "error": cells[-1]}
        fits.pop(file, None)
        fits[file] = LiveFit(file, int(size), float(time or "nan"), status, **about)
    return list(fits.values()), unit


def live_page(
    fits: Sequence[LiveFit], parameters: Sequence[Parameter], unit: str, title: str, count: int
) -> str:
    """Format the page of a live series after so many fits, which asks its server for `news`."""
    told = news(fits, parameters, unit)
    return page("watch.html", title, told["figures"], drawn=told.pop("figures"), count=count, **told)


def news(fits: Sequence[LiveFit], parameters: Sequence[Parameter], unit: str) -> dict[str, Any]:
    """Parts of the page that change: a sentence, the latest files, and the figure."""
    failed = sum(bool(fit.error) for fit in fits)
    decided = sum(fit.status in _DECIDED for fit in fits)
    counted = f"{len(fits)} files: {decided} decided, {len(fits) - decided - failed} not, {failed} not fitted"
    last = f"{counted}. Last: {line(fits[-1], parameters, unit)}" if fits else "Waiting for files."
    rows = []
    for fit in fits[: -_LISTED - 1 : -1]:
        numbers = zip(parameters, fit.values, fit.stderr, strict=False)
        values = [with_unit(with_error(value, error), p.unit) for p, value, error in numbers]
        values = [value.replace(" ", "\u00a0") for value in values]
        values, time = values or [""] * len(parameters), "" if fit.error else f"{fit.time:.6g}"
        rows.append([fit.file, time, *values, fit.error or fit.status + ", after a jump" * fit.jump])
    heads = ["file", labelled("time", unit), *(p.name for p in parameters), "status"]
    drawn = [live_figure(fits, parameters, unit)]
    latest = Table("The latest files, the newest first", heads, rows)
    return {"sentence": last, "latest": latest, "figures": drawn}


def live_figure(fits: Sequence[LiveFit], parameters: Sequence[Parameter], unit: str) -> dict[str, Any]:
    """The figure of the page: parameters against time, those that are decided and the others."""
    fitted = sorted((fit for fit in fits if not fit.error), key=lambda fit: fit.time)
    time, panels = np.array([fit.time for fit in fitted]), []
    decided = np.array([fit.status in _DECIDED for fit in fitted], bool)
    for i, p in enumerate(parameters):
        value, error = (np.array([getattr(f, key)[i] for f in fitted]) for key in ("values", "stderr_noise"))
        error = np.where(np.isfinite(error), error, 0.0)
        lines = [
            Line(time[decided], value[decided], "decided", "fit", "point", errors=error[decided]),
            Line(time[~decided], value[~decided], "not decided", "blue", "cross", errors=error[~decided]),
        ]
        panels.append(Panel(labelled(p.name, p.unit), lines, height=2.4 if p.key == "thickness" else 1.6))
    panels.append(
        Panel("rms of residuals", [Line(time, np.array([f.rms for f in fitted]), "", "data", "point")])
    )
    section = Section(labelled("time", unit), [[panel] for panel in panels])
    caption = "Parameters against time, each file fitted alone, with errors of the noise."
    return figure("watch", caption, section)
