"""Page of a fit and its posterior: verdict, interactive figures, tables, sources, and how to repeat it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.fitting.curves import ColourCurve
from pellicle.fitting.result import Status
from pellicle.fitting.status import RIVAL
from pellicle.reporting import fit_text, parameter_text
from pellicle.reporting.drawable import Line, Panel, Section
from pellicle.reporting.fit_panels import file_names
from pellicle.reporting.page import figures, repetition
from pellicle.reporting.page.document import Table, page, picture
from pellicle.reporting.plotly_figure import figure
from pellicle.reporting.quantities import colours_in_words, colours_of, display
from pellicle.sampling.result import verdict

if TYPE_CHECKING:
    from pellicle.fitting.result import Fit, Part
    from pellicle.sampling.result import Posterior

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
_FAINT = 0.4
"""Opacity of the background of a correlation of ±1; text on it keeps its contrast."""


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
    misfit, index = figures.of_misfit(fit), figures.of_index(fit)
    shown = [*of_data, *(each for each in (misfit, index) if each)]
    about = None
    if posterior is not None:
        about = posterior_section(posterior, pictures or {})
        shown.append(about["trace"])
    surface = None
    if fit.layer_test is not None:
        from pellicle.reporting.page.surface_section import surface_section

        surface = surface_section(fit)
        shown.append(surface["lobes"])
    names = " and ".join(name for name in file_names(fit) if name) or "fit"
    content = {
        **_tables(fit),
        "data_figures": of_data,
        "image": picture(image, f"Figure of the fit: {fit.verdict}"),
        "misfit": misfit,
        "index": index,
        "surface": surface,
        "posterior": about,
        "again": [
            {"name": f"again-{i}", "about": about, "text": text} for i, (about, text) in enumerate(again)
        ],
        "sources": repetition.sources(fit, posterior),
        "bibtex": repetition.bibtex(),
    }
    return page("fit.html", names, shown, sections=_sections(content), **content)


def _tables(fit: Fit) -> dict[str, Any]:
    """Words, tables and swatches of a fit for the template, beside its figures."""
    return {
        "tone": TONES[fit.status],
        "status": str(fit.status),
        "verdict": fit.verdict,
        "advice": fit_text.ADVICE[fit.status],
        "warnings": fit.warnings,
        "swatches": [_swatches(part) for part in fit.parts if isinstance(part.curve, ColourCurve)],
        "rivals": _rivals(fit),
        "parameters": _parameters(fit),
        "matrix": _matrix(fit),
        "budget": _budget(fit),
        "together": parameter_text.together(fit.free[0]) if fit.budget and fit.free else "",
        "layer": Table("Error on samples that were held out", (), fit_text.layer_test_rows(fit)),
        "plans": [_plan(part) for part in fit.parts],
        "statistics": _statistics(fit),
    }


def _sections(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    every = [
        ("warnings", f"Warnings ({len(content['warnings'])})", content["warnings"]),
        ("data", "Data and fit", True),
        ("rivals", "Misfit and rivals", content["misfit"] or content["rivals"].rows),
        ("nk", "n and k", content["index"]),
        ("parameters", "Parameters", True),
        ("layer", "Layer test", content["layer"].rows),
        ("surface", "Sphere and lobes", content["surface"]),
        ("posterior", "Posterior", content["posterior"]),
        ("plan", "Plan", True),
        ("statistics", "Statistics", True),
        ("again", "Repeat it", content["again"]),
        ("cite", "How to cite", True),
    ]
    return [(name, text) for name, text, there in every if there]


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
        about = figures.label(rival, fit)
        rows.append({"number": number, "about": about, "cells": cells, "shown": bool(rival.curves)})
    units = {name: fit.parameters[name].unit for name in names if name in fit.parameters}
    heads = [f"{name} ({units[name]})" if units.get(name) else name for name in names]
    head = ["rival", "Δχ²", *(["probability"] if known else []), *heads]
    caption = f"Other minima and how much worse they fit (Δχ² below {RIVAL:g}: about as well)"
    return Table(caption, head, rows)


def _parameters(fit: Fit) -> Table:
    rows = []
    for p in sorted(fit.parameters.values(), key=lambda p: not p.free):
        unit = f" {p.unit}" if p.unit else ""
        if not p.free:
            rows.append((p.name, f"{p.value:.6g}{unit} (fixed)", "", "", ""))
            continue
        finite = math.isfinite(p.stderr)
        noise = f"{p.stderr_noise:.2g}{unit}" if math.isfinite(p.stderr_noise) else ""
        expanded = f"± {p.expanded:.2g}{unit}" if finite else ""
        words = parameter_text.value_in_words(p), expanded, noise, parameter_text.bounds_in_words(p)
        rows.append((p.name, *words))
    head = ("parameter", "value ± standard error", "95 %", "error by noise alone", "bounds")
    return Table("Parameters, the free ones first", head, rows)


def _matrix(fit: Fit) -> dict[str, Any]:
    """Correlations with the tint of each cell: name of a colour and its opacity."""
    names = fit.correlation_names

    def cell(value: float) -> tuple[str, tuple[str, str]]:
        if not math.isfinite(value):
            return "", ("plus", "0")
        return f"{value:+.2f}", ("plus" if value > 0 else "minus", f"{_FAINT * abs(value):.2f}")

    rows = [(name, [cell(float(x)) for x in row]) for name, row in zip(names, fit.correlation, strict=True)]
    return {"names": names, "rows": rows if len(names) > 1 else []}


def _budget(fit: Fit) -> Table:
    lead = next(iter(fit.free), None)
    caption = f"Standard uncertainties, and what each alone would change {lead.name}" if lead else ""
    return Table(caption, ("effect", "uncertainty", "change"), parameter_text.rows(fit))


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
    both = zip(display(data, curve.data), display(data, curve.model), strict=True)
    rows = [
        {
            "name": f"{i + 1}" if data.angle is None else f"{data.angle[i]:g}°",
            "data": _hex(measured),
            "fit": _hex(model),
            "difference": "" if curve.difference is None else f"{curve.difference[i]:.2g}",
        }
        for i, (measured, model) in enumerate(both)
    ]
    return {"caption": colours_in_words(part), "rows": rows}


def _hex(rgb: Any) -> str:
    return "#" + "".join(f"{round(255 * min(max(float(x), 0.0), 1.0)):02x}" for x in rgb)


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
        "marginals": Table(
            "Marginal of each parameter",
            ("parameter", "median", "2.5 %", "97.5 %", "mean", "sd", "unit"),
            rows,
        ),
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
        unit = posterior.fit.parameters[name].unit
        title = f"{name} ({unit})" if unit else name
        values = np.pad(draws[:, :, i], ((0, 1), (0, 0)), constant_values=np.nan).T.ravel()
        panels.append([Panel(title, [Line(step, values, title, "index-n", width=0.8, listed=False)])])
    caption = f"Trace of {walkers} of {posterior.draws.shape[1]} walkers after the burn-in."
    drawn = figure("trace", caption, Section("step after the burn-in", panels))
    drawn["layout"]["hovermode"] = False
    return drawn
