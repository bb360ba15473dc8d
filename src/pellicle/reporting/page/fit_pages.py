"""Page of a fit: verdict, interactive figures and tables, posterior, sources, and how to repeat it."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pellicle.fitting.curves import ColourCurve
from pellicle.fitting.result import Fit, Part, Status
from pellicle.reporting import figures, fit_text
from pellicle.reporting.drawable import Line, Panel, Section, labelled
from pellicle.reporting.figures import file_names
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
    library: str = "",
) -> str:
    """Format a fit, and its posterior if there is one, as a page.

    **Arguments:** `image`, the PNG of the fit's figure; `pictures`, other PNG images by name ("corner",
    "predictive"); `again`, what repeats the fit: descriptions and texts to copy; `library`, the path from the
    page to Plotly in a file of its own.
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
        library,
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
