"""Section of a posterior in the page of a fit: marginals, checks, trace, and its figures as pictures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.reporting.drawable import Line, Panel, Section
from pellicle.reporting.page.document import Table, picture
from pellicle.reporting.plotly_figure import figure
from pellicle.sampling.result import verdict

if TYPE_CHECKING:
    from pellicle.sampling.result import Posterior

_STEPS, _WALKERS, _PARAMETERS = 300, 8, 8
"""Steps, walkers and parameters of the trace that are drawn."""
_PICTURES = {
    "corner": "Marginals of all parameters and joint densities of all pairs,"
    " with quantiles of 2.5, 50 and 97.5 %.",
    "predictive": "Data over the bands of 95 % of the model's curves and of repeated measurements.",
}


def section(posterior: Posterior, pictures: Mapping[str, bytes]) -> dict[str, Any]:
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
