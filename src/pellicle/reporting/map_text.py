"""Report and JSON record of the map of a cube.

They have the shares of the statuses and where they are, values, errors and figures.
"""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from pellicle.fitting.batch.data import BY_NEIGHBOURS, NO_DATA
from pellicle.fitting.result import Status
from pellicle.mapping.map_result import Map, Run
from pellicle.reporting.fit_text import ADVICE as OF_FITS
from pellicle.reporting.json_record import strict, taken, versions
from pellicle.reporting.map_summary import DECIDED, MapSummary, ParameterSummary, dataset_of, summarise
from pellicle.reporting.plain_text import blocks_of, facts, wrapped

if TYPE_CHECKING:
    from xarray import Dataset

SCHEMA = "pellicle.cube-map/1"
ERRORS = (
    "The standard error (`stderr`) contains systematic effects, which are common to all pixels: use it for"
    " the value at a pixel. Differences between pixels have the error of the noise alone (`stderr_noise`)."
)
"""Explanation of the errors of a map, and when to use which."""
ADVICE = {str(status): text for status, text in OF_FITS.items()} | {
    BY_NEIGHBOURS: "Use the numbers where the thickness cannot jump: the order follows from the neighbours'.",
}


def cube_report(made: Dataset | Map, summary: MapSummary | None = None) -> str:
    """Format a map as text of at most 100 columns: the statuses and where they are, then the numbers.

    `summary` is that of the map, if it has been computed.
    """
    summary = summarise(made) if summary is None else summary
    parameters = [line for p in summary.parameters for line in facts(parameter_rows(p))]
    if summary.sampled > 1 and parameters:
        every = ordinal(summary.sampled)
        parameters += wrapped(f"Percentiles are those of every {every} pixel in each direction.")
    blocks = [
        ("Map", [*wrapped(in_words(summary)), *facts(file_rows(summary))]),
        ("Status: what to do", facts(status_rows(summary))),
        (decided_in_words(summary), parameters),
        ("Rate of change: a straight line through the times", facts(rate_rows(summary))),
        ("Errors", wrapped(ERRORS)),
        ("Plan: what was simulated", facts(plan_rows(summary))),
    ]
    return blocks_of(blocks)


def status_rows(made: MapSummary) -> list[tuple[str, str]]:
    """Each status that occurs, and what to do."""
    return [(word, advice) for word, advice in ADVICE.items() if word in made.counts]


def rate_rows(made: MapSummary) -> list[tuple[str, str]]:
    """Each parameter of a series of maps, and its rate of change."""
    return [(rate.variable, str(rate)) for rate in made.rates]


def in_words(made: MapSummary) -> str:
    """The statuses of the pixels with data in one sentence, such as "97.2 % converged, 2.8 % ambiguous along
    the edge."."""
    if not made.with_data:
        return "No pixel has data."
    parts = [
        " ".join([f"{share(count, made.with_data)} %", word, made.places.get(word, "")]).strip()
        for word, count in made.counts.items()
        if word != NO_DATA
    ]
    return ("; " if any("," in part for part in parts) else ", ").join(parts) + "."


def share(count: int, total: int) -> str:
    """Percentage with a digit where it is not 100 or 0, and never rounded to them."""
    percent = 100 * count / total
    if count in (0, total):
        return f"{percent:.0f}"
    return f"{percent:.1f}" if 0.05 <= percent < 99.95 else ("> 99.9" if percent > 50 else f"{percent:.2g}")


def pixels_in_words(made: MapSummary) -> str:
    """`40 frames of 120 x 80 pixels`, or `49 sites`."""
    *before, last = [f"{n}" for n in made.axes.shape]
    if made.axes.kind == "image":
        *before, rows = before
        last = f"{rows} x {last}"
    series = made.axes.series
    last += f" {made.axes.points}" + " (y, x)" * (made.axes.kind == "image")
    return f"{' x '.join(before)} frames ({series.name}) of {last}" if series else last


def file_rows(made: MapSummary) -> list[tuple[str, str]]:
    """File, its spectra, pixels without data, time of the fits, and how the file was read."""
    about = made.attributes
    rows = [("file", str(about["path"]))] if about.get("path") else []
    bands = f", {about['bands']} bands" if "bands" in about else ""
    lowest, highest = about.get("range_nm", (None, None))
    between = f" from {lowest:g} to {highest:g} nm" if lowest is not None and highest is not None else ""
    rows.append(("data", f"{about.get('signal', 'R')}{bands}{between}; {pixels_in_words(made)}"))
    missing = made.counts.get(NO_DATA, 0)
    if missing:
        text = f"{_points(missing, made)} ({share(missing, made.pixels)} %)"
        rows.append(("no data", f"{text} {made.places.get(NO_DATA, '')}".strip()))
    every = int(about.get("preview", 1))
    if every > 1:
        rows.append(("preview", f"of every {ordinal(every)} pixel in each direction"))
    if made.run is not None:
        rows.append(("time", _time(made.run)))
    return [*rows, *(("" if i else "read", note) for i, note in enumerate(made.notes))]


def ordinal(every: int) -> str:
    """`2nd`, `8th`."""
    return f"{every}" + (
        "th" if every % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(every % 10, "th")
    )


