"""Page of several fits: statuses, statistics and a figure of each parameter, a table, scatter of repeats."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import PurePosixPath
from typing import Any
from urllib.parse import quote

import numpy as np

from pellicle.fitting.repeated_measurements import Repeats
from pellicle.fitting.result import Status
from pellicle.fitting.status import with_error
from pellicle.reporting import repeats as repeats_text
from pellicle.reporting.drawable import Line, Panel, Section, Style, labelled
from pellicle.reporting.drawable import Table as Columns
from pellicle.reporting.fit_text import NUISANCE
from pellicle.reporting.page.document import Table, page
from pellicle.reporting.page.fit_pages import TONES
from pellicle.reporting.plotly_figure import figure

Record = Mapping[str, Any]
_MOST_PARAMETERS = 8
"""Columns of free parameters, the first of each file."""
_STYLES: Mapping[str, tuple[Style, str]] = {
    "good": ("circle", "green"),
    "warn": ("diamond", "fit"),
    "bad": ("cross", "red"),
}
"""Symbol and colour of the results of a tone: both differ."""


def batch_page(records: Sequence[Record], pages: Sequence[str | None], repeats: Repeats | None = None) -> str:
    """Format the results of several files as a page.

    **Arguments:** `records`, the JSON records of fits and failures; `pages`, the path of each one's own page
    relative to this one, with slashes, None where there is none; `repeats`, the scatter of their parameters
    where the files are repeated measurements.
    """
    links = [None if each is None else quote(each) for each in pages]
    every = [record["parameters"] for record in records]
    shown = (name for p in every for name in p if p[name]["free"] and not NUISANCE.fullmatch(name))
    # those of the instrument are the last ones
    names = sorted(dict.fromkeys(shown), key=lambda name: name.startswith("instrument."))[:_MOST_PARAMETERS]
    units = {name: next((p[name]["unit"] for p in every if name in p), "") for name in names}
    drawn = [_figure(records, links, name, units[name], i) for i, name in enumerate(names)]
    rows = [_row(record, link, names) for record, link in zip(records, links, strict=True)]
    scatter = None
    if repeats is not None:
        head, *cells = repeats_text.rows(repeats)
        scatter = {"verdict": repeats.verdict, "head": head[1:], "rows": cells}
        scatter |= {"notes": repeats_text.notes(repeats), "warnings": repeats_text.warnings(repeats)}
    counts = Counter(str(record["status"]) for record in records)
    return page(
        "batch.html",
        f"{len(records)} fits",
        drawn,
        figures_of=list(zip(names, drawn, strict=True)),
        statistics=_spread(records, {name: labelled(name, units[name]) for name in names}),
        heads=[(name, units[name]) for name in names],
        rows=rows,
        counts=[(status, TONES[Status(status)], number) for status, number in counts.most_common()],
        repeats=scatter,
    )


def _row(record: Record, link: str | None, names: Sequence[str]) -> dict[str, Any]:
    cells = []
    for name in names:
        p = record["parameters"].get(name)
        if p is None or not p["free"] or p["value"] is None:
            cells.append({"value": "", "text": ""})
            continue
        stderr = math.inf if p["stderr"] is None else p["stderr"]
        cells.append({"value": f"{p['value']:.10g}", "text": with_error(p["value"], stderr)})
    chi2 = record["chi2_reduced"]
    return {
        "name": _name(record),
        "link": link,
        "status": str(record["status"]),
        "tone": TONES[Status(record["status"])],
        "verdict": record.get("error") or record["verdict"],
        "cells": cells,
        "chi2": "" if chi2 is None else f"{chi2:.4g}",
        "warnings": len(record["warnings"]),
    }


def _spread(records: Sequence[Record], labels: Mapping[str, str]) -> Table:
    """Statistics of each parameter over the files whose fits have converged; `labels` are by name."""
    found = [record["parameters"] for record in records if record["status"] == Status.CONVERGED]
    rows = []
    for name, label in labels.items():
        values = [p[name]["value"] for p in found if name in p and p[name]["free"]]
        if len(values) > 1:
            mean, sd, span = np.mean(values), np.std(values, ddof=1), np.ptp(values)
            relative = (f"{100 * sd / mean:.2g} %", f"{50 * span / mean:.2g} %") if mean > 0 else ("", "")
            ends = f"{np.min(values):.6g} to {np.max(values):.6g}"
            rows.append((label, str(len(values)), f"{mean:.6g}", f"{sd:.2g}", relative[0], ends, relative[1]))
    deviation = "standard deviation", "relative"
    head = (
        "parameter",
        "files",
        "mean",
        *deviation,
        "least to largest",
        "uniformity: half the range over the mean",
    )
    return Table("Over the files that have converged", head, rows)


def _name(record: Record) -> str:
    """The file without its folder, and the spectrum in it."""
    data = record["data"]
    data = data[0] if isinstance(data, list) else data
    spectrum = f" [{data['spectrum']}]" if data.get("spectrum") else ""
    return PurePosixPath(str(data["path"]).replace("\\", "/")).name + spectrum


def _figure(
    records: Sequence[Record], links: Sequence[str | None], name: str, unit: str, number: int
) -> dict[str, Any]:
    """A parameter of each file with its standard error, in the order of the files; `number` of the figure."""
    estimates = [(i, record, record["parameters"].get(name)) for i, record in enumerate(records)]
    known = [(i, record, p) for i, record, p in estimates if p and p["free"] and p["value"] is not None]
    lines = []
    for tone, (style, colour) in _STYLES.items():
        rows = [(i, record, p) for i, record, p in known if TONES[Status(record["status"])] == tone]
        if rows:
            lines.append(
                Line(
                    np.array([i + 1.0 for i, _, _ in rows]),
                    np.array([p["value"] for _, _, p in rows]),
                    ", ".join(sorted({str(record["status"]) for _, record, _ in rows})),
                    colour,
                    style,
                    errors=np.array([np.nan if p["stderr"] is None else p["stderr"] for _, _, p in rows]),
                    hints=[escape(f"{_name(record)}: {p['value']:.6g}") for _, record, p in rows],
                    links=[{"link": links[i]} if links[i] else {} for i, _, _ in rows],
                )
            )
    label = labelled(name, unit)
    caption = (
        f"Fitted {label} of each file with its standard error. A click on a point opens the page of its fit."
    )
    values = [record["parameters"].get(name, {}).get("value") for record in records]
    table = Columns({"file": np.arange(1.0, len(records) + 1), label: values})
    section = Section("number of the file", [[Panel(label, lines, height=3.0)]], table=table)
    axis = {"tickformat": "d", **({"dtick": 1} if len(records) < 12 else {})}
    return figure(f"results-{number}" if number else "results", caption, section, axis=axis)
