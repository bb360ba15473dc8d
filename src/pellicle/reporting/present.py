"""Report, figure and folder of any result: a fit, a posterior, a comparison, a map, a plan, or a cost."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from pellicle.accuracy.registry import Cost
from pellicle.fitting.comparison import Comparison
from pellicle.fitting.planned_measurement import MeasurementPlan
from pellicle.fitting.repeated_measurements import Repeats
from pellicle.fitting.result import Fit
from pellicle.forward_model.plan import Plan
from pellicle.identification.hypothesis import Identification
from pellicle.mapping.photograph import ThicknessMap
from pellicle.reporting import (
    comparison,
    cost,
    figures,
    fit_text,
    folders,
    identification,
    identification_figures,
    measurement_plan,
    photograph_map,
    plans,
    posterior,
    repeats,
)
from pellicle.sampling.result import Posterior, verdict

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pellicle.mapping.map_result import Map


class _Ways(NamedTuple):
    """Functions that report, draw and write a result; None where it has no figure or no files."""

    report: Callable[..., str]
    draw: Callable[..., Figure] | None = None
    write: Callable[..., Path] | None = None


_WAYS: dict[type, _Ways] = {
    Fit: _Ways(fit_text.report, figures.draw_fit, folders.write_fit),
    Posterior: _Ways(
        lambda posterior: fit_text.report(posterior.fit, posterior),
        posterior.corner_figure,
        lambda folder, posterior: folders.write_fit(folder, posterior.fit, posterior),
    ),
    Comparison: _Ways(comparison.report, None, comparison.write_comparison),
    Identification: _Ways(
        identification.report, identification_figures.draw, identification.write_identification
    ),
    Repeats: _Ways(repeats.report, None, repeats.write_repeats),
    Plan: _Ways(plans.report),
    MeasurementPlan: _Ways(measurement_plan.report),
    Cost: _Ways(cost.text, cost.draw, cost.write_cost),
    ThicknessMap: _Ways(photograph_map.report, photograph_map.draw, photograph_map.write_map),
}


def _way(result: object, name: str, wanted: str) -> Callable[..., Any]:
    """A function of the ways of a result. Raises TypeError where it has none."""
    ways = next((ways for kind, ways in _WAYS.items() if isinstance(result, kind)), None)
    # the module of a cube's map needs an optional package: no import, no such object
    module = sys.modules.get("pellicle.mapping.map_result")
    if module is not None and isinstance(result, module.Map):
        from pellicle.reporting import map_figures as maps
        from pellicle.reporting.map_text import cube_report

        ways = _Ways(cube_report, lambda made: next(maps.figures(made))[1], maps.write_cube_map)
    module = sys.modules.get("pellicle.mapping.series_result")
    if module is not None and isinstance(result, module.Series):
        from pellicle.reporting import series

        ways = _Ways(series.report, series.draw, series.write_series)
    way = None if ways is None else getattr(ways, name)
    if way is None:
        raise TypeError(f"a {type(result).__name__} has no {wanted} have")
    return way


def report(
    result: Fit | Posterior | Comparison | Identification | Repeats | Plan | Cost | Map | ThicknessMap,
) -> str:
    """Format a result as plain text.

    **Arguments:** `result` of `pl.fit`, `pl.sample`, `pl.compare`, `pl.fitting.repeats`, `pl.plan`, `pl.cost`
    or `pl.map`.

    **Returns:** the text that the command line prints: the verdict first, then the numbers behind it.

    **Raises:** TypeError for another object.

    ```python
    >>> plan = pl.plan(pl.Scene(pl.Layer(1.46, 100.0), 3.9))
    >>> print(pl.report(plan).splitlines()[-1])
    error at most 0.0e+00 of R; the tolerance is 0

    ```
    """
    return _way(result, "report", "report; fits, posteriors and plans")(result)


def plot(result: Fit | Posterior | Identification | Cost | Map | ThicknessMap) -> Figure:
    """Draw a result.

    **Arguments:** `result` of `pl.fit` (data, fit, residuals; of films also misfit against thickness, n and
    k), `pl.identify` (data, curves and evidence of hypotheses), `pl.sample` (corner plot), `pl.cost` (error
    against time) or `pl.map` (of a cube: the first parameter, its standard error, status and histogram).

    **Returns:** a Matplotlib figure, which a notebook shows and `figure.savefig(path)` writes.

    **Raises:** TypeError for another object.
    """
    return _way(result, "draw", "figure; fits, posteriors and costs")(result)


def save(
    result: Fit | Posterior | Comparison | Repeats | Cost | Map | ThicknessMap,
    folder: str | os.PathLike[str],
) -> Path:
    """Write a result into a folder, as the command line does: report, JSON record, tables and figures.

    **Arguments:** `result` of `pl.fit`, `pl.sample`, `pl.compare`, `pl.fitting.repeats`, `pl.cost` or
    `pl.map`; `folder`, which is made if it is absent. Files of an earlier result in it are replaced.

    **Returns:** the folder.

    **Raises:** UsageError where the folder holds files that pellicle did not write, or cannot be written;
    TypeError for another object.
    """
    return _way(result, "write", "files; fits, posteriors and costs")(folder, result)


def html(result: Fit | Posterior | Comparison | Identification | Repeats | Cost | Map) -> str:
    """Format a result for a notebook: verdict, a table of its numbers or hypotheses, the report to unfold."""
    match result:
        case Fit():
            head, columns = f"<b>{result.status}</b>: {escape(result.verdict)}", ("", "value", "± 1σ", "unit")
            rows = [(p.name, f"{p.value:.8g}", f"{p.stderr:.2g}", p.unit) for p in result.free]
        case Posterior():
            head, columns = escape(verdict(result)), ("", "median", "2.5 %", "97.5 %", "unit")
            every = result.parameters.values()
            rows = [(m.name, *(f"{x:.6g}" for x in (m.q50, m.q025, m.q975)), m.unit) for m in every]
        case Identification():
            head, columns = (
                f"<b>{result.status}</b>: {escape(result.verdict)}",
                ("", *identification.HEAD[1:]),
            )
            rows = [(x.name, *cells) for x, cells in identification.rows_of(result) if x in result.hypotheses]
        case _:
            return f"<pre>{escape(report(result))}</pre>"
    heads = "".join(f"<th>{column}</th>" for column in columns)
    cells = ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows]
    table = "".join(f"<tr>{row}</tr>" for row in (heads, *cells))
    text = f"<details><summary>report</summary><pre>{escape(report(result))}</pre></details>"
    return f"<p>{head}</p><table>{table}</table>{text}"
