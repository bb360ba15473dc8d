"""Pages of fits: one fit with its posterior, sources and how to repeat it, or a batch with its statuses.

A page has a verdict, interactive figures and tables; that of a batch a table to sort and filter, and the
scatter of repeats.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import PurePosixPath
from typing import Any
from urllib.parse import quote

import numpy as np

from pellicle.fitting.curves import ColourCurve
from pellicle.fitting.repeated_measurements import Repeats
from pellicle.fitting.result import Fit, Part, Status
from pellicle.reporting import figures, fit_text
from pellicle.reporting import repeats as repeats_text
from pellicle.reporting.drawable import Line, Panel, Section, Style, labelled
from pellicle.reporting.drawable import Table as Columns
from pellicle.reporting.figures import file_names
from pellicle.reporting.fit_text import NUISANCE
from pellicle.reporting.json_record import taken
from pellicle.reporting.page import repetition
from pellicle.reporting.page.document import Table, page, picture
from pellicle.reporting.plain_text import with_unit
from pellicle.reporting.plotly_figure import figure
from pellicle.reporting.posterior import MARGINAL
from pellicle.reporting.quantities import colour_codes, colours_in_words, colours_of
from pellicle.sampling.result import Posterior, verdict

TONES = {
    Status.CONVERGED: "good",
    Status.AT_BOUND: "warn",
    Status.AMBIGUOUS: "warn",
    Status.NOT_IDENTIFIABLE: "warn",
    Status.MISFIT: "bad",
    Status.NOT_CONVERGED: "bad",
    Status.FAILED: "bad",
}
"""Class of the page's style for each status."""
MOST_FIGURES = 40
"""Parts of a joint fit that have an interactive figure; the CSV file has them all."""


def fit_page(
    fit: Fit,
    image: bytes,
    posterior: Posterior | None = None,
    pictures: Mapping[str, bytes] | None = None,
    again: Sequence[tuple[str, str]] = (),
) -> str:
    """Format a fit, and its posterior if there is one, as a page.

    **Arguments:** `image`, the PNG of the fit's figure; `pictures`, other PNG images by name ("corner",
    "predictive"); `again`, what repeats the fit: descriptions and texts to copy.
    """
    of_data = [figures.of_part(fit, i) for i in range(min(len(fit.parts), MOST_FIGURES))]
    misfit, index, section, surface = figures.of_misfit(fit), figures.of_index(fit), None, None
    shown = [*of_data, *(drawn for drawn in (misfit, index) if drawn)]
    if posterior is not None:
        section = posterior_section(posterior, pictures or {})
        shown.append(section["trace"])
    if fit.layer_test is not None:
        from pellicle.reporting.page.surface_section import surface_section

        surface = surface_section(fit)
        shown.append(surface["lobes"])
    lead = fit.free[0] if fit.free else None
    caption = f"Standard uncertainties, and what each alone would change {lead.name if lead else ''}"
    return page(
        "fit.html",
        " and ".join(filter(None, file_names(fit))) or "fit",
        shown,
        **taken(fit, "status", "verdict", "warnings"),
        **{"tone": TONES[fit.status], "advice": fit_text.ADVICE[fit.status]},
        swatches=[_swatches(part) for part in fit.parts if isinstance(part.curve, ColourCurve)],
        rivals=_rivals(fit),
        parameters=_parameters(fit),
        matrix=dict(zip(fit.correlation_names, np.asarray(fit.correlation).tolist(), strict=True)),
        budget=Table(caption, ("effect", "uncertainty", "change"), fit_text.budget_rows(fit)),
        together=fit_text.together(fit, lead) if fit.budget and lead else "",
        layer=Table("Error on samples that were held out", (), fit_text.layer_test_rows(fit)),
        plans=[_plan(part) for part in fit.parts],
        statistics=_statistics(fit),
        data_figures=of_data,
        image=picture(image, f"Figure of the fit: {fit.verdict}"),
        misfit=misfit,
        index=index,
        surface=surface,
        posterior=section,
        again=again,
        sources=repetition.sources(fit, posterior),
        bibtex=repetition.bibtex(),
    )


def _rivals(fit: Fit) -> Table:
    """One row for each rival, numbered as in the figures."""
    names = list(dict.fromkeys(name for rival in fit.rivals for name in rival.parameters))
    known = any(rival.probability is not None for rival in fit.rivals)
    rows: list[Any] = []
    for number, rival in enumerate(fit.rivals):
        cells = [f"{rival.delta_chi2:.3g}"]
        if known:
            cells.append("" if rival.probability is None else f"{rival.probability:.2g}")
        for name in names:
            value = f"{rival.parameters[name]:.5g}" if name in rival.parameters else ""
            error = "" if rival.stderr is None or name not in rival.stderr else f" ± {rival.stderr[name]:.2g}"
            cells.append(value + error)
        about = figures.rival_label(rival, fit)
        rows.append({"number": number, "about": about, "cells": cells, "shown": bool(rival.curves)})
    units = {name: p.unit for name, p in fit.parameters.items()}
    heads = [labelled(name, units.get(name, "")) for name in names]
    head = ["rival", "Δχ²", *(["probability"] if known else []), *heads]
    return Table(f"O{fit_text.OTHER_MINIMA[1:]}", head, rows)