def _time(run: Run) -> str:
    """`3.2 s, 81 000 pixels/s`, with the time of compilation and the pixels of an earlier run."""
    if not run.pixels:
        return "all pixels are of an earlier run"
    rate = _rate(run)
    digits = max(0, math.floor(math.log10(rate)) - 2) if rate > 0 else 0  # three are shown
    speed = f"{round(rate, -digits):,.0f}".replace(",", " ")
    parts = [f"{run.seconds:.3g} s", f"{speed} pixels/s"]
    if run.compiling > 0.1 * run.seconds:
        parts.insert(1, f"{run.compiling:.2g} s of it compilation")
    if run.workers > 1:
        parts.append(f"{run.workers} processes")
    if run.earlier:
        parts.append(f"without {run.earlier} pixels of an earlier run")
    return ", ".join(parts)


def _rate(run: Run) -> float:
    """Pixels per second, without the time of compilation."""
    return run.pixels / max(run.seconds - run.compiling, 1e-3)


def decided_in_words(made: MapSummary) -> str:
    """The number of pixels whose parameters can be used, and their statuses."""
    if not made.decided:
        return "Parameters: no pixel has numbers that can be used"
    words = " or ".join(word for word in DECIDED if word in made.counts)
    return f"Parameters at the {_points(made.decided, made)} with status {words}"


def _points(count: int, made: MapSummary) -> str:
    """`1 pixel`, or `42 sites`."""
    return f"{count} {made.axes.points if count != 1 else made.axes.points.removesuffix('s')}"


def parameter_rows(p: ParameterSummary) -> list[tuple[str, str]]:
    """Median, range, standard error and slope of a parameter; the first row bears its name."""
    if not math.isfinite(p.percentiles[2]):
        return []
    digits = ".5g"
    if math.isfinite(p.stderr) and p.stderr > 0:  # a digit more than the standard error has
        digits = f".{min(max(0, 1 - math.floor(math.log10(p.stderr))), 9)}f"
    least, low, middle, high, largest = (f"{value:{digits}}" for value in p.percentiles)
    unit = f" {p.unit}" if p.unit else ""
    stderr, noise = _error(p.stderr, unit), _error(p.stderr_noise, unit)
    spread = f"mean {p.mean:{digits}}{unit}, standard deviation over the map {_error(p.sd, unit)}"
    if math.isfinite(p.uniformity):
        spread += f", uniformity {p.uniformity:.2g} % (largest less least, over twice the mean)"
    rows = [
        (p.name, f"median {middle}{unit}, 5 to 95 %: {low} to {high}{unit}, all: {least} to {largest}{unit}"),
        ("", spread),
        ("", f"standard error {stderr} (median), of the noise {noise}"),
    ]
    if p.plane is not None:
        slopes = ", ".join(f"{name} {slope:+.3g}" for name, slope in p.plane.slopes.items())
        shape = "plane" if len(p.plane.slopes) > 1 else "line"
        share = f"{math.floor(1000 * min(p.plane.explains, 0.999)) / 10:.1f}"  # cut, so that it is never 100
        text = (
            f"a {shape} explains {share} % of the variance: slope {slopes}"
            f" {p.plane.unit}, rms beside it {_error(p.plane.rms, unit)}"
        )
        rows.append(("", text))
    return rows


def _error(value: float, unit: str) -> str:
    if math.isnan(value):
        return "unknown"
    return f"{value:.2g}{unit}" if math.isfinite(value) else "infinite"


def plan_rows(made: MapSummary) -> list[tuple[str, str]]:
    """Effects that are simulated or left out with an error, then the names of the absent ones."""
    rows = [
        (str(row["effect"]), f"{'on' if row['on'] else 'off'}: {row['why']}")
        for row in made.plan
        if row["on"] or row["error_bound"]
    ]
    absent = [str(row["effect"]) for row in made.plan if not row["on"] and not row["error_bound"]]
    return [*rows, *([("left out", ", ".join(absent))] if absent else [])]


def cube_json(made: Dataset | Map, summary: MapSummary | None = None) -> dict[str, Any]:
    """Convert a map to the dictionary of its summary; infinite and undefined numbers are None."""
    facts = summarise(made) if summary is None else summary
    about, run = facts.attributes, facts.run
    record = {
        "schema": SCHEMA,
        "data": {
            "path": about.get("path", ""),
            "fingerprint": about.get("fingerprint", ""),
            "signal": about.get("signal", "R"),
            "shape": dict(zip(dataset_of(made)["status"].dims, facts.axes.shape, strict=True)),
            **taken(facts, "pixels", "with_data"),
        },
        "summary": in_words(facts),
        "status": facts.counts,
        "places": facts.places,
        "converged": facts.counts.get(str(Status.CONVERGED), 0) / facts.with_data if facts.with_data else 0.0,
        "parameters": {
            p.name: {
                **taken(p, "variable", "unit"),
                **dict(zip(("least", "q05", "median", "q95", "largest"), p.percentiles, strict=True)),
                **taken(p, "mean", "sd", "uniformity", "stderr", "stderr_noise"),
                **({} if p.plane is None else {"plane": asdict(p.plane)}),
            }
            for p in facts.parameters
        },
        "rates": {rate.variable: asdict(rate) for rate in facts.rates},
        "plan": facts.plan,
        "preview": int(about.get("preview", 1)),
        "notes": facts.notes,
        "seconds": None if run is None else run.seconds,
        "pixels_per_second": _rate(run) if run is not None and run.pixels else None,
        "versions": versions(),
    }
    return strict(record)