def _parameters(fit: Fit) -> Table:
    rows = []
    for p in (p for own in fit_text.by_sample(fit).values() for p in own):
        noise = expanded = ""
        if (p.free or p.tied) and math.isfinite(p.stderr_noise):
            noise = with_unit(f"{p.stderr_noise:.2g}", p.unit)
        if (p.free or p.tied) and math.isfinite(p.stderr):
            expanded = with_unit(f"± {p.expanded:.2g}", p.unit)
        rows.append((p.name, fit_text.value_in_words(p), expanded, noise, fit_text.bounds_in_words(p)))
    head = ("parameter", "value ± standard error", "95 %", "error by noise alone", "bounds")
    return Table("Parameters, the free ones first", head, rows)


def _plan(part: Part) -> Table:
    rows = [
        (row.effect, "on" if row.on else "off", f"{row.error_bound:.1e}" if row.error_bound else "0", row.why)
        for row in part.plan.rows
    ]
    name = f"{part.name}: effects" if part.name else "Effects"
    return Table(f"{name} of the simulation", ("effect", "simulated", "error bound", "why"), rows)


def _statistics(fit: Fit) -> Table:
    rows = []
    for part in fit.parts:
        data = part.data
        source = getattr(data, "source", data.path)
        rows.append((part.name or "data", fit_text.data_in_words(part)))
        rows += [("file", source)] if source else []
        rows += [("SHA-256", data.sha256)] if data.sha256 else []
        rows += [("note", note) for note in getattr(data, "notes", ())]
    return Table("Fit quality, files and how they were read", (), [*fit_text.statistic_rows(fit), *rows])


def _swatches(part: Part) -> dict[str, Any]:
    """Colours of data and fit as a browser shows them, and their differences."""
    data, curve = colours_of(part)
    codes = zip(colour_codes(data, curve.data), colour_codes(data, curve.model), strict=True)
    rows = [
        {
            "name": f"{i + 1}" if data.angle is None else f"{data.angle[i]:g}°",
            "data": measured,
            "fit": model,
            "difference": "" if curve.difference is None else f"{curve.difference[i]:.2g}",
        }
        for i, (measured, model) in enumerate(codes)
    ]
    return {"caption": colours_in_words(part), "rows": rows}


_STEPS, _WALKERS, _PARAMETERS = 300, 8, 8
"""Steps, walkers and parameters of the trace that are drawn."""
_PICTURES = {
    "corner": "Marginals of all parameters and joint densities of all pairs,"
    " with quantiles of 2.5, 50 and 97.5 %.",
    "predictive": "Data over the bands of 95 % of the model's curves and of repeated measurements.",
}


def posterior_section(posterior: Posterior, pictures: Mapping[str, bytes]) -> dict[str, Any]:
    """Figures and tables of a posterior, as the template takes them."""
    checks = posterior.checks
    rows = [
        (m.name, *(f"{x:.6g}" for x in (m.q50, m.q025, m.q975, m.mean)), f"{m.sd:.2g}", m.unit)
        for m in posterior.parameters.values()
    ]
    about = [
        ("walkers", str(posterior.draws.shape[1])),
        ("steps, of them burn-in", f"{checks.steps}, {checks.discard}"),
        ("autocorrelation times", f"{checks.n_over_tau:.0f}"),
        ("independent draws", f"about {checks.independent}"),
        ("split R̂", f"{checks.rhat:.3f}"),
        ("accepted moves", f"{100 * checks.acceptance:.0f} %"),
        ("minima that matter, visited", f"{checks.minima_visited} of {checks.minima_found}"),
    ]
    return {
        "verdict": verdict(posterior),
        "marginals": Table("Marginal of each parameter", ("parameter", *MARGINAL, "unit"), rows),
        "checks": Table("Checks of the chain", (), about),
        "trace": _trace(posterior),
        "pictures": [picture(pictures[name], text) for name, text in _PICTURES.items() if name in pictures],
    }


def _trace(posterior: Posterior) -> dict[str, Any]:
    """Steps of some walkers, one panel for each parameter."""
    draws = posterior.draws[:: -(-len(posterior.draws) // _STEPS) or 1, :_WALKERS]
    steps, walkers, _ = draws.shape
    step = np.tile([*np.arange(steps) * (len(posterior.draws) / max(steps, 1)), np.nan], walkers)
    panels = []
    for i, name in enumerate(posterior.names[:_PARAMETERS]):
        title = labelled(name, posterior.fit.parameters[name].unit)
        values = np.pad(draws[:, :, i], ((0, 1), (0, 0)), constant_values=np.nan).T.ravel()
        panels.append([Panel(title, [Line(step, values, title, "index-n", width=0.8, listed=False)])])
    caption = f"Trace of {walkers} of {posterior.draws.shape[1]} walkers after the burn-in."
    drawn = figure("trace", caption, Section("step after the burn-in", panels))
    drawn["layout"]["hovermode"] = False
    return drawn


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
    drawn = _figure(records, links, names[0], units[names[0]]) if names else None
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
        [drawn] if drawn else [],
        figure=drawn,
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
        error = "" if p["stderr"] is None else f" ± {p['stderr']:.2g}"
        cells.append({"value": f"{p['value']:.10g}", "text": f"{p['value']:.6g}{error}"})
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


def _name(record: Record) -> str:
    """The file without its folder, and the spectrum in it."""
    data = record["data"]
    data = data[0] if isinstance(data, list) else data
    spectrum = f" [{data['spectrum']}]" if data.get("spectrum") else ""
    return PurePosixPath(str(data["path"]).replace("\\", "/")).name + spectrum


def _figure(records: Sequence[Record], links: Sequence[str | None], name: str, unit: str) -> dict[str, Any]:
    """The leading parameter of each file with its standard error, in the order of the files."""
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
    return figure("results", caption, section, axis=axis)
